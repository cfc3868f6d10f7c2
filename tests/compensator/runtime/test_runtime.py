"""Compensators step by step in Python: the numbers of model and exported C, other steps, pauses, and states."""

import dataclasses
import itertools
import json
import math
import time

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.motors.adaptation import TunedJoint
from tendonff.compensator.compensators.motors.drive import commanded
from tendonff.compensator.compensators.motors.joint import inverse_of
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.export.joint.text import problem_of
from tendonff.compensator.runtime.code import tendon_runtime
from tendonff.compensator.scenario.driven.joint import sample_joint
from tendonff.compensator.studies.adapt.loop import inverses
from tendonff.models.joint.parameters import DrivenJoint
from tendonff.ocp.adaptation.joint_tuner import JointTuner
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError

pytestmark = pytest.mark.compiler
HELD = (tf.RuntimeStatus.INPUT_HELD,)
RANGE = tf.RuntimeStatus.RANGE


@pytest.fixture(scope="module", params=["hand_joint", "instrument_pair"])
def joint(request, examples):
    """A joint, its samples, and what the model commands the motors at each, shape (rows, motors)."""
    scenario = tf.load_scenario(examples / f"{request.param}.toml")
    sampled = sample_joint(scenario)
    found, _ = inverse_of(scenario, sampled, problem_of(scenario, sampled))
    motor_rad = commanded(scenario.mechanism.drive, found.motor_rad, scenario.run.step_s, live=True)
    return scenario, sampled, motor_rad


@pytest.fixture(scope="module")
def tuned(examples):
    return tf.load_scenario(examples / "finger_adaptive.toml")


def commands(runtime, references, dt=None):
    return np.array([np.atleast_1d(runtime.step(float(each), dt=dt)) for each in references])


@pytest.mark.parametrize(
    ("given", "named"),
    [(("0.1",), "reference"), (([0.1],), "reference"), ((0.1, "1e-3"), "dt"), ((0.1, None, "x"), "measured")],
)
def test_what_is_no_number_is_refused_by_name_and_value(examples, given, named):
    runtime = tf.Runtime(examples / "hand_joint_adaptive.toml")
    with pytest.raises(tf.ParameterError, match=f"{named} must be a number, got "):
        runtime.step(*given)


def test_a_measurement_that_nothing_uses_is_refused(examples):
    runtime = tf.Runtime(examples / "hand_joint.toml")
    with pytest.raises(tf.ParameterError, match=r"measured = 0\.1 is for a scenario with"):
        runtime.step(0.1, measured=0.1)


@pytest.mark.parametrize(
    ("file", "name", "inside", "beyond"),
    [
        ("hand_joint", "reference", 0.2, 20.0),
        ("finger", "reference", 30.0, 3000.0),
        ("finger_moving", "knuckle", 0.0, 40.0),
    ],
)
def test_a_number_out_of_range_has_a_status_of_its_own(examples, file, name, inside, beyond):
    """An angle in degrees, a tension in mN."""
    runtime = tf.Runtime(examples / f"{file}.toml")
    low, high = runtime.ranges[name]
    assert low < inside < high < beyond
    still = dict.fromkeys(runtime.joints, 0.0)
    runtime.step(runtime.start, joints=still)
    before = runtime.step(runtime.start, joints=still)
    wrong = (beyond, still) if name == "reference" else (runtime.start, still | {name: beyond})
    assert runtime.step(wrong[0], joints=wrong[1]) == before
    assert RANGE in runtime.status
    assert tf.RuntimeStatus.INPUT_HELD not in runtime.status
    runtime.step(None, joints=still)
    assert tf.RuntimeStatus.INPUT_HELD in runtime.status
    assert RANGE not in runtime.status


def test_several_joints_have_a_range_each(examples):
    runtime = tf.Runtime(examples / "three_joint_finger.toml")
    assert set(runtime.ranges) == set(runtime.joints)
    before = runtime.step(dict.fromkeys(runtime.joints, 0.3))
    assert (runtime.step([17.0, 29.0, 11.0]) == before).all()
    assert runtime.status == (RANGE,)


