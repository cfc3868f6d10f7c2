"""Motor angles that identify several motors: strokes of each joint and of all, at two levels of tension."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.smoothing import low_pass_piece
from tendonff.compensator.identification.motors.log import ROW_S
from tendonff.compensator.identification.pen import COSINE, QUINTIC, Pen
from tendonff.compensator.scenario.driven.finger import SampledFinger
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.path import JointMotion
from tendonff.models.turns import in_turn
from tendonff.ocp.mechanism.problem import MechanismProblem
from tendonff.ocp.mechanism.response import MechanismStatus, invert_mechanism
from tendonff.ocp.mechanism.start import mechanism_problem

STROKE_S, SMALL_S, HOLD_S, TIGHTEN_S = 1.2, 0.4, 0.3, 1.0
SMALL = 0.08
"""Small reversals, as a share of a joint's range."""

EVEN_HZ = 4.0
"""The way over which a joint stands while its motors turn back is taken no faster: counts tell no jump of the speed."""

TIGHTER = 2.5
"""The second level of tension, over the first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorsRoutine:
    """Motor angles over time.

    Attributes
    ----------
    time_s : ndarray, shape (rows,)
    motor_rad : ndarray, shape (rows, motors)
        Counted from where the motors stand at the start.
    joint_rad : ndarray, shape (rows, joints)
        Where they lead the joints.
    names, joints : tuple of str
        Of the motors and of the joints.
    parts : tuple of str
        What each part is for, with its start.
    """

    time_s: Array
    motor_rad: Array
    joint_rad: Array
    names: tuple[str, ...]
    joints: tuple[str, ...]
    parts: tuple[str, ...]

    def lines(self, folder: Path) -> tuple[str, ...]:
        """Its file in this folder and its parts in words."""
        head = f"{folder / 'suggested_motors.csv'}: {self.time_s[-1]:.4g} s"
        return (head, *(f"  {part}" for part in self.parts))


@in_turn
def suggest_motors(finger: Finger, sampled: SampledFinger, file: str) -> MotorsRoutine:
    """Motor angles for a log that identifies a mechanism, within the range of its reference.

    Raises
    ------
    InputError
        If no tensions lead the joints along such a motion.
    """
    low, high = sampled.angle_rad.min(axis=0), sampled.angle_rad.max(axis=0)
    start = sampled.angle_rad[0]
    pen = Pen(start, ROW_S, shape=COSINE)
    pen.note("rest")
    pen.hold(HOLD_S)
    _strokes(pen, finger, low, high)
    pen.note("all tendons tighter: stiffness")
    pen.move((low + high) / 2, STROKE_S)
    pen.hold(HOLD_S)
    begin = len(pen.drawn)
    pen.hold(TIGHTEN_S)
    end = len(pen.drawn)
    _strokes(pen, finger, low, high)
    angle = pen.drawn
    columns = dict(zip(sampled.motion.names, sampled.motion.angle_rad[0].tolist(), strict=True))
    standing = {name: columns[name] for name in finger.others}
    first, second = (_led(finger, angle, standing, factor, file) for factor in (1.0, TIGHTER))
    share = QUINTIC.at(np.interp(np.arange(len(angle)), [begin, end], [0.0, 1.0]))[:, None]
    motor = low_pass_piece((1 - share) * first(False) + share * second(True), ROW_S, EVEN_HZ)
    return MotorsRoutine(
        time_s=pen.time_s,
        motor_rad=motor - motor[0],
        joint_rad=angle,
        names=tuple(m.name for m in finger.motors),
        joints=finger.names,
        parts=tuple(pen.parts),
    )


def _strokes(pen: Pen, finger: Finger, low: Array, high: Array) -> None:
    """Full strokes of each joint alone, its small reversals, then of all joints together."""
    middle = (low + high) / 2
    for k, name in enumerate(finger.names):
        pen.note(f"strokes of {name}: friction of the tendons that cross it")
        here = middle.copy()
        for at in (high[k], low[k], high[k]):
            here[k] = at
            pen.move(here, STROKE_S)
        for at in (high[k] - SMALL * (high[k] - low[k]), high[k]):
            here[k] = at
            pen.move(here, SMALL_S)
        here[k] = middle[k]
        pen.move(here, STROKE_S)
    pen.note("strokes of all joints")
    for at in (high, low, high, low):
        pen.move(at, STROKE_S)
    pen.move(middle, STROKE_S)
    pen.hold(HOLD_S)


def _led(
    finger: Finger, angle: Array, standing_rad: Mapping[str, float], factor: float, file: str
) -> Callable[[bool], Array]:
    """Motors that lead the joints at a level of tension; counted from the start of the scenario's level if asked."""
    sharing = replace(finger.sharing, least_tension_N=factor * max(finger.sharing.least_tension_N, 1e-3))
    time = np.arange(len(angle), dtype=np.float64) * ROW_S
    motion = JointMotion(names=finger.names, time_s=time, angle_rad=angle).beside(standing_rad)
    start = {name: float(column[0]) for name, column in motion.by_joint.items()}
    loops = {m.body: m.drive.pretension_N or 0.0 for m in finger.motors if len(m.winds) > 1}

    def at(level: float) -> MechanismProblem:
        own = replace(sharing, least_tension_N=sharing.least_tension_N * level / factor)
        return mechanism_problem(finger.mechanism(motion), Level.PRESLIDING, start, pretension_N=loops, sharing=own)

    try:
        problem = at(factor)
        found = invert_mechanism(problem, motion.angle_rad, ROW_S)
    except ParameterError as error:
        raise InputError(f"{file}: {error}") from None
    if found.status is MechanismStatus.FAILED:
        raise InputError(f"{file}: no motion can be suggested: {found.message}")
    alone = np.array(problem.alone)
    tighter = (problem.tension_N - at(1.0).tension_N) * alone

    def motors(from_start: bool) -> Array:
        if not from_start:
            return found.motor
        shift = np.zeros(problem.motors)
        for t, motor in enumerate(problem.motor_of):
            shift[motor] += tighter[t] / finger.tendons[t].tendon.stiffness_N_per_m / problem.winding_m[t]
        return np.asarray(found.motor + shift)

    return motors
