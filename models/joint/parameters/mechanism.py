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
from typing import ClassVar

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters.drive import DriveKind, JointDrive
from tendonff.models.joint.parameters.joint import DrivenJoint
from tendonff.models.joint.parameters.tendon import JointTendon
from tendonff.models.layout import Array
from tendonff.models.mechanism import parts
from tendonff.models.mechanism.geometry import Geometry, Routed
from tendonff.models.parameters import Tendon
from tendonff.models.path import JointMotion
from tendonff.models.tendon.assembly import End
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.elements import whole_of

_LED = End(mass_kg=1.0, damping_N_s_per_m=0.0, stiffness_N_per_m=0.0)
"""An end whose motion is given: its own numbers have no effect."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanism(Routed):
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
    motors_tell: ClassVar[bool] = True
    """Angles and torques of its motors tell its numbers."""

    def __post_init__(self) -> None:
        if len(self.joints) != 1:
            raise ParameterError(f"one driven joint is possible for now, got {len(self.joints)}; describe each alone")
        names = [tendon.name for tendon in self.tendons]
        if len(set(names)) != len(names):
            raise ParameterError(f"tendons need different names, got {', '.join(names)}")
        for tendon in self.tendons:
            if len(tendon.arms) != 1:
                raise ParameterError(f'tendon "{tendon.name}" needs one moment arm, got {len(tendon.arms)}')
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

    @property
    def drums_m(self) -> dict[str, dict[str, float]]:
        """Radii of drums by motor and tendon, positive where the tendon is taken in at positive angles [m]."""
        drums = dict(zip([tendon.name for tendon in self.tendons], self.drum_radius_m, strict=True))
        if self.drive.kind is DriveKind.LOOP:
            ways = zip(drums.items(), self.geometry().moment_arm_m(np.zeros((1, 1)))[0, :, 0], strict=True)
            return {"motor": {name: math.copysign(radius, arm) for (name, radius), arm in ways}}
        return {f"motor {k}": {name: radius} for k, (name, radius) in enumerate(drums.items(), start=1)}

    def geometry(self) -> Geometry:
        """Lengths, wrap angles and moment arms by the angle of the joint; others that sections name stand at zero."""
        drum = parts.Arm(body="drum", metres_per_unit=0.0)
        return Geometry(tendons=tuple(t.wound_on(drum) for t in self.tendons), bodies=(self.joint.name,))

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
