"""The exported joint the other way round, and as a ros2_control transmission."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.export.host import compile_on_host
from tendonff.compensator.joint.compensators import linear_motor_rad
from tendonff.compensator.joint.export.project import export_joints
from tendonff.compensator.joint.export.text import joint_sources, problem_of
from tendonff.compensator.joint.scenario.scenario import sample_joint
from tendonff.ocp.codegen.precision import Precision
from tests.compensator.joint.test_joint_export import changed

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
    return good && (tff_joint_observe(&self, TFF_STEP_S, 1e3, 0) == TFF_FAILED) && (self.angle_rad == angle[n - 1])
        && (tff_joint_observe(&self, -TFF_STEP_S, 0, 0) == TFF_INPUT_HELD);
}
"""


@pytest.fixture(scope="module")
def hand(examples, tmp_path_factory):
    return changed(examples / "hand_joint.toml", tmp_path_factory.mktemp("hand") / "hand.toml")


@pytest.mark.parametrize(("precision", "most_rad"), [(Precision.DOUBLE, 1e-8), (Precision.FLOAT, 3e-4)])
def test_the_observer_says_where_the_forward_simulation_has_the_joint(hand, precision, most_rad):
    """The motor goes by the ratio alone, which leaves the joint 0.8 deg behind. A motor out of reach is reported."""
    sampled = sample_joint(hand)
    motor = linear_motor_rad(hand, sampled)
    code = compile_on_host(joint_sources((hand,), precision=precision), DRIVER, precision)
    angle = code.array(sampled.angle_rad.copy())
    call = code.function("observe", ctypes.c_long, *(code.reals,) * 2, result=ctypes.c_int)
    assert call(len(motor), code.array(motor.ravel()), angle) == 1
    there = tf.simulate(problem_of(hand, sampled), motor.reshape(-1, 1), hand.run.step_s).angle_rad
    assert np.abs(there - sampled.angle_rad).max() > 0.01
    assert np.abs(angle - there).max() < most_rad


def test_a_pair_has_no_observer(examples):
    driver = """#include "tff_joint.h"
    int ask(void) { static tff_joint self; (void)tff_joint_init(&self, 0, 0, 0);
    return (int)tff_joint_observe(&self, TFF_STEP_S, 0, 0); }"""
    pair = tf.load_scenario(examples / "instrument_pair.toml")
    code = compile_on_host(joint_sources((pair,)), driver, Precision.DOUBLE)
    assert code.function("ask", result=ctypes.c_int)() == 16


def test_the_ros_2_transmission_commands_as_the_runtime_and_sees_the_joint(hand, tmp_path):
    """Compiled against minimal headers with the names and signatures of ros2_control, not against ROS itself."""
    if shutil.which("g++") is None or shutil.which("gcc") is None:
        pytest.skip("g++ is not installed")
    folder, program = tmp_path / "c", tmp_path / "transmission"
    export_joints(hand).write(folder)
    package = folder / "ros2" / "tff_transmission"
    flags = ("-O0", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-I", folder)
    subprocess.run(["gcc", *flags, "-c", folder / "tff_joint.c", "-o", tmp_path / "joint.o"], check=True)
    sources = (HERE / "ros2" / "main.cpp", package / "tff_transmission_loader.cpp", tmp_path / "joint.o")
    command = ["g++", "-std=c++17", *flags, "-I", HERE / "ros2", "-I", package, *sources, "-lm", "-o", program]
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
