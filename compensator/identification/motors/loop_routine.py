"""Motor angles that identify a loop: full strokes, small reversals, slow pushes against the stops."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.law import COARSE_MASSES
from tendonff.compensator.identification.motors.log import ROW_S
from tendonff.compensator.identification.pen import COSINE, Pen
from tendonff.compensator.scenario.driven.joint import JointScenario, sample_joint
from tendonff.models.errors import ParameterError
from tendonff.models.joint.closed_form import GrossSliding, data_sheet
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.turns import in_turn
from tendonff.ocp.fits.mechanism import Loop, MotorResponse, MotorRun, respond

TORQUE_SHARE, SPEED_SHARE = 0.8, 0.5
"""Shares of the motor's limits that the routine uses."""

PUSH_TRAVELS, LEAST_PUSH_RAD = 5.0, 0.1
"""Length of a push: so many times the travel from touch to kink, and at least so much, since neither is known yet."""

SMALL, LEAST_SMALL_RAD = (0.6, 1.2, 2.4), 0.02
"""Small reversals, in travels of the lost motion, and at least so large: an angle is read in counts."""

STOP_ROOM = 0.1
"""Strokes end before a stop, by this share of the range."""

BACK = 3.0
"""Way back from a stop before a push, in travels of the lost motion: friction has turned over."""

STROKE_S, PUSH_S, SMALL_S, HOLD_S = 1.4, 2.5, 0.4, 0.3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorRoutine:
    """Motor angles over time.

    Attributes
    ----------
    time_s, motor_rad : ndarray, shape (rows,)
        The angle counts from where the motor stands at the start.
    parts : tuple of str
        What each part is for, with its start.
    expected : MotorResponse
        What the scenario's mechanism does with it.
    """

    time_s: Array
    motor_rad: Array
    parts: tuple[str, ...]
    expected: MotorResponse

    def lines(self, folder: Path) -> tuple[str, ...]:
        """Its file in this folder and its parts in words."""
        reach = f"{self.motor_rad.min():.3g} to {self.motor_rad.max():.3g} rad"
        head = f"{folder / 'suggested_motor.csv'}: {self.time_s[-1]:.4g} s, {reach}"
        return (head, *(f"  {part}" for part in self.parts))


def is_loop(mechanism: Mechanism | Finger) -> bool:
    """Whether one motor drives one joint by a loop."""
    return isinstance(mechanism, Mechanism) and mechanism.drive.kind is DriveKind.LOOP


@in_turn
def suggest_routine(scenario: JointScenario) -> MotorRoutine:
    """Motor angles for a log that identifies the loop of a scenario, within its range and the motor's limits.

    With stop_high_rad or stop_low_rad in the table of the joint, it pushes against these; without, only friction is
    identified, and the lost motion where the angle of the joint is logged.

    Raises
    ------
    InputError
        If the joint has no loop, or the limits leave no room.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/hand_joint.toml")
    >>> routine = tf.suggest(scenario)
    >>> bool(10 <= routine.time_s[-1] <= 30)
    True
    """
    mechanism, file = scenario.mechanism, scenario.source.name
    if mechanism.drive.kind != "loop":
        raise InputError(f"{file}: the routine is for a loop; a pair's motors are each identified by themselves")
    sampled = sample_joint(scenario)
    start = float(sampled.angle_rad[0])
    low, high = float(sampled.angle_rad.min()), float(sampled.angle_rad.max())
    law = GrossSliding.of(mechanism, start)
    ratio = abs(law.tendons[0].arm_m) / law.tendons[0].drum_m * mechanism.drive.gear_ratio
    lost = data_sheet(law, 0.0).lost_motion_rad * ratio
    stops = {1: mechanism.joint.stop_high_rad, -1: mechanism.joint.stop_low_rad}
    room = STOP_ROOM * (high - low)
    high = high if stops[1] is None else stops[1] - room
    low = low if stops[-1] is None else stops[-1] + room
    top, bottom = (high - start) * ratio, (low - start) * ratio
    if not top - bottom > (1 + BACK) * lost:
        raise InputError(
            f"{file}: the range of {high - low:.3g} rad is within the lost motion of {lost:.3g} rad; give a reference "
            "that moves the joint over its range"
        )
    pen = Pen(0.0, ROW_S, shape=COSINE, most_per_s=SPEED_SHARE * (mechanism.drive.speed_max_rad_per_s or math.inf))
    pen.note("rest")
    pen.hold(HOLD_S)
    pen.note("full strokes: friction, its share from the tendons, gravity")
    for _ in range(2):
        pen.move(top, STROKE_S)
        pen.move(bottom, STROKE_S)
    middle = (top + bottom) / 2
    hint = "" if any(stop is not None for stop in stops.values()) else "; without joint_rad or a stop no lost motion"
    pen.note(f"small reversals: gear friction and presliding{hint}")
    pen.move(middle, STROKE_S)
    for size in SMALL:
        pen.move(middle + max(size * lost, LEAST_SMALL_RAD), SMALL_S)
        pen.move(middle, SMALL_S)
    for way, stop in stops.items():
        if stop is not None:
            touch = (stop - start) * ratio + way * lost
            far = _push(scenario.mechanism, law, ratio, start, touch, way)
            pen.note(f"pushes against the stop at {stop:.3g} rad, until a tendon is slack: mu theta and T/k")
            pen.move(touch - way * BACK * lost, STROKE_S)
            pen.move(far, PUSH_S)
            pen.hold(HOLD_S)
            pen.move(touch - way * BACK * lost, PUSH_S)
            pen.move(far, PUSH_S)
    pen.note("strokes that judge the law")
    pen.move(middle, STROKE_S)
    pen.move(bottom, STROKE_S)
    pen.move(0.0, STROKE_S)
    pen.hold(HOLD_S)
    motor = pen.drawn
    run = MotorRun.of_one(motor, ROW_S, start)
    try:
        expected = respond(Loop(mechanism=mechanism), run, segments=COARSE_MASSES)
    except ParameterError as error:
        raise InputError(f"{file}: {error}") from None
    return MotorRoutine(
        time_s=pen.time_s,
        motor_rad=motor,
        parts=tuple(pen.parts),
        expected=expected,
    )


def _push(mechanism: Mechanism, law: GrossSliding, ratio: float, start: float, touch: float, way: int) -> float:
    """Motor angle at the end of a push: well beyond the kink, within the motor's torque."""
    first = law.tendons[0]
    exponent = max(abs(first.signed_exponent(1 if first.arm_m > 0 else -1)), 1e-6)
    travel = law.tension_N / first.stiffness_N_per_m * -math.expm1(-exponent) / math.sinh(exponent)
    wanted = max(PUSH_TRAVELS * travel / first.drum_m * mechanism.drive.gear_ratio, LEAST_PUSH_RAD * ratio)
    most = mechanism.drive.torque_max_N_m
    if most is None:
        return touch + way * wanted
    pen = Pen(0.0, ROW_S)
    pen.hold(HOLD_S)
    pen.move(touch, STROKE_S)
    pushed = len(pen.drawn)
    pen.move(touch + way * wanted, PUSH_S)
    ramp = pen.drawn
    answer = respond(Loop(mechanism=mechanism), MotorRun.of_one(ramp, ROW_S, start), segments=COARSE_MASSES)
    over = np.flatnonzero(np.abs(answer.torque_N_m[:, 0]) > TORQUE_SHARE * most)
    return float(ramp[over[0]]) if over.size and over[0] >= pushed else touch + way * wanted