@pytest.mark.parametrize(
    ("file", "line", "key", "given"),
    [
        ("hand_joint", "gravity_zero_rad = 0.0", "range_rad", "[-0.3, 1.2]"),
        ("finger", 'kind = "sine"', "range_N", "[5.0, 60.0]"),
        ("finger_moving", "[joints.knuckle]", "range_rad", "[-1.0, 2.0]"),
    ],
)
def test_the_range_is_a_key_of_the_scenario(examples, tmp_path, file, line, key, given):
    text = (examples / f"{file}.toml").read_text()
    text = "\n".join(row for row in text.splitlines() if not row.startswith("range_"))
    (tmp_path / "own.toml").write_text(text.replace(line, f"{line}\n{key} = {given}", 1))
    name = "knuckle" if file == "finger_moving" else "reference"
    assert list(tf.Runtime(tmp_path / "own.toml").ranges[name]) == json.loads(given)
    (tmp_path / "own.toml").write_text(text.replace(line, f"{line}\n{key} = [0.05, 0.1]", 1))
    with pytest.raises(tf.InputError, match=rf"{key} = \[0.05, 0.1\] .*does not hold .*; widen it"):
        tf.Runtime(tmp_path / "own.toml")


def test_a_joint_without_stops_takes_a_quarter_turn_beyond_its_reference_and_one_with_stops_those():
    free = DrivenJoint(name="a", inertia_kg_m2=1e-5)
    assert free.accepted_rad(0.0, 1.0) == pytest.approx((-math.pi / 2, 1.0 + math.pi / 2))
    stopped = DrivenJoint(name="a", inertia_kg_m2=1e-5, stop_high_rad=1.2, stop_stiffness_N_m_per_rad=100.0)
    assert stopped.accepted_rad(0.0, 1.0) == pytest.approx((-math.pi / 2, 1.2))


def test_a_joint_is_commanded_as_its_design_says(joint):
    scenario, sampled, motor_rad = joint
    runtime = tf.Runtime(scenario)
    assert runtime.kind is tf.RuntimeKind.JOINT
    assert commands(runtime, sampled.angle_rad) == pytest.approx(motor_rad, abs=1e-9)
    assert runtime.status == ()


def test_a_joint_tunes_itself_as_the_model_of_its_tuner_does(examples):
    """Of a rig with a third less lost motion, whose motor may turn at half its speed."""
    scenario = tf.load_scenario(examples / "hand_joint_adaptive.toml")
    drive = dataclasses.replace(scenario.mechanism.drive, speed_max_rad_per_s=2.5)
    scenario = dataclasses.replace(scenario, mechanism=dataclasses.replace(scenario.mechanism, drive=drive))
    sampled = sample_joint(scenario)
    motor, command = inverses(scenario, sampled)
    tuning, angle = TunedJoint.of(scenario, sampled).tuning, sampled.angle_rad[:1200]
    rng = np.random.default_rng(1)
    measured = angle + 0.3 * (motor[: len(angle), 1] - angle) + 4e-4 * rng.standard_normal(len(angle))
    model = JointTuner(tuning, angle, motor[: len(angle)], command[: len(angle)], 2.5 * scenario.run.step_s)
    runtime = tf.Runtime(scenario)
    found = []
    for row in range(1, len(angle)):
        told = float(runtime.step(float(angle[row]), measured=float(measured[row - 1])))
        found.append((told - model.step(float(measured[row - 1])), runtime.factor - model.factor))
    assert np.abs(found).max() < 1e-8
    assert abs(model.factor - 1) > 0.05


def test_seventeen_joints_take_less_than_a_millisecond_a_cycle(joint):
    """Of the processor; the best of some cycles, since others may use it too. Usual are 0.1 to 0.2 ms."""
    scenario, sampled, _ = joint
    runtime, spent = tf.Runtime(scenario), []
    for part in np.array_split(sampled.angle_rad[:500], 10):
        start = time.process_time()
        for angle in part.tolist():
            runtime.step(angle)
        spent.append((time.process_time() - start) / len(part))
    assert 17 * min(spent) < 1e-3


def test_calls_after_5_to_15_ms_follow_the_course_of_those_after_1_ms(joint):
    """The motors stay within 0.2 deg of the inverse at the scenario's own rate."""
    scenario, sampled, motor_rad = joint
    runtime = tf.Runtime(scenario)
    times = np.cumsum(np.random.default_rng(3).uniform(5e-3, 15e-3, 200))
    runtime.step(float(sampled.angle_rad[0]))
    errors = []
    for before, now in itertools.pairwise([0.0, *times[times < sampled.time_s[-1]]]):
        wanted = np.interp(now, sampled.time_s, sampled.angle_rad)
        expected = [np.interp(now, sampled.time_s, column) for column in motor_rad.T]
        errors.append(np.abs(runtime.step(float(wanted), dt=now - before) - np.array(expected)).max())
        assert runtime.status == ()
    assert math.degrees(max(errors)) < 0.2


