"""Exported C of driven joints: compiled, and compared with the Python model."""

import json
import math
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.export.joint import project
from tendonff.compensator.export.joint.project import export_joints
from tendonff.compensator.export.joint.text import joint_sources
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import SolveError

pytestmark = pytest.mark.compiler
SHORT = """[reference]
kind = "sine"
amplitudes_rad = [0.4]
frequencies_Hz = [1.4]
fade_in_s = 0.2
duration_s = 0.8
[run]
step_s = 0.001
level = "presliding"
"""
FOLLOWING = """[path]
segments = 8
[[path.sections]]
name = "palm"
angle_rad = 1.0
length_m = 0.1
[[path.sections]]
name = "wrist"
joint = "wrist"
angle_rad = 0.8
angle_per_rad = 0.6
length_m = 0.04
length_per_rad_m = 0.003
[[path.sections]]
name = "pulley"
joint = "tip"
angle_rad = 0.9
angle_per_rad = 0.5
length_m = 0.03
length_per_rad_m = -0.002
[tendon]"""


def changed(source: Path, target: Path, *changes: tuple[str, str], head: str = "") -> JointScenario:
    """An example with a short reference and other text."""
    text = source.read_text("utf-8").partition("[reference]")[0] + SHORT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    target.write_text(text + head, "utf-8")
    return load_scenario(target)


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> tuple[JointScenario, ...]:
    """Joints that differ: loop behind a slow servo, pair in sections, loop that bends with two joints, loop through
    slack, one tendon against a spring, lengths from a table with relaxation and the Stribeck effect."""
    folder, examples = tmp_path_factory.mktemp("several"), Path(__file__).parents[3] / "examples"
    hand, pair = examples / "hand_joint.toml", examples / "instrument_pair.toml"
    path = hand.read_text("utf-8").partition("[path]")[2].partition("[tendon]")[0]
    q = np.linspace(-1.2, 1.2, 9)
    (folder / "lengths.csv").write_text(
        "angle_rad,length_m\n" + "".join(f"{a:.9g},{0.2 - 8e-3 * a - 1e-3 * a * a:.9g}\n" for a in q)
    )
    stribeck = "mu_static_release = 0.17\nmu_dynamic_release = 0.16\nstribeck_velocity_m_per_s = 5e-3"
    wrist = '[joints.wrist]\nkind = "sine"\namplitudes_rad = [0.3]\nfrequencies_Hz = [0.9]\n'
    end = pair.read_text("utf-8").partition('name = "close"')[2].partition("[drive]")[0]
    return (
        changed(
            hand,
            folder / "a.toml",
            ("gear_ratio = 1.0 ", "servo_time_s = 0.02\nbacklash_rad = 0.02\ngear_ratio = 2.0 "),
        ),
        changed(pair, folder / "b.toml"),
        changed(
            hand,
            folder / "c.toml",
            ("joints.knuckle", "joints.tip"),
            ("[path]" + path + "[tendon]", FOLLOWING),
            head=wrist,
        ),
        changed(
            hand,
            folder / "d.toml",
            ("joints.knuckle", "joints.loose"),
            ("pretension_N = 5.0", "pretension_N = 2.0"),
            ("gravity_N_m = 0.02 ", "gravity_N_m = 0.2 "),
        ),
        changed(
            pair,
            folder / "e.toml",
            ("joints.wrist]", "joints.sprung]\nstiffness_N_m_per_rad = 0.1\nrest_rad = -1.0"),
            ('[[tendons]]\nname = "close"' + end, ""),
        ),
        changed(
            hand,
            folder / "f.toml",
            ("joints.knuckle", "joints.table"),
            ("moment_arm_m = 0.008 ", 'lengths = "lengths.csv" '),
            ("relaxing_stiffness_N_per_m = 0.0", "relaxing_stiffness_N_per_m = 4e3\nrelaxation_time_s = 0.4"),
            ("mu_dynamic = 0.2 ", f"mu_static = 0.23\n{stribeck}\nmu_dynamic = 0.2 "),
        ),
    )


