"""Identification of driven joints: of one on a loop by its motor, of several motors together."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.joint.output import write_routine
from tendonff.compensator.identification.joint.result import JointIdentification
from tendonff.compensator.identification.joint.routine import MotorRoutine, suggest_routine
from tendonff.compensator.identification.joint.run import identify_joint
from tendonff.compensator.identification.motors.output import write_routine as write_motors
from tendonff.compensator.identification.motors.result import MotorsIdentification
from tendonff.compensator.identification.motors.routine import MotorsRoutine
from tendonff.compensator.identification.motors.run import identify_motors, suggest_motor_routine
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.models.joint.parameters import DriveKind

Driven: TypeAlias = JointScenario | FingerScenario
Files: TypeAlias = Sequence[str | os.PathLike[str]]


def identify_one(
    scenario: JointScenario,
    data: Files,
    validate: Files = (),
    *,
    how: Measurement | None = None,
    say: Callable[[str], None] = lambda _: None,
    confirm: Callable[[str], bool] = lambda _: False,
) -> JointIdentification | MotorsIdentification:
    """Fit a driven joint to what its motor, or motors, felt; see `identify_joint` and `identify_motors`."""
    if scenario.mechanism.drive.kind is DriveKind.LOOP:
        return identify_joint(scenario, data, validate, how=how, say=say, confirm=confirm)
    return identify_several(scenario, data, validate, how=how, say=say, confirm=confirm)


def identify_several(
    scenario: Driven,
    data: Files,
    validate: Files = (),
    *,
    how: Measurement | None = None,
    say: Callable[[str], None] = lambda _: None,
    confirm: Callable[[str], bool] = lambda _: False,
) -> MotorsIdentification:
    """Fit a mechanism to what its motors felt; InputError where more than skip and tare is said of files."""
    given = how or scenario.measurement
    if replace(given, skip_s=None, tare_s=None) != replace(scenario.measurement, skip_s=None, tare_s=None):
        raise InputError(
            f"{scenario.source.name}: of several motors every column has its name (motor_NAME_rad, "
            "motor_torque_NAME_N_m, joint_NAME_rad) and SI units; of options on the files --skip and --tare are taken"
        )
    return identify_motors(scenario, data, validate, skip_s=given.skip_s, tare_s=given.tare_s, say=say, confirm=confirm)


def suggest_one(scenario: JointScenario) -> MotorRoutine | MotorsRoutine:
    """Motor angles for a log that identifies a driven joint."""
    if scenario.mechanism.drive.kind is DriveKind.LOOP:
        return suggest_routine(scenario)
    return suggest_motor_routine(scenario)


def write_one(scenario: JointScenario, folder: Path, *, pdf: bool = False) -> MotorRoutine | MotorsRoutine:
    """Write suggested motor angles of a driven joint."""
    if scenario.mechanism.drive.kind is DriveKind.LOOP:
        return write_routine(scenario, folder, pdf=pdf)
    return write_several(scenario, folder, pdf=pdf)


def write_several(scenario: Driven, folder: Path, *, pdf: bool = False) -> MotorsRoutine:
    """Write suggested motor angles of several motors."""
    found = suggest_motor_routine(scenario)
    write_motors(found, folder, pdf=pdf)
    return found
