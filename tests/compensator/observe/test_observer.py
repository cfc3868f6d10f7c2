"""Output tension from the near end: an independent plant, a far end that something moves, other calls, lost inputs."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tendonff as tf
from tendonff.models.capstan import CapstanLaw
from tendonff.models.layout import ChainInputs
from tendonff.ocp.tendon.simulate import Simulator
from tests.independent_plant import respond

pytestmark = pytest.mark.compiler
STEP_S = 4e-3
"""Of the plant's rows; that of the scenario is 1 ms."""


@pytest.fixture(scope="module")
def finger(examples):
    scenario = tf.load_scenario(examples / "finger.toml")
    friction = replace(scenario.transmission.friction, mu_static=scenario.transmission.friction.mu_dynamic)
    transmission = replace(scenario.transmission, friction=replace(friction, mu_static_release=None))
    return replace(scenario, transmission=transmission)


@pytest.fixture(scope="module")
def plant(finger):
    """An independent plant of 12 masses under a force that turns round at several depths."""
    time = np.arange(0.0, 0.56, 4e-3)
    start = tf.sample_reference(finger).initial_tension_N
    force = start * (1 + 0.8 * np.sin(9 * time) * np.minimum(4 * time, 1) * (0.6 + 0.4 * np.cos(23 * time)))
    return time, respond(finger.transmission, time, force, start, masses=12)


def seen(observer, tension_N, position_m=None, dt=None, **more):
    """Value, low and high at each row, shape (rows, 3)."""
    positions = [None] * len(tension_N) if position_m is None else position_m
    rows = (
        observer.step(tension_N=t, position_m=q, dt=dt, **more).tension_N
        for t, q in zip(tension_N, positions, strict=True)
    )
    return np.array([(row.value, row.low, row.high) for row in rows])


def percent(values_N, truth_N):
    return 100 * float(np.sqrt(np.mean((values_N - truth_N) ** 2))) / float(np.ptp(truth_N))


def test_the_output_of_an_independent_plant_is_seen_and_enclosed(finger, plant, record_property):
    _, rig = plant
    for position in (None, rig.actuator_m):
        value, low, high = seen(tf.Observer(finger), rig.input_N, position, dt=STEP_S).T
        error = percent(value, rig.output_N)
        record_property("figure", f"observer {'with' if position is not None else 'without'} position: {error:.3f} %")
        assert error <= (0.5 if position is None else 0.8)
        assert np.all((low <= rig.output_N + 1e-6) & (rig.output_N <= high + 1e-6))
        assert percent(rig.input_N, rig.output_N) > 20  # what the input alone says


@pytest.mark.parametrize("corner", [(0.8, 1.2), (1.2, 0.8)])
def test_bounds_hold_on_a_plant_with_other_friction_each_way(finger, plant, corner):
    time, rig = plant
    friction = finger.transmission.friction
    pull, release = (
        factor * mu for factor, mu in zip(corner, (friction.mu_dynamic, friction.release_dynamic), strict=True)
    )
    changed = replace(friction, mu_dynamic=pull, mu_static=pull, mu_dynamic_release=release, mu_static_release=release)
    other = respond(
        replace(finger.transmission, friction=changed), time[:70], rig.input_N[:70], float(rig.input_N[0]), masses=6
    )
    _, low, high = seen(tf.Observer(finger), other.input_N, dt=STEP_S).T
    assert np.all((low <= other.output_N + 1e-6) & (other.output_N <= high + 1e-6))


@pytest.fixture(scope="module")
def held(finger):
    """A finger that something else moves by 2 mm to and fro while its actuator works."""
    step, start = finger.run.step_s, tf.sample_reference(finger).initial_tension_N
    chain = tf.Chain.of(finger.transmission, finger.run.level, 40)
    time = np.arange(0.0, 0.6, step)
    force = start * (1 + 0.5 * np.sin(17 * time) * np.minimum(5 * time, 1))
    inputs = ChainInputs.of(len(time), near_force_N=force, far_rest_m=2e-3 * np.sin(8 * time) * np.minimum(2 * time, 1))
    rest = chain.rest_state(start)
    rows = Simulator(chain, step, rest, inputs[:1]).advance(inputs[1:])
    return rows.tension_N, rows.ends_m[:, 0] - rest.near_position_m


