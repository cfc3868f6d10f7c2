"""Doubts about several driven joints: what is possible but looks like another unit."""

import numpy as np

from tendonff.compensator.files.reading import read_csv
from tendonff.compensator.scenario.doubts import UnitDoubt, angle_doubt, length_doubts, settle, step_doubts, unaccepted
from tendonff.compensator.scenario.driven.finger import FingerScenario, sample_finger
from tendonff.compensator.scenario.driven.joint_doubts import (
    course_doubts,
    drive_doubts,
    driven_doubts,
    moved_doubts,
    tendon_doubts,
)
from tendonff.models.joint.parameters.finger import Finger


def finger_doubts(scenario: FingerScenario, *, follows_reference: bool = True) -> tuple[UnitDoubt, ...]:
    """Doubts about the numbers of a scenario file and, unless not followed, its reference: empty for a sound one."""
    finger, run = scenario.mechanism, scenario.run
    arms = _largest_arms_m(finger)
    found = [*step_doubts(run), *moved_doubts(scenario.joints, scenario.source.parent)]
    for joint in finger.joints:
        found += driven_doubts(joint, arms[joint.name])
    for motor in finger.motors:
        found += drive_doubts(motor.drive, "motors", "drums_m")
    for tendon in finger.tendons:
        [own_N] = [motor.drive.pretension_N for motor in finger.motors if tendon.name in motor.winds]
        at_rest = "motors.pretension_N" if own_N else "sharing.least_tension_N"
        found += tendon_doubts(tendon, "moment_arms_m", at_rest, own_N or finger.sharing.least_tension_N)
    if follows_reference:
        found += _of_reference(scenario, arms)
    return unaccepted(found, run)


def look_at_finger(
    scenario: FingerScenario,
    *,
    follows_reference: bool = True,
    strict: bool = False,  # noqa: ARG001  what is out of reach shows in the design
    accept: bool = False,
) -> tuple[str, ...]:
    """Warnings about a scenario before any work; arguments and errors as of `first_look`."""
    doubts = finger_doubts(scenario, follows_reference=follows_reference)
    found = settle(doubts, file=scenario.source.name, accept=accept)
    if follows_reference:  # one without meaning is refused at once
        sample_finger(scenario)
    return found


def _largest_arms_m(finger: Finger) -> dict[str, float]:
    """Largest moment arm about each joint, either way, in its rest position."""
    rest = np.array([[joint.rest_rad for joint in finger.joints]])
    return dict(zip(finger.names, np.abs(finger.geometry().moment_arm_m(rest)[0]).max(axis=0).tolist(), strict=True))


def _of_reference(scenario: FingerScenario, arms_m: dict[str, float]) -> list[UnitDoubt]:
    folder, found = scenario.source.parent, []
    if scenario.file is not None:
        columns = tuple(f"{name}_rad" for name in scenario.mechanism.names)
        table = read_csv(folder / scenario.file, ("time_s", *columns), increasing="time_s", starts_at_zero=True)
        for column in columns:
            most = float(np.abs(table[column]).max())
            found += angle_doubt("reference.file", most, f"{scenario.file}: {column}")
        return [*length_doubts(scenario, float(table["time_s"][-1]), scenario.run), *found]
    for name, spec in scenario.references.items():
        found += course_doubts(spec, f"reference.joints.{name}", folder, arms_m[name])
    longest = max(scenario.references.values(), key=lambda spec: spec.length_s(folder))
    return [*length_doubts(longest, longest.length_s(folder), scenario.run), *found]
