"""A finger of MuJoCo's whose flexor is a tendonff plant, stepped together, and a controller beside it.

MuJoCo moves the bones and knows the tendon's geometry; the tension in each part of the tendon comes from the exported
plant, which takes the joint angles. The controller runs the exported C inverse: fewer masses, a longer step.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from examples.mujoco_finger.exported import ExportedInverse
from examples.mujoco_finger.passive import PassiveTendon
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Actuator, Friction, Load, Tendon, Transmission
from tendonff.models.parameters import Path as TendonPath
from tendonff.models.path import JointMotion, Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.tendon.inverse import invert

Array = NDArray[np.float64]

MODEL = Path(__file__).with_name("finger.xml")
JOINTS = ("knuckle", "middle")
RADII_M = (0.010, 0.008)
STEP_S, DURATION_S, START_N = 1e-3, 4.0, 20.0
PLANT_MASSES, MODEL_MASSES = 40, 20


class Controller(StrEnum):
    """Where the actuator's force comes from.

    Attributes
    ----------
    PLAIN
        Reference applied directly.
    AT_REST
        The exact inverse for the pose of the start.
    MEASURED
        Exact inverse as exported C, with the present joint angles.
    """

    PLAIN = "reference applied directly"
    AT_REST = "design at rest"
    MEASURED = "inverse with measured joints"


def sections() -> tuple[Section, ...]:
    """The flexor's path in closed form, from the drawing: eyelets, pulleys and the straights between them.

    The pulleys belong to the bone before their joint, so flexing takes wrap angle off their far side: what the way
    loses there, it loses in the straight behind.
    """
    arms = ((0.020, 0.004), (0.016, 0.003))  # eyelets before and behind a pulley: distance along the bone, height
    free = [math.sqrt(x**2 + z**2 - r**2) for r, (x, z) in zip(RADII_M, arms, strict=True)]
    dips = [math.asin(r / math.hypot(x, z)) + math.atan2(z, x) for r, (x, z) in zip(RADII_M, arms, strict=True)]
    between = math.atan2(0.003 - 0.004, 0.029 - 0.020)
    eyelet = 0.001
    return (
        Section(name="palm", angle_rad=0.0, length_m=0.04),
        Section(name="entry", angle_rad=dips[0], length_m=eyelet),
        Section(name="to the knuckle", angle_rad=0.0, length_m=free[0] - eyelet),
        Section(
            name="knuckle",
            angle_rad=2 * dips[0],
            length_m=2 * dips[0] * RADII_M[0],
            joint="knuckle",
            angle_per_rad=-1.0,
        ),
        Section(
            name="from the knuckle",
            angle_rad=0.0,
            length_m=free[0] - eyelet,
            joint="knuckle",
            length_per_rad_m=-RADII_M[0],
        ),
        Section(name="first near", angle_rad=dips[0] - between, length_m=eyelet),
        Section(name="first bone", angle_rad=0.0, length_m=math.hypot(0.009, 0.001) - eyelet),
        Section(name="first far", angle_rad=dips[1] + between, length_m=eyelet),
        Section(name="to the middle", angle_rad=0.0, length_m=free[1]),
        Section(
            name="middle", angle_rad=2 * dips[1], length_m=2 * dips[1] * RADII_M[1], joint="middle", angle_per_rad=-1.0
        ),
        Section(name="second bone", angle_rad=0.0, length_m=free[1]),
    )


def transmission(motion: JointMotion, masses: int = MODEL_MASSES) -> Transmission:
    """The flexor: a thin steel cable; the middle joint moves its far end."""
    parts = sections()
    return Transmission(
        path=TendonPath(total_angle_rad=math.fsum(s.angle_rad for s in parts), segments=masses, sections=parts),
        tendon=Tendon(
            mass_kg=0.001,
            stiffness_N_per_m=3e4,
            relaxing_stiffness_N_per_m=5e3,
            relaxation_time_s=0.3,
            damping_N_s_per_m=2.0,
        ),
        friction=Friction(
            mu_dynamic=0.12,
            mu_static=0.12,
            stribeck_velocity_m_per_s=0.005,
            viscous_N_s_per_m=0.5,
            bristle_stiffness_N_per_m=1e6,
            soft_bristle_stiffness_N_per_m=5e4,
        ),
        actuator=Actuator(
            mass_kg=0.1, damping_N_s_per_m=5.0, force_min_N=0.0, force_max_N=150.0, force_rate_max_N_per_s=1e5
        ),
        load=Load(mass_kg=0.01, stiffness_N_per_m=1e3, damping_N_s_per_m=1.0, joint="middle", moment_arm_m=-RADII_M[1]),
        motion=motion,
    )


def wanted(time_s: Array) -> Array:
    """Reference tension at the insertion [N]."""
    fade = np.minimum(time_s / 0.5, 1.0) ** 2
    course: Array = START_N + fade * (7 * np.sin(2 * np.pi * 0.6 * time_s) + 3 * np.sin(2 * np.pi * 1.7 * time_s))
    return course


def pushed(time_s: float) -> Array:
    """External torques that move the finger, unknown to the controller [N m]."""
    fade = min(time_s / 0.5, 1.0) ** 2
    waves = [0.12 * math.sin(2 * math.pi * 0.9 * time_s), 0.06 * math.sin(2 * math.pi * 1.3 * time_s + 1.0)]
    return fade * np.array(waves)


def wrap_angles(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, list[str]]:
    """By how much MuJoCo's tendon turns at each eyelet and on each pulley [rad], and their names."""
    count = int(data.ten_wrapnum[0])
    points = np.array(data.wrap_xpos).reshape(-1, 3)[:count]
    geoms = np.array(data.wrap_obj).ravel()[:count]
    ways = np.diff(points, axis=0)
    heading = np.unwrap(np.arctan2(ways[:, 2], ways[:, 0]))
    turns, names, k = [], [], 1
    while k < count - 1:
        wraps = geoms[k] >= 0  # a pulley has two points, with the chord of its arc between them
        turns.append(abs(heading[k + 1] - heading[k - 1]) if wraps else abs(heading[k] - heading[k - 1]))
        names.append(model.geom(int(geoms[k])).name if wraps else "eyelet")
        k += 2 if wraps else 1
    return np.array(turns), names


