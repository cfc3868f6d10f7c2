"""A driven joint between tendons as bodies, tendons and drives."""

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import DriveKind
from tendonff.models.joint.parameters import Mechanism as JointMechanism
from tendonff.models.joint.parameters.finger import DRUM_INERTIA_KG_M2, turning
from tendonff.models.mechanism.mechanism import Mechanism, led_joints
from tendonff.models.mechanism.parts import Arm, Body, Force, Lead, Unit
from tendonff.models.path import JointMotion

MOTOR = "motor"
"""Name of the one motor of a loop; those of a pair are called like their tendons."""


def describe(mechanism: JointMechanism, motion: JointMotion) -> Mechanism:
    """The mechanism of a driven joint: a loop is two tendons on one led motor with opposite windings, a pair has two.

    The joint is free, with an input for the torque of its surroundings on it; motors and all other joints are led. A
    motor whose gear gives way is a drum on a servo of that stiffness. Motor angles count from the start.

    Parameters
    ----------
    mechanism : joint.parameters.Mechanism
    motion : JointMotion
        Of the driven joint, from where it starts over its whole range, and of all others that sections name.
    """
    joint = mechanism.joint
    if joint.name not in motion.names:
        raise ParameterError(f'the driven joint "{joint.name}" needs a motion, got those of {", ".join(motion.names)}')
    angles = motion.angle_rad[:, motion.names.index(joint.name)]
    start = float(motion.at(np.zeros(1))[0, motion.names.index(joint.name)])
    named = (section.joint for tendon in mechanism.tendons for section in tendon.path.sections)
    others = tuple(dict.fromkeys(name for name in named if name is not None and name != joint.name))
    driven = Body(
        name=joint.name,
        unit=Unit.RADIAN,
        inertia=joint.inertia_kg_m2,
        loads=joint.loads(mechanism.tendons[0].friction, mechanism.arms_at(start)[0]),
        span=(float(angles.min()), float(angles.max())),
    )
    loop = mechanism.drive.kind is DriveKind.LOOP
    motors = [MOTOR] if loop else [tendon.name for tendon in mechanism.tendons]
    gives = mechanism.drive.gear_stiffness_N_m_per_rad is not None
    inertia, known = DRUM_INERTIA_KG_M2 if gives else 1.0, led_joints(motion, others)
    drums = tuple(Body(name=name, unit=Unit.RADIAN, inertia=inertia) for name in motors)
    windings = zip(mechanism.drum_radius_m, mechanism.windings(start), strict=True)
    per_rad = [radius * way / mechanism.drive.gear_ratio for radius, way in windings]
    return Mechanism(
        bodies=(driven, *drums, *known),
        tendons=tuple(
            tendon.wound_on(Arm(body=MOTOR if loop else tendon.name, metres_per_unit=winding))
            for tendon, winding in zip(mechanism.tendons, per_rad, strict=True)
        ),
        drives=(
            Force(body=joint.name),
            *(turning(name, mechanism.drive) for name in motors),
            *(Lead(body=body.name) for body in known),
        ),
    )
