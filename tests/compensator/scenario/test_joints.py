"""Sections and joints in a scenario file: what they mean, and one message for each way to get them wrong."""

import math
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.joint_motion import moved, sample_joints
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_to_toml


@pytest.fixture
def text(examples: Path) -> str:
    return (examples / "finger_moving.toml").read_text(encoding="utf-8")


def test_sections_add_up_and_joints_move_them(text: str) -> None:
    scenario = parse_scenario(text)
    assert scenario.transmission.path.total_angle_rad == pytest.approx(2.7)
    motion = sample_joints(scenario, 4.0)
    assert motion is not None
    assert motion.names == ("knuckle", "middle")
    time = motion.time_s
    assert time[-1] == pytest.approx(4.0)
    expected = np.minimum(time / 0.5, 1) * 0.6 * np.sin(2 * np.pi * 0.7 * time)
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
