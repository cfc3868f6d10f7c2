r"""A driven joint between tendons, as a user writes it.

::

    motor  ==T1 drum==( tendon 1 )==T1 joint==>  joint: J q'' + b q' + k (q - rest) + g sin(q - zero) + dry friction
     drum  ==T2 drum==( tendon 2 )==T2 joint==>         = sum of the tendons' torques - torque on what it touches

A tendon with a positive moment arm pulls the joint towards positive angles: the path that it leaves to the drum gets
shorter by the arm times the angle. A motor's angle is positive where it turns the joint towards positive angles, or
where it has one tendon alone, where it pulls that tendon in.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from tendonff.models.assembly import End
from tendonff.models.chain import Chain
from tendonff.models.elements import whole_of
from tendonff.models.errors import LARGEST, ParameterError, require, require_given
from tendonff.models.fidelity import Level
from tendonff.models.layout import Array
from tendonff.models.parameters import Friction, Path, Tendon
from tendonff.models.path import JointMotion

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

NO_STOP_RAD = 1e3
"""Where a stop is said to be that is not there [rad]: no joint turns so far."""

_LED = End(mass_kg=1.0, damping_N_s_per_m=0.0, stiffness_N_per_m=0.0)
"""An end whose motion is given: its own numbers have no effect."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenJoint:
    """A joint that tendons turn.

    Parameters
    ----------
    name : str
        The NAME of its table.
    inertia_kg_m2 : float
        Moving inertia J about the joint [kg m2], > 0.
    damping_N_m_s_per_rad : float, optional
        Viscous damping b [N m s/rad], >= 0.
    stiffness_N_m_per_rad : float, optional
        Spring k towards `rest_rad` [N m/rad], >= 0.
    rest_rad : float, optional
        Angle at which the spring is relaxed [rad].
    gravity_N_m : float, optional
        Amplitude g of a torque g sin(q - gravity_zero_rad) that tendons hold [N m].
    gravity_zero_rad : float, optional
        Angle at which gravity asks for no torque [rad].
    coulomb_N_m : float, optional
        Dry friction of the joint itself [N m], >= 0.
    stop_low_rad, stop_high_rad : float, optional
        Angles at which the joint touches a stop [rad]; default: none.
    stop_stiffness_N_m_per_rad : float, optional
        Stiffness of the stops beyond them [N m/rad], > 0 where there is one.
    """

    name: str
    inertia_kg_m2: float
    damping_N_m_s_per_rad: float = 0.0
    stiffness_N_m_per_rad: float = 0.0
    rest_rad: float = 0.0
    gravity_N_m: float = 0.0
    gravity_zero_rad: float = 0.0
    coulomb_N_m: float = 0.0
    stop_low_rad: float | None = None
    stop_high_rad: float | None = None
    stop_stiffness_N_m_per_rad: float = 0.0

    def __post_init__(self) -> None:
        require("inertia_kg_m2", self.inertia_kg_m2, above=0, hint="a finger's last bone has about 1e-5 kg m2")
        for name in ("damping_N_m_s_per_rad", "stiffness_N_m_per_rad", "coulomb_N_m"):
            require(name, getattr(self, name), least=0, hint="leave it out for none")
        for name in ("rest_rad", "gravity_N_m", "gravity_zero_rad"):
            value = getattr(self, name)
            if not (math.isfinite(value) and abs(value) <= LARGEST):
                raise ParameterError(f"{name} must be a finite number, got {value}; leave it out for 0")
        self._check_stops()

    def _check_stops(self) -> None:
        require("stop_stiffness_N_m_per_rad", self.stop_stiffness_N_m_per_rad, least=0, hint="60 to 200 for a finger")
        for name in ("stop_low_rad", "stop_high_rad"):
            require_given(name, getattr(self, name), hint="leave it out where there is no stop")
        if self.has_stop and self.stop_stiffness_N_m_per_rad == 0:
            raise ParameterError("a stop needs stop_stiffness_N_m_per_rad > 0, got 0; 60 to 200 for a finger")
        low, high = self.stops_rad
        if not low < high:
            raise ParameterError(f"stop_low_rad must be below stop_high_rad, got {low:g} and {high:g}; swap them")

    @property
    def has_stop(self) -> bool:
        """Whether there is a stop."""
        return self.stop_low_rad is not None or self.stop_high_rad is not None

    @property
    def stops_rad(self) -> tuple[float, float]:
        """Angles of both stops, far away where there is none [rad]."""
        low, high = self.stop_low_rad, self.stop_high_rad
        return -NO_STOP_RAD if low is None else low, NO_STOP_RAD if high is None else high

    def static_torque_N_m(self, angle_rad: Array) -> Array:
        """Torque that tendons hold at rest at an angle: spring, gravity and stops [N m]."""
        angle = np.asarray(angle_rad, dtype=np.float64)
        low, high = self.stops_rad
        held: Array = self.stiffness_N_m_per_rad * (angle - self.rest_rad)
        pushed = self.stop_stiffness_N_m_per_rad * (np.maximum(angle - high, 0.0) - np.maximum(low - angle, 0.0))
        return held + pushed + self.gravity_N_m * np.sin(angle - self.gravity_zero_rad)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LengthTable:
    """Length of the path that a joint leaves to a tendon, by its angle: a cubic spline, straight beyond its ends.

    Parameters
    ----------
    angle_rad : ndarray, shape (n,)
        Increasing joint angles [rad], n >= 3.
    length_m : ndarray, shape (n,)
        Length between drum and insertion [m]; an offset that all share has no effect.
    """

    angle_rad: Array
    length_m: Array

    def __post_init__(self) -> None:
        angle, length = (np.array(each, dtype=np.float64) for each in (self.angle_rad, self.length_m))
        if angle.ndim != 1 or angle.shape != length.shape or len(angle) < 3:
            raise ParameterError(
                f"a table of lengths needs at least 3 rows of an angle and a length, got {angle.shape} and "
                f"{length.shape}; 5 to 20 rows over the range of the joint are a good start"
            )
        if not (np.isfinite(angle).all() and np.isfinite(length).all()):
            raise ParameterError("a table of lengths must hold finite numbers only; remove the rows that do not")
        late = np.flatnonzero(np.diff(angle) <= 0)
        if late.size:
            row = int(late[0]) + 1
            raise ParameterError(
                f"the angles of a table of lengths must increase, got {angle[row]:g} after {angle[row - 1]:g} rad; "
                "sort its rows"
            )
        object.__setattr__(self, "angle_rad", angle)
        object.__setattr__(self, "length_m", length)

    @property
    def travel_pieces(self) -> Array:
        """Cubics of the far end's travel -L(q), rows of c0 + c1 s + c2 s^2 + c3 s^3 with s from the knot [m]."""
        return np.ascontiguousarray(-self._spline().c[::-1].T)

    def length_at(self, angle_rad: Array) -> Array:
        """L(q) [m]."""
        angle = np.asarray(angle_rad, dtype=np.float64)
        within = np.clip(angle, self.angle_rad[0], self.angle_rad[-1])
        spline = self._spline()
        length: Array = spline(within) + spline(within, 1) * (angle - within)
        return length

    def arm_at(self, angle_rad: Array) -> Array:
        """Moment arm -dL/dq [m]."""
        within = np.clip(np.asarray(angle_rad, dtype=np.float64), self.angle_rad[0], self.angle_rad[-1])
        arm: Array = -self._spline()(within, 1)
        return arm

    def _spline(self) -> "CubicSpline":
        from scipy.interpolate import CubicSpline  # a third of a second to import, for a measured length alone

        return CubicSpline(self.angle_rad, self.length_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """Effect of a joint on the far end of a tendon.

    Parameters
    ----------
    joint : str
        Name of the joint.
    moment_arm_m : float, optional
        Constant moment arm [m], positive where pulling turns the joint towards positive angles; 0 where only sections
        of the path follow the joint.
    lengths : LengthTable, optional
        Length of the path by angle, instead of a constant arm.
    """

    joint: str
    moment_arm_m: float | None = None
    lengths: LengthTable | None = None

    def __post_init__(self) -> None:
        if (self.moment_arm_m is None) == (self.lengths is None):
            raise ParameterError("a tendon needs moment_arm_m or lengths, one of them")
        if self.moment_arm_m is not None and not math.isfinite(self.moment_arm_m):
            raise ParameterError(f"moment_arm_m must be finite, got {self.moment_arm_m}")

    def travel_m(self, angle_rad: Array) -> Array:
        """Far end's position for joint angles, up to an offset [m]."""
        if self.lengths is not None:
            return -self.lengths.length_at(angle_rad)
        return np.asarray(angle_rad, dtype=np.float64) * (self.moment_arm_m or 0.0)

    def arm_at(self, angle_rad: Array) -> Array:
        """Moment arm of the far end [m]."""
        if self.lengths is not None:
            return self.lengths.arm_at(angle_rad)
        return np.full(np.shape(angle_rad), self.moment_arm_m or 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTendon:
    """Tendon from its drum to the joint.

    Parameters
    ----------
    name : str
        Its name in reports.
    path : Path
        From the drum to the joint.
    tendon : Tendon
        Its mass and stiffness.
    friction : Friction
        On this path.
    arms : tuple of Arm
        One for each joint that moves its far end.
    """

    name: str
    path: Path
    tendon: Tendon
    friction: Friction
    arms: tuple[Arm, ...]

    def __post_init__(self) -> None:
        if len(self.arms) != 1:
            raise ParameterError(
                f'tendon "{self.name}": a tendon moves with one driven joint for now, got {len(self.arms)} arms'
            )

    @property
    def arm(self) -> Arm:
        """Effect of the driven joint on its far end."""
        return self.arms[0]

    def follows(self, joint: str) -> bool:
        """Whether a section of its path bends or gets longer with a joint."""
        return any(s.joint == joint and (s.angle_per_rad or s.length_per_rad_m) for s in self.path.sections)

    def moment_arm_at(self, angle_rad: Array) -> Array:
        """Moment arm with a tension that is the same along the path, -d(whole length)/dq [m]."""
        gained = math.fsum(s.length_per_rad_m for s in self.path.sections if s.joint == self.arm.joint)
        return self.arm.arm_at(angle_rad) - gained

    def path_travel_m(self, angle_rad: Array, others: dict[str, Array] | None = None) -> Array:
        """Length between path and drum for joint angles, by name where sections follow others, up to an offset [m].

        Its slope over the driven joint's angle is the moment arm.
        """
        joints = {self.arm.joint: np.asarray(angle_rad, dtype=np.float64)} | (others or {})
        travel = self.arm.travel_m(joints[self.arm.joint])
        for section in self.path.sections:
            if section.joint is not None and section.joint in joints:
                travel = travel - section.length_per_rad_m * joints[section.joint]
        return travel


TURNING = 0.05
"""Share of its play by which a drum turns back before the motor crosses it [-]: rounding is no reversal."""


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
        Time constant with which the motor follows its command [s], >= 0.
    resolution_rad : float, optional
        Step of the command at the motor [rad], >= 0: 2 pi/4096 for 12 bits a turn.
    command_interval_s : float, optional
        Time between two commands [s], > 0; default: one a step.
    backlash_rad : float, optional
        Play of the gear, in series with the drum of a loop [rad of the commanded shaft], >= 0: the drum stands, held by
        its tendons, until the motor has crossed it. A pair's tensions keep its gears on one side.
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
    servo_time_s: float = 0.0
    resolution_rad: float = 0.0
    command_interval_s: float | None = None
    backlash_rad: float = 0.0
    homing_rad: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", DriveKind(self.kind))
        for radius in self.drum_radius_m:
            require("drum_radius_m", radius, above=0, hint="half the drum's diameter plus half the tendon's")
        require("gear_ratio", self.gear_ratio, above=0, hint="turns of the motor for one of the drum")
        for name in ("inertia_kg_m2", "coulomb_N_m", "servo_time_s", "resolution_rad", "backlash_rad", "homing_rad"):
            require(name, getattr(self, name), least=0, hint="leave it out for none")
        for name in ("torque_constant_N_m_per_A", "speed_max_rad_per_s", "torque_max_N_m", "command_interval_s"):
            require_given(name, getattr(self, name), above=0, hint="leave it out if it is not known")
        require("gear_efficiency", self.gear_efficiency, above=0, hint="0.9 for a good gear")
        if self.gear_efficiency > 1:
            raise ParameterError(f"gear_efficiency must be at most 1, got {self.gear_efficiency}; 0.9 for a good gear")
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
        dry = self.coulomb_N_m + (1 - self.gear_efficiency) * np.abs(held_N_m)
        torque: Array = held_N_m + self.inertia_kg_m2 * acceleration_rad_per_s2 + dry * way
        return torque

    @property
    def play_rad(self) -> float:
        """Play between motor and drum that has an effect [rad of the commanded shaft]."""
        return self.backlash_rad if self.kind is DriveKind.LOOP else 0.0

    @property
    def turning_rad(self) -> float:
        """Way back of a drum from where it went furthest that counts as a reversal [rad of the commanded shaft]."""
        return max(TURNING * self.play_rad, self.resolution_rad)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanism:
    """Joint, tendons and drive: everything physical about a driven joint.

    Parameters
    ----------
    joints : tuple of DrivenJoint
        One for now.
    tendons : tuple of JointTendon
        Two, of which one pulls each way; with a pair drive and a spring at the joint, one may do.
    drive : JointDrive
        The motors and what joins them to the tendons.
    """

    joints: tuple[DrivenJoint, ...]
    tendons: tuple[JointTendon, ...]
    drive: JointDrive

    def __post_init__(self) -> None:
        if len(self.joints) != 1:
            raise ParameterError(f"one driven joint is possible for now, got {len(self.joints)}; describe each alone")
        names = [tendon.name for tendon in self.tendons]
        if len(set(names)) != len(names):
            raise ParameterError(f"tendons need different names, got {', '.join(names)}")
        for tendon in self.tendons:
            if tendon.arm.joint != self.joint.name:
                raise ParameterError(
                    f'tendon "{tendon.name}" names the joint "{tendon.arm.joint}", which is not driven'
                )
        if len(self.drive.drum_radius_m) not in (1, len(self.tendons)):
            raise ParameterError(
                f"drum_radius_m must be one number or one for each of {len(self.tendons)} tendons, "
                f"got {len(self.drive.drum_radius_m)}"
            )
        self._check_number()

    def _check_number(self) -> None:
        if len(self.tendons) == 1:
            if self.drive.kind is DriveKind.LOOP:
                raise ParameterError(
                    'a drive of kind = "loop" needs two tendons, got 1; use "pair" for one and a spring'
                )
            if self.joint.stiffness_N_m_per_rad == 0:
                raise ParameterError(
                    "a joint with one tendon needs a spring that pulls the other way, got stiffness_N_m_per_rad = 0; "
                    "give it, or a second tendon"
                )
        elif len(self.tendons) != 2:
            raise ParameterError(
                f"a joint needs one or two tendons, got {len(self.tendons)}; three and more share a "
                "torque in ways that are not decided here"
            )

    @property
    def joint(self) -> DrivenJoint:
        """The driven joint."""
        return self.joints[0]

    @property
    def drum_radius_m(self) -> tuple[float, ...]:
        """Radius of each tendon's drum [m]."""
        given = self.drive.drum_radius_m
        return given if len(given) == len(self.tendons) else given * len(self.tendons)

    def arms_at(self, angle_rad: float) -> tuple[float, ...]:
        """Moment arm of each tendon at an angle [m].

        Raises
        ------
        ParameterError
            If one vanishes, or two pull the same way.
        """
        arms = tuple(float(t.moment_arm_at(np.array(angle_rad))) for t in self.tendons)
        for tendon, arm in zip(self.tendons, arms, strict=True):
            if arm == 0:
                raise ParameterError(
                    f'tendon "{tendon.name}" has no moment arm at {angle_rad:g} rad; check moment_arm_m and lengths'
                )
        if len(arms) == 2 and arms[0] * arms[1] > 0:
            raise ParameterError(
                f"the tendons must pull opposite ways, got moment arms of {arms[0]:g} and {arms[1]:g} m at "
                f"{angle_rad:g} rad; turn the sign of one"
            )
        return arms

    def windings(self, angle_rad: float) -> tuple[int, ...]:
        """Way each tendon is wound: with +1 a positive angle of its motor pulls it in."""
        if self.drive.kind is DriveKind.PAIR:
            return (1,) * len(self.tendons)
        return tuple(1 if arm > 0 else -1 for arm in self.arms_at(angle_rad))

    def motor_rad(self, travel_m: Array, angle_rad: float) -> Array:
        """Angles of the motors for travels of the tendons at their drums, shape (rows, tendons): the same shape."""
        scale = np.array(self.drum_radius_m) * np.array(self.windings(angle_rad)) / self.drive.gear_ratio
        motor: Array = np.asarray(travel_m, dtype=np.float64) / scale
        return motor

    def chains(self, level: Level, motion: JointMotion, segments: int | None = None) -> tuple[Chain, ...]:
        """A chain for each tendon, both of whose ends are led: the drum's by the motor, the other by the joint.

        Parameters
        ----------
        level : Level
        motion : JointMotion
            Of the driven joint, whose range decides who gets masses, and of the others that sections name.
        segments : int, optional
            Number of masses of each; default: each path's own.
        """
        relaxing = next(
            (t.tendon for t in self.tendons if t.tendon.second_relaxing_stiffness_N_per_m is not None), None
        )
        return tuple(self._chain(tendon, level, motion, segments, relaxing) for tendon in self.tendons)

    @staticmethod
    def _chain(
        given: JointTendon, level: Level, motion: JointMotion, segments: int | None, relaxing: Tendon | None
    ) -> Chain:
        tendon = given.tendon
        if relaxing is not None and tendon.second_relaxing_stiffness_N_per_m is None:
            # Both chains share their code: one that relaxes once gets a second part without stiffness.
            time = relaxing.second_relaxation_time_s
            tendon = replace(tendon, second_relaxing_stiffness_N_per_m=0.0, second_relaxation_time_s=time)
        count = given.path.segments if segments is None else segments
        return Chain(
            elements=whole_of(replace(given, tendon=tendon), level).divided(count, motion),
            level=level,
            motion=motion,
            far_joint=(given.arm.joint, -(given.arm.moment_arm_m or 0.0)),
            near=_LED,
            far=_LED,
        )
