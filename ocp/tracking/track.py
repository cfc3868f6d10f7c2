"""Optimal control: the force profile within the actuator's limits whose output comes closest to a reference."""

import math
import time
from dataclasses import replace

import numpy as np
from threadpoolctl import ThreadpoolController

from tendonff.models.chain import Chain
from tendonff.ocp.batch import Progress
from tendonff.ocp.errors import CodeError, SolveError
from tendonff.ocp.inverse import InverseStatus, Inversion, invert
from tendonff.ocp.simulate import simulate
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.answer import Found, answer
from tendonff.ocp.tracking.cost import Evaluation, evaluate
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.motion import limit_motion
from tendonff.ocp.tracking.problem import WORST_POWER, TrackingProblem, TrackOptions, travel_N
from tendonff.ocp.tracking.ratcheting import STIFFER, disagreement
from tendonff.ocp.tracking.result import Tracking, TrackStatus
from tendonff.ocp.tracking.search.grids import GridRefinement
from tendonff.ocp.tracking.search.led import led_force
from tendonff.ocp.tracking.search.programme import programme
from tendonff.ocp.tracking.search.receding_horizon import solve

__all__ = ["TrackOptions", "TrackStatus", "Tracking", "solve_tracking", "track"]


def track(
    chain: Chain,
    reference_N: Array,
    step_s: float,
    limits: ForceLimits,
    options: TrackOptions = TrackOptions(),  # noqa: B008 - frozen
    *,
    initial_tension_N: float | None = None,
    inversion: Inversion | None = None,
    progress: Progress | None = None,
) -> Tracking:
    """Find the force within the limits whose response comes closest to the reference (x_c2 = f_c2 = 0).

    Where no limit binds that is the exact inverse. Elsewhere the profile prepares each reversal: it leaves the inverse
    early, ramps at the largest rate through the dead zone, and meets the inverse again later.

    Parameters
    ----------
    chain : Chain
        Design model.
    reference_N : ndarray, shape (n,)
        Desired output tension at 0, h, 2 h ... [N], > 0.
    step_s : float
        h [s], > 0.
    limits : ForceLimits
    options : TrackOptions, optional
    initial_tension_N : float, optional
        Uniform tension T0 of the start at rest [N]; default: the first reference.
    inversion : Inversion, optional
        `invert` of the same arguments, where the caller has it already.
    progress : callable, optional
        Callback(completed, total), in iterations; total is their limit.

    Returns
    -------
    Tracking
        Whatever happens; the status says what it is.

    Raises
    ------
    ParameterError
        If reference or step are not usable numbers.
    """
    reference = np.asarray(reference_N, dtype=np.float64)
    start = float(reference[0]) if initial_tension_N is None else initial_tension_N
    inverse = invert(chain, reference, step_s, initial_tension_N=start) if inversion is None else inversion
    problem = TrackingProblem.of(
        (chain,), reference, step_s, limits, options, initial_tension_N=start, inverse_N=inverse.force_N
    )
    return solve_tracking(problem, inverse, options, progress)


def solve_tracking(
    problem: TrackingProblem, inversion: Inversion, options: TrackOptions, progress: Progress | None = None
) -> Tracking:
    """Solve a tracking problem, and say what the answer is worth.

    The first plant is the nominal one: its inverse is the starting point and its output is predicted. Progress is
    counted in iterations.
    """
    with BLAS.limit(limits=1):
        return _solve(problem, inversion, options, progress)


BLAS = ThreadpoolController().select(user_api="blas")
"""At the size of these matrices a second thread costs a hundred times what it gives."""


def _solve(
    problem: TrackingProblem, inversion: Inversion, options: TrackOptions, progress: Progress | None
) -> Tracking:
    """As `solve_tracking`."""
    began = time.perf_counter()
    found = _search(problem, inversion, options, progress)
    cautions: tuple[str, ...] = ()
    if found.refinements and _pumps(problem, inversion, found.force_N):
        weight, share = _SOBER * found.at_clipped.squares.max() / travel_N(problem.clipped(inversion.force_N)), 1.0
        if _differ(problem):  # there travel that makes the plants' memories alike is worth its while
            weight, share = problem.goal.travel_weight, _STIFF
        sober = replace(
            problem,
            plants=(
                *problem.plants,
                *(replace(p, chain=p.chain.stiffened(STIFFER), weight=share) for p in problem.plants),
            ),
            goal=replace(problem.goal, power=WORST_POWER, travel_weight=weight),
        )
        calm = _search(sober, inversion, options, progress)
        promised, left = (float(np.sqrt(f.evaluation.squares.max())) for f in (found, calm))
        caution = (
            f"a force that shakes promises {promised:.3g} N RMS by pumping the bristles, which stiff bristles and the "
            f"static law deny; this profile holds with stiff bristles as well, and leaves {left:.3g} N RMS at worst, "
            "those counted"
        )
        cautions = (caution,)
        found = calm
    return answer(found, problem, inversion, options, cautions=cautions, solve_s=time.perf_counter() - began)


def _pumps(problem: TrackingProblem, inversion: Inversion, force_N: Array) -> bool:
    """Whether the profile pumps the bristles of the nominal plant."""
    chain, start, reference = problem.plants[0].chain, float(inversion.force_N[0]), problem.goal.reference_N
    output = simulate(chain, force_N, problem.step_s, initial_tension_N=start).output_tension_N
    if np.mean((output - reference) ** 2) < 0.25 * np.mean(_missed_N(problem) ** 2):
        return True
    suspect, usual = (
        disagreement(chain, force, problem.step_s, start) for force in (force_N, problem.clipped(inversion.force_N))
    )
    return suspect.exceeds(usual, float(np.ptp(reference)))


