"""Receding horizon: what planning reaches where the reference is known only so far ahead.

Time goes in moves. At each the reference is known up to the preview, and held beyond; what is best for that is
computed from the state that the chain is in, and kept for one move. So row k depends on nothing later than k plus the
preview. With preview for the dead zone that is nearly as good as knowing all; with less, a rule that expects the
reference to go on can do better than one that expects it to stop.
"""

import time
from dataclasses import replace

import numpy as np

from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.models.layout import ChainInputs
from tendonff.ocp.batch import Progress
from tendonff.ocp.inverse import invert
from tendonff.ocp.simulate import Simulator
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.answer import Found, answer
from tendonff.ocp.tracking.cost import evaluate
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.motion import limit_motion
from tendonff.ocp.tracking.problem import TrackingProblem, TrackOptions
from tendonff.ocp.tracking.result import Tracking, TrackStatus
from tendonff.ocp.tracking.search.grids import refine
from tendonff.ocp.tracking.search.knots import coarse_spacing
from tendonff.ocp.tracking.search.sqp import SqpSettings
from tendonff.ocp.tracking.track import BLAS, track

_MOVES = 5  # in one preview, ...
_MOST_MOVES = 200  # and in all, but two in a preview at least
_HELD = 0.5  # of the preview: so long the last known reference is held beyond it
_SMALL = 1e-4  # of the range: an error that is not worth a search
_ITERATIONS = 40  # for one move
LEAST_ROWS = 10
"""Rows of preview below which there is nothing to plan."""


def track_preview(
    chain: Chain,
    reference_N: Array,
    step_s: float,
    limits: ForceLimits,
    preview_s: float,
    options: TrackOptions = TrackOptions(),  # noqa: B008 - frozen
    *,
    initial_tension_N: float | None = None,
    progress: Progress | None = None,
) -> Tracking:
    """Find the force within the limits, knowing the reference only so far ahead.

    Parameters
    ----------
    chain : Chain
    reference_N : ndarray, shape (n,)
    step_s : float
    limits : ForceLimits
    preview_s : float
        How far ahead the reference is known [s], at least ten steps.
    options : TrackOptions, optional
    initial_tension_N : float, optional
        Default: the first reference.
    progress : callable, optional
        Callback(completed, total), in rows.
    """
    ahead = round(preview_s / step_s)
    if ahead < LEAST_ROWS:
        raise ParameterError(
            f"preview_s must be at least {LEAST_ROWS} steps = {LEAST_ROWS * step_s:g} s, got {preview_s:g}; with less "
            "there is nothing to plan: use the exact inverse"
        )
    began = time.perf_counter()
    reference = np.asarray(reference_N, dtype=np.float64)
    start = float(reference[0]) if initial_tension_N is None else initial_tension_N
    n, held = len(reference), max(round(_HELD * ahead), 1)
    move = min(max(ahead // _MOVES, len(reference) // _MOST_MOVES, 1), ahead // 2)
    longer = np.concatenate([reference, np.full(ahead + held, reference[-1])])
    inverse = invert(chain, longer, step_s, initial_tension_N=start)  # causal: row k knows nothing later
    if limits.admits(inverse.force_N, step_s, 1e-9) and not limits.motion.binds:
        return track(chain, reference, step_s, limits, options, initial_tension_N=start, progress=progress)
    problem = TrackingProblem.of(
        (chain,), longer, step_s, limits, options, initial_tension_N=start, inverse_N=inverse.force_N
    )
    (plant,) = problem.plants
    simulator = Simulator(chain, step_s, plant.state, ChainInputs.of_force(np.array([problem.start_N])))
    settings = SqpSettings(
        iterations=min(options.max_iterations, _ITERATIONS),
        tolerance=options.tolerance,
        trust_N=0.1 * float(np.ptp(reference)) + 1e-6,
    )
    force, static, plan = np.array([problem.start_N]), plant.static.start_N, np.empty(0)
    with BLAS.limit(limits=1):
        for row in range(0, n - 1, move):
            known = np.minimum(np.arange(row, row + ahead + held + 1), row + ahead)
            part = problem.piece(slice(row, row + len(known)), (simulator.state,), (static,), float(force[-1]))
            (seen,) = part.plants
            part = replace(
                part,
                goal=replace(part.goal, reference_N=longer[known]),
                plants=(replace(seen, static=replace(seen.static, wanted_N=plant.static.wanted_N[known])),),
            )
            starts = [inverse.force_N[known]]
            if plan.size:
                starts.append(np.concatenate([plan[move:], np.full(move, plan[-1])]))
            plan = _planned(part, starts, settings)
            if limits.motion.binds:
                plan = part.clipped(limit_motion(chain, plan, step_s, limits, part.rest_N, simulator.state))
            kept = plan[1 : min(move, n - 1 - row) + 1]
            force = np.concatenate([force, kept])
            simulator.advance(ChainInputs.of_force(kept))
            static = float(replace(plant.static, start_N=static).output_N(kept)[-1])
            if progress is not None:
                progress(min(row + move, n - 1), n - 1)
    whole = problem.piece(slice(0, n), (plant.state,), (plant.static.start_N,), problem.start_N)
    known_inverse = replace(
        inverse,
        time_s=inverse.time_s[:n],
        force_N=inverse.force_N[:n],
        least_tension_N=inverse.least_tension_N[:n],
    )
    at_force, at_clipped = evaluate(whole, force), evaluate(whole, whole.clipped(known_inverse.force_N))
    most = law_of(chain).largest_output_N(limits.maximum_N - chain.coulomb_N)
    status = TrackStatus.OPTIMAL if float(reference.max()) <= most else TrackStatus.BEST_ACHIEVABLE
    work = Found(status=status, force_N=force, evaluation=at_force, at_clipped=at_clipped)
    told = answer(work, whole, known_inverse, options, cautions=(), solve_s=time.perf_counter() - began)
    share = 100 * told.rms_error_N / max(float(np.ptp(reference)), 1e-300)
    reach = "" if status is TrackStatus.OPTIMAL else "the reference is out of reach; "
    message = (
        f"{reach}with {preview_s:.4g} s of preview, planned anew every {move * step_s:.3g} s: RMS error "
        f"{told.rms_error_N:.3g} N ({share:.2g} % of range), that of the clipped inverse "
        f"{told.clipped_rms_error_N:.3g} N; {told.solve_s:.1f} s"
    )
    return replace(told, message=message)


def _planned(part: TrackingProblem, starts_N: list[Array], settings: SqpSettings) -> Array:
    """The best profile over what is known, from the better of some profiles within the limits."""
    tried = [(evaluate(part, each), each) for each in map(part.clipped, starts_N)]
    best = min(tried, key=lambda each: each[0].merit)
    span = max(float(np.ptp(part.goal.reference_N)), 1e-9)
    if best[0].beyond_N == 0 and best[0].squares[0] < (_SMALL * span) ** 2:
        return best[1]
    return refine(part, tuple(starts_N), settings, coarse_spacing(part.goal.reference_N)).force_N