@pytest.mark.parametrize("lost", ["nothing called", "nothing arrived"])
@pytest.mark.parametrize("at", [0.45, 0.63])
def test_after_a_pause_of_half_a_second_no_motor_jumps(joint, lost, at):
    """From the last command the motors set out smoothly to where the reference has gone, and reach it."""
    scenario, sampled, motor_rad = joint
    runtime, gap = tf.Runtime(scenario), round(0.5 / scenario.run.step_s)
    at = round(at * (len(motor_rad) - gap))
    before = commands(runtime, sampled.angle_rad[:at])[-1]
    if lost == "nothing arrived":
        assert all(np.all(runtime.step(None) == before) and HELD[0] in runtime.status for _ in range(gap))
    first = runtime.step(float(sampled.angle_rad[at + gap]), dt=0.5 if lost == "nothing called" else None)
    assert (tf.RuntimeStatus.PAUSE in runtime.status) is (lost == "nothing called")
    after = np.vstack([[before], [np.atleast_1d(first)], commands(runtime, sampled.angle_rad[at + gap + 1 :])])
    steps = np.degrees(np.abs(np.diff(after, axis=0)))
    assert steps[:5].max() < 0.2
    assert after[-1] == pytest.approx(motor_rad[-1], abs=1e-3)


def test_one_tendon_is_commanded_as_its_exact_inverse_says(examples):
    """On a path that joints move, whose angles go by name or in order."""
    scenario = tf.load_scenario(examples / "finger_moving.toml")
    problem = Problem.of(scenario)
    rows = slice(0, 400)
    angles = problem.chain.motion.at(problem.reference.time_s[rows])
    runtime = tf.Runtime(scenario)
    named = [dict(zip(runtime.joints, row, strict=True)) for row in angles]
    given = [row.tolist() if k % 2 else named[k] for k, row in enumerate(angles)]
    found = [runtime.step(float(t), joints=q) for t, q in zip(problem.reference.tension_N[rows], given, strict=True)]
    expected = tf.invert(problem.chain, problem.reference.tension_N[rows], problem.reference.step_s)
    assert found == pytest.approx(expected.force_N, abs=1e-9)
    with pytest.raises(tf.ParameterError, match=r"must be 2 angles \(knuckle, middle\), got 0"):
        runtime.step(30.0)
    with pytest.raises(tf.ParameterError, match="none of middle"):
        runtime.step(30.0, joints={"knuckle": 0.0})


@pytest.mark.parametrize("kind", list(tf.RuntimeKind)[:3])
def test_calls_at_half_the_rate_follow_the_course_of_all_calls(tuned, kind):
    """Of stream and tuner the samples between them, on a straight line; of the inverse steps of twice the length."""
    problem = Problem.of(tuned)
    tension, step = problem.reference.tension_N[:1001], problem.reference.step_s
    every = commands(tf.Runtime(tuned, kind=kind), tension)
    half = commands(tf.Runtime(tuned, kind=kind), tension[::2], dt=2 * step)
    if kind is not tf.RuntimeKind.INVERSE:  # they have no sample at t = 0: the first call has passed two
        half, every = half[1:], every[2:]
    assert np.abs(half - every[: 2 * len(half) : 2]).max() < 0.01 * np.ptp(every)


def test_steps_of_another_length_are_those_of_a_scenario_with_that_step(tuned):
    """The exact inverse of every second sample, solved at twice the step."""
    problem = Problem.of(tuned)
    tension, step = problem.reference.tension_N[:801:2], 2 * problem.reference.step_s
    found = commands(tf.Runtime(tuned, kind="inverse"), tension, dt=step)[:, 0]
    assert found == pytest.approx(tf.invert(problem.chain, tension, step).force_N, abs=1e-8)


@pytest.mark.parametrize("kind", ["inverse", "stream"])
def test_a_runtime_has_the_numbers_of_the_exported_c(tuned, kind):
    tension = Problem.of(tuned).reference.tension_N[:500]
    code = tendon_runtime(tuned, tf.RuntimeKind(kind))
    (found,) = run_on_host(code.sources, "tff", Precision.DOUBLE, [{kind: tension}])
    assert np.array_equal(commands(tf.Runtime(tuned, kind=kind), tension)[:, 0], found[kind])