def _missed_N(problem: TrackingProblem) -> Array:
    """What the largest force cannot hold against friction in full slip, whatever the bristles promise, shape (n,)."""
    chain = problem.plants[0].chain
    most = law_of(chain).largest_output_N(problem.limits.maximum_N - chain.coulomb_N)
    return np.maximum(problem.goal.reference_N - most, 0.0)


def _search(problem: TrackingProblem, inversion: Inversion, options: TrackOptions, progress: Progress | None) -> Found:
    """The best profile: of the search, or the clipped inverse or static law where that finds nothing better."""
    reference, limits = problem.goal.reference_N, problem.limits
    nominal, start_N = problem.plants[0].chain, float(inversion.force_N[0])

    def moderate(force: Array) -> Array:
        state = problem.plants[0].state
        return limit_motion(nominal, problem.clipped(force), problem.step_s, limits, problem.rest_N, state)

    wanted_N = moderate(inversion.force_N)
    clipped = problem.clipped(wanted_N)
    at_clipped = evaluate(problem, clipped)
    law = moderate(law_of(nominal).input_history_N(reference, start_N))
    static = problem.clipped(law)
    exact = (
        inversion.status is InverseStatus.EXACT
        and options.effort_weight == 0
        and len(problem.plants) == 1
        and limits.admits(inversion.force_N, problem.step_s, 1e-9)
        and np.array_equal(clipped, problem.clipped(inversion.force_N))
        and at_clipped.beyond_N == 0
    )
    if exact:  # the clipped inverse is the inverse itself, and its error is rounding, unless the rig amplifies that
        small = at_clipped.squares[0] <= (_EXACT * float(np.ptp(reference))) ** 2
        status = TrackStatus.EXACT if small else TrackStatus.UNSTABLE
        return Found(status=status, force_N=clipped, evaluation=at_clipped, at_clipped=at_clipped)
    candidates = [(at_clipped, clipped), (evaluate(problem, static), static)]
    refinements: tuple[GridRefinement, ...] = ()
    by_motion: tuple[GridRefinement, ...] = ()
    note = ""
    try:
        planned = [programme(problem)] if len(problem.plants) == 1 or _differ(problem) else []
        started, further = inversion.force_N, [law, *planned]
        if not np.array_equal(wanted_N, problem.clipped(inversion.force_N)):  # a limit of the motion binds
            led, by_motion = led_force(problem, inversion, options)
            kept = problem.clipped(moderate(problem.clipped(led)))
            candidates.append((evaluate(problem, kept), kept))
            started, further = min(candidates, key=lambda c: c[0].merit)[1], planned if _differ(problem) else []
        starts = (started, *further)
        force, refinements = solve(_taut(problem, started), starts, options, progress)
        candidates.append((evaluate(problem, force), force))
        if limits.motion.binds:  # the search may end beyond a limit of the motion
            kept = problem.clipped(moderate(force))
            candidates.append((evaluate(problem, kept), kept))
    except (CodeError, SolveError) as error:
        note = f"; the search stopped: {error}"
    inside = [k for k, (found, _) in enumerate(candidates) if found.beyond_N <= _BEYOND * float(np.ptp(reference))]
    best = min(inside or range(len(candidates)), key=lambda i: candidates[i][0].merit)
    evaluation, force = candidates[best]
    if by_motion and not any(r.improved for r in refinements):
        refinements = by_motion
    won = best > 1 and any(r.improved for r in refinements)
    return Found(
        status=_status(problem, evaluation, refinements if won else ()),
        note=note,
        force_N=force,
        evaluation=evaluation,
        at_clipped=at_clipped,
        refinements=refinements,
    )


def _differ(problem: TrackingProblem) -> bool:
    """Whether the plants have friction of their own."""
    exponents = [law_of(plant.chain).pull_exponent for plant in problem.plants]
    return max(exponents) > (1 + 1e-6) * min(exponents)


_STIFF = 0.5  # weight of a squared error with stiff bristles where plants differ
_SOBER = 1.0  # of the clipped inverse's squared error: the cost of travelling as far once more
_BEYOND = 5e-4  # of the reference's range, as `MotionBound` counts: half a percent of the speed
_EXACT = 1e-3  # of the reference's range: an error below this is called rounding
_FLOORS = (1.0, 4.0, 16.0, 64.0, 256.0)


def _taut(problem: TrackingProblem, wanted_N: Array) -> TrackingProblem:
    """The problem with a least force that keeps the tendon taut: a search that starts slack sees no slope."""
    limits = problem.limits
    for floor in (limits.minimum_N, *(problem.bounds.low_N * share for share in _FLOORS)):
        if limits.minimum_N <= floor < min(limits.maximum_N, problem.start_N):
            taut = replace(problem, limits=replace(limits, minimum_N=floor))
            if evaluate(problem, taut.clipped(wanted_N)).beyond_N == 0:
                return taut
    return problem


def _status(problem: TrackingProblem, evaluation: Evaluation, refinements: tuple[GridRefinement, ...]) -> TrackStatus:
    if not math.isfinite(evaluation.merit):
        return TrackStatus.FAILED
    if _missed_N(problem).any():
        return TrackStatus.BEST_ACHIEVABLE
    if not refinements:
        return TrackStatus.CLIPPED
    return TrackStatus.OPTIMAL if all(r.converged for r in refinements) else TrackStatus.ACCEPTABLE
