"""Many simulations at once, over the standard executor interface.

Any `concurrent.futures.Executor` will do: threads or processes of this machine, or what Dask
(`distributed.Client(...).get_executor()`) and others offer for many machines.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Generic, TypeVar

from tendonff.models.layout import ChainState, fields_of
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import in_turn, out_of_turn
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.simulate import Simulation, simulate

Progress = Callable[[int, int], None]
"""Callback(completed, total)."""

J = TypeVar("J")
R = TypeVar("R")


@dataclass(frozen=True, slots=True, kw_only=True)
class Done(Generic[R]):
    """Result of a job."""

    index: int  # its place in the list of jobs
    value: R | None  # its result; None where it failed
    error: Exception | None  # why it failed

    def require(self) -> R:
        """Return the result, or raise `SolveError` that names the job."""
        if self.error is not None or self.value is None:
            raise SolveError(f"job {self.index + 1} failed: {self.error}") from self.error
        return self.value


@out_of_turn()
def run_jobs(
    function: Callable[[J], R],
    jobs: Sequence[J],
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> list[Done[R]]:
    """Apply a function to many jobs at once, results in their order; a job that fails does not stop the others.

    By default one thread per core runs them: compiled steps beside each other, what CasADi does in turn
    (`models.turns`), which without a compiler is all. Processes (`ProcessPoolExecutor`, Dask) do not wait for each
    other; for them the function must be importable there, and jobs and results pickled. The executor stays open.
    Progress is Callback(completed, total) in this thread, whenever one ends.
    """
    if executor is None:
        with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as threads:
            return run_jobs(function, jobs, executor=threads, progress=progress)
    futures: dict[Future[R], int] = {}
    results: list[Done[R] | None] = [None] * len(jobs)
    try:
        for index, job in enumerate(jobs):
            futures[executor.submit(function, job)] = index
        for done, future in enumerate(as_completed(futures), start=1):
            index = futures[future]
            try:
                results[index] = Done(index=index, value=future.result(), error=None)
            except Exception as error:  # noqa: BLE001 - whatever a job raises is its result
                results[index] = Done(index=index, value=None, error=error)
            if progress is not None:
                progress(done, len(jobs))
    except BaseException:  # Ctrl-C, or an error of the progress callback: do not finish the rest first
        for future in futures:
            future.cancel()
        raise
    return [result for result in results if result is not None]


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationJob:
    """Arguments of one call of `simulate`, documented there.

    Attributes
    ----------
    chain : Chain
        The model.
    force_N : numpy.ndarray
        Shape (n,); force of the actuator [N].
    step_s : float
        Time step [s].
    initial_tension_N : float or None
        Tension at rest before [N]; default: the first force.
    state : ChainState or None
        State to start from instead.
    record : bool
        Whether every state is kept.
    engine : Engine
        What computes the steps.
    """

    chain: Chain
    force_N: Array
    step_s: float
    initial_tension_N: float | None = None
    state: ChainState | None = None
    record: bool = False
    engine: Engine = Engine.AUTO


@in_turn
def run_simulation(job: SimulationJob) -> Simulation:
    """Simulate one job."""
    return simulate(**fields_of(job))


def simulate_batch(
    jobs: Sequence[SimulationJob],
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> list[Done[Simulation]]:
    """Simulate many jobs at once, as `run_jobs` does.

    A run whose step could not be solved is a result with that outcome; errors are jobs that could not be run, such
    as a force that is not finite.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> chain = tf.Chain.of(scenario.transmission, tf.Level.ELASTIC)
    >>> force = tf.sample_reference(scenario).tension_N
    >>> jobs = [tf.SimulationJob(chain=chain, force_N=k * force, step_s=1e-3) for k in (1.0, 1.5)]
    >>> peaks = [done.require().output_tension_N.max() for done in tf.simulate_batch(jobs)]
    >>> bool(peaks[1] > 1.4 * peaks[0])
    True
    """
    return run_jobs(run_simulation, jobs, executor=executor, progress=progress)