def test_a_position_shows_a_far_end_that_something_else_moves(finger, held):
    tension_N, position_m = held
    blind = percent(seen(tf.Observer(finger), tension_N[:, 0])[:, 0], tension_N[:, -1])
    observer = tf.Observer(finger)
    value, low, high = seen(observer, tension_N[:, 0], position_m).T
    assert blind > 8
    assert percent(value, tension_N[:, -1]) < 0.35 * blind
    assert tf.ObserverStatus.FAR_MOVED in observer.status
    late = slice(100, None)
    assert np.all((low <= tension_N[:, -1])[late] & (tension_N[:, -1] <= high)[late])


def test_calls_at_another_rate_see_the_same(finger, plant):
    _, rig = plant
    often = seen(tf.Observer(finger), rig.input_N, dt=STEP_S)[3::3]
    seldom = seen(tf.Observer(finger), rig.input_N[3::3], dt=3 * STEP_S)
    assert percent(seldom[:, 0], often[:, 0]) < 1.0


def test_what_was_lost_is_not_known_until_the_tendon_has_slid(finger, plant):
    _, rig = plant
    observer = tf.Observer(finger)
    seen(observer, rig.input_N[:60], dt=STEP_S)
    for _ in range(20):
        last = observer.step(tension_N=math.nan, dt=STEP_S).tension_N
    assert observer.status == (tf.ObserverStatus.INPUT_HELD,)
    assert last.low == 0
    assert last.high > 2 * rig.input_N.max()
    value, low, high = seen(observer, rig.input_N[80:], dt=STEP_S).T
    assert np.all((low <= rig.output_N[80:]) & (rig.output_N[80:] <= high))
    assert np.abs(np.diff(value, prepend=last.value)).max() < 5
    fresh = high[-1] - low[-1]
    assert fresh < 0.6 * (high[0] - low[0])


def test_a_start_of_which_nothing_is_known_says_so(finger):
    known = tf.Observer(finger, start=40.0, given=50.0).step(tension_N=50.0).tension_N
    unknown = tf.Observer(finger, start=math.nan, given=50.0).step(tension_N=50.0).tension_N
    assert known.value == pytest.approx(40.0, abs=0.5)
    law = CapstanLaw.of(finger.transmission)
    assert unknown.low <= law.output_bounds_N(50.0)[0]
    assert unknown.high >= law.output_bounds_N(50.0)[1]
    with pytest.raises(tf.InputError, match="state the input tension"):
        tf.Observer(finger, start=math.nan)


def test_friction_that_sets_in_gradually_is_the_static_law_forward(finger):
    friction = replace(finger.transmission.friction, pull_spread=0.6, release_spread=0.4, adhesion_N=1.0)
    spread = replace(finger, transmission=replace(finger.transmission, friction=friction))
    start = tf.sample_reference(spread).initial_tension_N
    tension = start * (1 + 0.5 * np.sin(0.05 * np.arange(400)) * np.cos(0.013 * np.arange(400)))
    value, low, high = seen(tf.Observer(spread), tension).T
    assert value == pytest.approx(CapstanLaw.of(spread.transmission).output_history_N(tension, start), rel=1e-12)
    assert np.all((low <= value) & (value <= high))


def test_joint_angles_are_needed_where_joints_move_the_path(examples):
    observer = tf.Observer(examples / "finger_moving.toml")
    with pytest.raises(tf.ParameterError, match="must be the angles of"):
        observer.step(tension_N=30.0)
    angles = dict.fromkeys(observer.joints, 0.0)
    now = observer.step(tension_N=30.0, joints=angles).tension_N
    assert now.low <= now.value <= now.high
    assert tf.ObserverStatus.INPUT_HELD not in observer.status
