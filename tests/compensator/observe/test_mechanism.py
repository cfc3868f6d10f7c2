"""Angle and torque of a joint from angle and torque of its motor: what it touches is found, a pair is refused."""

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.compensators.motors.joint import linear_motor_rad
from tendonff.compensator.observe.mechanism import rubbing
from tendonff.compensator.scenario.driven.joint import sample_joint
from tendonff.ocp.joint.start import joint_problem
from tests.compensator.export.test_joint_export import changed

pytestmark = pytest.mark.compiler
TOUCH = slice(300, 400)
"""Rows in which the contact comes up to 0.1 N m."""


@pytest.fixture(scope="module")
def hand(examples, tmp_path_factory):
    return changed(examples / "hand_joint.toml", tmp_path_factory.mktemp("hand") / "hand.toml")


@pytest.fixture(scope="module")
def touching(hand):
    """Finer joint with 10 % more friction that touches something, under a motor that goes by the ratio alone."""
    sampled = sample_joint(hand)
    motor = linear_motor_rad(hand, sampled).reshape(-1, 1)
    contact = 0.1 * np.clip((np.arange(len(motor)) - TOUCH.start) / (TOUCH.stop - TOUCH.start), 0, 1)
    problem = joint_problem(rubbing(hand.mechanism, 1.1), hand.run.level, sampled.motion, segments=12)
    return tf.simulate(problem, motor, hand.run.step_s, contact_N_m=contact).require()


def seen(hand, run, torque):
    observer = tf.Observer(hand)
    rows = [
        observer.step(motor_rad=float(q), motor_torque_N_m=float(t) if torque else None)
        for q, t in zip(run.motor_rad[1:, 0], run.motor_torque_N_m[1:, 0], strict=True)
    ]
    return [
        np.array([(e.value, e.low, e.high) for e in column])
        for column in zip(*((r.angle_rad, r.torque_N_m) for r in rows), strict=True)
    ]


def rms(values):
    return float(np.sqrt(np.mean(np.asarray(values) ** 2)))


def test_the_torque_of_the_motor_shows_what_the_joint_touches(hand, touching, record_property):
    after = slice(TOUCH.stop + 100, None)
    blind, (angle, torque) = seen(hand, touching, False)[0], seen(hand, touching, True)
    there, pulled = touching.angle_rad[1:], touching.torque_N_m[1:]
    without, within = (np.degrees(rms(x[:, 0] - there)) for x in (blind, angle))
    record_property(
        "figure", f"joint touching 0.1 N m: {within:.2f} deg with the motor's torque, {without:.2f} without"
    )
    assert within < 0.4
    assert without > 1.5
    assert rms(torque[:, 0] - pulled) < 0.015
    for found, truth, slack in ((angle, there, 2e-3), (torque, pulled, 2e-3)):
        assert np.all((found[after, 1] <= truth[after] + slack) & (truth[after] <= found[after, 2] + slack))


def test_a_pair_is_refused_with_the_reason(examples):
    with pytest.raises(tf.InputError, match="two motors that share the load"):
        tf.Observer(examples / "instrument_pair.toml")


def test_an_observer_of_a_joint_takes_no_tension(hand):
    with pytest.raises(tf.ParameterError, match="motor_rad and motor_torque_N_m"):
        tf.Observer(hand).step(tension_N=3.0)
