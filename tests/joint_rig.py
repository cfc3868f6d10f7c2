"""A finger's joint between two tendons, as the tests take it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import Arm, DriveKind, DrivenJoint, JointDrive, JointTendon, Mechanism
from tendonff.models.parameters import Friction, Path, Tendon
from tendonff.models.path import JointMotion, Section
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.start import joint_problem

Array = NDArray[np.float64]
STEP = 1e-3
TIME = np.arange(0.0, 2.5, STEP)
_FADE = np.where(TIME < 0.8, np.sin(np.pi * TIME / 1.6) ** 2, 1.0)
ANGLE = _FADE * np.deg2rad(40) * (0.7 * np.sin(np.pi * TIME) + 0.3 * np.sin(2.6 * np.pi * TIME))
EXPONENT, ARM, STIFFNESS = 0.6, 8e-3, 2e4


def mechanism(
    kind: DriveKind = DriveKind.LOOP, tension_N: float = 15.0, *, segments: int = 6, adhesion_N: float = 0.0
) -> Mechanism:
    """Equal tendons of mu theta = 0.6; the tension after tensioning, or a pair's least."""
    friction = Friction(
        mu_dynamic=0.2,
        mu_static=0.2,
        stribeck_velocity_m_per_s=5e-3,
        viscous_N_s_per_m=0.0,
        bristle_stiffness_N_per_m=1e6,
        soft_bristle_stiffness_N_per_m=1e5,
        adhesion_N=adhesion_N,
    )
    tendon = Tendon(
        mass_kg=1e-3,
        stiffness_N_per_m=STIFFNESS,
        relaxing_stiffness_N_per_m=0.0,
        relaxation_time_s=1.0,
        damping_N_s_per_m=0.05,
    )
    path = Path(total_angle_rad=EXPONENT / 0.2, segments=segments)
    loop = kind is DriveKind.LOOP
    return Mechanism(
        joints=(DrivenJoint(name="q", inertia_kg_m2=4e-5, damping_N_m_s_per_rad=2e-4, gravity_N_m=0.02),),
        tendons=tuple(
            JointTendon(
                name=name, path=path, tendon=tendon, friction=friction, arms=(Arm(joint="q", moment_arm_m=arm),)
            )
            for name, arm in (("flexor", ARM), ("extensor", -ARM))
        ),
        drive=JointDrive(
            kind=kind,
            drum_radius_m=(ARM,),
            pretension_N=tension_N if loop else None,
            least_tension_N=None if loop else tension_N,
        ),
    )


def scaled(rig: Mechanism, *, mu: float = 1.0, stiffness: float = 1.0) -> Mechanism:
    """The same with other friction and stiffness of both tendons."""
    return replace(
        rig,
        tendons=tuple(
            replace(
                t,
                friction=replace(t.friction, mu_dynamic=0.2 * mu, mu_static=0.2 * mu),
                tendon=t.tendon.scaled(stiffness),
            )
            for t in rig.tendons
        ),
    )


def heavier(rig: Mechanism, gravity_N_m: float) -> Mechanism:
    return replace(rig, joints=(replace(rig.joint, gravity_N_m=gravity_N_m),))


def bent(rig: Mechanism) -> Mechanism:
    """Both tendons bend and get longer with the joint, by different amounts, on drums of different radii."""

    def path(way: int, gain_m: float) -> Path:
        tube = Section(name="tube", angle_rad=2.0, length_m=0.12)
        pulley = Section(
            name="pulley", angle_rad=1.0, length_m=0.08, joint="q", angle_per_rad=way, length_per_rad_m=way * gain_m
        )
        return Path(total_angle_rad=3.0, segments=10, sections=(tube, pulley))

    first, second = rig.tendons
    return replace(
        rig,
        tendons=(
            replace(first, path=path(-1, 8e-3), arms=(Arm(joint="q", moment_arm_m=0.0),)),
            replace(second, path=path(1, 6e-3), arms=(Arm(joint="q", moment_arm_m=-1.5e-3),)),
        ),
        drive=replace(rig.drive, drum_radius_m=(8e-3, 7.5e-3)),
    )


def motion(angle_rad: Array = ANGLE, time_s: Array = TIME) -> JointMotion:
    return JointMotion(names=("q",), time_s=time_s, angle_rad=angle_rad[:, None])


def problem(rig: Mechanism, level: Level = Level.PRESLIDING, segments: int | None = None) -> JointProblem:
    return joint_problem(rig, level, motion(), segments=segments)
