"""Optimal control of a reference that repeats: the cycle between its neighbours."""

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np

from tendonff.models.layout import ChainState
from tendonff.models.parameters.uncertainty import Objective
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import in_turn
from tendonff.ocp.errors import SolveError
from tendonff.ocp.optimal.track import solve_tracking
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.batch import Progress
from tendonff.ocp.tendon.inverse import Inversion
from tendonff.ocp.tendon.periodic import steady_response
from tendonff.ocp.tracking.diagnosis import departures
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.options import TrackOptions
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.result import Tracking, TrackStatus

_CYCLES = 3


@in_turn
def track_cycle(
    chains: tuple[Chain, ...],
    cycle_N: Array,
    step_s: float,
    limits: ForceLimits,
    objective: Objective = Objective.WORST,
    options: TrackOptions = TrackOptions(),  # noqa: B008 - frozen
    *,
    initial_tension_N: float,
    inversion: Inversion,
    progress: Progress | None = None,
    others_N: Sequence[Array] = (),
) -> Tracking:
    """Find the force of a cycle within the limits: three cycles from the inverse's steady state, the middle one kept.

    The first cycle settles, the third is what the second prepares.

    Parameters
    ----------
    chains : tuple of Chain
        Design models, the nominal one first.
    cycle_N : ndarray, shape (n,)
        One period of the desired output tension, its last row the first of the next [N].
    step_s : float
    limits : ForceLimits
    objective : Objective, optional
        Which error over the chains is minimised.
    options : TrackOptions, optional
    initial_tension_N : float
        Tension of the rest that travel counts from [N].
    inversion : Inversion
        `steady_inverse` of the same cycle on the nominal chain, with its states.
    progress : callable, optional
        Callback(completed, total), in iterations.
    others_N : sequence of ndarray, optional
        Reference of each further chain, shape (n,) [N]; default: that of the nominal one.

    Returns
    -------
    Tracking
        Of one period; its figures are those of the kept cycle.
    """
    if inversion.states is None:
        raise SolveError("the steady cycle kept no states")
    began = perf_counter()
    clipped = limits.apply(inversion.force_N, step_s)
    states = [ChainState.from_vector(inversion.states[0], chains[0].layout)]
    others = (steady_response(other, clipped, step_s, initial_tension_N=initial_tension_N) for other in chains[1:])
    states.extend(run.final for run, _ in others)  # each in its own steady state under the same force

    def repeated(rows: Array) -> Array:
        return np.concatenate([*[rows[:-1]] * (_CYCLES - 1), rows])

    problem = TrackingProblem.of(
        chains,
        tuple(states),
        [repeated(each) for each in (cycle_N, *others_N)],
        step_s,
        limits,
        options,
        initial_tension_N=initial_tension_N,
        start_N=limits.start(float(inversion.force_N[0])),
        inverse_N=repeated(inversion.force_N),
        objective=objective,
    )
    force = repeated(inversion.force_N)
    time = np.arange(len(force), dtype=np.float64) * step_s
    long = replace(inversion, time_s=time, force_N=force, least_tension_N=repeated(inversion.least_tension_N))
    found = solve_tracking(problem, long, options, progress, build_s=perf_counter() - began)
    middle = slice(len(cycle_N) - 1, 2 * len(cycle_N) - 1)
    kept, output = found.force_N[middle].copy(), found.predicted_output_N[middle]
    if found.status is TrackStatus.EXACT:
        kept = inversion.force_N.copy()
    kept[0] = kept[-1]
    error = output - cycle_N
    return replace(
        found,
        departures=departures(output, cycle_N, step_s),
        time_s=inversion.time_s,
        force_N=kept,
        predicted_output_N=output,
        rms_error_N=float(np.sqrt(np.mean(error**2))),
        peak_error_N=float(np.max(np.abs(error))),
    )
