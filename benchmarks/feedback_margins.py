"""Margins of feedback as stated and by simulation: python -m benchmarks.feedback_margins [JOINTS] [SEED].

Tension of finger, Bowden cable and surgical instrument, and joints as `benchmarks.feedback` draws them. Where a design
finds its least margin, on that mechanism and at that instant, a plant of 40 masses that shares no code with the package
moves on at a constant rate, of a tension a constant share a second. Its own motion without feedback is the reference,
so that the loop is at rest until a small kick. The gain is raised until the kick no longer dies out: with measurements
in time, and later by the phase margin. Logarithms keep their slopes of that instant: while a tension falls, changes of
its logarithm die out more slowly, by the rate at which it falls, and faster while it rises.
"""

import copy
import math
import sys
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import tendonff as tf
from benchmarks.feedback import drawn
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.feedback.joint import JointFeedbackTask
from tendonff.compensator.feedback.run import tune_feedback
from tendonff.compensator.feedback.task import FeedbackTask
from tendonff.compensator.feedback.tension import TensionFeedbackTask
from tendonff.compensator.scenario.settings import Feedback
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.ocp.feedback.closed_loop import Course
from tendonff.ocp.feedback.design import LoopDesign
from tendonff.ocp.feedback.law import FeedbackController, FeedbackLaw
from tendonff.ocp.feedback.system import FeedbackSystem, Quantity
from tendonff.ocp.feedback.tune import Margins, margins_of
from tendonff.ocp.joint.start import start_tensions
from tests.independent_rig import Rig
from tests.joint_plant import Plant

Array = NDArray[np.float64]
KICK, LARGE = 1e-9, 1e4  # of the motion's range; and of the kick, beyond which it is no small change any more
PERIODS = 26  # of the oscillation
SETTLES = 0.5  # of the time, until what the kick starts beside it has died out
GONE = 1e-3  # of the first change, below which it has died out
RIG_STEP_S = 5e-6
MOST_CHANGE = 2.0  # of the logarithm of a tension
SLOWEST_HZ = 2.0  # of a crossover: no motion lasts for the delay that moves a slower one to −180 deg
FASTEST = 0.25  # of the rate of samples: above it a later measurement does more than to turn the phase
_FINER, _HALVINGS = 1.2, 5


class Mover(ABC):
    """A plant under commands of one correction."""

    @abstractmethod
    def move(self, before: Array, after: Array) -> float:
        """Output after a step in which commands, shape (motors,), go straight from one value to another."""

    @abstractmethod
    def copy(self) -> "Mover":
        """Another in the same state."""


class TensionPlant(Mover):
    """A tendon whose masses sit in the middle of equal pieces."""

    def __init__(self, task: TensionFeedbackTask, transmission: Transmission, step_s: float) -> None:
        friction = transmission.friction
        stiff = friction.bristle_stiffness_N_per_m / friction.soft_bristle_stiffness_N_per_m
        bristle = 1.0 if task.problem.level is Level.PRESLIDING else stiff
        start = task.problem.reference.initial_tension_N
        self._rig, self._step_s = Rig(transmission, start, bristle=bristle, step_s=RIG_STEP_S), step_s

    def move(self, before: Array, after: Array) -> float:
        """See `Mover.move`."""
        self._rig.advance(float(before[0]), float(after[0]), self._step_s)
        return self._rig.tension_N

    def copy(self) -> "TensionPlant":
        """See `Mover.copy`."""
        other = copy.copy(self)
        other._rig = self._rig.copy()
        return other


class JointPlant(Mover):
    """A joint between tendons."""

    def __init__(self, mechanism: Any, step_s: float, start_rad: float) -> None:
        tensions, _ = start_tensions(mechanism, start_rad)
        self._plant = Plant(mechanism, step_s, start_rad, tensions_N=tensions)

    def move(self, before: Array, after: Array) -> float:
        """See `Mover.move`."""
        return float(self._plant.turn(np.array([before, after]))[-1, 0])

    def copy(self) -> "JointPlant":
        """See `Mover.copy`."""
        other = copy.copy(self)
        other._plant = self._plant.copy()
        return other


