"""Doubts about a driven joint: what is possible but looks like another unit."""

import math
from collections.abc import Iterable, Iterator

import numpy as np

from tendonff.compensator.joint.scenario.reference import JointQuantity, JointReference
from tendonff.compensator.joint.scenario.scenario import JointScenario
from tendonff.compensator.scenario.doubts import (
    FURTHEST_RAD,
    UnitDoubt,
    angle_doubt,
    furthest_rad,
    gear_doubts,
    length_doubts,
    radius_doubts,
    rope_doubts,
    speed_doubts,
    step_doubts,
    unaccepted,
    value_doubt,
)
from tendonff.compensator.scenario.joints import CsvJoint
from tendonff.compensator.scenario.sampled.joint_motion import read_angles
from tendonff.models.joint.parameters import DrivenJoint, JointDrive, Mechanism

_LARGEST_N = 2e4  # in a tendon of a joint
_LARGEST_INERTIA_KG_M2, _LARGEST_ROTOR_KG_M2 = 50.0, 1.0  # a leg with a robot on it, a motor of 100 kW
_LONGEST_SERVO_S, _LONGEST_INTERVAL_S = 2.0, 1.0
_OVER_PRETENSION = 5.0  # a tendon in use pulls so many times its tension at rest


def joint_doubts(scenario: JointScenario, *, follows_reference: bool = True) -> tuple[UnitDoubt, ...]:
    """Doubts about the numbers of a scenario file and, unless not followed, its reference: empty for a sound one."""
    mechanism, run = scenario.mechanism, scenario.run
    tension_N = mechanism.drive.pretension_N or mechanism.drive.least_tension_N or 0.0
    found = [*step_doubts(run), *_of_joint(mechanism.joint, _least_arm_m(mechanism)), *_of_drive(mechanism.drive)]
    for tendon in mechanism.tendons:
        found += rope_doubts(tendon.path, tendon.tendon, tendon.friction, _OVER_PRETENSION * tension_N)
        if tendon.arm.lengths is None:
            found += radius_doubts("tendons.moment_arm_m", tendon.arm.moment_arm_m or 0.0)
        else:
            angles = tendon.arm.lengths.angle_rad
            found += angle_doubt("tendons.lengths", float(np.abs(angles).max()), f'lengths of "{tendon.name}"')
            found += radius_doubts("tendons.lengths", float(np.abs(tendon.arm.arm_at(angles)).max()))
    for name, joint in scenario.joints.items():
        furthest, where = furthest_rad(joint), ""
        if isinstance(joint, CsvJoint):
            _, angle = read_angles(scenario.source.parent / joint.file, name)
            furthest, where = float(np.abs(angle).max()), f"{joint.file}: {name}"
        found += angle_doubt(f"joints.{name}", furthest, where)
    if follows_reference:
        found += _of_references(scenario)
    return unaccepted(found, run)


def _least_arm_m(mechanism: Mechanism) -> float:
    arms = [abs(tendon.arm.moment_arm_m) for tendon in mechanism.tendons if tendon.arm.moment_arm_m]
    return min(arms, default=math.inf)


def _of_joint(joint: DrivenJoint, arm_m: float) -> Iterator[UnitDoubt]:
    table = f"joints.{joint.name}"
    for key in ("rest_rad", "gravity_zero_rad", "stop_low_rad", "stop_high_rad"):
        yield from _degrees(f"{table}.{key}", [getattr(joint, key) or 0.0])
    if joint.inertia_kg_m2 > _LARGEST_INERTIA_KG_M2:
        yield _square_grams(f"{table}.inertia_kg_m2", joint.inertia_kg_m2)
    for key in ("stiffness_N_m_per_rad", "gravity_N_m", "coulomb_N_m"):
        if (torque := abs(getattr(joint, key))) > _LARGEST_N * arm_m:
            text = f"a tendon holds it with {torque / arm_m:.3g} N; N mm? Then it is {torque / 1e3:g}"
            yield value_doubt(f"{table}.{key}", torque, text)


