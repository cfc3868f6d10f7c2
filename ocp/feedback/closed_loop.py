"""Simulation of the closed loop: feedforward and feedback on a mechanism behind its drive, sample by sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.turns import in_turn
from tendonff.ocp.feedback.law import FeedbackController, FeedbackLaw
from tendonff.ocp.feedback.system import FeedbackSystem
from tendonff.ocp.mechanism.compiled import CompiledMechanism
from tendonff.ocp.mechanism.problem import Array, MechanismMemory, rest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """Reference, feedforward and surroundings of a run, at rows h apart.

    Parameters
    ----------
    step_s : float
        h [s], > 0.
    reference : ndarray, shape (rows, goals)
        Of the goals.
    command : ndarray, shape (rows, motors)
        Feedforward behind the drive: what motors follow without lag [unit of the engine's commands].
    known : ndarray, shape (rows, known)
        Coordinates of the bodies that are no motors, used of those that are led.
    effort : ndarray, shape (rows, known)
        What the bodies give to what they touch.
    force_N : ndarray, shape (rows, goals), optional
        Of the feedforward on each tendon whose tension is a goal [N].
    shape : ndarray, shape (rows, goals), optional
        Friction's, as the feedforward gives it: change of the logarithm of its force with that of friction [-].
    """

    step_s: float
    reference: Array
    command: Array
    known: Array
    effort: Array
    force_N: Array | None = None
    shape: Array | None = None

    def held(self, time_s: float) -> "Course":
        """The same, standing still at its end for some time."""
        rows = round(time_s / self.step_s)

        def longer(values: Array) -> Array:
            return np.vstack([values, np.repeat(values[-1:], rows, axis=0)])

        return Course(
            step_s=self.step_s,
            reference=longer(self.reference),
            command=longer(self.command),
            known=longer(self.known),
            effort=longer(self.effort),
            force_N=None if self.force_N is None else longer(self.force_N),
            shape=None if self.shape is None else longer(self.shape),
        )

    @property
    def forces_N(self) -> Array:
        """`force_N`; zeros where no tension is a goal."""
        return np.zeros_like(self.reference) if self.force_N is None else self.force_N

    @property
    def shapes(self) -> Array:
        """`shape`; zeros where there is none."""
        return np.zeros_like(self.reference) if self.shape is None else self.shape


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClosedLoop:
    """Response of a loop.

    Attributes
    ----------
    output : ndarray, shape (rows, goals)
        Fewer rows than the reference where the simulation failed.
    correction : ndarray, shape (samples, goals)
        Of each loop; of a tension a change of the logarithm of the force.
    final : MechanismMemory
        State of the mechanism after the last row.
    complete : bool
        The simulation reached the end.
    """

    output: Array
    correction: Array
    final: MechanismMemory
    complete: bool


@in_turn
def simulate_feedback(
    system: FeedbackSystem,
    laws: Sequence[FeedbackLaw],
    course: Course,
    *,
    delay_s: float | None = None,
    resolution: float = 0.0,
) -> ClosedLoop:
    """Close loops about a mechanism.

    Parameters
    ----------
    system : FeedbackSystem
    laws : sequence of FeedbackLaw
        One for each goal, of one sample time; none: the feedforward alone.
    course : Course
    delay_s : float, optional
        True age of a measurement when it arrives [s], >= 0; default: what the laws take it for.
    resolution : float, optional
        Step of the sensor [unit of the goal], >= 0.

    Raises
    ------
    ParameterError
        If the laws' sample time is no multiple of the step.
    CodeError
        If no C compiler works here.
    """
    step, rows = course.step_s, len(course.reference)
    sample_s = laws[0].sample_s if laws else rows * step
    every = rows - 1 if not laws else samples_of(sample_s, step)
    age_s = (laws[0].delay_s if laws else 0.0) if delay_s is None else delay_s
    references, shapes, forces_N = system.seen(course.reference), course.shapes, course.forces_N
    controllers = [FeedbackController(law, float(references[0, k])) for k, law in enumerate(laws)]
    problem = system.problem
    memory, engine = rest(problem), CompiledMechanism(problem, step)
    start = system.measured(memory.z[None, :, 1], memory.tension_N[None])
    output = np.vstack([start, np.full((rows - 1, len(system.goals)), math.nan)])
    drive = _Drive(system, step, course.command[0])
    effort, forced = course.effort, np.array([not leads for leads in problem.leads[problem.known :]])
    corrections, row = [], 0
    while row < rows - 1:
        chunk = slice(row, min(row + every, rows - 1) + 1)
        if laws:
            seen = _at(output[: row + 1], row - age_s / step)
            if resolution > 0:
                seen = np.round(seen / resolution) * resolution
            given = np.column_stack([references[row], system.seen(seen), shapes[row]]).tolist()
            corrections.append([each.step(*values) for each, values in zip(controllers, given, strict=True)])
            command = drive.respond(course.command[chunk], np.array(corrections[-1]), forces_N[chunk])
        else:
            command = drive.respond(course.command[chunk], np.zeros(len(system.goals)), forces_N[chunk])
        found = engine.run(
            memory,
            np.hstack([course.known[chunk], command]),
            np.hstack([effort[chunk], np.where(forced, -command, 0.0)]),
        )
        good = len(found.lowest_N)
        output[row + 1 : row + 1 + good] = system.measured(found.position, found.tension_N)
        row += good
        if good < len(command) - 1:
            break
    return ClosedLoop(
        output=output[: row + 1],
        correction=np.array(corrections).reshape(len(corrections), len(system.goals)),
        final=memory,
        complete=row == rows - 1,
    )


def samples_of(sample_s: float, step_s: float) -> int:
    """Steps of a simulation in a sample; ParameterError where they are no whole number."""
    every = round(sample_s / step_s)
    if every < 1 or not math.isclose(every * step_s, sample_s, rel_tol=1e-6):
        raise ParameterError(
            f"sample_s must be a multiple of step_s = {step_s:g} s, got {sample_s:g}; change one of them"
        )
    return every


def _at(rows: Array, place: float) -> Array:
    """Row at a place between two rows; the first before it."""
    place = max(place, 0.0)
    below = min(int(place), len(rows) - 1)
    above = min(below + 1, len(rows) - 1)
    found: Array = rows[below] + (place - below) * (rows[above] - rows[below])
    return found


class _Drive:
    """The way of corrections to the motors: delay, lag, and the play of the gears that all of the command crosses."""

    def __init__(self, system: FeedbackSystem, step_s: float, first: Array) -> None:
        self._lag_share = 1.0 if system.lag_s == 0 else 1 - math.exp(-step_s / system.lag_s)
        none = np.zeros(len(system.goals))
        self._waiting = [none] * round(system.drive_delay_s / step_s)
        self._reached, self._now = none, np.array(first, dtype=np.float64)
        self._system = system

    def respond(self, command: Array, correction: Array, force_N: Array) -> Array:
        """Commands behind the drive, shape (rows + 1, motors), the first that of the present instant."""
        found = [self._now]
        half = self._system.play / 2
        for row, force in zip(command[1:], force_N[1:], strict=True):
            self._waiting.append(correction)
            self._reached = self._reached + self._lag_share * (self._waiting.pop(0) - self._reached)
            motor = row + self._system.moved(self._reached, force)
            self._now = np.clip(self._now, motor - half, motor + half)
            found.append(self._now)
        return np.vstack(found)