@dataclass(frozen=True, kw_only=True)
class Run:
    """Record of a run, rows at the controller's steps."""

    time_s: Array
    wanted_N: Array
    force_N: Array
    tension_N: Array
    joint_rad: Array

    @property
    def error_percent(self) -> float:
        """RMS error of the tension at the insertion, % of the range of the reference."""
        return float(100 * np.sqrt(np.mean((self.tension_N - self.wanted_N) ** 2)) / np.ptp(self.wanted_N))


def settled(model: mujoco.MjModel) -> mujoco.MjData:
    """The finger at rest under the tension of the start, as without friction."""
    data = mujoco.MjData(model)
    data.qpos[:] = START_N * np.array(RADII_M) / model.jnt_stiffness
    mujoco.mj_forward(model, data)
    return data


def run(controller: Controller, duration_s: float = DURATION_S) -> Run:
    """Step finger, tendon and controller together."""
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    data = settled(model)
    rows = round(duration_s / STEP_S) + 1
    substeps = round(STEP_S / model.opt.timestep)
    time: Array = np.arange(rows, dtype=np.float64) * STEP_S
    still = JointMotion(names=JOINTS, time_s=np.zeros(1), angle_rad=np.array([data.qpos]))
    rig, plant = transmission(still), transmission(still, PLANT_MASSES)
    reference = wanted(time)
    at_rest = invert(Chain.of(rig, Level.PRESLIDING).at_rest(), reference, STEP_S).force_N
    inverse = ExportedInverse(rig, START_N, STEP_S) if controller is Controller.MEASURED else None
    if inverse is not None:
        inverse.step(START_N, data.qpos)  # where the joints stand
    forces, tensions, joints = np.full(rows, START_N), [START_N], [data.qpos.copy()]

    def force_N(now: float) -> float:
        """Straight between the controller's samples, of which the coming one is known."""
        return float(np.interp(now, time, forces))

    with PassiveTendon(model, data, plant, start_N=START_N, force_N=force_N) as tendon:
        for k in range(1, rows):
            if inverse is None:
                forces[k:] = (reference if controller is Controller.PLAIN else at_rest)[k]
            else:  # encoders: angle and speed now, from which the angle at the end of the step
                forces[k:] = inverse.step(float(reference[k]), data.qpos + STEP_S * data.qvel)
            for _ in range(substeps):
                data.qfrc_applied[:] = pushed(data.time)
                mujoco.mj_step(model, data)
            tendon.follow(data)
            tensions.append(float(tendon.tension_N[-1]))
            joints.append(data.qpos.copy())
    if tendon.plant.held:
        raise SolveError(f"the exported plant found no balance in {tendon.plant.held} samples")
    return Run(
        time_s=time,
        wanted_N=reference,
        force_N=forces,
        tension_N=np.array(tensions),
        joint_rad=np.array(joints),
    )
