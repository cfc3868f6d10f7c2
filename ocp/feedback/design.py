"""Design of the feedback beside a feedforward: gains that every mechanism that may be the real one can bear."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.turns import in_turn
from tendonff.ocp.errors import SolveError
from tendonff.ocp.feedback.closed_loop import ClosedLoop, Course, samples_of, simulate_feedback
from tendonff.ocp.feedback.law import MOST_SAMPLES, FeedbackLaw
from tendonff.ocp.feedback.linear import Branch, branches
from tendonff.ocp.feedback.requirement import Requirement
from tendonff.ocp.feedback.system import FeedbackSystem, Quantity
from tendonff.ocp.feedback.tune import Margins, Sampled, tune, worst_margins
from tendonff.ocp.mechanism.compiled import CompiledMechanism
from tendonff.ocp.mechanism.problem import Array, MechanismMemory, rest

_SLOW_RAD_PER_S = 1.0  # at which the gain of sliding is taken
_SLIDES = 0.3  # of the largest speed of the reference: enough to slide
_INSTANTS = 7  # of a motion that are linearised
_WIDTHS = (
    0.003,
    0.006,
    0.012,
    0.025,
    0.05,
    0.1,
    0.2,
)  # half widths of the play to try, over the range of the reference
_NARROWER = (0.4, 0.15)  # times the width with the best shape: what may do better in the loop
_WIDEST = 0.012  # of the range: in a turn the correction is inverted at once, whatever the error does
_SHAPED = 0.5  # share of a feedforward's error that the shape of friction must explain to be used
_DEVIATIONS = 2.0  # times the largest share of an error that the uncertainty has: what may have to be learned
_LEAST_DEVIATION = 0.1  # of the errors' size
_RATE_ERROR = 1.5  # times the largest that the uncertainty has: beyond it is an age
_STICKS = 8.0  # widths of the play in which a turn slides again
_TURN = 0.08  # the same of a streamed shape, over the range of the reference
_CAUTION = 10.0  # over the errors' size, with a streamed shape: what it leaves, as of bristles, lasts for whole strokes
_PEAK = 1.05  # of the feedforward's peak, above which a peak has a price
_PEAK_PRICE = 2.0
_FLOORS = (0.0, 0.1)
"""Shares of critical damping that oscillations have at least [-]: what friction adds, where all else leaves no gain."""
_ENOUGH = 0.5  # of the feedforward's error: a feedback that leaves no more needs no floor of damping
_CLAMP = 1.5  # times the largest correction that was needed, where the law expects to learn no more
STANDING_S = 1.0
"""Time of standing still in which limit cycles are looked for [s]."""
_SWING, _FADES = 1e-3, 0.5  # of the range: a swing that counts; share of the swing before, below which it dies out
_WORSE = 1.5  # times the feedforward's RMS error: a loop that oscillates while it moves


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """Sensor and timing of the loops.

    Parameters
    ----------
    sample_s : float
        Time between two calls of the controller [s], > 0.
    delay_s : float
        Age of a measurement when it arrives [s], >= 0.
    resolution : float, optional
        Step of the measurement [unit of the goal], >= 0.
    limit : float, optional
        Largest correction [unit of the command], > 0; default: what the design finds necessary.
    """

    sample_s: float
    delay_s: float
    resolution: float = 0.0
    limit: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopDesign:
    """Laws of the loops, and their margins.

    Attributes
    ----------
    laws : tuple of FeedbackLaw
        One for each goal.
    plants : tuple of Sampled
        Branches that were judged, of all mechanisms.
    growing : tuple of str
        Branches that are unstable without feedback, to which margins do not apply.
    least_damping : float
        Share of critical damping that every oscillation of the branches was given at least, for friction [-].
    margins : tuple of Margins
        Worst of each goal over the branches.
    """

    laws: tuple[FeedbackLaw, ...]
    plants: tuple[Sampled, ...]
    growing: tuple[str, ...]
    least_damping: float
    margins: tuple[Margins, ...]

    def with_laws(self, laws: Sequence[FeedbackLaw]) -> "LoopDesign":
        """The same with other laws of the same gains' ratio, and their margins."""
        return replace(self, laws=tuple(laws), margins=worst_margins(self.plants, laws))


