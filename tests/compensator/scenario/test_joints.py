"""Sections and joints in a scenario file: what they mean, and one message for each way to get them wrong."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.joints import ConstantJoint
from tendonff.compensator.scenario.sampled.joint_motion import moved, sample_joints
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_to_toml
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.tables.force import ForceTables


@pytest.fixture
def text(examples: Path) -> str:
    return (examples / "finger_moving.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("fade", "course"),
    [("linear", lambda s: s), ("smooth", lambda s: s**3 * (10 - 15 * s + 6 * s**2))],
)
def test_sections_add_up_and_joints_move_them(text: str, fade: str, course: Callable) -> None:
    """With the smooth fade, the quintic step, neither speed nor acceleration jumps."""
    scenario = parse_scenario(text.replace('fade = "smooth"', f'fade = "{fade}"'))
    assert scenario.transmission.path.total_angle_rad == pytest.approx(2.7)
    motion = sample_joints(scenario, 4.0)
    assert motion is not None
    assert motion.names == ("knuckle", "middle")
    time = motion.time_s
    assert time[-1] == pytest.approx(4.0)
    expected = course(np.minimum(time / 0.5, 1)) * 0.6 * np.sin(2 * np.pi * 0.7 * time)
    assert motion.angle_rad[:, 0] == pytest.approx(expected)
    assert moved(scenario, 4.0).motion is not None


def test_a_scenario_with_sections_reads_back_as_the_same(text: str) -> None:
    scenario = parse_scenario(text)
    again = parse_scenario(scenario_to_toml(scenario))
    assert again.transmission == scenario.transmission
    assert again.joints == scenario.joints


def test_a_far_end_that_a_joint_moves_needs_no_spring(text: str) -> None:
    start = text.index("[load]")
    end = text.index("[reference]")
    held = f'{text[:start]}[load]\nkind = "joint"\njoint = "middle"\nmoment_arm_m = 0.008\n\n{text[end:]}'
    load = parse_scenario(held).transmission.load
    assert (load.joint, load.moment_arm_m) == ("middle", 0.008)
    assert parse_scenario(scenario_to_toml(parse_scenario(held))).transmission.load == load


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[joints.middle]", "[joints.other]", 'joint "middle" is named but not given'),
        ("segments = 12", "segments = 12\ntotal_angle_rad = 2.7", "give total_angle_rad or"),
        ('joint = "knuckle"', 'joint = ["knuckle", "middle"]', "joint must be one name"),
        ('name = "first bone"', 'name = "wrist"', 'two sections are named "wrist"'),
        ("angle_rad = 1.2", "angle = 1.2", 'unknown key "angle"'),
        ('kind = "sine"\namplitudes_rad', 'kind = "cosine"\namplitudes_rad', 'kind must be one of "constant", "sine"'),
        (
            'name = "wrist"\n',
            'name = "wrist"\nmu_static = 0.15\n',
            r'"wrist": mu_dynamic = 0\.2 is above mu_static = 0\.15: change both',
        ),
        (
            'name = "wrist"\n',
            'name = "wrist"\nmu_static_release = 0.15\n',
            r'"wrist": mu_dynamic_release = 0\.2 is above mu_static_release = 0\.15: change both',
        ),
        (
            "stiffness_N_per_m = 2.0e4",
            "elastic_modulus_Pa = 5e10\nlength_m = 0.3\ndiameter_m = 0.5e-3",
            r"two sources for one quantity: \[tendon\] length_m = 0\.3, and 0\.205 from length_m of the sections",
        ),
        ("amplitudes_rad = [0.6]", "amplitudes_rad = [0.6, 1.0]", "frequencies_Hz must be as many as amplitudes_rad"),
    ],
)
def test_what_is_wrong_is_said_by_name(text: str, old: str, new: str, message: str) -> None:
    assert old in text
    with pytest.raises(InputError, match=message):
        parse_scenario(text.replace(old, new, 1))


def test_a_motion_without_meaning_is_said_with_the_way_out(text: str) -> None:
    for old, new, message in (
        ("amplitudes_rad = [0.6]", "amplitudes_rad = [700.0]", "more than 100 turns"),
        ("length_per_rad_m = 0.01 ", "length_per_rad_m = 0.1 ", "its length would become"),
    ):
        with pytest.raises(InputError, match=message):
            sample_joints(parse_scenario(text.replace(old, new, 1)), 4.0)


def test_measured_motion_is_taken_from_its_file_and_must_be_long_enough(text: str, tmp_path: Path) -> None:
    start = text.index("[joints.knuckle]")
    end = text.index("[joints.middle]")
    recorded = f'{text[:start]}[joints.knuckle]\nkind = "csv"\nfile = "motion.csv"\n\n{text[end:]}'
    source = tmp_path / "scenario.toml"
    rows = "".join(f"{t:.2f};{math.degrees(0.4 * math.sin(t)):.6f}\n" for t in np.arange(0.0, 5.0, 0.05))
    (tmp_path / "motion.csv").write_text(f"time_s;knuckle_deg\n{rows}", encoding="utf-8")
    motion = sample_joints(parse_scenario(recorded, source), 4.0)
    assert motion is not None
    assert motion.at(np.array([1.02, 3.48]))[:, 0] == pytest.approx(0.4 * np.sin([1.02, 3.48]), abs=2e-5)
    (tmp_path / "motion.csv").write_text("time_s,knuckle_rad\n0,0\n2,0.4\n", encoding="utf-8")
    with pytest.raises(InputError, match=r'"knuckle" is known from 0 to 2 s, but the run takes from 0 to 4 s'):
        sample_joints(parse_scenario(recorded, source), 4.0)
    (tmp_path / "motion.csv").write_text("time_s,elbow_rad\n0,0\n2,0.4\n", encoding="utf-8")
    with pytest.raises(InputError, match='column "knuckle_rad" is missing'):
        sample_joints(parse_scenario(recorded, source), 4.0)


@pytest.fixture
def moving_finger(examples, tmp_path):
    """The moving finger's file, a force, and the scenario's own motion as a file."""
    time = np.arange(601) * 1e-3
    scenario = load_scenario(examples / "finger_moving.toml")
    motion = sample_joints(scenario, 0.6)
    force = np.column_stack([time, 30 + 5 * np.sin(6 * time)])
    np.savetxt(tmp_path / "F.csv", force, delimiter=",", header="time_s,force_N", comments="", fmt="%.17g")
    rows, head = np.column_stack([time, motion.at(time)]), "time_s," + ",".join(f"{n}_rad" for n in motion.names)
    np.savetxt(tmp_path / "J.csv", rows, delimiter=",", header=head, comments="", fmt="%.17g")
    rows[:, 1:] = 0
    np.savetxt(tmp_path / "still.csv", rows, delimiter=",", header=head, comments="", fmt="%.17g")
    return examples / "finger_moving.toml", tmp_path


def test_simulate_takes_the_motion_of_a_file_instead_of_the_scenarios(moving_finger):
    toml, folder = moving_finger

    def tension(*options):
        command = ["simulate", str(toml), "--force", str(folder / "F.csv"), "--out", str(folder / "O.csv"), *options]
        assert run(command) == 0
        return np.loadtxt(folder / "O.csv", delimiter=",", skiprows=1)[:, -3]

    own = tension()
    np.testing.assert_allclose(tension("--joints", str(folder / "J.csv")), own, atol=1e-9)
    assert np.abs(tension("--joints", str(folder / "still.csv")) - own).max() > 1


def test_joints_of_a_file_need_joints_in_the_scenario(moving_finger, examples, capsys):
    _, folder = moving_finger
    command = ["simulate", str(examples / "finger.toml"), "--force", str(folder / "F.csv")]
    assert run([*command, "--joints", str(folder / "J.csv"), "--out", str(folder / "O.csv")]) == 2
    assert "--joints needs joints" in capsys.readouterr().err


@pytest.mark.compiler
def test_a_table_of_one_pose_is_that_of_the_path_in_this_pose(examples, tmp_path, capsys):
    toml = examples / "finger_moving.toml"
    assert run(["table", str(toml), "--out", str(tmp_path / "none")]) == 2
    said = capsys.readouterr().err
    assert "the distribution of wrap angle along the path matters" in said
    assert "export-c" in said
    assert "--pose" in said
    assert run(["table", str(toml), "--pose", "knuckle=0.3", "--out", str(tmp_path / "half")]) == 2  # the other moves
    assert run(["table", str(toml), "--pose", "knuckl=0.3", "--out", str(tmp_path / "wrong")]) == 2
    assert 'did you mean "knuckle"?' in capsys.readouterr().err
    made = ForceTables.made(load_scenario(toml), pose_rad={"knuckle": 0.3, "middle": -0.2})
    other = ForceTables.made(load_scenario(toml), pose_rad={"knuckle": -0.5, "middle": -0.3})
    bent = {"knuckle": ConstantJoint(angle_rad=0.3), "middle": ConstantJoint(angle_rad=-0.2)}
    same = ForceTables.made(replace(load_scenario(toml), joints=bent))
    force = [t.tables[0].built.table.pull.force_N for t in (made, same, other)]
    np.testing.assert_array_equal(force[0], force[1])
    assert force[0].max() > 1.1 * force[2].max()  # more wrap, more friction
