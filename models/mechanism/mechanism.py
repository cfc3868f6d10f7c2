"""Any mechanism of bodies, tendons and drives; topology is data."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tendonff.models import parameters
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.mechanism.loads import Damper, DryFriction, Spring
from tendonff.models.mechanism.parts import Arm, Attachment, Body, Drive, Force, Lead, Servo, Tendon, Unit
from tendonff.models.parameters.drive import Drive as DriveKind
from tendonff.models.path import JointMotion
from tendonff.models.tendon.elements import Elements, whole_of


@dataclass(frozen=True, slots=True, kw_only=True)
class CutTendon:
    """A tendon divided into masses and links at a fidelity level.

    Attributes
    ----------
    name : str
    elements : Elements
    near, far : Attachment
    """

    name: str
    elements: Elements
    near: Attachment
    far: Attachment

    @property
    def count(self) -> int:
        """Number N of masses on the path."""
        return self.elements.count


@dataclass(frozen=True, slots=True, kw_only=True)
class CutMechanism:
    """A mechanism at a fidelity level, its tendons divided.

    Attributes
    ----------
    bodies : tuple of Body
    tendons : tuple of CutTendon
    drives : tuple of Drive
    """

    bodies: tuple[Body, ...]
    tendons: tuple[CutTendon, ...]
    drives: tuple[Drive, ...]

    @property
    def led(self) -> tuple[Body, ...]:
        """Bodies whose motion a drive gives."""
        return tuple(body for body in self.bodies if body.name in self._leaders)

    @property
    def free(self) -> tuple[Body, ...]:
        """Bodies that move by their balance."""
        return tuple(body for body in self.bodies if body.name not in self._leaders)

    @property
    def _leaders(self) -> set[str]:
        return {drive.body for drive in self.drives if drive.leads}


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanism:
    """Bodies, the tendons between them, and the drives that act on them.

    Parameters
    ----------
    bodies : tuple of Body
        Of different names.
    tendons : tuple of Tendon
        Whose ends and sections follow bodies by name.
    drives : tuple of Drive
        Several may act on one body, unless one of them leads it.

    Raises
    ------
    ParameterError
        If two parts share a name, or one names a body that is not there.
    """

    bodies: tuple[Body, ...]
    tendons: tuple[Tendon, ...]
    drives: tuple[Drive, ...]

    def __post_init__(self) -> None:
        names = [body.name for body in self.bodies]
        for what, given in (("bodies", names), ("tendons", [tendon.name for tendon in self.tendons])):
            twice = next((name for name in given if given.count(name) > 1), None)
            if twice is not None:
                raise ParameterError(f'{what} need different names, got "{twice}" twice; rename one')
        users = [(f'tendon "{t.name}"', body) for t in self.tendons for body in t.bodies]
        for who, body in (*users, *(("a drive", drive.body) for drive in self.drives)):
            if body not in names:
                raise ParameterError(f'{who} names the body "{body}", which is not there; bodies: {", ".join(names)}')
        for drive in self.drives:
            others = sum(other.body == drive.body for other in self.drives) - 1
            if drive.leads and others:
                raise ParameterError(f'"{drive.body}" is led, so nothing else can drive it; leave the other drive out')

    @classmethod
    def of(cls, transmission: parameters.Transmission) -> "Mechanism":
        """A single tendon: an actuator and a load, or a joint that moves the far end, and joints that move sections.

        Inputs are the actuator's force, or its command behind a servo, and the force of the surroundings on the load.
        """
        actuator, load, friction = transmission.actuator, transmission.load, transmission.friction
        dry: tuple[DryFriction, ...] = ()
        if not actuator.law.is_ideal:
            dry = (
                DryFriction(
                    coulomb=actuator.law.coulomb_N,
                    lost_share=actuator.law.lost_share,
                    bristle_stiffness=friction.bristle_stiffness_N_per_m,
                    soft_bristle_stiffness=friction.soft_bristle_stiffness_N_per_m,
                ),
            )
        motor = Body(
            name="actuator",
            unit=Unit.METRE,
            inertia=actuator.mass_kg,
            loads=(Damper(damping=actuator.damping_N_s_per_m), *dry),
        )
        drive: Drive = Force(body="actuator")
        if actuator.drive is DriveKind.POSITION and actuator.servo_stiffness_N_per_m is not None:
            drive = Servo(body="actuator", stiffness=actuator.servo_stiffness_N_per_m)
        joints = led_joints(transmission.motion, transmission.joints)
        far, ends, contact = Arm(body="load", metres_per_unit=1.0), list[Body](), list[Drive]()
        if load.joint is not None:
            far = Arm(body=load.joint, metres_per_unit=-(load.moment_arm_m or 0.0))
        else:
            hung = Body(
                name="load",
                unit=Unit.METRE,
                inertia=load.mass_kg,
                loads=(Damper(damping=load.damping_N_s_per_m), Spring(stiffness=load.stiffness_N_per_m)),
            )
            ends, contact = [hung], [Force(body="load")]
        tendon = Tendon(
            name="tendon",
            path=transmission.path,
            tendon=transmission.tendon,
            friction=friction,
            near=Attachment(arms=(Arm(body="actuator", metres_per_unit=1.0),)),
            far=Attachment(arms=(far,)),
        )
        leads = tuple(Lead(body=joint.name) for joint in joints)
        return cls(bodies=(motor, *ends, *joints), tendons=(tendon,), drives=(drive, *contact, *leads))

    def body(self, name: str) -> Body:
        """A body by its name."""
        return next(body for body in self.bodies if body.name == name)

    def cut(
        self,
        level: Level,
        segments: int | None = None,
        numbers: Mapping[str, Mapping[str, ca.SX]] | None = None,
    ) -> CutMechanism:
        """The mechanism at a level, its tendons divided.

        Parameters
        ----------
        level : Level
        segments : int, optional
            Number of masses on each tendon; default: each path's own.
        numbers : mapping of str to mapping of str to ca.SX, optional
            Other numbers or symbols of tendons by name, by the names of the fields of `Whole`, such as
            `mu_dynamic_pull`: what sensitivities may be taken over.
        """
        changed = numbers or {}
        return CutMechanism(
            bodies=tuple(body.at(level) for body in self.bodies),
            tendons=tuple(self._cut(tendon, level, segments, changed.get(tendon.name, {})) for tendon in self.tendons),
            drives=self.drives,
        )

    def _cut(self, tendon: Tendon, level: Level, segments: int | None, numbers: Mapping[str, ca.SX]) -> CutTendon:
        followed = tuple(dict.fromkeys(joint for section in tendon.path.sections for joint in section.joints))
        spans = np.array([self.body(name).span for name in followed], dtype=np.float64).reshape(-1, 2).T
        motion = JointMotion(names=followed, time_s=np.arange(2.0), angle_rad=spans) if followed else None
        count = tendon.path.segments if segments is None else segments
        if not count >= 1:
            raise ParameterError(f"segments must be >= 1, got {count}; 6 is a good start")
        elements = whole_of(tendon, level).changed(numbers).divided(count, motion)
        return CutTendon(name=tendon.name, elements=elements, near=tendon.near, far=tendon.far)


def led_joints(motion: JointMotion | None, names: tuple[str, ...]) -> tuple[Body, ...]:
    """Bodies for joints whose motion is known; at zero where there is none."""
    spans = dict.fromkeys(names, (0.0, 0.0))
    if motion is not None:
        given = dict(zip(motion.names, motion.angle_rad.T, strict=True))
        spans = {name: (float(given[name].min()), float(given[name].max())) for name in names if name in given}
        missing = [name for name in names if name not in given]
        if missing:
            raise ParameterError(f'the joint "{missing[0]}" has no motion; give it one')
    return tuple(Body(name=name, unit=Unit.RADIAN, inertia=1.0, span=span) for name, span in spans.items())