@in_turn
def design_loops(
    systems: Sequence[FeedbackSystem],
    course: Course,
    sensor: Sensor,
    requirement: Requirement,
    *,
    followed: Sequence[Course] | None = None,
    scored: slice = slice(None),
) -> LoopDesign:
    """Gains, filter, clamp and shape of the feedback beside a feedforward.

    Parameters
    ----------
    systems : sequence of FeedbackSystem
        The nominal one and all others that may be the real one.
    course : Course
        Reference and feedforward.
    sensor : Sensor
    requirement : Requirement
        Margins on every branch of every system.
    followed : sequence of Course, optional
        Motion of each system along which it is linearised, as it follows the reference; default: the feedforward's.
    scored : slice, optional
        Rows whose errors count.

    Raises
    ------
    ParameterError
        If no gain keeps the margins, or the sensor's times do not fit the step.
    SolveError
        If the mechanism cannot be simulated under the feedforward.
    """
    every = samples_of(sensor.sample_s, course.step_s)
    if sensor.delay_s > MOST_SAMPLES * sensor.sample_s:
        raise ParameterError(
            f"delay_s must be at most {MOST_SAMPLES} samples of {sensor.sample_s:g} s, got {sensor.delay_s:g}"
        )
    delay_s = sensor.delay_s + systems[0].drive_delay_s
    found: list[Branch] = []
    errors: list[Array] = []
    seen: list[Array] = []
    references = systems[0].seen(course.reference)
    for number, (system, own) in enumerate(zip(systems, followed or [course] * len(systems), strict=True)):
        run = simulate_feedback(system, (), course)
        if not run.complete:
            raise SolveError(f"the feedforward cannot be simulated beyond t = {len(run.output) * course.step_s:.4g} s")
        found += linearised(system, own, f"system {number}")
        errors.append((run.output - course.reference)[scored])
        seen.append((system.seen(run.output) - references)[scored])
    slow = np.array([_SLOW_RAD_PER_S])
    sliding = np.max([np.abs(b.response(slow, sensor.sample_s, 0.0)[0].diagonal()) for b in found], axis=0)
    laws = tuple(
        replace(
            _shape(systems[0], goal, course, [error[:, goal] for error in seen], sensor, scored),
            gain=float(sliding[goal]),
            lag_s=systems[0].lag_s,
        )
        for goal in range(len(systems[0].goals))
    )
    rms = [float(np.sqrt(np.mean(error**2))) for error in errors]
    worst = sorted(range(len(errors)), key=lambda k: -rms[k])[:2]
    peaks = [float(np.abs(errors[k]).max()) for k in worst]

    def cost(tried: tuple[FeedbackLaw, ...]) -> float:
        found = 0.0
        for k, peak in zip(worst, peaks, strict=True):
            run = simulate_feedback(systems[k], tried, course, resolution=sensor.resolution)
            if not run.complete:
                return math.inf
            error = (run.output - course.reference)[scored]
            over = max(float(np.abs(error).max()) - _PEAK * peak, 0.0)
            found = max(found, float(np.sqrt(np.mean(error**2))) + _PEAK_PRICE * over)
        return found

    duration_s = len(course.reference[scored]) * course.step_s
    lag_s = delay_s + systems[0].lag_s + sensor.sample_s / 2
    chosen: list[tuple[float, tuple[FeedbackLaw, ...], float, tuple[Sampled, ...]]] = []
    for floor in _FLOORS:
        stable = [each for each in (branch.damped(floor) for branch in found) if not each.grows]
        plants = tuple(Sampled.of(each, sensor.sample_s, delay_s) for each in stable)
        if plants and (best := tune(plants, laws, requirement, lag_s, duration_s, cost)) is not None:
            chosen.append((*best, floor, plants))
        if chosen and chosen[-1][0] < _ENOUGH * max(rms):
            break
    if not chosen:
        raise ParameterError(
            "no feedback keeps the margins here; measure with less delay, or lower gain_margin and phase_margin_deg"
        )
    _, tuned, floor, plants = min(chosen, key=lambda each: each[0])
    tuned = _narrowed(tuned, cost)
    largest = np.zeros(len(tuned))
    for k in worst:
        run = simulate_feedback(systems[k], tuned, course, resolution=sensor.resolution)
        largest = np.maximum(largest, np.abs(run.correction[max(scored.start or 0, 0) // every :]).max(axis=0))
    clamps = _clamps(systems[0], course, sensor, tuned, largest)
    clamped = [replace(law, clamp=float(clamp)) for law, clamp in zip(tuned, clamps, strict=True)]
    return LoopDesign(
        laws=tuple(clamped),
        plants=plants,
        growing=tuple(branch.name for branch in found if branch.damped(floor).grows),
        least_damping=floor,
        margins=worst_margins(plants, clamped),
    )


def _narrowed(
    laws: tuple[FeedbackLaw, ...], cost: Callable[[tuple[FeedbackLaw, ...]], float]
) -> tuple[FeedbackLaw, ...]:
    """The laws with the width of their plays that costs least."""
    if not any(law.error_scale for law in laws):
        return laws
    tried = [tuple(replace(law, width=width * law.width) for law in laws) for width in (1.0, *_NARROWER)]
    return min(tried, key=cost)


def _clamps(
    system: FeedbackSystem, course: Course, sensor: Sensor, laws: Sequence[FeedbackLaw], largest: Array
) -> Array:
    """Clamp of each loop, shape (goals,): where no limit is stated, room for what it needed and expects to learn."""
    if sensor.limit is None:
        shapes = np.ones(len(laws)) if course.shape is None else np.abs(course.shape).max(axis=0)
        likely = [law.likely_correction(float(shape)) for law, shape in zip(laws, shapes, strict=True)]
        clamps: Array = np.maximum(_CLAMP * largest, likely)
        return clamps
    most = system.moved_per_unit(course.forces_N).max(axis=0) * np.abs(system.direction).max(axis=0)
    limits: Array = sensor.limit / most
    return limits if system.quantity is Quantity.POSITION else np.log1p(limits)


def linearised(system: FeedbackSystem, course: Course, name: str) -> list[Branch]:
    """The plant of the loops along the motion: sliding, and sticking, in units of what the loops see."""
    memories, rows = _states(system, course)
    names = [f"{name}, {place}" for place in (*(f"at {row * course.step_s:.4g} s" for row in rows), "sticking")]
    sticking = [False] * len(memories) + [True]
    found = branches(system, [*memories, memories[0]], names, sticking=sticking)
    goals = np.vstack([system.measured(memory.z[None, :, 1], memory.tension_N[None]) for memory in memories])
    corrections, outputs = system.moved_per_unit(course.forces_N), system.seen_per_unit(goals)
    scaled = [each.scaled(corrections[row], out) for each, row, out in zip(found, rows, outputs, strict=False)]
    # bristles are springs wherever the tendon sticks: the largest ratio of both units bounds them all
    most = (corrections * system.seen_per_unit(course.reference)).max(axis=0)
    return [*scaled, found[-1].scaled(most, np.ones_like(most))]


def _sliding_rows(reference: Array) -> list[int]:
    """Rows at a speed that counts: of each part of the motion the fastest, and the last, where most of a tendon slides.

    Near a turn the tendon is between sticking and sliding; both branches bound what it does there.
    """
    speed = np.abs(np.gradient(reference, axis=0)).max(axis=1)
    rows: set[int] = set()
    for part in np.array_split(np.arange(1, len(speed)), _INSTANTS):
        slides = part[speed[part] >= _SLIDES * speed.max()]
        if len(slides):
            rows |= {int(slides[np.argmax(speed[slides])]), int(slides[-1])}
    return sorted(rows)


def _states(system: FeedbackSystem, course: Course) -> tuple[list[MechanismMemory], list[int]]:
    """States of a run under the feedforward, and their rows."""
    problem = system.problem
    memory, engine = rest(problem), CompiledMechanism(problem, course.step_s)
    forced = np.array([not leads for leads in problem.leads[problem.known :]])
    position = np.hstack([course.known, course.command])
    effort = np.hstack([course.effort, np.where(forced, -course.command, 0.0)])
    memories, rows = [], _sliding_rows(course.reference)
    for before, after in itertools.pairwise([0, *rows]):
        engine.run(memory, position[before : after + 1], effort[before : after + 1])
        memories.append(memory.copy())
    return memories, rows


def _shape(
    system: FeedbackSystem, goal: int, course: Course, own: Sequence[Array], sensor: Sensor, scored: slice
) -> FeedbackLaw:
    """Law of a goal without gains: the shapes that the errors of the feedforward, shape (rows,), have."""
    reference = system.seen(course.reference)[:, goal]
    span = float(np.ptp(reference)) or max(float(np.abs(reference).max()), 1e-9)
    middle = float(reference.max() + reference.min()) / 2
    resolution = sensor.resolution * float(system.seen_per_unit(course.reference)[:, goal].max())
    others = np.column_stack([np.ones_like(reference), (reference - middle) / (span / 2)])
    judged = [error for error in own if np.abs(error).max() > 1e-6 * span]
    if course.shape is None:
        tried = {share * span: _play_shape(reference, share * span) for share in _WIDTHS}
    else:
        tried = {_WIDTHS[0] * span: course.shape[:, goal]}
    best, width, columns = 0.0, _WIDTHS[1] * span, np.column_stack([next(iter(tried.values())), others])
    for half, shape in tried.items():
        with_shape = np.column_stack([shape, others])
        explained = [_explained(with_shape[scored], error) for error in judged]
        if explained and (fit := float(np.median(explained))) > best:
            best, width, columns = fit, half, with_shape
    shaped = best > (_SHAPED if course.shape is None else 0.0)
    width = min(width, _WIDEST * span)
    size = max((float(np.sqrt(np.mean(error**2))) for error in own), default=0.0)
    law = FeedbackLaw(
        sample_s=sensor.sample_s,
        delay_s=sensor.delay_s,
        proportional=1.0,
        integral_per_s=1.0,
        deadband=resolution / 2,
        width=max(width, resolution),
    )
    if not shaped:
        return law
    if course.shape is None:
        law, caution = replace(law, stroke=max(_STICKS * width, 4 * size)), 1.0
    else:
        law, caution = replace(law, streamed=True, stroke=_TURN * span), _CAUTION
    scale = caution * max(size, resolution)
    rate: Array = np.gradient(reference, course.step_s)[:, None]
    *shares, late_s = np.abs([_fit(np.hstack([columns, rate])[scored], error) for error in own]).max(axis=0).tolist()
    friction, constant, level = (max(_DEVIATIONS * share / scale, _LEAST_DEVIATION / caution) for share in shares)
    return replace(
        law,
        error_scale=scale,
        deviations=(friction, constant, level),
        rate_error_s=_RATE_ERROR * late_s,
        middle=middle,
        half_range=span / 2,
    )


def _play_shape(reference: Array, half: float) -> Array:
    """The reference, shape (rows,), less its play, over the half width of the play."""
    play = np.empty_like(reference)
    now = reference[0]
    for row, value in enumerate(reference):
        play[row] = now = min(max(now, value - half), value + half)
    found: Array = (reference - play) / half
    return found


def _fit(columns: Array, values: Array) -> Array:
    """Least squares of values by columns."""
    return np.asarray(np.linalg.lstsq(columns, values, rcond=None)[0], dtype=np.float64)


def _explained(columns: Array, values: Array) -> float:
    """Share of the variance of values that columns explain [-]."""
    fitted = columns @ _fit(columns, values)
    spread = float(np.mean((values - values.mean()) ** 2))
    return 1 - float(np.mean((values - fitted) ** 2)) / spread if spread > 0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """Rest or limit cycle of a loop under a constant reference.

    Attributes
    ----------
    swing : float
        Peak to peak of the output in the last half of the time, without its drift [unit of the goal].
    hunts : bool
        It goes on, or the loop oscillated on the way.
    """

    swing: float
    hunts: bool


def standing(run: ClosedLoop, course: Course, rows: int, resolution: float, feedforward_rms: float) -> Standing:
    """Judge a run whose reference is constant over its last rows."""
    if not run.complete:
        return Standing(swing=math.inf, hunts=True)
    error = run.output - course.reference
    moving = float(np.sqrt(np.mean(error[:-rows] ** 2)))
    quarter = rows // 4
    before, last = (_swing(error[slice(*ends)]) for ends in ((-2 * quarter, -quarter), (-quarter, None)))
    span = float(np.ptp(course.reference, axis=0).max())
    counts = max(_SWING * span, 2 * resolution)
    goes_on = last > counts and last > _FADES * before
    return Standing(swing=max(before, last), hunts=goes_on or moving > _WORSE * feedforward_rms + counts)


def _swing(error: Array) -> float:
    """Largest peak to peak of columns without their straight trend."""
    time = np.arange(len(error))
    slope, offset = np.polyfit(time, error, 1)
    return float(np.ptp(error - time[:, None] * slope - offset, axis=0).max())
