"""A first look by closed forms: straight lines through the strokes and the pushes of a loop.

Between stops the motor feels +-(2 a T r + friction of its gear), whatever it does. Against a stop the torque rises by
k a coth(a/2) while both tendons are taut and by k a/(1 - e^-a) once one is slack: the ratio 1 + e^-a gives a = mu theta
without any scale of torque, and the travel between touch and kink gives T/k. Presliding rounds the kink, and the lines
leave 17 to 20 % in a: they are where the fit of the whole mechanism starts.
"""

import math
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.motors.log import MotorsLog
from tendonff.compensator.identification.parameters import Parameter
from tendonff.models.joint.closed_form import GrossSliding
from tendonff.models.joint.parameters import Mechanism

PUSHED = 1.2
"""A push: torque beyond that of free strokes by this factor."""

LEAST_STEEP = 1e-3
"""Slope of weight at least, as a share of the loop's: a push is steeper than the geometric mean of the two."""

STEEPER = 1.5
"""Ratio of slopes from which on a rise is a stop after weight, and not a stop after which a tendon goes slack."""

END_SHARE = 0.005
"""End of a push: so near to the furthest motor angle, as a share of its range."""

SLIDING_SHARE = 0.4
"""Gross sliding: so much of the motor's range after a reversal, and further."""

_LEAST_ROWS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """A push against a stop, by straight lines.

    Attributes
    ----------
    way : int
        +1 towards positive angles.
    touch_rad : float
        Motor angle at which the torque begins to rise.
    kink_rad : float or None
        Motor angle at which the slope falls; None where it does not.
    slopes_N_m_per_rad : tuple of float
        Before and after the kink.
    """

    way: int
    touch_rad: float
    kink_rad: float | None
    slopes_N_m_per_rad: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstLook:
    """Result of the closed forms for a log.

    Attributes
    ----------
    drive_torque_N_m, offset_N_m : float
        Half the difference, and the mean, of the torques of free strokes either way.
    pushes : tuple of Push
        One for each stop that was touched.
    exponent : float or None
        a = mu theta from the slopes.
    tension_over_stiffness_m : float or None
        T/k from the travel to the kink.
    """

    drive_torque_N_m: float
    offset_N_m: float
    pushes: tuple[Push, ...]
    exponent: float | None
    tension_over_stiffness_m: float | None

    def start(self, mechanism: Mechanism, start_rad: float) -> dict[Parameter, float]:
        """Values from which a fit may start; what the look does not tell is the mechanism's."""
        n, drive = Parameter, mechanism.drive
        law = GrossSliding.of(mechanism, start_rad)
        own = law.tendons[0].signed_exponent(1 if law.tendons[0].arm_m > 0 else -1)
        exponent = min(max(self.exponent or own, 0.1), 2.5)
        found = {n.MU: n.MU.of(mechanism) * exponent / max(own, 1e-6)} if own > 0 else {}
        radius = law.tendons[0].drum_m / drive.gear_ratio
        stiffness = n.STIFFNESS.of(mechanism)
        if self.pushes:
            slope = float(np.median([p.slopes_N_m_per_rad[0] for p in self.pushes]))
            shape = exponent / math.tanh(exponent / 2)
            stiffness = min(max(slope / (radius**2 * shape), 0.1 * stiffness), 10 * stiffness)
            found[n.STIFFNESS] = stiffness
        tension = 0.8 * self.drive_torque_N_m / (2 * exponent * radius)
        if self.tension_over_stiffness_m is not None:
            tension = min(self.tension_over_stiffness_m * stiffness, tension / 0.8)
        found[n.TENSION] = max(tension, 0.1)
        found[n.COULOMB] = max(self.drive_torque_N_m - 2 * exponent * tension * radius, 0.05 * self.drive_torque_N_m)
        arm = abs(mechanism.arms_at(start_rad)[0])
        lost = tension / stiffness * math.tanh(exponent / 2) / arm
        for push in self.pushes:
            angle = start_rad + push.touch_rad * radius / arm - push.way * lost
            found[n.STOP_HIGH if push.way > 0 else n.STOP_LOW] = angle
        return found


