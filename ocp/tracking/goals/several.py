"""Several references at once."""

from collections.abc import Sequence
from concurrent.futures import Executor
from functools import partial

from tendonff.models.chain import Chain
from tendonff.ocp.batch import Done, Progress, run_jobs
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackOptions
from tendonff.ocp.tracking.result import Tracking
from tendonff.ocp.tracking.track import BLAS, track


def track_batch(
    chain: Chain,
    references_N: Sequence[Array],
    step_s: float,
    limits: ForceLimits,
    options: TrackOptions = TrackOptions(),  # noqa: B008 - frozen
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> list[Done[Tracking]]:
    """Find the optimal profile of each of several references, from rest at its first tension; see `track`.

    Parameters
    ----------
    chain : Chain
    references_N : sequence of ndarray
        Of any lengths [N].
    step_s : float
    limits : ForceLimits
    options : TrackOptions, optional
    executor : concurrent.futures.Executor, optional
        Where they are computed, Dask's included; default: one thread per core.
    progress : callable, optional
        Callback(completed, total), in references.

    Returns
    -------
    list of Done
        In the order of the references; one that is not usable does not stop the others.
    """
    solve = partial(_solved, chain, step_s, limits, options)
    with BLAS.limit(limits=1):
        return run_jobs(solve, references_N, executor=executor, progress=progress)


def _solved(chain: Chain, step_s: float, limits: ForceLimits, options: TrackOptions, reference_N: Array) -> Tracking:
    return track(chain, reference_N, step_s, limits, options)