@dataclass(frozen=True, kw_only=True)
class Steady:
    """A motion that goes on at a constant rate from an instant.

    Parameters
    ----------
    system : FeedbackSystem
    start : Mover
        Plant at that instant.
    step_s : float
    command, force_N, shape, output : ndarray, shape (rows, ...)
        From the beginning, without feedback; shape: of friction.
    row : int
        The instant.
    """

    system: FeedbackSystem
    start: Mover
    step_s: float
    command: Array
    force_N: Array
    output: Array
    row: int
    shape: Array

    @classmethod
    def of(cls, task: FeedbackTask, mechanism: Any, place_s: float, lasts_s: float) -> "Steady":
        """The motion of a mechanism that follows the reference; from an instant on its rate is that before."""
        course, system = task.followed(mechanism), task.system(mechanism)
        step, row = course.step_s, round(place_s / course.step_s)
        rows = round(lasts_s / step)
        if system.quantity is Quantity.TENSION:
            seen = np.log(course.forces_N + system.offset_N)
            rows = min(rows, int(MOST_CHANGE / abs(float(seen[row, 0] - seen[row - 8, 0]) / 8)))
            command = force = np.exp(_going_on(seen, row, rows)) - system.offset_N
        else:
            alone = course.command @ np.linalg.pinv(system.direction).T  # of the joint, no tendon stretches
            command = course.command[row] + (_going_on(alone, row, rows) - alone[row]) @ system.direction.T
            command[: row + 1] = course.command[: row + 1]
            force = np.zeros((len(command), 1))
        plant = _plant(task, mechanism, course)
        first = float(course.reference[0, 0])
        output = [first, *(plant.move(*command[k : k + 2]) for k in range(row))]
        start = plant.copy()
        output += [plant.move(*command[k : k + 2]) for k in range(row, len(command) - 1)]
        return cls(
            system=system,
            start=start,
            step_s=step,
            command=command,
            force_N=force,
            output=np.array(output),
            row=row,
            shape=np.append(course.shapes[: row + 1, 0], np.full(rows, course.shapes[row, 0])),
        )

    def kicked(self, law: FeedbackLaw) -> Array:
        """Change of the output by a kick of the first correction, over the kick, shape (rows,)."""
        step, system = self.step_s, self.system
        wanted, plant = system.seen(self.output[:, None])[:, 0], self.start.copy()
        per_unit = float(system.seen_per_unit(self.output[self.row])), system.moved_per_unit(self.force_N[self.row])
        every, kick = round(law.sample_s / step), KICK * float(np.ptp(wanted))
        (whole, part), first = law.age, self.row % every
        controller = FeedbackController(law, float(wanted[first]))
        past = deque([float(wanted[first])] * (whole + 2), maxlen=whole + 2)  # as the controller has it
        follow = 1.0 if system.lag_s == 0 else 1 - math.exp(-step / system.lag_s)
        waiting, reached = [0.0] * round(system.drive_delay_s / step), 0.0
        seen = wanted[: self.row + 1].tolist()
        for row in range(first, len(wanted) - every, every):
            late = max(row - law.delay_s / step, 0.0)
            error = _at(wanted, late) - _at(seen, late)  # none before the kick
            past.appendleft(float(wanted[row]))
            aged = past[-2] + part * (past[-1] - past[-2])
            correction = controller.step(past[0], aged - error, float(self.shape[row]))
            if row < self.row:
                continue
            correction += kick if row == self.row else 0.0
            for k in range(row, row + every):
                waiting.append(correction)
                last, reached = reached, reached + follow * (waiting.pop(0) - reached)
                last = reached if system.lag_s == 0 else last  # without lag commands jump
                ends = zip((k, k + 1), (last, reached), strict=True)
                now = [self.command[j] + system.direction @ (per_unit[1] * u) for j, u in ends]
                seen.append(wanted[k + 1] + per_unit[0] * (plant.move(*now) - self.output[k + 1]))
        found: Array = (np.array(seen) - wanted[: len(seen)])[self.row :]
        return found / kick