def look(log: MotorsLog, mechanism: Mechanism) -> FirstLook | None:
    """First look at a log; None where it holds no free strokes either way."""
    motor, torque, step = log.run.motor_rad[:, 0], log.torque_N_m[:, 0], log.run.step_s
    speed = np.gradient(motor, step)
    fast = np.abs(speed) > 0.1 * float(np.percentile(np.abs(speed), 95))
    sliding = _sliding(motor, speed) & fast
    levels = []
    for way in (1, -1):
        rows = sliding & (way * speed > 0)
        if rows.sum() < _LEAST_ROWS:
            return None
        levels.append(float(np.median(torque[rows])))
    drive, offset = (levels[0] - levels[1]) / 2, (levels[0] + levels[1]) / 2
    if not drive > 0:
        return None
    found = (_push(motor, torque, way, drive, levels[0 if way > 0 else 1]) for way in (1, -1))
    least = _least_slope(mechanism, float(log.run.start_rad[0]))
    pushes = tuple(push for push in found if push is not None and push.slopes_N_m_per_rad[0] > least)
    exponents = [e for push in pushes if (e := _exponent(push)) is not None]
    exponent = float(np.median(exponents)) if exponents else None
    ratio = None
    if exponent is not None:
        radius = mechanism.drum_radius_m[0] / mechanism.drive.gear_ratio
        travels = [abs(p.kink_rad - p.touch_rad) * radius for p in pushes if p.kink_rad is not None]
        ratio = float(np.median(travels)) * math.sinh(exponent) / -math.expm1(-exponent)
    return FirstLook(
        drive_torque_N_m=drive,
        offset_N_m=offset,
        pushes=pushes,
        exponent=exponent,
        tension_over_stiffness_m=ratio,
    )


def _sliding(motor: Array, speed: Array) -> Mask:
    """Rows that are far enough from the last reversal, and not at the ends of the range, where stops may be."""
    far = SLIDING_SHARE * float(np.ptp(motor))
    turned, way = motor[0], 0.0
    found = np.zeros(len(motor), dtype=bool)
    for row, (at, v) in enumerate(zip(motor, np.sign(speed), strict=True)):
        if v not in (0.0, way):
            turned, way = at, v
        found[row] = abs(at - turned) > far
    low, high = np.percentile(motor, [0, 100])
    margin = 0.2 * (high - low)
    kept: Mask = found & (motor > low + margin) & (motor < high - margin)
    return kept


def _least_slope(mechanism: Mechanism, start_rad: float) -> float:
    """Slope of a push at least: a weight or a spring also adds to friction, where it pulls at an end of the range."""
    joint, first = mechanism.joint, GrossSliding.of(mechanism, start_rad).tendons[0]
    radius = first.drum_m / mechanism.drive.gear_ratio
    loop = 2 * first.stiffness_N_per_m * radius**2
    weight = (abs(joint.gravity_N_m) + joint.stiffness_N_m_per_rad) * (radius / first.arm_m) ** 2
    return math.sqrt(max(weight, LEAST_STEEP * loop) * loop)


def _push(motor: Array, torque: Array, way: int, drive: float, level: float) -> Push | None:
    """The push that goes furthest one way: where its torque leaves that of free strokes, and two straight lines.

    None where the motor goes no further than it stood at the start: there the joint is within its stops.
    """
    if way * motor[0] >= (way * motor).max() - END_SHARE * float(np.ptp(motor)):
        return None
    furthest = np.flatnonzero(way * motor >= (way * motor).max() - END_SHARE * float(np.ptp(motor)))
    last = int(furthest[np.argmax(way * torque[furthest])])  # once the motor stands, friction of its gear lets go
    if way * (torque[last] - level) < (PUSHED - 1) * drive:
        return None
    way_up = way * motor[: last + 1]
    lowest = np.minimum.accumulate(way_up[::-1])[::-1]  # from each row to the push
    back = np.flatnonzero(way_up > lowest + 0.02 * float(np.ptp(motor)))
    first = int(back[-1]) + 1 if back.size else 0
    x, y = way * motor[first : last + 1], way * (torque[first : last + 1] - level)
    free = np.flatnonzero(y <= 0.05 * drive)
    begin = int(free[-1]) + 1 if free.size else 0
    x, y = x[begin:], y[begin:]
    if len(x) < _LEAST_ROWS or np.ptp(x) <= 0:
        return None
    best: tuple[float, float, float, float, float] | None = None
    for kink in np.linspace(x[0] + 0.15 * np.ptp(x), x[0] + 0.85 * np.ptp(x), 25):
        rows = np.column_stack([np.ones(len(x)), x - kink, np.maximum(x - kink, 0.0)])
        (at, before, more), *_ = np.linalg.lstsq(rows, y, rcond=None)
        left = float(np.sum((rows @ np.array([at, before, more]) - y) ** 2))
        if best is None or left < best[0]:
            best = (left, float(kink), float(at), float(before), float(before + more))
    if best is None or best[3] <= 0:
        return None
    _, kink, at, before, after = best
    if after > STEEPER * before:  # what rises before is weight: the stop is where it gets steep
        return Push(way=way, touch_rad=way * kink, kink_rad=None, slopes_N_m_per_rad=(after, after))
    bent = 0 < after < 0.97 * before
    return Push(
        way=way,
        touch_rad=way * max(kink - at / before, float(x[0])),  # a shallow line leads beyond what the motor reached
        kink_rad=way * kink if bent else None,
        slopes_N_m_per_rad=(before, after),
    )


def _exponent(push: Push) -> float | None:
    """Exponent a from the ratio of the slopes, 1 + e^-a; None where it cannot be."""
    before, after = push.slopes_N_m_per_rad
    if push.kink_rad is None or not 1.02 < before / after < 1.98:
        return None
    return -math.log(before / after - 1)
