"""The motors of a joint, and what joins them to the tendons."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tendonff.models.errors import ParameterError, require, require_given
from tendonff.models.gear import require_efficiency, slip_friction
from tendonff.models.layout import Array
from tendonff.models.servo import CommandHold, DriveClass, Servo, stated_or_assumed_s


class DriveKind(StrEnum):
    """Arrangement of the motors.

    Attributes
    ----------
    LOOP
        One motor on whose drum both tendons are wound, pre-tensioned.
    PAIR
        A motor for each tendon.
    """

    LOOP = "loop"
    PAIR = "pair"


@dataclass(frozen=True, slots=True, kw_only=True)
class JointDrive:
    """Motors whose position is commanded.

    Parameters
    ----------
    kind : DriveKind
        One motor for both tendons, or one for each.
    drum_radius_m : tuple of float
        Radius of the drum up to the middle of the tendon, one for each tendon [m], > 0.
    pretension_N : float, optional
        Of a loop: tension of both tendons after tensioning, joint at its start and at rest [N], >= 0.
    least_tension_N : float, optional
        Of a pair: tension at the joint that the looser tendon keeps [N], > 0.
    gear_ratio : float, optional
        Turns of the motor for one of the drum [-], > 0.
    inertia_kg_m2 : float, optional
        Inertia at the motor's shaft [kg m2], >= 0.
    coulomb_N_m : float, optional
        Dry friction at the motor's shaft [N m], >= 0.
    gear_efficiency : float, optional
        Share of the torque that the gear passes on [-], > 0 and <= 1; the rest is dry friction that grows with it.
    torque_constant_N_m_per_A : float, optional
        Torque for a current [N m/A], > 0.
    speed_max_rad_per_s, torque_max_N_m : float, optional
        Largest speed and torque of the motor, either way, > 0.
    servo_time_s : float, optional
        Time constant with which the motor follows its command [s], >= 0; default: none.
    resolution_rad : float, optional
        Step of the command at the motor [rad], >= 0: 2 pi/4096 for 12 bits a turn.
    delay_s : float, optional
        Dead time between a command and the motor's answer [s], >= 0; default: none.
    command_interval_s : float, optional
        Time between two commands [s], > 0; default: one a step.
    command_hold : CommandHold, optional
        What the drive makes of commands between their samples; default: a straight line.
    drive_class : DriveClass, optional
        Kind of drive, "hobby servo", "dynamixel", "industrial" or "ideal": lag and delay that are not stated are those
        of its kind, with a spread that counts in the expected error; default: errors of each kind are stated.
    backlash_rad : float, optional
        Play of the gear, in series with the drum of a loop [rad of the commanded shaft], >= 0: the drum stands, held by
        its tendons, until the motor has crossed it. A pair's tensions keep its gears on one side.
    gear_stiffness_N_m_per_rad : float, optional
        Torque over the angle by which gear and servo, in series, give way, both at the commanded shaft [N m/rad], > 0:
        the motor is ahead of its drum by what its tendons take over it; default: they do not give.
    homing_rad : float, optional
        Size of the stroke to both sides [rad of the joint], >= 0, that wipes out before a run what friction has stored.
    """

    kind: DriveKind
    drum_radius_m: tuple[float, ...]
    pretension_N: float | None = None
    least_tension_N: float | None = None
    gear_ratio: float = 1.0
    inertia_kg_m2: float = 0.0
    coulomb_N_m: float = 0.0
    gear_efficiency: float = 1.0
    torque_constant_N_m_per_A: float | None = None
    speed_max_rad_per_s: float | None = None
    torque_max_N_m: float | None = None
    servo_time_s: float | None = None
    delay_s: float | None = None
    resolution_rad: float = 0.0
    command_interval_s: float | None = None
    command_hold: CommandHold = CommandHold.LINE
    backlash_rad: float = 0.0
    drive_class: DriveClass | None = None
    gear_stiffness_N_m_per_rad: float | None = None
    homing_rad: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", DriveKind(self.kind))
        object.__setattr__(self, "command_hold", CommandHold(self.command_hold))
        for radius in self.drum_radius_m:
            require("drum_radius_m", radius, above=0, hint="half the drum's diameter plus half the tendon's")
        require("gear_ratio", self.gear_ratio, above=0, hint="turns of the motor for one of the drum")
        least_zero = ("inertia_kg_m2", "coulomb_N_m", "resolution_rad", "backlash_rad")
        for name in (*least_zero, "homing_rad"):
            require(name, getattr(self, name), least=0, hint="leave it out for none")
        for name in ("servo_time_s", "delay_s"):
            require_given(name, getattr(self, name), least=0, hint="leave it out for none")
        above_zero = ("torque_constant_N_m_per_A", "speed_max_rad_per_s", "torque_max_N_m", "command_interval_s")
        for name in (*above_zero, "gear_stiffness_N_m_per_rad"):
            require_given(name, getattr(self, name), above=0, hint="leave it out if it is not known")
        require_efficiency(self.gear_efficiency)
        if self.kind is DriveKind.LOOP:
            if self.pretension_N is None or self.least_tension_N is not None:
                raise ParameterError('a drive of kind = "loop" needs pretension_N, and no least_tension_N')
            require("pretension_N", self.pretension_N, least=0, hint="the data sheet of a design recommends one")
        else:
            if self.least_tension_N is None or self.pretension_N is not None:
                raise ParameterError('a drive of kind = "pair" needs least_tension_N, and no pretension_N')
            require("least_tension_N", self.least_tension_N, above=0, hint="a tendon cannot push; try 2")

    def torque_N_m(self, held_N_m: Array, acceleration_rad_per_s2: Array, way: Array) -> Array:
        """Torque of the motor: what its tendons take, inertia, and dry friction.

        Parameters
        ----------
        held_N_m : ndarray
            What the tendons take at the motor's shaft [N m].
        acceleration_rad_per_s2 : ndarray, same shape
        way : ndarray, same shape
            Friction over its value in full slip, -1 to 1: the sign of the speed, or a bristle's state.
        """
        dry = slip_friction(self.coulomb_N_m, 1 - self.gear_efficiency, np.abs(held_N_m))
        torque: Array = held_N_m + self.inertia_kg_m2 * acceleration_rad_per_s2 + dry * way
        return torque

    @property
    def gives_rad_per_N_m(self) -> float:
        """Angle by which gear and servo give way to a torque at the commanded shaft [rad/(N m)]."""
        return 0.0 if self.gear_stiffness_N_m_per_rad is None else 1 / self.gear_stiffness_N_m_per_rad

    @property
    def play_rad(self) -> float:
        """Play between motor and drum that has an effect [rad of the commanded shaft]."""
        return self.backlash_rad if self.kind is DriveKind.LOOP else 0.0

    @property
    def servo(self) -> Servo:
        """The way from a command to the drum, both as angles of the commanded shaft."""
        return Servo(
            servo_time_s=stated_or_assumed_s(self.servo_time_s, self.drive_class, "servo_time_s"),
            delay_s=stated_or_assumed_s(self.delay_s, self.drive_class, "delay_s"),
            command_interval_s=self.command_interval_s,
            command_hold=self.command_hold,
            resolution=self.resolution_rad,
            play=self.play_rad,
        )

    @property
    def turning_rad(self) -> float:
        """Way back of a drum from where it went furthest that counts as a reversal [rad of the commanded shaft]."""
        return self.servo.turning
