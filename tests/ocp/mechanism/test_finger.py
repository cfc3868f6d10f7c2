"""A finger of three joints and four tendons, judged on an explicit plant of its own and on what it contains."""

from dataclasses import replace

import finger_plant
import numpy as np
import pytest

from tendonff.compensator.scenario.driven.joint import sample_joint
from tendonff.compensator.scenarios import load_scenario
from tendonff.models import parameters
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.description import describe
from tendonff.models.joint.parameters import Arm as JointArm
from tendonff.models.joint.parameters import DrivenJoint, JointTendon
from tendonff.models.mechanism import (
    Arm,
    Attachment,
    Body,
    Damper,
    DryFriction,
    Force,
    Lead,
    Mechanism,
    Spring,
    Tendon,
    Unit,
)
from tendonff.models.mechanism.geometry import Geometry
from tendonff.models.mechanism.sharing import Sharing
from tendonff.models.mechanism.static import local_arms_m
from tendonff.models.path import Section
from tendonff.ocp.joint.invert import invert_joint
from tendonff.ocp.joint.simulate import simulate_joint
from tendonff.ocp.joint.start import joint_problem
from tendonff.ocp.mechanism.problem import MechanismProblem
from tendonff.ocp.mechanism.response import MechanismStatus, invert_mechanism, simulate_mechanism
from tendonff.ocp.mechanism.start import mechanism_problem, unreachable

pytestmark = pytest.mark.compiler

JOINTS = {"mcp": 1e-4, "pip": 4e-5, "dip": 1e-5}
ARMS = {
    "mcp_flexor": (0.010, 0.0, 0.0),
    "pip_flexor": (0.002, 0.010, 0.0),
    "dip_flexor": (0.002, 0.002, 0.008),
    "extensor": (-0.014, -0.012, -0.008),
}
DRUM_M, STEP_S, DAMPING = 0.008, 1e-3, 1e-3
SHARING = Sharing(least_tension_N=8.0, smooth_N=2.0, change_weight=10.0)


def motion(length_s=3.0):
    """Sines from rest, faded in over half a second, shape (rows, joints)."""
    time = np.arange(round(length_s / STEP_S) + 1) * STEP_S
    fade = np.minimum(time / 0.5, 1.0)
    fade = fade**2 * (3 - 2 * fade)
    middle, size = np.array([0.7, 0.8, 0.5]), np.array([0.30, 0.35, 0.25])
    rate, phase = np.array([0.7, 1.1, 0.9]), np.array([0.0, 0.5, 1.0])
    return middle + fade[:, None] * size * np.sin(2 * np.pi * time[:, None] * rate + phase)


WANTED = motion()


def sections(arms):
    bends = (
        Section(name=joint, angle_rad=0.3, length_m=0.03, joint=joint, length_per_rad_m=-arm)
        for joint, arm in zip(JOINTS, arms, strict=True)
        if arm
    )
    return (Section(name="channel", angle_rad=2.0, length_m=0.25), *bends)


def parts(name, *, mu=0.15, stiffness=2e4, segments=12):
    path = sections(ARMS[name])
    return {
        "name": name,
        "path": parameters.Path(total_angle_rad=sum(s.angle_rad for s in path), segments=segments, sections=path),
        "tendon": parameters.Tendon(
            mass_kg=2e-3,
            stiffness_N_per_m=stiffness,
            relaxing_stiffness_N_per_m=0.0,
            relaxation_time_s=1.0,
            damping_N_s_per_m=0.02,
        ),
        "friction": parameters.Friction(
            mu_dynamic=mu,
            mu_static=mu,
            stribeck_velocity_m_per_s=0.01,
            viscous_N_s_per_m=1.0,
            bristle_stiffness_N_per_m=1e6,
            soft_bristle_stiffness_N_per_m=3e5,
        ),
    }


