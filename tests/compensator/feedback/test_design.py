"""`design` of a scenario with [feedback]: files, sentence, and what is refused."""

import json
import math
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

import tendonff as tf
from tendonff.compensator.door import design
from tendonff.compensator.export.joint.project import export_joints
from tendonff.compensator.files.reading import InputError

pytestmark = pytest.mark.compiler

FEEDBACK = """
[feedback]
sensor = "joint_angle"
delay_s = 0.01
sample_s = 0.005
resolution = 0.0004

[robust]
mu = 0.2
samples = 3
"""
HAND = Path("examples/hand_joint.toml").read_text("utf-8").replace("command_interval_s = 0.01 ", "servo_time_s = 0.02 ")
SHORT = """[reference]
quantity = "joint_angle"
kind = "waypoints"
times_s = [0.0, 0.3, 0.6, 0.9]
angles_rad = [0.0, 0.5, 0.1, 0.6]
shape = "smooth"

"""


def scenario(tmp_path, feedback=FEEDBACK, text=HAND):
    begin, end = text.index("[reference]"), text.index("[run]")
    file = tmp_path / "hand.toml"
    file.write_text(text[:begin] + SHORT + text[end:] + feedback, "utf-8")
    return tf.load_scenario(file)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("feedback")
    result = design(scenario(folder))
    result.write(folder / "out")
    return result, folder / "out"


def test_the_summary_states_gains_margins_and_errors(written):
    _, folder = written
    found = json.loads((folder / "summary.json").read_text("utf-8"))["feedback"]
    assert found["gain_margin"] > 1.98
    assert found["phase_margin_deg"] > 44.5
    assert found["proportional"] > 0
    assert found["integral_per_s"] > 0
    assert found["clamp"] > 0
    assert set(found["rmse"]) == set(found["peak"]) == {"feedforward", "feedback", "both"}
    assert found["rmse"]["both"] < 0.35 * found["rmse"]["feedforward"]
    assert found["rmse"]["both"] < 0.2 * found["rmse"]["feedback"]
    assert found["peak"]["both"] < 1.1 * found["peak"]["feedforward"]
    assert not any(cycle["hunts"] for cycle in found["limit_cycles"])


def test_the_report_has_both_figures_and_the_sentence(written):
    result, folder = written
    page = (folder / "report.html").read_text("utf-8")
    assert (folder / "feedback_loop.svg").exists()
    assert (folder / "feedback_error.svg").exists()
    assert "Feedback beside the feedforward" in page
    assert "10 ms of delay" in result.feedback.sentence


@pytest.mark.parametrize(
    ("feedback", "message"),
    [
        ('[feedback]\nsensor = "output_tension"\n', 'driven joints need sensor = "joint_angle", got "output_tension"'),
        ('[feedback]\nsensor = "motor_angle_and_torque"\n', "its estimate hides the errors that feedback should"),
        ('[feedback]\nsensor = "joint_angle"\nsample_s = 0.0015\n', "sample_s must be a multiple of step_s = 0.001 s"),
        ('[feedback]\nsensor = "joint_angle"\ndelay_s = 1.0\n', "delay_s must be at most 255 samples of 0.001 s"),
        ('[feedback]\nsensor = "joint_angle"\ngain_margin = 0.9\n', "gain_margin must be a finite number > 1, got 0.9"),
        ('[feedback]\nsensor = "joint_angle"\ndelays = 0.9\n', 'unknown key "delays", did you mean "delay_s"'),
    ],
)
def test_what_has_no_meaning_is_refused(tmp_path, feedback, message):
    with pytest.raises(InputError, match=message):
        design(scenario(tmp_path, feedback))


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("export")
    told = scenario(folder)
    export_joints(told).write(folder / "c")
    return told, folder / "c"


@pytest.mark.slow
def test_the_exported_module_passes_its_self_test(exported):
    _, folder = exported
    done = subprocess.run(["make", "test"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "feedback: largest departure 0 rad, passed" in done.stdout


@pytest.mark.slow
def test_the_runtime_adds_the_correction_at_the_sample_time_of_the_feedback(exported):
    told, _ = exported
    plain, fed = tf.Runtime(replace(told, feedback=None)), tf.Runtime(told)
    differences = []
    for k in range(40):
        angle = 0.3 * (1 - math.cos(0.01 * k))
        differences.append(fed.step(angle, measured=angle - 0.01) - plain.step(angle))
    held = [differences[k : k + 5] for k in range(0, 40, 5)]
    assert all(max(five) - min(five) < 1e-12 for five in held)
    assert differences[0] > 0
    assert len(set(differences)) > 4
