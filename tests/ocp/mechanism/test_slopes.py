"""Exact sensitivities of a mechanism's response against small differences of whole simulations."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.path import JointMotion
from tendonff.ocp.fits.mechanism import Change, Loop, MotorRun, respond, respond_with_slopes
from tendonff.ocp.mechanism.response import simulate_mechanism
from tendonff.ocp.mechanism.slopes import Direction, Start, simulate_slopes
from tendonff.ocp.mechanism.start import mechanism_problem

pytestmark = pytest.mark.compiler

STEP_S, ROWS = 1e-3, 201
TIME = np.arange(ROWS) * STEP_S
NUMBERS = {
    "tendons.mcp_flexor.friction.mu_dynamic": 0.15,
    "tendons.pip_flexor.tendon.stiffness_N_per_m": 2e4,
    "bristle_stiffness": 1.0,
    "joints.mcp.damping_N_m_s_per_rad": 1e-3,
}


@pytest.fixture(scope="module")
def bent(examples):
    """A finger whose tendons wrap more, and stretch less, as its joints bend."""
    finger = load_scenario(examples / "three_joint_finger.toml").mechanism
    tendons = []
    for tendon in finger.tendons:
        bends = tuple(replace(s, angle_per_rad=0.3) if s.joint else s for s in tendon.path.sections)
        tendons.append(replace(tendon, path=replace(tendon.path, sections=bends)))
    return replace(finger, tendons=tuple(tendons))


def at(finger, values):
    finger = with_numbers(finger, values)
    spans = np.outer([0.5, -0.2, 1.5], np.ones(3))
    whole = finger.mechanism(JointMotion(names=finger.names, time_s=np.arange(3.0), angle_rad=spans))
    start = dict.fromkeys(finger.names, 0.5)
    return Start.at_rest(mechanism_problem(whole, Level.PRESLIDING, start, sharing=finger.sharing, segments=4))


def between(start, key, value, share):
    sides = [start(NUMBERS | {key: value * (1 + way * share)}) for way in (1, -1)]
    return Direction(above=sides[0], below=sides[1], apart=2 * share * value)


def test_slopes_of_a_finger_are_those_of_differences_over_friction_stiffness_and_loads(bent):
    """Tendons drag both ways, wrap angles and lengths follow three free joints: no slope may be missing."""

    def start(values):
        return at(bent, values)

    size = 0.25 * np.minimum(TIME / 0.1, 1) * np.sin(6 * np.pi * TIME)
    motors = size[:, None] * np.array([1.0, -0.5, 0.7, -1.0])
    directions = [between(start, key, value, 1e-4) for key, value in NUMBERS.items()]
    run, slopes = simulate_slopes(start(NUMBERS), motors, STEP_S, directions)
    plain = simulate_mechanism(start(NUMBERS).problem, motors, STEP_S)
    np.testing.assert_array_equal(run.position, plain.position)
    for k, (key, value) in enumerate(NUMBERS.items()):
        small = between(start, key, value, 2e-6)
        above, below = (simulate_mechanism(each.problem, motors, STEP_S) for each in (small.above, small.below))
        for name in ("position", "effort", "tension_N"):
            expected = (getattr(above, name) - getattr(below, name)) / small.apart
            off = np.abs(getattr(slopes, name)[..., k] - expected).max()
            assert off < 1e-5 * np.abs(expected).max(), (key, name)


def test_a_direction_to_other_laws_is_refused(bent):
    still = np.zeros((2, 4))
    stribeck = replace(bent.tendons[0].friction, mu_static=0.2)
    other = replace(bent, tendons=(replace(bent.tendons[0], friction=stribeck), *bent.tendons[1:]))
    direction = Direction(above=at(other, {}), below=at(bent, {}), apart=1.0)
    with pytest.raises(ParameterError, match="direction 0 leads to a mechanism of other laws"):
        simulate_slopes(at(bent, {}), still, STEP_S, [direction])


LOOP = {
    "friction.mu_dynamic": (0.15, 1e-5),
    "drive.pretension_N": (40.0, 1e-3),
    "drive.coulomb_N_m": (0.01, 1e-5),
    "drive.gear_efficiency": (0.9, 1e-5),
    "drive.backlash_rad": (2e-3, 1e-7),
    "joints.knuckle.gravity_N_m": (0.02, 1e-5),
    "joints.knuckle.stop_high_rad": (0.8, 1e-6),
}


def test_slopes_of_what_a_motor_feels_are_those_of_differences(examples):
    """Gear and play turn over with the motor, the joint runs into its stop: the command itself depends on a number."""
    known = load_scenario(examples / "hand_joint.toml").mechanism
    stopped = replace(known.joint, stop_high_rad=0.8, stop_stiffness_N_m_per_rad=20.0)
    known = replace(known, joints=(stopped,))
    motor = 0.45 * (1 - np.cos(2 * np.pi * 2.5 * TIME))
    run = MotorRun.of_one(motor, STEP_S, 0.0)
    held = 0.2 * np.sin(2 * np.pi * 2.5 * TIME)

    def loop(values):
        return Loop(mechanism=with_numbers(known, values), slip_rad=3e-3, backlash_held_N_m=held)

    values = {key: value for key, (value, _) in LOOP.items()}
    changes = [
        Change(above=loop(values | {key: at + by}), below=loop(values | {key: at - by}), apart=2 * by)
        for key, (at, by) in LOOP.items()
    ]
    answer, slopes = respond_with_slopes(loop(values), run, changes, segments=4, refinement=2)
    assert answer.angle_rad.max() > 0.8  # else the stop is not touched
    assert not answer.slack
    for k, change in enumerate(changes):
        sides = [respond(each, run, segments=4, refinement=2) for each in (change.above, change.below)]
        for name in ("torque_N_m", "angle_rad"):
            expected = (getattr(sides[0], name) - getattr(sides[1], name)) / change.apart
            off = np.abs(getattr(slopes, name)[..., k] - expected)
            assert np.quantile(off, 0.98) <= 1e-5 * np.abs(expected).max(), (list(LOOP)[k], name)
