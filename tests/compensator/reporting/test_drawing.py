"""The drawing of what a scenario describes."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.cli import run
from tendonff.compensator.reporting.drawing import described_figure
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.path import Section


def lines_of(figure, panel=0):
    """Points of the lines that the legend of a panel names, by the name before the colon."""
    lines = figure.axes[panel].get_lines()
    return {str(line.get_label()).split(":")[0]: np.column_stack(line.get_data()) for line in lines}


def turned_rad(points):
    """Sum of the changes of direction along a line, shape (n, 2), which misses half a step at each end."""
    steps = np.diff(points, axis=0)
    steps = steps[np.hypot(*steps.T) > 1e-12]
    changes = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    return abs(changes.sum())


@pytest.mark.parametrize("angle_rad", [0.0, 0.3, math.pi, 4.7, 12.0])
def test_a_path_turns_by_its_wrap_angle(examples, angle_rad):
    scenario = load_scenario(examples / "finger.toml").transmission
    path = replace(scenario.path, total_angle_rad=angle_rad)
    line = lines_of(described_figure(replace(scenario, path=path)))["path"]
    assert turned_rad(line) == pytest.approx(angle_rad, abs=0.06)


def test_every_section_turns_by_its_own_angle_and_joins_the_last_one(examples):
    scenario = load_scenario(examples / "finger_moving.toml").transmission
    assert len(scenario.path.sections) == 5
    lines = lines_of(described_figure(scenario))
    drawn = [lines[section.name] for section in scenario.path.sections]
    for section, line in zip(scenario.path.sections, drawn, strict=True):
        assert turned_rad(line) == pytest.approx(section.angle_rad, abs=0.06)
    for last, line in pairwise(drawn):
        assert line[0] == pytest.approx(last[-1])


def test_a_section_of_any_length_is_seen(examples):
    scenario = load_scenario(examples / "finger.toml").transmission
    sections = (Section(name="long", angle_rad=0.2, length_m=2.0), Section(name="short", angle_rad=1.0, length_m=1e-4))
    path = replace(scenario.path, total_angle_rad=1.2, sections=sections)
    lines = lines_of(described_figure(replace(scenario, path=path)))
    assert np.ptp(lines["short"], axis=0).max() > 0.02 * np.ptp(lines["long"], axis=0).max()


def test_tendons_pass_each_joint_at_their_moment_arms(examples):
    """Above the joint where they turn it to positive angles, at one scale."""
    mechanism = load_scenario(examples / "three_joint_finger.toml").mechanism
    figure = described_figure(mechanism)
    lines = lines_of(figure, panel=len(figure.axes) - 1)
    flexor, extensor = lines["dip_flexor"], lines["extensor"]
    heights = [[float(np.interp(joint, *line.T)) for joint in (1, 2, 3)] for line in (flexor, extensor)]
    scale = heights[0][0] / 2.0
    assert np.array(heights) == pytest.approx(scale * np.array([[2.0, 2.0, 8.0], [-14.0, -12.0, -8.0]]))


def test_tendons_of_a_loop_leave_the_drum_on_either_side(examples):
    mechanism = tf.load_scenario(examples / "hand_joint.toml").mechanism
    figure = described_figure(mechanism)
    lines = lines_of(figure, panel=1)
    for tendon, radius in zip(mechanism.tendons, mechanism.drum_radius_m, strict=True):
        arm = mechanism.arms_at(0.0)[mechanism.tendons.index(tendon)]
        line = lines[tendon.name]
        assert line[0, 1] / line[1, 1] == pytest.approx(math.copysign(radius, arm) / arm)


@pytest.mark.parametrize("rig", ["bowden", "hand"])
def test_new_writes_a_drawing_beside_the_file(tmp_path, rig, capsys):
    assert run(["new", str(tmp_path / "mine.toml"), "--for", rig]) == 0
    assert "</svg>" in (tmp_path / "mine.svg").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").unlink()
    assert run(["new", str(tmp_path / "mine.toml"), "--for", rig]) == 2
    assert "mine.svg exists" in capsys.readouterr().err