def finger(wanted=WANTED, *, forced=False, **changed) -> Mechanism:
    joints = [
        Body(
            name=name,
            unit=Unit.RADIAN,
            inertia=inertia,
            loads=(Damper(damping=DAMPING),),
            span=(float(column.min()), float(column.max())),
        )
        for (name, inertia), column in zip(JOINTS.items(), wanted.T, strict=True)
    ]
    motors = [Body(name=f"motor_{name}", unit=Unit.RADIAN, inertia=1e-5) for name in ARMS]
    tendons = tuple(
        Tendon(
            **parts(name, **changed),
            near=Attachment(arms=(Arm(body=f"motor_{name}", metres_per_unit=DRUM_M),)),
            far=Attachment(),
        )
        for name in ARMS
    )
    drives = tuple((Force if forced else Lead)(body=motor.name) for motor in motors)
    return Mechanism(bodies=(*joints, *motors), tendons=tendons, drives=drives)


def problem(wanted=WANTED, *, level=Level.PRESLIDING, **changed) -> MechanismProblem:
    return mechanism_problem(finger(wanted, **changed), level, start_of(wanted), sharing=SHARING)


def start_of(wanted):
    return dict(zip(JOINTS, wanted[0].tolist(), strict=True))


def rms_deg(off_rad):
    """Over all joints, after the fade of half a second."""
    return float(np.degrees(np.sqrt(np.mean(off_rad[500:] ** 2))))


def on_the_plant(motor_rad, tension_N, *, mu=0.15, stiffness=2e4):
    joints = [
        DrivenJoint(name=name, inertia_kg_m2=inertia, damping_N_m_s_per_rad=DAMPING) for name, inertia in JOINTS.items()
    ]
    none = (JointArm(joint="mcp", moment_arm_m=0.0),)
    tendons = [JointTendon(**parts(name, mu=mu, stiffness=stiffness), arms=none) for name in ARMS]
    drums = DRUM_M * np.eye(len(ARMS))
    found = finger_plant.respond(joints, tendons, drums, motor_rad, STEP_S, WANTED[0], tension_N, masses=40)
    return found.angle_rad - WANTED[1 : len(motor_rad)]


@pytest.fixture(scope="module")
def designed():
    return invert_mechanism(problem(), WANTED, STEP_S)


@pytest.mark.slow
def test_the_finger_follows_on_an_explicit_plant_of_40_masses_within_three_hundredths_of_a_degree(designed):
    assert rms_deg(on_the_plant(designed.motor[:901], designed.tension_N[0])) < 0.03
    assert designed.status is MechanismStatus.DONE
    assert designed.tension_N.min() > SHARING.least_tension_N


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("mu", "stiffness", "tension", "most_deg"),
    [(0.12, 2e4, 1.0, 0.15), (0.18, 2e4, 1.0, 0.15), (0.18, 1.6e4, 0.8, 0.45)],
)
def test_a_wrong_friction_costs_less_than_a_sixth_of_the_ratio_alone(designed, mu, stiffness, tension, most_deg):
    off = on_the_plant(designed.motor, tension * designed.tension_N[0], mu=mu, stiffness=stiffness)
    assert rms_deg(off) < most_deg


@pytest.mark.parametrize("level", list(Level))
def test_the_response_to_the_inverse_is_the_motion(level):
    wanted = motion(0.6)
    asked = invert_mechanism(problem(wanted, level=level), wanted, STEP_S)
    found = simulate_mechanism(problem(wanted, level=level), asked.motor, STEP_S)
    assert np.abs(found.position - wanted).max() < 1e-10
    assert np.abs(found.tension_N - asked.tension_N).max() < 1e-6


