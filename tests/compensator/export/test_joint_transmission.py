"""The exported joint the other way round, and as a ros2_control transmission."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import tendonff as tf
from benchmarks.joint_glitches import Course, Fault
from tendonff.compensator.compensators.motors.joint import linear_motor_rad
from tendonff.compensator.export.host import compile_on_host
from tendonff.compensator.export.joint.project import export_joints
from tendonff.compensator.export.joint.text import joint_sources, problem_of
from tendonff.compensator.scenario.driven.joint import sample_joint
from tendonff.ocp.codegen.precision import Precision
from tests.compensator.export.test_joint_export import changed

pytestmark = pytest.mark.compiler
HERE = Path(__file__).parent
DRIVER = """#include "tff_joint.h"
int observe(long n, const tff_real *motor, tff_real *angle)
{
    static tff_joint self;
    long k;
    int good = tff_joint_init(&self, 0, angle[0], 0);
    for (k = 1; k < n; k++) {
        good = good && (tff_joint_observe(&self, TFF_STEP_S, motor[k], 0) == TFF_OK);
        angle[k] = self.angle_rad;
    }
    return good && (tff_joint_observe(&self, TFF_STEP_S, 1e3, 0) == TFF_INPUT_HELD) && (self.angle_rad == angle[n - 1])
        && (tff_joint_observe(&self, -TFF_STEP_S, 0, 0) == TFF_INPUT_HELD);
}
"""


@pytest.fixture(scope="module")
def hand(examples, tmp_path_factory):
    return changed(examples / "hand_joint.toml", tmp_path_factory.mktemp("hand") / "hand.toml")


@pytest.mark.parametrize(("precision", "most_rad"), [(Precision.DOUBLE, 1e-8), (Precision.FLOAT, 3e-4)])
def test_the_observer_says_where_the_forward_simulation_has_the_joint(hand, precision, most_rad):
    """The motor goes by the ratio alone, which leaves the joint 0.8 deg behind. A motor that jumps is reported."""
    sampled = sample_joint(hand)
    motor = linear_motor_rad(hand, sampled)
    code = compile_on_host(joint_sources((hand,), precision=precision), DRIVER, precision)
    angle = code.array(sampled.angle_rad.copy())
    call = code.function("observe", ctypes.c_long, *(code.reals,) * 2, result=ctypes.c_int)
    assert call(len(motor), code.array(motor.ravel()), angle) == 1
    there = tf.simulate(problem_of(hand, sampled), motor.reshape(-1, 1), hand.run.step_s).angle_rad
    assert np.abs(there - sampled.angle_rad).max() > 0.01
    assert np.abs(angle - there).max() < most_rad


@pytest.fixture(scope="module")
def course(examples):
    return Course.of(tf.load_scenario(examples / "hand_joint.toml"))


@pytest.mark.parametrize(("samples", "jump_rad", "longest"), [(2, 2 * np.pi, 0), (20, 1.0, 0), (400, -2 * np.pi, 150)])
@pytest.mark.parametrize("start", [0.2, 0.45, 0.7])
def test_an_observer_comes_back_after_a_fault_of_the_encoder(course, start, samples, jump_rad, longest):
    """At once, to 2 deg meanwhile; after 0.1 s without a good angle from rest at the nearest one, which is flagged."""
    right, usual = course.observed(course.motor_rad)
    assert not usual.any()
    fault = Fault(start=start, samples=samples, jump_rad=jump_rad)
    angle, status = course.observed(course.faulty(fault))
    at = round(start * len(angle))
    assert np.all(status[at : at + min(samples, 40)] == 1)
    later = at + samples + longest
    assert np.abs(angle - right)[later:].max() < np.deg2rad(0.2)
    assert not status[later:].any()
    assert np.any(status == 2048) == (longest > 0)
    if not longest:
        assert np.abs(angle - right).max() < np.deg2rad(2)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e9])
def test_a_contact_that_is_no_number_holds_the_observer(course, bad):
    contact = np.zeros_like(course.motor_rad)
    contact[400:410] = bad
    right, _ = course.observed(course.motor_rad)
    angle, status = course.observed(course.motor_rad, contact)
    assert np.all(status[400:410] == 1)
    assert np.all(angle[400:410] == angle[399])
    assert np.abs(angle - right)[410:].max() < 1e-3


def test_noise_without_end_is_refused_and_starts_nothing_again(course):
    motor = course.motor_rad + 5.0 * np.random.default_rng(1).standard_normal(len(course.motor_rad))
    angle, status = course.observed(motor)
    assert np.all(np.isfinite(angle))
    assert np.mean(status == 1) > 0.5
    assert np.ptp(angle) < 4


INIT_AT = """#include <math.h>
#include "tff_joint.h"
int start(const tff_real *motor, tff_real *command, tff_real *plain)
{
    static tff_joint self, usual, none;
    int k, good = tff_joint_init_at(&self, 0, 0.1, motor, 0) && tff_joint_init(&usual, 0, 0.1, 0);
    *command = self.command_rad[0];
    for (k = 0; k < 50; k++) {
        (void)tff_joint_step(&self, 0.1 + (0.002 * k), 0);
        (void)tff_joint_step(&usual, 0.1 + (0.002 * k), 0);
    }
    plain[0] = self.command_rad[0] - usual.command_rad[0];
    good = good && tff_joint_init_at(&none, 0, 0.1, motor, 0);
    good = good && (tff_joint_observe(&none, TFF_STEP_S, *motor, 0) == TFF_OK) && (fabs(none.angle_rad - 0.1) < 1e-9);
    good = good && (tff_joint_init_at(&none, 0, 0.1, &plain[1], 0) == 0);
    return good && (tff_joint_step(&none, 0.1, 0) == TFF_FAILED);
}
"""


def test_a_joint_starts_from_where_its_motor_is(hand):
    code = compile_on_host(joint_sources((hand,)), INIT_AT, Precision.DOUBLE)
    command, plain = code.array(np.zeros(1)), code.array(np.array([0.0, np.nan]))
    call = code.function("start", *(code.reals,) * 3, result=ctypes.c_int)
    assert call(code.array(np.array([3.5])), command, plain) == 1
    assert command[0] == pytest.approx(3.5, abs=1e-12)
    assert plain[0] == pytest.approx(3.5, abs=1e-9)


PAIR = """#include "tff_joint.h"
int follow(long n, const tff_real *motor, tff_real *angle, tff_real *tension, tff_real *slack)
{
    static tff_joint self;
    long k;
    int good = tff_joint_init(&self, 0, angle[0], 0);
    for (k = 1; k < n; k++) {
        const uint32_t status = tff_joint_observe_motors(&self, TFF_STEP_S, &motor[2 * k], 0);
        good = good && ((status & ~(TFF_SLACK | TFF_TORQUE_LIMITED)) == TFF_OK);
        slack[k] = ((status & TFF_SLACK) != 0u) ? self.slack_m : 0;
        angle[k] = self.angle_rad;
        tension[2 * k] = self.tension_N[0];
        tension[(2 * k) + 1] = self.tension_N[1];
    }
    return good && (tff_joint_observe(&self, TFF_STEP_S, 0, 0) == TFF_FAILED);
}
"""


@pytest.mark.parametrize(
    ("precision", "together_rad", "most_rad", "most_N"),
    [
        (Precision.DOUBLE, 0.015, 1e-8, 1e-6),
        (Precision.FLOAT, 0.015, 1e-4, 0.02),
        (Precision.DOUBLE, -0.05, 3e-4, 0.1),  # slack for a while, where the simulation ends a step in parts
    ],
)
def test_the_plant_of_a_pair_goes_where_the_simulation_has_it(examples, precision, together_rad, most_rad, most_N):
    """Both motors pull more or less at once, so that they share the load otherwise than the inverse would."""
    pair = tf.load_scenario(examples / "instrument_pair.toml")
    sampled = sample_joint(pair)
    motor = linear_motor_rad(pair, sampled) + together_rad * (1 - np.cos(7 * sampled.time_s))[:, None]
    code = compile_on_host(joint_sources((pair,), precision=precision), PAIR, precision)
    angle, slack = code.array(sampled.angle_rad.copy()), code.array(np.zeros(len(motor)))
    tension = code.array(np.zeros(motor.shape))
    call = code.function("follow", ctypes.c_long, *(code.reals,) * 4, result=ctypes.c_int)
    assert call(len(motor), code.array(motor), angle, tension, slack) == 1
    there = tf.simulate(problem_of(pair, sampled), motor, pair.run.step_s)
    assert np.abs(there.angle_rad - sampled.angle_rad).max() > 0.005
    assert np.abs(angle - there.angle_rad).max() < most_rad
    assert np.abs(tension - there.tension_N)[1:].max() < most_N
    assert (slack.max() > 1e-4) == (together_rad < 0)


def test_the_ros_2_transmission_commands_as_the_runtime_and_sees_the_joint(hand, tmp_path):
    """Compiled against minimal headers with the names and signatures of ros2_control, not against ROS itself."""
    if shutil.which("g++") is None or shutil.which("gcc") is None:
        pytest.skip("g++ is not installed")
    folder, program = tmp_path / "c", tmp_path / "transmission"
    export_joints(hand).write(folder)
    package = folder / "ros2" / "tff_transmission"
    flags = ("-O0", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-I", folder)
    subprocess.run(["gcc", *flags, "-c", folder / "tff_joint.c", "-o", tmp_path / "joint.o"], check=True)
    stubs = HERE / "ros2_transmission"
    sources = (stubs / "main.cpp", package / "tff_transmission_loader.cpp", tmp_path / "joint.o")
    command = [
        "g++",
        "-std=c++17",
        *flags,
        "-I",
        HERE / "ros2_transmission",
        "-I",
        package,
        *sources,
        "-lm",
        "-o",
        program,
    ]
    subprocess.run(command, check=True)
    wanted = 0.3 * np.sin(np.linspace(0, 6, 300)) ** 2
    given = "\n".join(repr(float(0.25 + angle / 2)) for angle in wanted)  # offset and reduction of the joint
    done = subprocess.run([program, "knuckle"], input=given, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    motor, seen = np.array([list(map(float, line.split())) for line in done.stdout.splitlines()]).T
    runtime = tf.Runtime(hand)
    expected = [1.0 - 30.0 * runtime.step(float(angle), dt=2e-3) for angle in wanted]
    assert motor == pytest.approx(expected, abs=1e-10)
    assert (
        np.abs(2 * (seen - 0.25) - wanted).max() < 0.01
    )  # the servo's lag, which the command takes back and this motor has not
