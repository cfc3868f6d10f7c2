"""Drive between a controller's commands and the drums: the servo of `models.servo`, within the speed of the motor."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.models.joint.parameters import JointDrive
from tendonff.models.servo import CommandHold


def driven(
    drive: JointDrive, command_rad: FloatArray, step_s: float, refinement: int = 1, *, periodic: bool = False
) -> FloatArray:
    """Angles of the drums at the commanded shaft, shape (rows, motors), for commands; see `Servo.follow`.

    Of a cycle, in the steady one.
    """
    if not periodic:
        return drive.servo.follow(command_rad, step_s, refinement)
    cycles = np.vstack([command_rad[:-1], command_rad])
    return drive.servo.follow(cycles, step_s, refinement)[-((len(command_rad) - 1) * refinement + 1) :]


def known_by_ratio(drive: JointDrive) -> JointDrive:
    """A drive without what a controller that knows the ratio alone does not know either."""
    plain = replace(drive, servo_time_s=0.0, delay_s=0.0, backlash_rad=0.0, command_hold=CommandHold.LINE)
    return replace(plain, drive_class=None)  # a class is knowledge of lag and delay too


def commanded(drive: JointDrive, motor_rad: FloatArray, step_s: float, *, live: bool = False) -> FloatArray:
    """Commands whose answer is the wanted angle, the speed within its limit; see `Servo.command`.

    Live, the rate of a motor is known from the samples so far alone, as on a controller.
    """
    command = drive.servo.command(motor_rad, step_s, live=live)
    if drive.speed_max_rad_per_s is None:
        return command
    most, limited = drive.speed_max_rad_per_s * step_s, command.copy()
    for row in range(1, len(command)):
        limited[row] = limited[row - 1] + np.clip(command[row] - limited[row - 1], -most, most)
    return limited


def require_stiff_gears(file: str, drives: Sequence[JointDrive], what: str) -> None:
    """Refuse drives whose gears give way where that is not followed; InputError with the way out."""
    if any(drive.gear_stiffness_N_m_per_rad is not None for drive in drives):
        raise InputError(f"{file}: gear_stiffness_N_m_per_rad is not taken into account by {what}; leave it out")