def test_without_friction_motors_turn_by_lengths_and_stretch():
    """dX_t = -dL_t + T_t L_t/(k L), and R^T T is the torque."""
    wanted = motion(0.45)  # before the corner where the fade ends
    found = invert_mechanism(problem(wanted, mu=0.0), wanted, STEP_S)
    geometry = Geometry(tendons=finger(wanted).tendons, bodies=tuple(JOINTS))
    length = geometry.length_m(wanted)
    at_zero = np.array([sum(s.length_m or 0.0 for s in sections(arms)) for arms in ARMS.values()])
    stretch = found.tension_N / 2e4 * length / at_zero
    travel = -(length - length[0]) + stretch - stretch[0]
    assert found.motor * DRUM_M == pytest.approx(travel, abs=5e-6)  # inertia and viscous friction of the tendons
    speed = np.gradient(wanted, STEP_S, axis=0)
    torque = DAMPING * speed + np.array(list(JOINTS.values())) * np.gradient(speed, STEP_S, axis=0)
    given = np.einsum("rt,rtj->rj", found.tension_N, geometry.moment_arm_m(wanted))
    assert given[5:-5] == pytest.approx(torque[5:-5], abs=0.02 * np.ptp(given))


def test_tensions_change_slowly_where_changes_have_a_price(designed):
    steady = invert_mechanism(replace(problem(), sharing=replace(SHARING, change_weight=300.0)), WANTED, STEP_S)
    most = [np.abs(np.diff(run.tension_N[100:].sum(axis=1))).max() for run in (steady, designed)]
    assert 2 * most[0] < most[1]


def test_motors_that_give_torques_move_the_finger_alike(designed):
    torque = designed.effort + 1e-5 * np.gradient(np.gradient(designed.motor, STEP_S, axis=0), STEP_S, axis=0)
    found = simulate_mechanism(problem(forced=True), torque[:1001], STEP_S)
    assert found.status is MechanismStatus.DONE
    assert np.degrees(np.abs(found.position - WANTED[:1001]).max()) < 1.0


@pytest.mark.parametrize("name", ["hand_joint", "instrument_pair"])
def test_a_mechanism_with_one_joint_is_the_loop_or_pair(name):
    scenario = load_scenario(f"examples/{name}.toml")
    sampled, step = sample_joint(scenario), scenario.run.step_s
    known = joint_problem(scenario.mechanism, scenario.run.level, sampled.motion)
    rows = sampled.angle_rad[:800]
    asked = invert_joint(known, rows, step)
    drive = scenario.mechanism.drive
    joint = scenario.mechanism.joint.name
    same = mechanism_problem(
        describe(scenario.mechanism, sampled.motion),
        scenario.run.level,
        {joint: float(rows[0])},
        pretension_N={"motor": drive.pretension_N or 0.0},
        sharing=Sharing(least_tension_N=drive.least_tension_N or 2.0, smooth_N=1e-6, change_weight=0.0),
    )
    found = invert_mechanism(same, rows[:, None], step)
    assert found.motor == pytest.approx(asked.motor_rad, abs=2e-8)
    run, old = simulate_mechanism(same, asked.motor_rad, step), simulate_joint(known, asked.motor_rad, step)
    assert run.position[:, 0] == pytest.approx(old.angle_rad, abs=1e-8)
    assert run.tension_N == pytest.approx(old.tension_N, abs=2e-6)  # twice the barrier


def test_sections_act_with_local_tensions():
    """Virtual work: the torque on each joint is what its section takes off the length times the tension there."""
    tendon = finger().tendons[2]
    still = local_arms_m(tendon, dict.fromkeys(JOINTS, 0.5), {})
    pulled = local_arms_m(tendon, dict.fromkeys(JOINTS, 0.5), dict.fromkeys(JOINTS, 1.0))
    growth = np.exp(0.15 * 0.3)
    assert pulled["dip"] == pytest.approx(0.008 * growth**0.5)
    assert pulled["mcp"] == pytest.approx(0.002 * growth**2.5)
    assert still["mcp"] < 0.002 < pulled["mcp"]


