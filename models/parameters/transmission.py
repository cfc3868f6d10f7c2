"""Parameters of the transmission, as a user writes them: of the whole tendon, not of its elements."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from tendonff.models.errors import LARGEST, ParameterError, require, require_given, require_whole
from tendonff.models.gear import DriveLaw, require_efficiency
from tendonff.models.parameters.drive import Drive, Motor
from tendonff.models.path import JointMotion, Section, above_static
from tendonff.models.servo import CommandHold, DriveClass, Servo, stated_or_assumed_s

LARGEST_EXPONENT = 0.5
"""Largest load exponent n [-]: measured ones are at most 1/3."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """Curved path on which the tendon slides.

    Parameters
    ----------
    total_angle_rad : float
        Wrap angle theta: sum of the absolute bending angles [rad], >= 0.
    segments : int
        Number N of lumped masses, >= 1.
    radius_m : float, optional
        Radius of curvature [m], > 0: for the record, neither friction nor motion depends on it.
    sections : tuple of Section, optional
        The path in parts, whose angles add up to theta; default: one arc.
    """

    total_angle_rad: float
    segments: int
    radius_m: float | None = None
    sections: tuple[Section, ...] = ()

    def __post_init__(self) -> None:
        require("total_angle_rad", self.total_angle_rad, least=0, hint="add up the absolute bending angles")
        require_whole("segments", self.segments, least=1, most=10_000, hint="try 6")
        require_given("radius_m", self.radius_m, above=0, hint="give the bending radius in metres")
        total = math.fsum(section.angle_rad for section in self.sections)
        if self.sections and abs(total - self.total_angle_rad) > 1e-9 * max(total, 1.0):
            raise ParameterError(
                f"total_angle_rad must be the sum of the sections' angles, {total:g}, got {self.total_angle_rad}; "
                "leave it out"
            )

    @property
    def parts(self) -> tuple[Section, ...]:
        """The sections; one arc where none are given."""
        return self.sections or (Section(name="path", angle_rad=self.total_angle_rad),)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tendon:
    """The whole tendon between actuator and load, eqs. (6), (7).

    Parameters
    ----------
    mass_kg : float
        Mass m [kg], > 0.
    stiffness_N_per_m : float
        Lasting stiffness k1 [N/m], > 0.
    relaxing_stiffness_N_per_m : float
        Stiffness k2 that relaxes away [N/m], >= 0; ignored by the elastic level.
    relaxation_time_s : float
        Relaxation time tau = b_k/k2 [s], > 0.
    damping_N_s_per_m : float
        Viscous damping c in parallel [N s/m], >= 0.
    second_relaxing_stiffness_N_per_m, second_relaxation_time_s : float, optional
        Stiffness k3 [N/m], >= 0, and time tau3 [s], > 0, of a second part that relaxes; default: none.
    stiffening, stiffening_tension_N : float, optional
        Share s [-], 0 <= s < 1, by which k1 grows from a tension T_0 [N], > 0, at which it is stiffness_N_per_m, to
        2 T_0; default: none. Not beside a second part that relaxes.
    """

    mass_kg: float
    stiffness_N_per_m: float
    relaxing_stiffness_N_per_m: float
    relaxation_time_s: float
    damping_N_s_per_m: float
    second_relaxing_stiffness_N_per_m: float | None = None
    second_relaxation_time_s: float | None = None
    stiffening: float | None = None
    stiffening_tension_N: float | None = None

    def __post_init__(self) -> None:
        require("mass_kg", self.mass_kg, above=0, hint="weigh the tendon; a light one is fine")
        require("stiffness_N_per_m", self.stiffness_N_per_m, above=0, hint="EA/L of the whole tendon")
        require("relaxing_stiffness_N_per_m", self.relaxing_stiffness_N_per_m, least=0, hint="use 0 for no relaxation")
        require("relaxation_time_s", self.relaxation_time_s, above=0, hint="time in which a held force settles")
        require("damping_N_s_per_m", self.damping_N_s_per_m, least=0, hint="use 0 for none")
        stiffness, time = self.second_relaxing_stiffness_N_per_m, self.second_relaxation_time_s
        if (stiffness is None) != (time is None):
            raise ParameterError(
                "second_relaxing_stiffness_N_per_m and second_relaxation_time_s go together, "
                f"got {stiffness} and {time}; give both, or leave both out for one relaxation time"
            )
        if stiffness is not None and time is not None:
            require("second_relaxing_stiffness_N_per_m", stiffness, least=0, hint="leave both keys out for none")
            require("second_relaxation_time_s", time, above=0, hint="ten times relaxation_time_s is a start")
        self._check_stiffening()

    def _check_stiffening(self) -> None:
        """A share below 1, at a tension."""
        share, tension = self.stiffening, self.stiffening_tension_N
        if (share is None) != (tension is None):
            raise ParameterError(
                f"stiffening and stiffening_tension_N go together, got {share} and {tension}; give both, or none"
            )
        if share is None or tension is None:
            return
        require("stiffening", share, least=0, hint="0.3 for 30 % more at twice the tension")
        require("stiffening_tension_N", tension, above=0, hint="a usual tension of the tendon")
        if share >= 1 or (share and self.second_relaxing_stiffness_N_per_m is not None):
            raise ParameterError(
                f"stiffening must be < 1 and without second_relaxing_stiffness_N_per_m, got {share:g}; 0.3 is usual"
            )

    @property
    def quick_stiffness_N_per_m(self) -> float:
        """Stiffness before anything has relaxed, k1 + k2 + k3 [N/m]."""
        return self.stiffness_N_per_m + self.relaxing_stiffness_N_per_m + (self.second_relaxing_stiffness_N_per_m or 0)

    def scaled(self, factor: float) -> "Tendon":
        """The same tendon with all stiffnesses times a factor [-]."""
        second = self.second_relaxing_stiffness_N_per_m
        return replace(
            self,
            stiffness_N_per_m=self.stiffness_N_per_m * factor,
            relaxing_stiffness_N_per_m=self.relaxing_stiffness_N_per_m * factor,
            second_relaxing_stiffness_N_per_m=None if second is None else second * factor,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction:
    """Friction between tendon and path, eqs. (4), (5), with two extensions that default to the paper.

    Parameters
    ----------
    mu_dynamic, mu_static : float
        Coefficients when pulling (v > 0), fast and near rest [-]; mu_static >= mu_dynamic >= 0.
    stribeck_velocity_m_per_s : float
        Speed omega of the transition from static to dynamic [m/s], > 0.
    viscous_N_s_per_m : float
        Viscous friction b of the whole tendon [N s/m], >= 0.
    bristle_stiffness_N_per_m, soft_bristle_stiffness_N_per_m : float
        Bristle stiffness sigma0 of the whole tendon [N/m], > 0: of the stiff levels, and of `presliding`.
    mu_dynamic_release : float, optional
        Coefficient when releasing (v < 0) [-]; default: mu_dynamic.
    mu_static_release : float, optional
        The same near rest [-]; default: mu_static mu_dynamic_release/mu_dynamic.
    adhesion_N : float, optional
        Load-independent tension p added to the tension in the friction law [N], >= 0; default 0.
    load_exponent : float, optional
        n of mu(T) = mu (T/T_0)^-n [-], 0 to 0.5, for friction that grows less than the tension does, as of polymers;
        default: 0, Coulomb's law.
    reference_tension_N : float, optional
        T_0, the tension at which the coefficients hold [N], > 0; goes with load_exponent.
    pull_spread, release_spread : float, optional
        Of the capstan law alone: its slip sets in gradually, over dead bands from (1 - spread) to (1 + spread) times
        the middle one [-], 0 to 1; the chain has its bristles for that. Default: none.
    """

    mu_dynamic: float
    mu_static: float
    stribeck_velocity_m_per_s: float
    viscous_N_s_per_m: float
    bristle_stiffness_N_per_m: float
    soft_bristle_stiffness_N_per_m: float
    mu_dynamic_release: float | None = None
    mu_static_release: float | None = None
    adhesion_N: float = 0.0
    load_exponent: float | None = None
    reference_tension_N: float | None = None
    pull_spread: float | None = None
    release_spread: float | None = None

    def __post_init__(self) -> None:
        require("mu_dynamic", self.mu_dynamic, least=0, hint="use 0 for a frictionless path")
        require("mu_static", self.mu_static, least=0, hint="use mu_dynamic for no Stribeck effect")
        if self.mu_static < self.mu_dynamic:
            raise ParameterError(above_static(self.mu_dynamic, self.mu_static))
        require("stribeck_velocity_m_per_s", self.stribeck_velocity_m_per_s, above=0, hint="0.001 to 0.05 is usual")
        require("viscous_N_s_per_m", self.viscous_N_s_per_m, least=0, hint="use 0 for none")
        require("bristle_stiffness_N_per_m", self.bristle_stiffness_N_per_m, above=0, hint="1e5 to 1e7 is stiff")
        soft = self.soft_bristle_stiffness_N_per_m
        require("soft_bristle_stiffness_N_per_m", soft, above=0, hint="1e3 to 1e5 is soft")
        require_given("mu_dynamic_release", self.mu_dynamic_release, least=0, hint="leave it out to use mu_dynamic")
        if self.mu_static_release is not None:
            require("mu_static_release", self.mu_static_release, least=0, hint="leave it out to scale mu_static")
            if self.mu_static_release < self.release_dynamic:
                raise ParameterError(above_static(self.release_dynamic, self.mu_static_release, "_release"))
        require("adhesion_N", self.adhesion_N, least=0, hint="use 0 for friction that is proportional to tension")
        for name in ("pull_spread", "release_spread"):
            spread = getattr(self, name)
            if spread is not None:
                require(name, spread, least=0, hint="leave it out for a single deadband")
                if spread > 1:
                    raise ParameterError(f"{name} must be <= 1, got {spread}: a deadband cannot be negative")
        self._check_load_dependence()

    def _check_load_dependence(self) -> None:
        exponent, reference = self.load_exponent, self.reference_tension_N
        require_given("load_exponent", exponent, least=0, hint="leave it out for friction proportional to tension")
        require_given("reference_tension_N", reference, above=0, hint="the tension at which mu_dynamic was found")
        if exponent is not None and exponent > LARGEST_EXPONENT:
            raise ParameterError(
                f"load_exponent must be <= {LARGEST_EXPONENT}, got {exponent}; polymers have 0.1 to 0.33"
            )
        if exponent and reference is None:
            raise ParameterError("load_exponent needs reference_tension_N: the tension at which mu_dynamic holds")
        if exponent and (self.pull_spread or self.release_spread):
            raise ParameterError("load_exponent and pull_spread, release_spread exclude each other; leave one out")

    @property
    def load_dependence(self) -> tuple[float, float]:
        """Exponent n [-] and T_0 [N] of mu(T) = mu (T/T_0)^-n, the defaults resolved."""
        return self.load_exponent or 0.0, self.reference_tension_N or 1.0

    @property
    def release_dynamic(self) -> float:
        """mu_dynamic when releasing [-], the default resolved."""
        return self.mu_dynamic if self.mu_dynamic_release is None else self.mu_dynamic_release

    @property
    def release_static(self) -> float:
        """mu_static when releasing [-], the default resolved."""
        if self.mu_static_release is not None:
            return self.mu_static_release
        if self.mu_dynamic == 0:  # no ratio to scale by: keep the static excess of pulling
            return max(self.mu_static, self.release_dynamic)
        # In this order equal coefficients stay equal to the last bit: a rounding error is no Stribeck effect.
        return self.release_dynamic * (self.mu_static / self.mu_dynamic)


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuator:
    """The motor that pulls, and its limits.

    Parameters
    ----------
    mass_kg : float
        Moving mass m_a [kg], > 0.
    damping_N_s_per_m : float
        Viscous damping b_a [N s/m], >= 0.
    force_min_N, force_max_N : float
        Range of the force [N], 0 <= force_min_N < force_max_N: a tendon cannot push.
    force_rate_max_N_per_s : float
        Largest rate of change of the force, either way [N/s], > 0.
    speed_max_m_per_s : float, optional
        Largest speed of its end, either way [m/s], > 0; default: none.
    travel_min_m, travel_max_m : float, optional
        Range of its position relative to the start [m], travel_min_m <= 0 <= travel_max_m; default: none.
    drive : Drive, optional
        Its command: force (default) or position.
    servo_stiffness_N_per_m : float, optional
        Stiffness k_c1 of a position drive between its command x_c1 and its end [N/m], > 0.
    coulomb_N : float, optional
        Dry friction of motor and gear, as a force at its end [N], >= 0; default: none.
    gear_efficiency : float, optional
        Share of the force that the gear passes on [-], > 0 and <= 1; the rest is dry friction that grows with the
        tension; default: all of it.
    motor : Motor, optional
        Motor, gear and drum behind it, which give mass_kg, force_max_N and speed_max_m_per_s.
    servo_time_s : float, optional
        Time constant with which the drive follows its command [s], >= 0; default: none.
    delay_s : float, optional
        Dead time between a command and the drive's answer [s], >= 0; default: none.
    command_interval_s : float, optional
        Time between two commands [s], > 0; default: one a step.
    command_hold : CommandHold, optional
        What the drive makes of commands between their samples; default: a straight line.
    resolution : float, optional
        Step of the command, in its unit [N] or [m], >= 0; default: none.
    drive_class : DriveClass, optional
        Kind of drive, "hobby servo", "dynamixel", "industrial" or "ideal": lag and delay that are not stated are those
        of its kind, with a spread that counts in the expected error; default: errors of each kind are stated.
    backlash_m : float, optional
        Play between a position drive and the tendon's end [m], >= 0; default: none.
    """

    mass_kg: float
    damping_N_s_per_m: float
    force_min_N: float
    force_max_N: float
    force_rate_max_N_per_s: float
    speed_max_m_per_s: float | None = None
    travel_min_m: float | None = None
    travel_max_m: float | None = None
    drive: Drive = Drive.FORCE
    servo_stiffness_N_per_m: float | None = None
    coulomb_N: float | None = None
    gear_efficiency: float | None = None
    motor: Motor | None = None
    servo_time_s: float | None = None
    delay_s: float | None = None
    command_interval_s: float | None = None
    command_hold: CommandHold | None = None
    resolution: float | None = None
    backlash_m: float | None = None
    drive_class: DriveClass | None = None

    def __post_init__(self) -> None:
        require("mass_kg", self.mass_kg, above=0, hint="include the rotor's inertia over the drum radius squared")
        require("damping_N_s_per_m", self.damping_N_s_per_m, least=0, hint="use 0 for none")
        require("force_min_N", self.force_min_N, least=0, hint="a tendon cannot push")
        require("force_max_N", self.force_max_N, above=0, hint="give the motor's peak force")
        if self.force_max_N <= self.force_min_N:
            raise ParameterError(f"force_max_N must be > force_min_N = {self.force_min_N:g}, got {self.force_max_N}")
        require("force_rate_max_N_per_s", self.force_rate_max_N_per_s, above=0, hint="use 1e9 for none")
        require_given("coulomb_N", self.coulomb_N, least=0, hint="use 0 for none")
        if self.gear_efficiency is not None:
            require_efficiency(self.gear_efficiency)
        require_given("speed_max_m_per_s", self.speed_max_m_per_s, above=0, hint="leave it out for none")
        for name, side in (("travel_min_m", -1), ("travel_max_m", 1)):
            value = getattr(self, name)
            if value is not None and not (side * value >= 0 and abs(value) < LARGEST):
                raise ParameterError(
                    f"{name} must be a finite number {'<=' if side < 0 else '>='} 0, got {value}; "
                    "it counts from the start at rest"
                )
        if self.drive is Drive.POSITION and self.servo_stiffness_N_per_m is None:
            raise ParameterError(
                'drive = "position" needs servo_stiffness_N_per_m: force at the end over the servo\'s position error'
            )
        if self.servo_stiffness_N_per_m is not None:
            if self.drive is not Drive.POSITION:
                raise ParameterError('servo_stiffness_N_per_m is for drive = "position"; add it, or leave this out')
            require("servo_stiffness_N_per_m", self.servo_stiffness_N_per_m, above=0, hint="from its data sheet")
        for name in ("servo_time_s", "delay_s", "resolution", "backlash_m"):
            require_given(name, getattr(self, name), least=0, hint="leave it out for none")
        require_given("command_interval_s", self.command_interval_s, above=0, hint="leave it out for one a step")
        if self.backlash_m and self.drive is not Drive.POSITION:
            raise ParameterError('backlash_m is for drive = "position"; a force is passed on across it: leave it out')
        self._check_motor()

    def _check_motor(self) -> None:
        """Refuse numbers that contradict the motor they come from."""
        for name, gives in self.motor.at_the_drum.items() if self.motor is not None else ():
            value = getattr(self, name)
            if value is None or not math.isclose(value, gives, rel_tol=1e-9):
                raise ParameterError(
                    f"{name} must be {gives:g}, as the actuator's motor gives, got {value}; change the motor instead"
                )

    @property
    def law(self) -> DriveLaw:
        """Capstan law of its own dry friction."""
        return DriveLaw(
            coulomb_N=self.coulomb_N or 0.0,
            lost_share=0.0 if self.gear_efficiency is None else 1 - self.gear_efficiency,
        )

    @property
    def servo(self) -> Servo:
        """The way from a command to the force [N], or to the position x_c1 [m]."""
        return Servo(
            servo_time_s=stated_or_assumed_s(self.servo_time_s, self.drive_class, "servo_time_s"),
            delay_s=stated_or_assumed_s(self.delay_s, self.drive_class, "delay_s"),
            command_interval_s=self.command_interval_s,
            command_hold=self.command_hold or CommandHold.LINE,
            resolution=self.resolution or 0.0,
            play=self.backlash_m or 0.0,
        )

    @property
    def largest_force_N(self) -> float:
        """Largest force that it gives, at standstill [N]: force_max_N, or less by the motor's stall torque."""
        return self.force_max_N if self.motor is None else min(self.force_max_N, self.motor.stall_force_N)

    @property
    def largest_force_name(self) -> str:
        """Where that comes from, as the user writes it: a motor's torque at the drum, where it is the limit."""
        if self.motor is None:
            return "force_max_N"
        torque = "torque_max_N_m" if self.largest_force_N == self.force_max_N else "stall_torque_N_m"
        return f"{torque} * gear_ratio/drum_radius_m"


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """Load at the far end: a mass on a spring, or a joint that moves the end.

    Parameters
    ----------
    mass_kg : float
        Moving mass m_l [kg], > 0.
    stiffness_N_per_m : float
        Stiffness k_l towards the reference x_c2 [N/m], > 0: it carries the tension at rest.
    damping_N_s_per_m : float
        Viscous damping b_l [N s/m], >= 0.
    joint : str, optional
        A joint that moves the far end, which then neither hangs on the spring nor has a motion of its own.
    moment_arm_m : float, optional
        The far end is at its start minus moment_arm_m times the joint's travel [m].
    """

    mass_kg: float
    stiffness_N_per_m: float
    damping_N_s_per_m: float
    joint: str | None = None
    moment_arm_m: float | None = None

    def __post_init__(self) -> None:
        arm = self.moment_arm_m
        if self.joint is not None and not (arm is not None and 0 < abs(arm) < math.inf):
            raise ParameterError(f"moment_arm_m must be finite and not 0 where a joint moves the far end, got {arm}")
        if self.joint is None and arm is not None:
            raise ParameterError(f"moment_arm_m must be left out without a joint, got {arm}; name it with joint = ...")
        require("mass_kg", self.mass_kg, above=0, hint="use the mass of the finger, tool or tension cell")
        require("stiffness_N_per_m", self.stiffness_N_per_m, above=0, hint="it carries the tension at rest")
        require("damping_N_s_per_m", self.damping_N_s_per_m, least=0, hint="use 0 for none")


@dataclass(frozen=True, slots=True, kw_only=True)
class Transmission:
    """Path, tendon, friction, actuator and load: everything physical about a rig.

    Parameters
    ----------
    path : Path
    tendon : Tendon
    friction : Friction
    actuator : Actuator
    load : Load
    motion : JointMotion, optional
        What the joints do that sections and load name; without it they stand at zero.
    """

    path: Path
    tendon: Tendon
    friction: Friction
    actuator: Actuator
    load: Load
    motion: JointMotion | None = None
    motors_tell: ClassVar[bool] = True
    """Tensions at its ends tell its numbers."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move the path or its far end."""
        named = (*(section.joint for section in self.path.sections), self.load.joint)
        return tuple(dict.fromkeys(name for name in named if name is not None))
