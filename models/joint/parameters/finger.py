"""Joints on tendons that cross several of them, and motors that wind one tendon or several."""

from dataclasses import dataclass

from tendonff.models.errors import ParameterError, require
from tendonff.models.joint.parameters.drive import JointDrive
from tendonff.models.joint.parameters.joint import DrivenJoint
from tendonff.models.joint.parameters.tendon import JointTendon
from tendonff.models.mechanism import (
    Arm,
    Body,
    Force,
    Lead,
    Mechanism,
    Servo,
    Tendon,
    Unit,
)
from tendonff.models.mechanism.geometry import Geometry, Routed
from tendonff.models.mechanism.mechanism import led_joints
from tendonff.models.mechanism.sharing import Sharing
from tendonff.models.path import JointMotion, TabulatedSection

DRUM_INERTIA_KG_M2 = 1e-9
"""Inertia of a drum at the commanded shaft, which a balance needs [kg m2]: as good as none."""

_BRISTLE_ARM_M = 0.01
"""Moment arm at which the dry friction of a joint has the bristles of the first tendon [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motor:
    """A motor and the tendons on its drums.

    Parameters
    ----------
    name : str
        Its name in reports and columns.
    winds : tuple of str
        Tendons that it winds.
    radii_m : tuple of float
        Radius of each drum up to the middle of the tendon [m], positive where the tendon is taken in as the motor turns
        to positive angles.
    drive : JointDrive
        Gear, friction, limits and servo; of a motor with several tendons a loop with its pre-tension.
    """

    name: str
    winds: tuple[str, ...]
    radii_m: tuple[float, ...]
    drive: JointDrive

    def __post_init__(self) -> None:
        if not self.winds or len(self.winds) != len(self.radii_m):
            raise ParameterError(f'motor "{self.name}" needs a drum for each tendon, got {len(self.radii_m)}')
        for tendon, radius in zip(self.winds, self.radii_m, strict=True):
            require(f'drum of "{tendon}" on motor "{self.name}"', abs(radius), above=0, hint="half its diameter")

    @property
    def body(self) -> str:
        """Name of its body, which differs from those of joints."""
        return f"motor_{self.name}"

    @property
    def winding_m(self) -> tuple[float, ...]:
        """Travel of each tendon per radian at the motor's shaft [m]."""
        return tuple(radius / self.drive.gear_ratio for radius in self.radii_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finger(Routed):
    """Driven joints, the tendons that cross them, and their motors.

    Parameters
    ----------
    joints : tuple of DrivenJoint
    tendons : tuple of JointTendon
        Whose far ends move with joints, or whose sections follow them.
    motors : tuple of Motor
        Each tendon is on one of them.
    sharing : Sharing
        How tendons share torques that they could share in many ways.
    """

    joints: tuple[DrivenJoint, ...]
    tendons: tuple[JointTendon, ...]
    motors: tuple[Motor, ...]
    sharing: Sharing

    def __post_init__(self) -> None:
        wound = [name for motor in self.motors for name in motor.winds]
        known = [tendon.name for tendon in self.tendons]
        for name in wound:
            if name not in known:
                raise ParameterError(f'a motor winds "{name}", which is no tendon; tendons: {", ".join(known)}')
        for name in known:
            if wound.count(name) != 1:
                raise ParameterError(f'tendon "{name}" must be on one motor, got {wound.count(name)}; check drums_m')
        for tendon in self.tendons:
            if not any(self._crosses(tendon, joint.name) for joint in self.joints):
                along = {name for section in tendon.path.sections for name in section.joints}
                moved = ", ".join(sorted(along.union(arm.joint for arm in tendon.arms)))
                raise ParameterError(
                    f'tendon "{tendon.name}" moves no driven joint, but {moved or "none"}; driven: '
                    f"{', '.join(self.names)}; give it moment_arms_m or sections of these"
                )

    @staticmethod
    def _crosses(tendon: JointTendon, joint: str) -> bool:
        return tendon.follows(joint) or any(arm.joint == joint for arm in tendon.arms)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def others(self) -> tuple[str, ...]:
        """Joints that no tendon drives and sections of paths follow."""
        named = (joint for tendon in self.tendons for section in tendon.path.sections for joint in section.joints)
        return tuple(dict.fromkeys(name for name in named if name not in self.names))

    @property
    def drums_m(self) -> dict[str, dict[str, float]]:
        """Radii of drums by motor and tendon, positive where the tendon is taken in at positive angles [m]."""
        return {motor.name: dict(zip(motor.winds, motor.radii_m, strict=True)) for motor in self.motors}

    @property
    def motors_tell(self) -> bool:
        """Angles and torques of its motors tell its numbers: the tendons hold every joint by themselves."""
        return len(self.tendons) > len(self.joints)

    @property
    def pretension_N(self) -> dict[str, float]:
        """Of the motors that wind several tendons, by the names of their bodies."""
        return {motor.body: motor.drive.pretension_N or 0.0 for motor in self.motors if len(motor.winds) > 1}

    def geometry(self) -> Geometry:
        """Lengths, wrap angles and moment arms by the angles of the joints."""
        return Geometry(tendons=tuple(self._tendon(tendon) for tendon in self.tendons), bodies=self.names)

    def beyond_tables(self, motion: JointMotion) -> tuple[str, ...]:
        """Sections whose tables a motion leaves, where they go on straight, in words; one for each joint."""
        found: dict[str, tuple[float, str]] = {}
        for tendon in self.tendons:
            for section in tendon.path.sections:
                for table in section.tables if isinstance(section, TabulatedSection) else ():
                    for joint, off in table.beyond(motion.by_joint).items():
                        if off > found.get(joint, (0.0, ""))[0]:
                            found[joint] = off, f'section "{section.name}" of tendon "{tendon.name}"'
        return tuple(
            f'"{joint}" leaves the table of {where} by {off:.3g} rad, where it goes on straight; import a wider range'
            for joint, (off, where) in found.items()
        )

    def mechanism(self, motion: JointMotion) -> Mechanism:
        """Bodies, tendons and drives: joints are free, motors led, and other joints that sections name are led.

        A motor whose gear gives way is a drum on a servo of that stiffness.

        The motion is that of the joints, whose ranges decide who gets masses, and of the others.
        """
        columns = dict(zip(motion.names, motion.angle_rad.T, strict=True))
        free = tuple(
            Body(
                name=joint.name,
                unit=Unit.RADIAN,
                inertia=joint.inertia_kg_m2,
                loads=joint.loads(self.tendons[0].friction, _BRISTLE_ARM_M),
                span=(float(columns[joint.name].min()), float(columns[joint.name].max())),
            )
            for joint in self.joints
        )
        motors = tuple(Body(name=motor.body, unit=Unit.RADIAN, inertia=_inertia(motor.drive)) for motor in self.motors)
        led = led_joints(motion, self.others)
        return Mechanism(
            bodies=(*free, *led, *motors),
            tendons=tuple(self._tendon(tendon) for tendon in self.tendons),
            drives=(
                *(Force(body=body.name) for body in free),
                *(Lead(body=body.name) for body in led),
                *(turning(motor.body, motor.drive) for motor in self.motors),
            ),
        )

    def _tendon(self, tendon: JointTendon) -> Tendon:
        near = next(
            Arm(body=motor.body, metres_per_unit=winding)
            for motor in self.motors
            for name, winding in zip(motor.winds, motor.winding_m, strict=True)
            if name == tendon.name
        )
        return tendon.wound_on(near)


def turning(body: str, drive: JointDrive) -> Lead | Servo:
    """Drive of a drum: led by its motor, or through a gear that gives way."""
    stiffness = drive.gear_stiffness_N_m_per_rad
    return Lead(body=body) if stiffness is None else Servo(body=body, stiffness=stiffness)


def _inertia(drive: JointDrive) -> float:
    """Inertia of what turns: the motor's, where it is forced; a drum behind a gear that gives way has next to none."""
    return DRUM_INERTIA_KG_M2 if drive.gear_stiffness_N_m_per_rad else max(drive.inertia_kg_m2, DRUM_INERTIA_KG_M2)