def test_torques_out_of_reach_are_found_with_joint_and_row():
    whole, torque = problem(), np.zeros_like(WANTED)
    assert unreachable(whole, WANTED, torque) is None
    tendons = whole.mechanism.tendons[:3]  # without the extensor nothing opens the finger
    closing = replace(whole, mechanism=replace(whole.mechanism, tendons=tendons))
    found = unreachable(closing, WANTED, torque)
    assert found is not None
    assert found.row == 0
    assert found.body in JOINTS


def test_a_start_that_no_tensions_hold_is_refused_with_its_pose():
    whole = finger()
    flexors = Mechanism(bodies=whole.bodies[:-1], tendons=whole.tendons[:3], drives=whole.drives[:3])
    with pytest.raises(ParameterError, match=r"hold the joints at the start \(mcp 40.1 deg"):
        mechanism_problem(flexors, Level.ELASTIC, start_of(WANTED), sharing=SHARING)


def springed():
    """Two joints with springs on one tendon."""
    path = (
        Section(name="channel", angle_rad=1.5, length_m=0.2),
        Section(name="a", angle_rad=0.3, length_m=0.03, joint="a", length_per_rad_m=-0.010),
        Section(name="b", angle_rad=0.3, length_m=0.03, joint="b", length_per_rad_m=-0.007),
    )
    joints = tuple(
        Body(
            name=name,
            unit=Unit.RADIAN,
            inertia=inertia,
            loads=(Damper(damping=2e-3), Spring(stiffness=stiffness, rest=-0.3)),
            span=(0.0, 1.5),
        )
        for name, inertia, stiffness in (("a", 8e-5, 0.12), ("b", 3e-5, 0.10))
    )
    given = parts("mcp_flexor") | {
        "name": "flexor",
        "path": parameters.Path(total_angle_rad=2.1, segments=10, sections=path),
    }
    tendon = Tendon(**given, near=Attachment(arms=(Arm(body="motor", metres_per_unit=DRUM_M),)), far=Attachment())
    motor = Body(name="motor", unit=Unit.RADIAN, inertia=1e-5)
    return Mechanism(bodies=(*joints, motor), tendons=(tendon,), drives=(Lead(body="motor"),))


def test_a_joint_without_a_reference_follows_from_its_spring():
    """One tendon, two springed joints: the wanted one is exact, the other one is where the simulation puts it."""
    time = np.arange(601) * STEP_S
    wanted = 0.5 + 0.2 * (1 - np.cos(2 * np.pi * time / 0.6))
    under = mechanism_problem(springed(), Level.PRESLIDING, {"a": 0.5, "b": 0.5}, following=("b",))
    spring = [0.12 * (0.5 + 0.3), 0.10 * (under.start[1] + 0.3)]
    assert under.tension_N[0] * np.array([0.010, 0.007]) == pytest.approx(spring, rel=1e-9)
    asked = invert_mechanism(under, np.column_stack([wanted, np.zeros(601)]), STEP_S)
    assert asked.status is MechanismStatus.DONE
    found = simulate_mechanism(under, asked.motor, STEP_S)
    assert np.abs(found.position[:, 0] - wanted).max() < 1e-9
    assert np.abs(found.position - asked.position).max() < 1e-9
    assert np.ptp(asked.position[:, 1]) > 0.1


def test_friction_that_grows_with_a_bodys_load_is_refused_with_its_reason():
    own = finger()
    gear = DryFriction(coulomb=0.0, bristle_stiffness=50.0, soft_bristle_stiffness=5.0, lost_share=0.1)
    bodies = (replace(own.bodies[0], loads=(gear,)), *own.bodies[1:])
    geared = mechanism_problem(replace(own, bodies=bodies), Level.PRESLIDING, start_of(WANTED), sharing=SHARING)
    with pytest.raises(ParameterError, match=r'"mcp" has a DryFriction of lost_share = 0.1.*give gear_efficiency'):
        geared.laws()