@pytest.fixture(scope="module")
def double(several: tuple[JointScenario, ...], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("code") / "double"
    exported = export_joints(several[0], further=several[1:], force_export=True)
    assert exported.loss_rad is not None
    assert exported.loss_rad < 1e-9
    exported.write(folder)
    return folder


def make(folder: Path, *what: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["make", "-C", str(folder), *what], capture_output=True, text=True, check=False)


def test_one_project_of_joints_that_differ_answers_as_python_does(double: Path) -> None:
    """To 1e-9 rad, over references and reversals; its own self test says so too."""
    done = make(double, "test", "example")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "self test passed" in done.stdout
    assert not list(double.glob("*joint_*.c")), "one copy of the code"


def test_the_observer_finds_a_joint_that_turns_within_a_long_step(tmp_path: Path, examples: Path) -> None:
    """Friction turns there, so that the motor's angle has a kink over the joint's; the shipped test watches it."""
    sine = SHORT.partition("[reference]\n")[2].partition("[run]")[0]
    turning = 'kind = "waypoints"\ntimes_s = [0.0, 0.3, 0.6]\nangles_rad = [0.3, 0.8, 0.3]\nshape = "smooth"\n'
    steps = ("step_s = 0.001", "step_s = 0.004")
    joint = changed(examples / "hand_joint.toml", tmp_path / "quick.toml", (sine, turning), steps)
    export_joints(joint, force_export=True).write(tmp_path / "c")
    done = make(tmp_path / "c", "test", "CFLAGS=-std=c99 -O1")
    assert done.returncode == 0, done.stdout[-500:] + done.stderr[-500:]


def test_what_is_written_says_what_each_joint_is_worth(double: Path) -> None:
    content = json.loads((double / "design.json").read_text("utf-8"))
    assert [joint["name"] for joint in content["joints"]] == ["knuckle", "wrist", "tip", "loose", "sprung", "table"]
    for joint in content["joints"]:
        scores = joint["scores"]
        assert scores["inverse"]["rmse_rad"] < scores["linear"]["rmse_rad"]
        assert math.degrees(scores["inverse"]["rmse_rad"]) < 0.5
    readme = (double / "README.md").read_text("utf-8")
    assert "TFF_JOINT_KNUCKLE" in readme
    assert "other_rad" in readme


def test_a_self_test_notices_a_number_that_is_off(double: Path, tmp_path: Path) -> None:
    """A hundredth of a thousandth of one compliance."""
    text = (double / "tff_joint.c").read_text("utf-8")
    where = text.index("static const tff_joint_weights tff_joint_weights_1_1")
    row = text.index("{ 6, ", where)
    fields = text[row : text.index("}", row)].split(", ")
    fields[3] = repr(float(fields[3]) * (1 + 1e-5))
    broken = text[:row] + ", ".join(fields) + text[text.index("}", row) :]
    for path in double.iterdir():
        if path.suffix in (".h", ".c") or path.name == "Makefile":
            (tmp_path / path.name).write_text(path.read_text("utf-8") if path.name != "tff_joint.c" else broken)
    done = make(tmp_path, "test")
    assert done.returncode != 0
    assert "FAILS  joint_knuckle: golden vectors; row " in done.stdout


def test_a_self_test_calls_at_random_and_no_function_takes_more_stack_than_the_readme_says(double: Path) -> None:
    """The answers of calls at random that rounding cannot change are nearly all, and statuses are compared exactly."""
    test = (double / "self_test_data.h").read_text("utf-8")
    words = re.findall(r"\d+(?=u)", test.partition("drive_status[DRIVE_BLOCKS] = {")[2].partition("}")[0])
    assert len(words) > 300
    assert sum(word != "0" for word in words) > 0.95 * len(words)
    (said,) = re.findall(r"more than (\d+) bytes of\nstack", (double / "README.md").read_text("utf-8"))
    done = make(double, "size", "CC=gcc")
    assert done.returncode == 0, done.stderr
    stacks = [int(row.split("\t")[1]) for row in done.stdout.splitlines() if row.count("\t") == 2 and ".c:" in row]
    assert 500 < max(stacks) <= int(said)


def test_single_precision_loses_less_than_a_hundredth_of_a_degree(several, tmp_path: Path) -> None:
    exported = export_joints(
        several[0], further=several[1:3], precision=Precision.FLOAT, prefix="hand", force_export=True
    )
    assert exported.loss_rad is not None
    assert math.degrees(exported.loss_rad) < 0.01
    exported.write(tmp_path / "float")
    source = (tmp_path / "float" / "hand_joint.c").read_text("utf-8")
    assert "double" not in source.replace("double-promotion", "")
    done = make(tmp_path / "float", "test")
    assert done.returncode == 0, done.stdout + done.stderr


def test_equal_scenarios_give_equal_bytes(several) -> None:
    assert joint_sources(several[:2]) == joint_sources(several[:2])


def test_joints_that_do_not_go_together_are_refused(several, tmp_path: Path, examples: Path) -> None:
    with pytest.raises(InputError, match=r"stands in a\.toml too"):
        export_joints(several[0], further=(several[0],))
    slower = changed(
        examples / "hand_joint.toml",
        tmp_path / "s.toml",
        ("joints.knuckle", "joints.other"),
        ("step_s = 0.001", "step_s = 0.002"),
    )
    with pytest.raises(InputError, match="share their sample time"):
        export_joints(several[0], further=(slower,))


def test_a_class_of_drives_is_exported_as_its_assumed_lag_and_not_credited_to_the_ratio(
    tmp_path: Path, examples: Path
) -> None:
    """Before, the C ignored the lag of a class while the ratio alone took it back: "nothing to export"."""
    sent = ("command_interval_s = 0.01 ", "command_interval_s = 0.001")
    named = changed(
        examples / "hand_joint.toml", tmp_path / "n.toml", ("[drive]", '[drive]\ndrive_class = "dynamixel"'), sent
    )
    servo = named.mechanism.drive.servo
    both = f"[drive]\nservo_time_s = {servo.servo_time_s}\ndelay_s = {servo.delay_s}"
    stated = changed(examples / "hand_joint.toml", tmp_path / "s.toml", ("[drive]", both), sent)
    first, second = (re.sub(r"[0-9a-f]{16}", "", str(joint_sources((one,)))) for one in (named, stated))
    assert first == second  # but for the digest of the scenario
    task = JointTask.of(named)
    assert np.allclose(task.commanded(task.lengths_rad, by_ratio=True), task.lengths_rad, atol=1e-12)


def test_commands_that_are_worse_than_the_ratio_are_not_exported(
    tmp_path: Path, examples: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Commands that do not move the joint, judged on the mechanism as all are."""
    judge = project.judge
    monkeypatch.setattr(project, "judge", lambda task, name, command_rad: judge(task, name, 0 * command_rad))
    scenario = changed(examples / "hand_joint.toml", tmp_path / "s.toml")
    with pytest.raises(SolveError, match=r"not better than the ratio alone .*--force-export"):
        export_joints(scenario)
    exported = export_joints(scenario, force_export=True)
    assert exported.judged[0].rms > exported.judged[0].plain_rms
    assert any("exported because of --force-export" in text for text in exported.warnings)


def test_the_command_exports_several_files(tmp_path: Path, several, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = (str(scenario.source) for scenario in several[:2])
    assert run(["export-c", first, second, "--out", str(tmp_path / "out"), "--prefix", "hand"]) == 0
    said = "".join(capsys.readouterr())
    assert "knuckle: Tracking error" in said
    assert "wrist: Tracking error" in said
    assert (tmp_path / "out" / "hand_joint.h").is_file()
