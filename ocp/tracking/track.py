"""Optimal control: the force profile within the actuator's limits whose output comes closest to a reference."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.chain import Chain
from tendonff.ocp.errors import CodeError, SolveError
from tendonff.ocp.inverse import InverseStatus, Inversion, invert
from tendonff.ocp.simulate import Simulator
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Goal, Judgement, Plant, TensionBounds, judge
from tendonff.ocp.tracking.diagnosis import departures, law_of, reasons
from tendonff.ocp.tracking.grids import Improvement, coarse_spacing, improve
from tendonff.ocp.tracking.limits import ForceLimits, Violation
from tendonff.ocp.tracking.receding_horizon import KNOTS_OF_OVERLAP, KNOTS_PER_WINDOW, windows
from tendonff.ocp.tracking.result import Tracking, TrackOptions, TrackStatus
from tendonff.ocp.tracking.sqp import Rules

__all__ = ["TrackOptions", "TrackStatus", "Tracking", "track", "track_plants"]

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Work:
    """What was found, before it is put into words."""

    status: TrackStatus
    note: str
    force_N: Array
    judgement: Judgement
    at_clipped: Judgement
    inversion: Inversion
    improvements: tuple[Improvement, ...]
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
        Wanted output tension at 0, h, 2 h ... [N], > 0.
    step_s : float
        h [s], > 0.
    limits : ForceLimits
    options : TrackOptions, optional
    initial_tension_N : float, optional
        Uniform tension T0 of the start at rest [N]; default: the first reference.
    progress : callable, optional
        Told iterations done and iterations at most.

    Returns
    -------
    Tracking
        Whatever happens; the status says what it is.

    Raises
    ------
    ParameterError
        If reference or step are not usable numbers.
    """
    start = float(np.asarray(reference_N, dtype=np.float64)[0]) if initial_tension_N is None else initial_tension_N
    return track_plants((chain,), chain, reference_N, step_s, limits, options, 1.0, start, progress)


def track_plants(
    chains: tuple[Chain, ...],
    nominal: Chain,
    reference_N: Array,
    step_s: float,
    limits: ForceLimits,
    options: TrackOptions,
    power: float,
    initial_tension_N: float,
    progress: Progress | None,
) -> Tracking:
    """One profile for several plants; see `track`.

    Parameters
    ----------
    chains : tuple of Chain
        The plants it must serve.
    nominal : Chain
        The one whose inverse is the starting point and whose output is predicted.
    reference_N : ndarray, shape (n,)
    step_s : float
    limits : ForceLimits
    options : TrackOptions
    power : float
        Order of the mean over the plants' squared errors: 1 for the mean, large for the worst.
    initial_tension_N : float
    progress : callable or None
    """
    began = time.perf_counter()
    reference = np.asarray(reference_N, dtype=np.float64)
    inversion = invert(nominal, reference, step_s, initial_tension_N=initial_tension_N)
    plants = tuple(Plant(chain=c, state=c.rest_state(initial_tension_N)) for c in chains)
    goal = _goal(reference, step_s, initial_tension_N, options, power)
    clipped = limits.apply(inversion.force_N, step_s, limits.start(initial_tension_N))
    at_clipped = judge(plants, goal, clipped)
    law = law_of(nominal).input_history_N(reference, initial_tension_N)
    static = limits.apply(law, step_s, float(clipped[0]))
    exact = (
        inversion.status is InverseStatus.EXACT
        and options.effort_weight == 0
        and chains == (nominal,)
        and limits.admits(inversion.force_N, step_s, 1e-9)
        and at_clipped.beyond_N == 0
    )
    candidates = [(at_clipped, clipped), (judge(plants, goal, static), static)]
    built = time.perf_counter()
    improvements: tuple[Improvement, ...] = ()
    note = ""
    if exact:  # the clipped inverse is the inverse itself, and its error is rounding
        best, status = 0, TrackStatus.EXACT
    else:
        try:
            for wanted in (inversion.force_N, law):  # the law only where the search from the inverse ends worse
                taut = _taut_limits(plants, goal, limits, wanted, float(clipped[0]))
                force, improvements = _search(plants, goal, taut, float(clipped[0]), wanted, options, progress)
                candidates.insert(0, (judge(plants, goal, force), force))
                if candidates[0][0].merit < min(judged.merit for judged, _ in candidates[1:]):
                    break
        except (CodeError, SolveError) as error:
            note = f"; the search stopped: {error}"
        best = min(range(len(candidates)), key=lambda i: candidates[i][0].merit)
        status = _status(candidates[best][0], improvements if best < len(candidates) - 2 else ())
    judgement, force = candidates[best]
    return _report(
        _Work(
            status=status,
            note=note,
            force_N=force,
            judgement=judgement,
            at_clipped=at_clipped,
            inversion=inversion,
            improvements=improvements,
            build_s=built - began,
            solve_s=time.perf_counter() - built,
        ),
        goal,
        options,
        limits,
        nominal,
    )


_FLOORS = (1.0, 4.0, 16.0, 64.0, 256.0)


def _taut_limits(
    plants: tuple[Plant, ...], goal: Goal, limits: ForceLimits, wanted: Array, start_N: float
) -> ForceLimits:
    """Limits whose least force keeps the tendon taut: a search that starts slack sees no slope."""
    for floor in (limits.minimum_N, *(goal.bounds.low_N * share for share in _FLOORS)):
        if limits.minimum_N <= floor < min(limits.maximum_N, start_N):
            taut = replace(limits, minimum_N=floor)
            if judge(plants, goal, taut.apply(wanted, goal.step_s, start_N)).beyond_N == 0:
                return taut
    return limits


