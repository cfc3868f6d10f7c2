"""From what a search found to an answer that explains itself."""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.inverse import Inversion
from tendonff.ocp.tracking.cost import Evaluation, evaluate
from tendonff.ocp.tracking.diagnosis import departures, law_of, reasons
from tendonff.ocp.tracking.limits import ForceLimits, Violation
from tendonff.ocp.tracking.options import TrackOptions
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.result import Tracking, TrackStatus
from tendonff.ocp.tracking.sqp import SqpResult


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """Result of a search."""

    status: TrackStatus
    force_N: Array  # shape (n,)
    # evaluation, at_clipped: of that force, and of the clipped inverse
    evaluation: Evaluation
    at_clipped: Evaluation
    note: str = ""  # how the search stopped, where it was cut short
    results: tuple[SqpResult, ...] = ()  # of each piece of the horizon; empty where nothing better was found


def answer(
    work: Found,
    problem: TrackingProblem,
    inversion: Inversion,
    options: TrackOptions,
    *,
    build_s: float,
    solve_s: float,
) -> Tracking:
    """Put what was found into a result that explains itself.

    `inversion` is the exact inverse of the nominal plant; posing the problem took `build_s`, the search `solve_s`.
    """
    h, reference, limits, force = problem.step_s, problem.reference_N, problem.limits, work.force_N
    nominal = problem.plants[0].chain
    seen = evaluate(replace(problem, plants=problem.plants[:1]), force).tensions_N
    tension = seen[0] if seen else np.full((len(reference), nominal.count + 1), np.nan)
    output = tension[:, -1]
    worst = worst_bound(tension, force, h, limits, options)
    status = work.status
    if status is not TrackStatus.FAILED and not _keeps_tension(tension, options):
        status = TrackStatus.INFEASIBLE
    error = output - reference
    rms, span = float(np.sqrt(np.mean(error**2))), max(float(np.ptp(reference)), 1e-300)
    squares = work.evaluation.squares
    clipped_rms = float(np.sqrt(work.at_clipped.squares[: problem.chains].max()))
    iterations = sum(result.iterations for result in work.results)
    gain = max((result.gain for result in work.results), default=0.0)
    causes: tuple[str, ...] = ()
    if status is not TrackStatus.EXACT:
        bounds = options.minimum_tension_N, options.maximum_tension_N
        causes = reasons(law_of(nominal), reference, inversion.force_N, h, limits, *bounds, nominal.drive)
    left = f"RMS error {rms:.3g} N ({100 * rms / span:.2g} % of range)"
    if problem.chains > 1:
        worst_rms = float(np.sqrt(squares[: problem.chains].max()))
        left = (
            f"RMS error {worst_rms:.3g} N on the worst of {problem.chains} plants, the search's own with "
            f"{nominal.count} masses (an expected error is over more and finer ones), {left[10:]} on the nominal one"
        )
    if work.at_clipped.beyond_N == 0:  # what breaks a bound is no yardstick
        left += f", that of the clipped inverse {clipped_rms:.3g} N"
    left += _floor(problem)
    effort = f"{iterations} iterations, {solve_s:.1f} s"
    message = {
        TrackStatus.EXACT: "no limit binds: the exact inverse is the optimum; no iterations",
        TrackStatus.OPTIMAL: f"{left}; {effort}",
        TrackStatus.UNSTABLE: (
            f"no limit binds, but simulated the exact inverse has an RMS error of {rms:.3g} N "
            f"({100 * rms / span:.2g} % of range): "
            "this rig amplifies rounding (stick-slip), so do not expect it to follow"
        ),
        TrackStatus.BEST_ACHIEVABLE: (
            f"the reference is out of reach; the best achievable profile that keeps the tendon taut: {left}; {effort}"
        ),
        TrackStatus.ACCEPTABLE: (
            f"{left}; the search ended after {effort}, when an iteration still gained {100 * gain:.2g} % of the "
            "squared error: raise max_iterations for more"
        ),
        TrackStatus.CLIPPED: f"{left}; nothing better in {effort}: this is the clipped inverse or capstan law",
        TrackStatus.INFEASIBLE: (
            f"no profile keeps the tension in bounds; closest: {worst}; {left}; {effort}; "
            "widen the tension bounds, let the reference change more slowly, or start from another initial tension"
        ),
        TrackStatus.FAILED: "no profile could be simulated on the design model; try a smaller step_s or another level",
    }[status]
    return Tracking(
        status=status,
        message=message + work.note,
        reasons=causes,
        departures=departures(output, reference, h),
        time_s=inversion.time_s,
        force_N=force,
        predicted_output_N=output,
        rms_error_N=rms,
        peak_error_N=float(np.max(np.abs(error))),
        clipped_rms_error_N=clipped_rms,
        least_tension_N=float(tension[1:].min()),
        largest_tension_N=float(tension[1:].max()),
        worst=worst,
        iterations=iterations,
        gain=gain,
        windows=max(len(work.results), 1),
        build_s=build_s,
        solve_s=solve_s,
    )


def _floor(problem: TrackingProblem) -> str:
    """Bound on the error of any force while plants with different friction all slip; empty where friction is the same.

    One force leaves a relative error of T + p of tanh(d) on one of two plants whose mu theta are 2 d apart.
    """
    exponents = [law_of(plant.chain).pull_exponent for plant in problem.plants[: problem.chains]]
    apart = 0.5 * (max(exponents) - min(exponents))
    if apart <= _ALIKE * max(exponents):
        return ""
    floor = 100 * np.tanh(apart)
    return (
        f"; while all slip, no force does better than {floor:.3g} % of the tension on both extremes of friction "
        f"(tanh d, mu theta known to +-{apart:.3g} = d)"
    )


_ALIKE = 1e-6


def _keeps_tension(tension_N: Array, options: TrackOptions) -> bool:
    moving = tension_N[1:]
    low, high = options.minimum_tension_N * (1 - 1e-6), options.maximum_tension_N * (1 + 1e-6)
    return bool(np.all(moving > 0) and np.all(moving >= low) and np.all(moving <= high))


def worst_bound(
    tension_N: Array, force_N: Array, step_s: float, limits: ForceLimits, options: TrackOptions
) -> Violation:
    """The bound that is broken most, or met most closely, among the actuator's and the tendon's.

    Tensions of shape (n, N + 1), force of shape (n,) [N].
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
