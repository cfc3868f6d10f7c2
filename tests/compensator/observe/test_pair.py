"""Angle and torque of a joint on a spring from the tensions at the drums of its two motors."""

from dataclasses import replace

import numpy as np
import pytest

import tendonff as tf
from tendonff.models.parameters.numbers import with_numbers
from tests.bent_instrument import BentInstrument, motion_of, scenario

pytestmark = pytest.mark.compiler

BEND_RAD, EVERY, STEP_S = 1.8, 20, 0.02


@pytest.fixture(scope="module")
def seen():
    """Tensions at the drums of the explicit plant each 20 ms, and what its wrist does."""
    rig, time = BentInstrument.drawn(3), np.arange(2501) * 1e-3
    _, found = rig.turned(BEND_RAD, *motion_of(np.random.default_rng(2), time), time, masses=6, step_s=4e-6)
    return rig, found.drum_N[::EVERY], found.angle_rad[::EVERY, 0]


def observer(rig, mu=1.0):
    return tf.Observer(replace(scenario(), mechanism=with_numbers(rig.mechanism, {"mu": mu})))


def test_tensions_tell_the_joint_and_friction_a_tenth_off_stays_within_the_bounds(seen):
    rig, tensions, angle = seen
    known, off = observer(rig), observer(rig, 1.1)
    found = np.array([known.step(tension_N=t, joints=[BEND_RAD], dt=STEP_S).angle_rad.value for t in tensions])
    assert np.ptp(angle) > 0.6
    assert np.degrees(np.sqrt(np.mean((found - angle) ** 2))) < 0.3
    bounded = [off.step(tension_N=t, joints={"bend": BEND_RAD}, dt=STEP_S).angle_rad for t in tensions]
    inside = [e.low - 2e-3 <= q <= e.high + 2e-3 for e, q in zip(bounded, angle, strict=True)]
    assert np.mean(inside) > 0.9  # at reversals the answers cross
    plain = observer(rig)
    straight = np.array([plain.step(tension_N=t, joints=[0.0], dt=STEP_S).angle_rad.value for t in tensions])
    assert np.std(straight - angle) > 3 * np.std(found - angle)


def test_a_torque_at_the_joint_is_that_of_its_spring_where_it_rests(seen):
    rig, tensions, _ = seen
    watched = observer(rig)
    for _ in range(20):
        last = watched.step(tension_N=tensions[-1], joints=[BEND_RAD], dt=STEP_S)
    spring = rig.mechanism.joint.stiffness_N_m_per_rad * last.angle_rad.value
    assert last.torque_N_m.value == pytest.approx(spring, abs=1.1 * rig.mechanism.joint.coulomb_N_m)


def test_a_step_without_a_tension_holds_the_last_answer_and_says_so(seen):
    rig, tensions, _ = seen
    watched = observer(rig)
    before = watched.step(tension_N=tensions[0], joints=[BEND_RAD], dt=STEP_S)
    for missing in ((float("nan"), 5.0), None):
        assert watched.step(tension_N=missing, joints=[BEND_RAD], dt=STEP_S) == before
        assert watched.status == (tf.ObserverStatus.INPUT_HELD,)
    watched.step(tension_N=tensions[1], joints=[BEND_RAD], dt=STEP_S)
    assert watched.status == ()


def test_other_numbers_than_two_tensions_are_refused(seen):
    watched = observer(seen[0])
    for wrong in ({"tension_N": 3.0}, {"tension_N": (1.0, 2.0, 3.0)}, {"tension_N": (1.0, 2.0), "position_m": 0.0}):
        with pytest.raises(tf.ParameterError, match="a pair takes 2 tensions alone"):
            watched.step(joints=[BEND_RAD], **wrong)
