"""Data sheet of a finger: what friction and elasticity cost, by tendon and by joint."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.motors.finger import FingerTask, slow
from tendonff.compensator.files.reading import InputError
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.mechanism.static import capstan_exponent, local_arms_m
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.path import JointMotion
from tendonff.ocp.errors import SolveError

_SLOPE_ROWS = 400  # of the slow motion of one joint, for each way
_HALVINGS = 10  # of the pre-tension that is sought


@dataclass(frozen=True, slots=True, kw_only=True)
class TendonSheet:
    """Numbers of a tendon that slides in full, at the mean tension of the motion.

    Attributes
    ----------
    name : str
    wrap_angle_rad : float
        Largest over the motion.
    tension_ratio : float
        Of both ends while it is pulled there: e^{mu theta} [-].
    drive_friction_N : float
        Half the difference of the drum's tension between pulling and paying out.
    lost_motion_rad : float
        Half the angle that the motor turns back before the far end follows.
    least_pretension_N : float or None
        Of a motor with several tendons: below it one goes slack in this motion.
    """

    name: str
    wrap_angle_rad: float
    tension_ratio: float
    drive_friction_N: float
    lost_motion_rad: float
    least_pretension_N: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSheet:
    """Numbers of a joint in the pose of the start.

    Attributes
    ----------
    name : str
    lost_motion_rad : float or None
        Half the angle by which it lags when motors that know the lengths alone turn back, slowly, over the range of its
        reference while the others stand; None of a joint that follows from its springs.
    torque_N_m : tuple of float or None
        Least and largest torque that the motors give it, friction against them, while the others stand; None where a
        motor states no `torque_max_N_m`.
    """

    name: str
    lost_motion_rad: float | None
    torque_N_m: tuple[float, float] | None


def tendon_sheets(task: FingerTask) -> tuple[TendonSheet, ...]:
    """Numbers of each tendon, in their order."""
    finger, found = task.finger, task.inversion
    geometry = finger.geometry()
    wraps = geometry.wrap_angle_rad(found.position_rad[:, : len(finger.joints)])
    pretension = least_pretensions_N(task)
    mechanism, sheets = finger.mechanism(task.sampled.motion), []
    for k, tendon in enumerate(finger.tendons):
        widest, tension = int(np.argmax(wraps[:, k])), float(found.tension_N[:, k].mean())
        places = dict(zip(task.sampled.motion.names, found.position_rad[widest].tolist(), strict=True))
        exponent = capstan_exponent(mechanism.tendons[k], places)
        motor = next(each for each in finger.motors if tendon.name in each.winds)
        winding = abs(motor.winding_m[motor.winds.index(tendon.name)])
        stretched = _mean_ratio(exponent) - _mean_ratio(-exponent)
        sheets.append(
            TendonSheet(
                name=tendon.name,
                wrap_angle_rad=float(wraps[widest, k]),
                tension_ratio=math.exp(exponent),
                drive_friction_N=tension * math.sinh(exponent),
                lost_motion_rad=tension / tendon.tendon.stiffness_N_per_m * stretched / 2 / winding,
                least_pretension_N=pretension.get(motor.name),
            )
        )
    return tuple(sheets)


def joint_sheets(task: FingerTask) -> tuple[JointSheet, ...]:
    """Numbers of each joint, in their order."""
    finger, known = task.finger, not task.follows
    return tuple(
        JointSheet(
            name=joint.name,
            lost_motion_rad=_lost_motion_rad(task, k) if known else None,
            torque_N_m=_torques_N_m(task, joint.name) if known else None,
        )
        for k, joint in enumerate(finger.joints)
    )


def least_pretensions_N(task: FingerTask) -> dict[str, float]:
    """Pre-tensions, by motor with several tendons, below which one goes slack in the motion; all are lowered alike."""
    stated = {m.name: m.drive.pretension_N for m in task.finger.motors if len(m.winds) > 1 and m.drive.pretension_N}
    if not stated:
        return {}

    def is_taut(share: float) -> bool:
        numbers = {f"motors.{name}.drive.pretension_N": share * tension for name, tension in stated.items()}
        try:
            return task.with_system(with_numbers(task.finger, numbers)).inversion.is_taut
        except (SolveError, ParameterError, InputError):
            return False

    low, high = 0.0, 1.0
    while not is_taut(high):
        low, high = high, 2 * high
        if high > 2**_HALVINGS:
            return {}
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if is_taut(middle) else (middle, high)
    return {name: high * tension for name, tension in stated.items()}


def _mean_ratio(exponent: float) -> float:
    """Mean tension along a tendon over that at its far end, where it slides one way."""
    return math.expm1(exponent) / exponent if exponent else 1.0


def _lost_motion_rad(task: FingerTask, joint: int) -> float | None:
    """Half the lag of one joint between both ways of a slow motion over its range."""
    sampled = task.sampled
    start = sampled.motion.angle_rad[0]
    column = sampled.angle_rad[:, joint]
    far = max((float(column.min()), float(column.max())), key=lambda q: abs(q - float(start[joint])))
    if math.isclose(far, float(start[joint])):
        return None
    way = start[joint] + (far - start[joint]) * np.linspace(0.0, 1.0, _SLOPE_ROWS)
    path = np.concatenate([way, way[-2::-1], way[1:]])
    angle = np.repeat(start[None, :], len(path), axis=0)
    angle[:, joint] = path
    time = np.arange(len(path), dtype=np.float64) * task.step_s
    motion = JointMotion(names=sampled.motion.names, time_s=time, angle_rad=angle)
    driven = sampled.angle_rad.shape[1]
    moved = replace(
        sampled,
        time_s=time,
        angle_rad=angle[:, :driven],
        effort_N_m=np.repeat(sampled.effort_N_m[:1], len(path), axis=0),
        motion=motion,
    )
    one = replace(task, sampled=moved, scenario=replace(task.scenario, periodic=False), finger=slow(task.finger))
    try:
        run = one.respond(one.finger, one.lengths_rad, level=Level.ELASTIC)
    except SolveError:
        return None
    reached, half = run.position_rad[:, joint], _SLOPE_ROWS // 2
    back, forth = 2 * (_SLOPE_ROWS - 1) - half, 2 * (_SLOPE_ROWS - 1) + half
    return abs(float(reached[back] - reached[forth])) / 2


def _torques_N_m(task: FingerTask, joint: str) -> tuple[float, float] | None:
    """Torques of a joint at the start, with tensions from the least to what the motors can hold against friction."""
    from scipy.optimize import linprog  # a quarter of a second to import, for the data sheet alone

    finger, sampled = task.finger, task.sampled
    places = dict(zip(sampled.motion.names, sampled.motion.angle_rad[0].tolist(), strict=True))
    tendons = finger.mechanism(sampled.motion).tendons
    most = _largest_tensions_N(finger, [capstan_exponent(tendon, places) for tendon in tendons])
    if most is None:
        return None
    found = []
    for way in (-1.0, 1.0):
        arms = [local_arms_m(tendon, places, {joint: way}) for tendon in tendons]
        torques = np.array([[arm.get(name, 0.0) for arm in arms] for name in finger.names])
        own = finger.names.index(joint)
        others = np.delete(np.arange(len(finger.names)), own)
        least = finger.sharing.least_tension_N
        answer = linprog(
            -way * torques[own],
            A_eq=torques[others] if len(others) else None,
            b_eq=np.zeros(len(others)) if len(others) else None,
            bounds=[(min(least, top), top) for top in most],
        )
        found.append(float(torques[own] @ answer.x) if answer.success else math.nan)
    return found[0], found[1]


def _largest_tensions_N(finger: Finger, exponents: Sequence[float]) -> list[float] | None:
    """Tension at each far end that its motor can hold while it pulls; None where a motor states no limit."""
    found = []
    for tendon, exponent in zip(finger.tendons, exponents, strict=True):
        motor = next(each for each in finger.motors if tendon.name in each.winds)
        if motor.drive.torque_max_N_m is None:
            return None
        winding = abs(motor.winding_m[motor.winds.index(tendon.name)])
        found.append(motor.drive.torque_max_N_m * motor.drive.gear_efficiency / winding * math.exp(-exponent))
    return found