def _status(judgement: Judgement, improvements: tuple[Improvement, ...]) -> TrackStatus:
    if not math.isfinite(judgement.merit):
        return TrackStatus.FAILED
    if not improvements:
        return TrackStatus.CLIPPED
    return TrackStatus.OPTIMAL if all(i.converged for i in improvements) else TrackStatus.ACCEPTABLE


def _goal(reference: Array, step_s: float, start: float, options: TrackOptions, power: float) -> Goal:
    span = max(float(np.ptp(reference)), 1e-3 * float(reference.max()))
    margin = 1e-4 * span  # the search aims a little inside, so that what it finds is inside
    slack = 1e-3 * min(float(reference.min()), start)
    return Goal(
        reference_N=reference,
        step_s=step_s,
        effort_weight=options.effort_weight,
        power=power,
        bounds=TensionBounds(
            low_N=options.minimum_tension_N + margin if options.minimum_tension_N > 0 else slack,
            high_N=options.maximum_tension_N - margin,
        ),
        penalty_N=4 * span + options.effort_weight * float(reference.max()),
    )


def _search(
    plants: tuple[Plant, ...],
    goal: Goal,
    limits: ForceLimits,
    start_N: float,
    wanted: Array,
    options: TrackOptions,
    progress: Progress | None,
) -> tuple[Array, tuple[Improvement, ...]]:
    """Improve window by window; the plants keep moving on the profile that was kept."""
    rows, spacing = len(wanted), coarse_spacing(goal.reference_N)
    length, overlap = KNOTS_PER_WINDOW * spacing, KNOTS_OF_OVERLAP * spacing
    if options.window_s is not None:
        length = max(round(options.window_s / goal.step_s), 2)
        overlap = max(min(overlap, length), 1)
    pieces = list(windows(rows, length, overlap))
    simulators = [Simulator(p.chain, goal.step_s, p.state, ChainInputs.of_force(np.array([start_N]))) for p in plants]
    force, improvements = np.array([start_N]), []
    rules = Rules(
        iterations=options.max_iterations,
        tolerance=options.tolerance,
        trust_N=0.1 * float(np.ptp(goal.reference_N)) + 1e-6,
    )
    counter = _Counter(progress, options.max_iterations * len(pieces))
    for piece in pieces:
        here = slice(piece.start, piece.end + 1)
        states = [s.state for s in simulators]
        moved = tuple(Plant(chain=p.chain, state=state) for p, state in zip(plants, states, strict=True))
        found = improve(
            moved,
            replace(goal, reference_N=goal.reference_N[here]),
            limits,
            limits.apply(wanted[here], goal.step_s, float(force[-1])),
            wanted[here],
            rules,
            spacing,
            counter.tick,
        )
        improvements.append(found)
        kept = found.force_N[1 : piece.keep - piece.start + 1]
        force = np.concatenate([force, kept])
        if piece.end > piece.keep:
            for simulator in simulators:
                simulator.advance(ChainInputs.of_force(kept))
    counter.finish()
    return force, tuple(improvements)


class _Counter:
    """Turns iterations into progress."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._total, self._done = progress, total, 0

    def tick(self) -> None:
        self._done += 1
        if self._progress is not None:
            self._progress(self._done, self._total)

    def finish(self) -> None:
        if self._progress is not None:
            self._progress(self._total, self._total)


def _report(work: _Work, goal: Goal, options: TrackOptions, limits: ForceLimits, nominal: Chain) -> Tracking:
    """Put what was found into a result that explains itself."""
    h, reference, force = goal.step_s, goal.reference_N, work.force_N
    rest = nominal.rest_state(float(work.inversion.force_N[0]))
    seen = judge((Plant(chain=nominal, state=rest),), goal, force).tensions_N
    tension = seen[0] if seen else np.full((len(reference), nominal.count + 1), np.nan)
    output = tension[:, -1]
    worst = worst_bound(tension, force, h, limits, options)
    status = work.status
    if status is not TrackStatus.FAILED and not _keeps_tension(tension, options):
        status = TrackStatus.INFEASIBLE
    error = output - reference
    rms, span = float(np.sqrt(np.mean(error**2))), max(float(np.ptp(reference)), 1e-300)
    clipped_rms = float(np.sqrt(work.at_clipped.squares.max()))
    iterations = sum(i.iterations for i in work.improvements)
    promise = max((abs(i.promise) for i in work.improvements), default=0.0)
    told: tuple[str, ...] = ()
    if status is not TrackStatus.EXACT:
        bounds = options.minimum_tension_N, options.maximum_tension_N
        told = reasons(law_of(nominal), reference, work.inversion.force_N, h, limits, *bounds)
    left = f"{rms:.3g} N rms ({100 * rms / span:.2g} % of range) remain, the clipped inverse leaves {clipped_rms:.3g} N"
    plants = len(work.judgement.squares)
    if plants > 1:
        worst_rms = float(np.sqrt(work.judgement.squares.max()))
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
        message=message + work.note,
        reasons=told,
        departures=departures(output, reference, h),
        time_s=work.inversion.time_s,
        force_N=force,
        predicted_output_N=output,
        rms_error_N=rms,
        peak_error_N=float(np.max(np.abs(error))),
        clipped_rms_error_N=clipped_rms,
        least_tension_N=float(tension[1:].min()),
        largest_tension_N=float(tension[1:].max()),
        worst=worst,
        iterations=iterations,
        promise=promise,
        windows=max(len(work.improvements), 1),
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
