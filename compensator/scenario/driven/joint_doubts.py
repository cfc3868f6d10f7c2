"""Doubts about a driven joint: what is possible but looks like another unit."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from tendonff.compensator.scenario.doubts import (
    UnitDoubt,
    angle_doubt,
    feedback_doubts,
    furthest_rad,
    gear_doubts,
    late_doubts,
    length_doubts,
    radius_doubts,
    rope_doubts,
    settle,
    speed_doubts,
    step_doubts,
    unaccepted,
    value_doubt,
)
from tendonff.compensator.scenario.driven.joint import JointScenario, sample_joint
from tendonff.compensator.scenario.driven.reference import JointCsv, JointQuantity, JointReference
from tendonff.compensator.scenario.joints import CsvJoint, Joint
from tendonff.compensator.scenario.sampled.joint_motion import read_angles
from tendonff.models.joint.parameters import DrivenJoint, JointDrive, JointTendon, Mechanism
from tendonff.models.path import FURTHEST_RAD

_LARGEST_N = 2e4  # in a tendon of a joint
_LARGEST_INERTIA_KG_M2, _LARGEST_ROTOR_KG_M2 = 50.0, 1.0  # a leg with a robot on it, a motor of 100 kW
_LEAST_IN_USE_N, _FURTHEST_AT_REST_M = 1e3, 0.1  # more at rest, and further, is in another unit
_OVER_PRETENSION = 5.0  # a tendon in use pulls so many times its tension at rest


def joint_doubts(scenario: JointScenario, *, follows_reference: bool = True) -> tuple[UnitDoubt, ...]:
    """Doubts about the numbers of a scenario file and, unless not followed, its reference: empty for a sound one."""
    mechanism, run = scenario.mechanism, scenario.run
    at_rest = f"drive.{'pretension_N' if mechanism.drive.pretension_N else 'least_tension_N'}"
    tension_N = mechanism.drive.pretension_N or mechanism.drive.least_tension_N or 0.0
    found = [
        *step_doubts(run),
        *feedback_doubts(scenario.feedback),
        *driven_doubts(mechanism.joint, _least_arm_m(mechanism)),
    ]
    found += drive_doubts(mechanism.drive, "drive", "drum_radius_m")
    for tendon in mechanism.tendons:
        found += tendon_doubts(tendon, "moment_arm_m", at_rest, tension_N)
    found += moved_doubts(scenario.joints, scenario.source.parent)
    if follows_reference:
        found += _of_references(scenario)
    return unaccepted(found, run)


def look_at_joint(
    scenario: JointScenario,
    *,
    follows_reference: bool = True,
    strict: bool = False,  # noqa: ARG001  what is out of reach shows in the design
    accept: bool = False,
) -> tuple[str, ...]:
    """Warnings about a scenario before any work; arguments and errors as of `first_look`."""
    doubts = joint_doubts(scenario, follows_reference=follows_reference)
    found = settle(doubts, file=scenario.source.name, accept=accept)
    return (*found, *sample_joint(scenario).warnings) if follows_reference else found


def _least_arm_m(mechanism: Mechanism) -> float:
    arms = [abs(tendon.arm.moment_arm_m) for tendon in mechanism.tendons if tendon.arm.moment_arm_m]
    return min(arms, default=math.inf)


def driven_doubts(joint: DrivenJoint, arm_m: float) -> Iterator[UnitDoubt]:
    """Doubts about a driven joint, on which tendons pull with a moment arm of this size [m]."""
    table = f"joints.{joint.name}"
    for key in ("rest_rad", "gravity_zero_rad", "stop_low_rad", "stop_high_rad"):
        yield from degrees_doubts(f"{table}.{key}", getattr(joint, key) or 0.0)
    yield from degrees_doubts(f"{table}.range_rad", max(joint.range_rad or (0.0,), key=abs))
    if joint.inertia_kg_m2 > _LARGEST_INERTIA_KG_M2:
        yield _square_grams(f"{table}.inertia_kg_m2", joint.inertia_kg_m2)
    for key in ("stiffness_N_m_per_rad", "gravity_N_m", "coulomb_N_m"):
        if abs(torque := getattr(joint, key)) > _LARGEST_N * arm_m:
            yield value_doubt(f"{table}.{key}", torque, _newton_mm(torque, arm_m))


def tendon_doubts(tendon: JointTendon, arms_key: str, at_rest: str, tension_N: float) -> Iterator[UnitDoubt]:
    """Doubts about a tendon with a tension at rest [N] from a key, and moment arms in a key of [[tendons]]."""
    stretch_m = tension_N / tendon.tendon.stiffness_N_per_m
    is_beyond = tension_N > _LEAST_IN_USE_N and stretch_m > _FURTHEST_AT_REST_M
    if is_beyond:
        text = f"it stretches the tendon at rest by {stretch_m:.2g} m: mN? Then it is {tension_N / 1e3:g}"
        yield value_doubt(at_rest, tension_N, text)
    in_use_N = 0.0 if is_beyond else _OVER_PRETENSION * tension_N
    yield from rope_doubts(tendon.path, tendon.tendon, tendon.friction, in_use_N)
    for section in tendon.path.sections:
        yield from radius_doubts("tendons.path.sections.length_per_rad_m", section.length_per_rad_m)
    for arm in tendon.arms:
        if arm.lengths is None:
            yield from radius_doubts(f"tendons.{arms_key}", arm.moment_arm_m or 0.0)
            continue
        angles = arm.lengths.angle_rad
        yield from angle_doubt("tendons.lengths", float(np.abs(angles).max()), f'lengths of "{tendon.name}"')
        yield from radius_doubts("tendons.lengths", float(np.abs(arm.arm_at(angles)).max()))


def moved_doubts(joints: Mapping[str, Joint], folder: Path) -> Iterator[UnitDoubt]:
    """Doubts about joints that something else moves; files that they name are in `folder`."""
    for name, joint in joints.items():
        furthest, where = furthest_rad(joint), ""
        if isinstance(joint, CsvJoint):
            _, angle = read_angles(folder / joint.file, name)
            furthest, where = float(np.abs(angle).max()), f"{joint.file}: {name}"
        yield from angle_doubt(f"joints.{name}", furthest, where)
        yield from degrees_doubts(f"joints.{name}.range_rad", max(joint.range_rad or (0.0,), key=abs))


def drive_doubts(drive: JointDrive, table: str, drums_key: str) -> Iterator[UnitDoubt]:
    """Doubts about a drive from this table, whose drums are in this key."""
    for radius in dict.fromkeys(drive.drum_radius_m):
        yield from radius_doubts(f"{table}.{drums_key}", radius)
    yield from gear_doubts(f"{table}.gear_ratio", drive.gear_ratio)
    yield from speed_doubts(f"{table}.speed_max_rad_per_s", drive.speed_max_rad_per_s)
    if drive.inertia_kg_m2 > _LARGEST_ROTOR_KG_M2:
        yield _square_grams(f"{table}.inertia_kg_m2", drive.inertia_kg_m2)
    if (torque := drive.torque_max_N_m or 0.0) * drive.gear_ratio / min(drive.drum_radius_m) > _LARGEST_N:
        force = torque * drive.gear_ratio / min(drive.drum_radius_m)
        text = f"is {force:.3g} N at the drum: mN m? Then it is {torque / 1e3:g}"
        yield UnitDoubt(f"{table}.torque_max_N_m", f"[{table}] torque_max_N_m = {torque:g} {text}")
    for key in ("pretension_N", "least_tension_N"):
        if (tension := getattr(drive, key) or 0.0) > _LARGEST_N:
            yield value_doubt(f"{table}.{key}", tension, f"mN? Then it is {tension / 1e3:g}")
    yield from late_doubts(table, drive)
    yield from degrees_doubts(f"{table}.homing_rad", drive.homing_rad)
    if drive.resolution_rad > FURTHEST_RAD:
        text = f"steps a turn? Then it is {math.tau / drive.resolution_rad:.4g}"
        yield value_doubt(f"{table}.resolution_rad", drive.resolution_rad, text)


def _of_references(scenario: JointScenario) -> Iterator[UnitDoubt]:
    folder, arm = scenario.source.parent, _least_arm_m(scenario.mechanism)
    yield from length_doubts(scenario.reference, scenario.reference.length_s(folder), scenario.run)
    for table, spec in (("reference", scenario.reference), ("reference.motion", scenario.motion)):
        if spec is not None:
            yield from course_doubts(spec, table, folder, arm)


def course_doubts(spec: JointReference, table: str, folder: Path, arm_m: float) -> Iterator[UnitDoubt]:
    """Doubts about angles or torques of a reference from this table; its file is in `folder`."""
    if isinstance(spec, JointCsv):
        times = np.linspace(0.0, spec.length_s(folder), 1000)
        most = float(np.abs(spec.sample(times, folder)).max())
        if spec.quantity is JointQuantity.ANGLE:
            yield from angle_doubt(f"{table}.file", most, f"{spec.file}: angle_rad")
        elif most > _LARGEST_N * arm_m:
            yield UnitDoubt(f"{table}.file", f"{spec.file}: torque_N_m = {most:g}: {_newton_mm(most, arm_m)}")
        return
    for key in ("amplitudes_rad", "angles_rad", "offset_rad", "amplitudes_N_m", "torques_N_m", "offset_N_m"):
        given = getattr(spec, key, None) or 0.0
        value = max(given, key=abs) if isinstance(given, tuple) else given
        if key.endswith("_rad"):
            yield from degrees_doubts(f"{table}.{key}", value)
        elif abs(value) > _LARGEST_N * arm_m:
            yield value_doubt(f"{table}.{key}", value, _newton_mm(value, arm_m))


def degrees_doubts(key: str, value_rad: float) -> Iterator[UnitDoubt]:
    """A doubt about an angle [rad] by its key."""
    if abs(value_rad) > FURTHEST_RAD:
        yield value_doubt(key, value_rad, f"degrees? Then it is {math.radians(value_rad):.4g}")


def _newton_mm(torque_N_m: float, arm_m: float) -> str:
    return f"a tendon gives it with {abs(torque_N_m) / arm_m:.3g} N; N mm? Then it is {torque_N_m / 1e3:g}"


def _square_grams(key: str, inertia_kg_m2: float) -> UnitDoubt:
    return value_doubt(key, inertia_kg_m2, f"g cm2? Then it is {1e-7 * inertia_kg_m2:g}")