def _plant(task: FeedbackTask, mechanism: Any, course: Course) -> Mover:
    if isinstance(task, TensionFeedbackTask):
        return TensionPlant(task, mechanism, course.step_s)
    assert isinstance(task, JointFeedbackTask)
    return JointPlant(mechanism, course.step_s, float(course.reference[0, 0]))


def _going_on(values: Array, row: int, rows: int) -> Array:
    """Rows up to one, and then so many at the rate before it."""
    rate = (values[row] - values[row - 8]) / 8
    return np.vstack([values[: row + 1], values[row] + np.arange(1, rows + 1)[:, None] * rate])


def _at(rows: Any, place: float) -> float:
    below = math.floor(place + 1e-9)
    above = min(below + 1, len(rows) - 1)
    return float(rows[below] + max(place - below, 0.0) * (rows[above] - rows[below]))


def growth(change: Array, step_s: float, hertz: float) -> float:
    """Rate at which an oscillation grows [1/s]."""
    period = max(round(0.5 / hertz / step_s), 4)  # of speeds
    speed = np.diff(change)[round(SETTLES * len(change)) :]
    sizes = np.sqrt(np.mean(speed[: len(speed) // period * period].reshape(-1, period) ** 2, axis=1))
    if not np.all(np.isfinite(sizes)) or sizes.max() > LARGE:
        return math.inf
    if sizes[-1] < GONE * np.abs(np.diff(change)).max():  # what is left is no oscillation
        return -math.inf
    return float(np.polyfit(np.arange(len(sizes)) * period * step_s, np.log(sizes), 1)[0])


def onset(grows: Callable[[float], float], first: float, most: float) -> float:
    """Value from which on an oscillation grows; infinite where it does not up to the largest."""
    high = first
    while grows(high) < 0:
        high *= _FINER
        if high > most:
            return math.inf
    low = high / _FINER
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if grows(middle) < 0 else (low, middle)
    return math.sqrt(low * high)


def least(design: LoopDesign, law: FeedbackLaw, by: Callable[[Margins], float]) -> tuple[str, Margins]:
    """Branch and margins with the least of something, of those that slide."""
    each = [
        (plant.branch.name, margins_of(plant.rad_per_s, plant.opened([law], 0)))
        for plant in design.plants
        if "sticking" not in plant.branch.name
    ]
    return min(each, key=lambda found: by(found[1]))


def steady_of(task: FeedbackTask, branch: str, hertz: float) -> Steady:
    """The steady motion at a branch of a design: "system 2, at 1.15 s"."""
    number, place = branch.split(", at ")
    mechanism = task.doubt.samples[int(number.removeprefix("system "))].system
    return Steady.of(task, mechanism, float(place.removesuffix(" s")), PERIODS / hertz)


def free(law: FeedbackLaw) -> FeedbackLaw:
    """The law without clamp, in the midst of a stroke."""
    return replace(law, clamp=math.inf, stroke=0.0)


def gain_margins(task: FeedbackTask, design: LoopDesign) -> tuple[float, float, str]:
    """Gain margin as stated and as simulated, and where."""
    law = free(design.laws[0])
    branch, margins = least(design, law, lambda each: each.gain)
    steady = steady_of(task, branch, margins.oscillation_Hz)

    def grows(gain: float) -> float:
        return growth(steady.kicked(law.scaled(gain)), steady.step_s, margins.oscillation_Hz)

    where = f"{branch}, {margins.oscillation_Hz:.0f} Hz"
    return design.margins[0].gain, onset(grows, 0.6 * margins.gain, 5 * margins.gain), where


def phase_margins(task: FeedbackTask, design: LoopDesign) -> tuple[float, float, str]:
    """Phase margin as stated [deg], the gain at which it oscillates once that is used up, and where.

    1 where the phase margin is exact. The delay takes it up, the law knowing it: a later measurement, or an earlier one
    where the phase is beyond −180 deg. Raising the delay alone until it oscillates says little where the loop's gain
    hardly is above 1: a gain 7 % less can then double that delay. NaN where the crossover is slower than `SLOWEST_HZ`,
    or faster than `FASTEST`, or the measurement would come too early.
    """
    law = free(design.laws[0])
    branch, margins = least(design, law, lambda each: each.phase_deg)
    hertz, where = margins.crossover_Hz, f"{branch}, {margins.crossover_Hz:.2g} Hz"
    if not SLOWEST_HZ < hertz < FASTEST / law.sample_s:
        return design.margins[0].phase_deg, math.nan, where
    (plant,) = [each for each in design.plants if each.branch.name == branch]
    angle = np.angle(-plant.opened([law], 0)[np.argmin(np.abs(plant.rad_per_s - math.tau * hertz))])
    used = replace(law, delay_s=law.delay_s + math.copysign(margins.phase_deg, angle) / 360 / hertz)
    steady = steady_of(task, branch, hertz)

    def grows(gain: float) -> float:
        return growth(steady.kicked(used.scaled(gain)), steady.step_s, hertz)

    return design.margins[0].phase_deg, onset(grows, 0.6, 5.0), where


def tension_task(name: str, delay_s: float) -> TensionFeedbackTask:
    """Tension of an example with friction 20 % off."""
    scenario = replace(tf.load_scenario(f"examples/{name}.toml"), robust=Uncertainty(mu=0.2, samples=3))
    problem = Problem.of(scenario)
    profiles = {each.name: each.profile(problem) for each in tf.COMPENSATORS if each.name in ("none", "inverse")}
    settings = Feedback(sensor="output_tension", delay_s=delay_s, sample_s=0.004)
    return TensionFeedbackTask.of(problem, settings, profiles, f"{name}.toml")


def joint_task(rng: np.random.Generator, number: int) -> JointFeedbackTask:
    """A drawn joint, as in `benchmarks.feedback`."""
    scenario = drawn(rng, number)
    rng.choice([-1, 1], 3)  # as that draws
    assert scenario.feedback is not None
    return JointFeedbackTask.of(JointTask.of(scenario), scenario.feedback)


def main(joints: int, seed: int) -> None:
    """Print a row a design and the worst of all."""
    rng, off = np.random.default_rng(seed), []
    tasks: list[tuple[str, FeedbackTask]] = [
        (f"{name}, {1e3 * delay:g} ms", tension_task(name, delay))
        for name in ("finger", "bowden", "surgical")
        for delay in (0.004, 0.012)
    ]
    for number in range(joints):
        joint = joint_task(rng, number)
        kind, delay_ms = joint.joint.mechanism.drive.kind, 1e3 * joint.settings.delay_s
        tasks.append((f"joint {number}, {kind}, {delay_ms:.0f} ms", joint))
    for name, task in tasks:
        design = tune_feedback(task).design
        gain, phase = gain_margins(task, design), phase_margins(task, design)
        off += [gain[1] / gain[0], *([] if math.isnan(phase[1]) else [phase[1]])]
        print(
            f"{name}: gain {gain[0]:.2f}, simulated {gain[1]:.2f} ({gain[2]}); "
            f"phase {phase[0]:.0f} deg, without it it oscillates at {phase[1]:.2f} times the gain ({phase[2]})",
            flush=True,
        )
    print(f"simulated over stated: {min(off):.2f} to {max(off):.2f}, {len(off)} margins")


if __name__ == "__main__":
    given = [int(value) for value in sys.argv[1:]]
    main(*given, *(8, 50)[len(given) :])
