"""Optimal control: the force profile within the actuator's limits whose output comes closest to a reference."""

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.chain import Chain
from tendonff.ocp.errors import CodeError, SolveError
from tendonff.ocp.inverse import InverseStatus, Inversion, invert
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Evaluation, evaluate
from tendonff.ocp.tracking.diagnosis import departures, law_of, reasons
from tendonff.ocp.tracking.grids import GridRefinement
from tendonff.ocp.tracking.limits import ForceLimits, Violation
from tendonff.ocp.tracking.motion import limit_motion
from tendonff.ocp.tracking.problem import TrackingProblem, TrackOptions
from tendonff.ocp.tracking.receding_horizon import Progress, solve
from tendonff.ocp.tracking.result import Tracking, TrackStatus

__all__ = ["TrackOptions", "TrackStatus", "Tracking", "solve_tracking", "track"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Work:
    """What was found, before it is put into words."""

    status: TrackStatus
    note: str
    force_N: Array
    evaluation: Evaluation
    at_clipped: Evaluation
    refinements: tuple[GridRefinement, ...]
    build_s: float
    solve_s: float


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
    problem = TrackingProblem.of((chain,), reference, step_s, limits, options, initial_tension_N=start)
    return solve_tracking(problem, inverse, options, progress)


def solve_tracking(
    problem: TrackingProblem, inversion: Inversion, options: TrackOptions, progress: Progress | None = None
) -> Tracking:
    """Solve a tracking problem, and say what the answer is worth.

    Parameters
    ----------
    problem : TrackingProblem
        Its first plant is the nominal one: its inverse is the starting point and its output is predicted.
    inversion : Inversion
        Exact inverse of the nominal plant.
    options : TrackOptions
    progress : callable, optional
        Callback(completed, total), in iterations.
    """
    began = time.perf_counter()
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
    candidates = [(at_clipped, clipped), (evaluate(problem, static), static)]
    built = time.perf_counter()
    refinements: tuple[GridRefinement, ...] = ()
    note = ""
    if exact:  # the clipped inverse is the inverse itself, and its error is rounding
        best, status = 0, TrackStatus.EXACT
    else:
        try:
            started = inversion.force_N if not limits.motion.binds else wanted_N
            for wanted in (started, law):  # the law only where the search from the inverse ends worse
                force, refinements = solve(_taut(problem, wanted), wanted, options, progress)
                candidates.insert(0, (evaluate(problem, force), force))
                if candidates[0][0].merit < min(found.merit for found, _ in candidates[1:]):
                    break
        except (CodeError, SolveError) as error:
            note = f"; the search stopped: {error}"
        best = min(range(len(candidates)), key=lambda i: candidates[i][0].merit)
        status = _status(candidates[best][0], refinements if best < len(candidates) - 2 else ())
    evaluation, force = candidates[best]
    work = _Work(
        status=status,
        note=note,
        force_N=force,
        evaluation=evaluation,
        at_clipped=at_clipped,
        refinements=refinements,
        build_s=built - began,
        solve_s=time.perf_counter() - built,
    )
    return _report(work, problem, inversion, options)


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


def _status(evaluation: Evaluation, refinements: tuple[GridRefinement, ...]) -> TrackStatus:
    if not math.isfinite(evaluation.merit):
        return TrackStatus.FAILED
    if not refinements:
        return TrackStatus.CLIPPED
    return TrackStatus.OPTIMAL if all(r.converged for r in refinements) else TrackStatus.ACCEPTABLE


def _report(work: _Work, problem: TrackingProblem, inversion: Inversion, options: TrackOptions) -> Tracking:
    """Put what was found into a result that explains itself."""
    h, reference, limits, force = problem.step_s, problem.goal.reference_N, problem.limits, work.force_N
    nominal = problem.plants[0].chain
    seen = evaluate(replace(problem, plants=problem.plants[:1]), force)
    tension = seen.tensions_N[0] if seen.tensions_N else np.full((len(reference), nominal.count + 1), np.nan)
    output = tension[:, -1]
    worst = worst_bound(tension, force, h, limits, options)
    too_fast = limits.worst_motion(seen.travels_m[0], h) if seen.travels_m else None
    status = work.status
    if status is not TrackStatus.FAILED and not _keeps_tension(tension, options):
        status = TrackStatus.INFEASIBLE
    note = work.note if too_fast is None else f"{work.note}; the motion is not kept: {too_fast}"
    error = output - reference
    rms, span = float(np.sqrt(np.mean(error**2))), max(float(np.ptp(reference)), 1e-300)
    clipped_rms = float(np.sqrt(work.at_clipped.squares.max()))
    iterations = sum(r.iterations for r in work.refinements)
    promise = max((abs(r.promise) for r in work.refinements), default=0.0)
    told: tuple[str, ...] = ()
    if status is not TrackStatus.EXACT:
        bounds = options.minimum_tension_N, options.maximum_tension_N
        told = reasons(law_of(nominal), reference, inversion.force_N, h, limits, *bounds)
    left = f"{rms:.3g} N rms ({100 * rms / span:.2g} % of range) remain, the clipped inverse leaves {clipped_rms:.3g} N"
    plants = len(work.evaluation.squares)
    if plants > 1:
        worst_rms = float(np.sqrt(work.evaluation.squares.max()))
        left = (
            f"{worst_rms:.3g} N rms remain on the worst of {plants} plants where the clipped inverse leaves "
            f"{clipped_rms:.3g} N; {rms:.3g} N ({100 * rms / span:.2g} % of range) on the nominal one"
        )
    effort = f"{iterations} iterations, {work.solve_s:.2g} s"
    message = {
        TrackStatus.EXACT: f"no limit binds: the exact inverse is the optimum, {rms:.2g} N rms remain; no iterations",
        TrackStatus.OPTIMAL: f"{left}; {effort}",
        TrackStatus.ACCEPTABLE: (
            f"{left}; the search ended after {effort}, with {100 * promise:.2g} % of the squared error still to be "
            "gained by its own estimate: raise max_iterations for more"
        ),
        TrackStatus.CLIPPED: f"{left}; nothing better was found in {effort}: this is the clipped inverse or static law",
        TrackStatus.INFEASIBLE: (
            f"no profile keeps the tension in bounds; closest: {worst}; {left}; {effort}; "
            "widen the tension bounds, let the reference change more slowly, or start from another initial tension"
        ),
        TrackStatus.FAILED: "no profile could be simulated on the design model; try a smaller step_s or another level",
    }[status]
    return Tracking(
        status=status,
        message=message + note,
        reasons=told,
        departures=departures(output, reference, h),
        time_s=inversion.time_s,
        force_N=force,
        predicted_output_N=output,
        rms_error_N=rms,
        peak_error_N=float(np.max(np.abs(error))),
        clipped_rms_error_N=clipped_rms,
        least_tension_N=float(tension[1:].min()),
        largest_tension_N=float(tension[1:].max()),
        worst=worst if too_fast is None else too_fast,
        iterations=iterations,
        promise=promise,
        windows=max(len(work.refinements), 1),
        build_s=work.build_s,
        solve_s=work.solve_s,
    )


def _keeps_tension(tension_N: Array, options: TrackOptions) -> bool:
    moving = tension_N[1:]
    low, high = options.minimum_tension_N * (1 - 1e-6), options.maximum_tension_N * (1 + 1e-6)
    return bool(np.all(moving > 0) and np.all(moving >= low) and np.all(moving <= high))


def worst_bound(
    tension_N: Array, force_N: Array, step_s: float, limits: ForceLimits, options: TrackOptions
) -> Violation:
    """The bound that is broken most, or met most closely, among the actuator's and the tendon's.

    Parameters
    ----------
    tension_N : ndarray, shape (n, N + 1)
    force_N : ndarray, shape (n,)
    step_s : float
    limits : ForceLimits
    options : TrackOptions
    """
    of_force = limits.worst(force_N, step_s)
    if not np.all(np.isfinite(tension_N)):
        return of_force
    for name, bound, side, pick in (
        ("minimum_tension_N", options.minimum_tension_N, -1.0, np.argmin),
        ("maximum_tension_N", options.maximum_tension_N, 1.0, np.argmax),
    ):
        at = int(pick(tension_N[1:])) + tension_N.shape[1]
        value = float(tension_N.ravel()[at])
        excess = side * (value - bound)
        if excess > 1e-6 * abs(bound) or (bound == 0 and excess >= 0):
            time_s = at // tension_N.shape[1] * step_s
            return Violation(name=name, time_s=time_s, value=value, bound=bound, excess=excess)
    return of_force