def _of_drive(drive: JointDrive) -> Iterator[UnitDoubt]:
    for radius in dict.fromkeys(drive.drum_radius_m):
        yield from radius_doubts("drive.drum_radius_m", radius)
    yield from gear_doubts("drive.gear_ratio", drive.gear_ratio)
    yield from speed_doubts("drive.speed_max_rad_per_s", drive.speed_max_rad_per_s)
    if drive.inertia_kg_m2 > _LARGEST_ROTOR_KG_M2:
        yield _square_grams("drive.inertia_kg_m2", drive.inertia_kg_m2)
    if (torque := drive.torque_max_N_m or 0.0) * drive.gear_ratio / min(drive.drum_radius_m) > _LARGEST_N:
        force = torque * drive.gear_ratio / min(drive.drum_radius_m)
        text = f"is {force:.3g} N at the drum: mN m? Then it is {torque / 1e3:g}"
        yield UnitDoubt("drive.torque_max_N_m", f"[drive] torque_max_N_m = {torque:g} {text}")
    for key in ("pretension_N", "least_tension_N"):
        if (tension := getattr(drive, key) or 0.0) > _LARGEST_N:
            yield value_doubt(f"drive.{key}", tension, f"mN? Then it is {tension / 1e3:g}")
    for key, most in (("servo_time_s", _LONGEST_SERVO_S), ("command_interval_s", _LONGEST_INTERVAL_S)):
        if (time := getattr(drive, key) or 0.0) > most:
            yield value_doubt(f"drive.{key}", time, f"milliseconds? Then it is {time / 1e3:g}")
    yield from _degrees("drive.homing_rad", [drive.homing_rad])
    if drive.resolution_rad > FURTHEST_RAD:
        text = "steps a turn? Then it is"
        yield value_doubt("drive.resolution_rad", drive.resolution_rad, f"{text} {math.tau / drive.resolution_rad:.4g}")


def _of_references(scenario: JointScenario) -> Iterator[UnitDoubt]:
    folder, arm = scenario.source.parent, _least_arm_m(scenario.mechanism)
    yield from length_doubts(scenario.reference.length_s(folder), scenario.run)
    for table, spec in (("reference", scenario.reference), ("reference.motion", scenario.motion)):
        if spec is None:
            continue
        torque = spec.quantity is JointQuantity.TORQUE
        for key, values in _values(spec, scenario):
            if not torque:
                yield from _degrees(f"{table}.{key}", values)
            elif (most := max(map(abs, values))) > _LARGEST_N * arm:
                text = f"a tendon gives it with {most / arm:.3g} N; N mm? Then it is {most / 1e3:g}"
                yield value_doubt(f"{table}.{key}", most, text)


def _values(spec: JointReference, scenario: JointScenario) -> Iterator[tuple[str, Iterable[float]]]:
    """Angles or torques of a reference by the key that gives them; those of a file by its name."""
    for stem in ("amplitudes", "angles", "torques", "offset"):
        for unit in ("rad", "N_m"):
            values = getattr(spec, f"{stem}_{unit}", None)
            if values:
                yield f"{stem}_{unit}", values if isinstance(values, tuple) else [values]
    if (file := getattr(spec, "file", None)) is not None:
        times = np.linspace(0.0, spec.length_s(scenario.source.parent), 1000)
        yield file, spec.sample(times, scenario.source.parent).tolist()


def _degrees(key: str, values: Iterable[float]) -> Iterator[UnitDoubt]:
    value = max(values, key=abs)
    if abs(value) > FURTHEST_RAD:
        yield value_doubt(key, value, f"degrees? Then it is {math.radians(value):.4g}")


def _square_grams(key: str, inertia_kg_m2: float) -> UnitDoubt:
    return value_doubt(key, inertia_kg_m2, f"g cm2? Then it is {1e-7 * inertia_kg_m2:g}")