def test_a_state_goes_on_where_it_was_taken(tuned):
    tension = Problem.of(tuned).reference.tension_N
    runtime = tf.Runtime(tuned)
    for k in range(200):
        runtime.step(float(tension[k]), measured=float(tension[k - 1]))
    kept = runtime.state()
    first, again = [], tf.Runtime(tuned)
    for each, found in ((runtime, first), (again, second := [])):
        each.restore(kept)
        found += [each.step(float(tension[k]), measured=float(tension[k - 1])) for k in range(200, 300)]
    assert first == second
    with pytest.raises(tf.InputError, match=r'of kind "adaptive" .* not of "inverse"'):
        tf.Runtime(tuned, kind="inverse").restore(kept)


@pytest.mark.parametrize("name", ["finger_adaptive", "hand_joint"])
def test_a_state_that_is_not_as_it_was_written_is_refused_and_changes_nothing(examples, name):
    runtime = tf.Runtime(examples / f"{name}.toml")
    wanted = [runtime.start + each for each in (0.0, 1e-3, 2e-3)]
    for each in wanted:
        runtime.step(each)
    kept, random = runtime.state(), np.random.default_rng(0)
    bad = [
        b"",
        kept.content[:-8],
        kept.content + bytes(8),
        random.bytes(len(kept.content)),
        b"\xff" * len(kept.content),
    ]
    for _ in range(40):
        damaged = bytearray(kept.content)
        damaged[random.integers(len(damaged))] ^= 1 << random.integers(8)
        bad.append(bytes(damaged))
    for content in bad:
        with pytest.raises(tf.InputError, match="the content of this state is damaged"):
            runtime.restore(dataclasses.replace(kept, content=content))
    assert runtime.state().content == kept.content


def test_what_is_no_state_no_start_and_no_joint_is_refused_by_name(examples):
    runtime = tf.Runtime(examples / "finger.toml")
    with pytest.raises(tf.InputError, match=r"state must be a RuntimeState, got bytes; keep what state\(\) gives"):
        runtime.restore(runtime.state().content)
    with pytest.raises(tf.ParameterError, match="joints has 'wrist', which no step takes; it takes none"):
        runtime.step(31.0, joints={"wrist": 0.1})
    with pytest.raises(tf.ParameterError, match="start must be a number, got '30'"):
        tf.Runtime(examples / "finger.toml", start="30")


def test_a_state_of_another_version_is_refused(tuned, monkeypatch):
    kept = tf.Runtime(tuned).state()
    monkeypatch.setattr("tendonff.compensator.runtime.runtime.__version__", "0.0.1")
    with pytest.raises(tf.InputError, match="of another version"):
        tf.Runtime(tuned).restore(kept)


@pytest.mark.parametrize("dt", [math.nan, -1e-3])
def test_a_time_that_is_none_holds_the_command(tuned, dt):
    runtime = tf.Runtime(tuned, kind="inverse")
    force = [runtime.step(each) for each in (30.0, 30.1, 30.2)][-1]
    assert runtime.step(31.0, dt=dt) == force
    assert runtime.status == HELD


def test_what_a_scenario_has_no_runtime_for_is_refused(tuned, examples):
    with pytest.raises(tf.InputError, match='kind must be one of inverse, stream, adaptive, joint, got "optimal"'):
        tf.Runtime(tuned, kind="optimal")
    with pytest.raises(tf.InputError, match=r"finger\.toml: table \[adaptation\] is missing"):
        tf.Runtime(examples / "finger.toml", kind="adaptive")
    with pytest.raises(tf.InputError, match='a driven joint has the kinds "joint" and "adaptive", got "inverse"'):
        tf.Runtime(examples / "hand_joint.toml", kind="inverse")
    with pytest.raises(tf.InputError, match="cannot start at 1e"):
        tf.Runtime(tuned, kind="inverse", start=1e9)


def test_without_a_compiler_the_refusal_names_what_was_looked_for_and_what_to_install(tuned, monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("tendonff.compensator.export.host.find_compiler", lambda: None)
    way = r'looked for cc, gcc, clang and .* ziglang\).*`pip install "tendonff\[compiler\]"`'
    with pytest.raises(CodeError, match=way):
        tf.Runtime(tuned, kind="inverse")
