"""Drive between a controller's commands and the drums: sampling, resolution, servo lag, speed and gear backlash."""

import math
from dataclasses import replace

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.models.joint.parameters import JointDrive


def driven(drive: JointDrive, command_rad: FloatArray, step_s: float) -> FloatArray:
    """Angles of the drums at the commanded shaft, shape (rows, motors), for commands.

    These are sampled, rounded, delayed by the servo's lag, and taken through the play of the gear.
    """
    command = np.asarray(command_rad, dtype=np.float64)
    time = np.arange(len(command)) * step_s
    if drive.command_interval_s is not None and drive.command_interval_s > step_s:
        at = np.arange(0.0, time[-1] + drive.command_interval_s, drive.command_interval_s)
        sampled = np.column_stack([rounded(np.interp(at, time, c), drive.resolution_rad) for c in command.T])
        command = np.column_stack([np.interp(time, at, c) for c in sampled.T])
    else:
        command = rounded(command, drive.resolution_rad)
    if drive.servo_time_s == 0:
        return played(command, drive.play_rad)
    keep = math.exp(-step_s / drive.servo_time_s)
    # First order, exact for commands that go straight between rows.
    lag = drive.servo_time_s
    reached = np.empty_like(command)
    reached[0] = now = command[0]
    for row in range(1, len(command)):
        slope = (command[row] - command[row - 1]) / step_s
        now = command[row] - slope * lag + (now - command[row - 1] + slope * lag) * keep
        reached[row] = now
    return played(reached, drive.play_rad)


def played(motor_rad: FloatArray, play_rad: float) -> FloatArray:
    """Angles of drums that stand until their motors, in the middle at first, have crossed the play (play operator)."""
    if play_rad == 0:
        return motor_rad
    drum = np.empty_like(motor_rad)
    now = drum[0] = motor_rad[0]
    for row, motor in enumerate(motor_rad):
        now = drum[row] = np.clip(now, motor - play_rad / 2, motor + play_rad / 2)
    return drum


def crossed(drum_rad: FloatArray, drive: JointDrive) -> FloatArray:
    """Angles of motors that have crossed the play wherever their drums turn back."""
    if drive.play_rad == 0:
        return drum_rad
    motor = np.empty_like(drum_rad)
    furthest, side = drum_rad[0].copy(), np.zeros(drum_rad.shape[1])
    for row, drum in enumerate(drum_rad):
        turned = np.abs(drum - furthest) > drive.turning_rad
        ahead = (drum - furthest) * side > 0
        side = np.where(turned & ~ahead, np.sign(drum - furthest), side)
        furthest = np.where(ahead | turned, drum, furthest)
        motor[row] = drum + side * drive.play_rad / 2
    return motor


def known_by_ratio(drive: JointDrive) -> JointDrive:
    """A drive without what a controller that knows the ratio alone does not know either."""
    return replace(drive, servo_time_s=0.0, backlash_rad=0.0)


def rounded(values: FloatArray, resolution: float) -> FloatArray:
    """Values in steps of the resolution, where there is one."""
    return values if resolution == 0 else np.round(values / resolution) * resolution


def commanded(drive: JointDrive, motor_rad: FloatArray, step_s: float, *, live: bool = False) -> FloatArray:
    """Commands whose answer is the wanted angle: play and lag of the servo taken back, the speed within its limit.

    Live, the rate of a motor is known from the samples so far alone, as on a controller.
    """
    command = crossed(motor_rad, drive)
    if drive.servo_time_s > 0:
        rate = _rate_so_far(motor_rad, step_s) if live else np.gradient(motor_rad, step_s, axis=0)
        command = command + drive.servo_time_s * rate
    if drive.speed_max_rad_per_s is None:
        return command
    most, limited = drive.speed_max_rad_per_s * step_s, command.copy()
    for row in range(1, len(command)):
        limited[row] = limited[row - 1] + np.clip(command[row] - limited[row - 1], -most, most)
    return limited


def _rate_so_far(values: FloatArray, step_s: float) -> FloatArray:
    """Rates at the ends of steps that start at rest, of second order [1/s]."""
    change = np.diff(values, axis=0, prepend=values[:1])
    before = np.roll(change, 1, axis=0)
    before[0] = 0.0
    rate: FloatArray = (1.5 * change - 0.5 * before) / step_s
    return rate
