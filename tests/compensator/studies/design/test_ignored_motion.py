"""What design and compare say of joints that move."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.closed_form import Capstan, Inverse, Uncompensated
from tendonff.compensator.compensators.ignored import ignored_motion
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.scenario.scenario import Scenario, parse_scenario
from tendonff.compensator.scenario.unit import NEWTON
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.compare.figures import errors_figure
from tendonff.compensator.studies.compare.run import compare
from tendonff.compensator.studies.design.figures import force_figure, tension_figure
from tendonff.compensator.studies.design.output import show
from tendonff.compensator.studies.design.result import Design
from tendonff.compensator.studies.design.run import design
from tendonff.ocp.errors import SolveError

COMPENSATORS = (Uncompensated(), Inverse())


@pytest.fixture(scope="module")
def moving(examples: Path) -> Scenario:
    text = (examples / "finger_moving.toml").read_text(encoding="utf-8")
    return parse_scenario(text.replace("duration_s = 4.0", "duration_s = 1.5"))


@pytest.fixture(scope="module")
def result(moving: Scenario) -> Design:
    return design(moving, compensators=COMPENSATORS)


def test_ignoring_the_motion_costs_far_more_than_the_inverse_leaves(result: Design) -> None:
    found = result.ignored
    assert found is not None
    own = result.on_proof("inverse").score
    assert found.known == own
    assert found.ignored.rmse_percent_of_range > 20 * own.rmse_percent_of_range
    assert found.ignored.rmse_percent_of_range > 10
    assert f"on the moving path: {found.ignored.percent} % of range" in found.text


def test_a_mean_pose_that_cannot_be_simulated_ends_no_design(moving: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise SolveError("no")

    problem = Problem.of(moving)
    monkeypatch.setattr(Plant, "respond", refuse)
    found = ignored_motion(problem)
    assert found is not None
    assert "moving path: not to be simulated if it is designed" in found.text
    assert set(found.named(NEWTON).values()) == {None}


@pytest.mark.usefixtures("unpainted")
def test_page_and_files_say_it_and_show_the_joints(result: Design, tmp_path: Path) -> None:
    assert result.ignored is not None
    result.write(tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert f"on the moving path: {result.ignored.ignored.percent} % of range" in page
    assert "Bottom: the joint angles" in page
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["ignored_motion"]["rmse_N"] == pytest.approx(result.ignored.ignored.rmse)


def test_a_limit_off_the_scale_is_written_above_its_panel(result: Design) -> None:
    """The force stays below 65 N of 120: its lower limit is drawn, the upper one written."""
    force, rate, _ = force_figure(result).axes
    assert force.get_title(loc="right") == "limit 120 N off scale"
    assert {line.get_ydata()[0] for line in force.lines if len(line.get_ydata()) == 2} == {0.0}
    assert rate.get_title(loc="right").startswith("limit ±2000 N/s")


def test_scores_are_whole_in_a_terminal_of_80_columns(result: Design, monkeypatch, capsys) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    show(result, Path("out"))
    table, _ = capsys.readouterr().out.split("worst case: over")
    assert "…" not in table
    assert "viscoelastic" in table


def test_figures_show_the_joints_under_the_tensions(result: Design, moving: Scenario) -> None:
    compared = compare(
        replace(moving, reference=replace(moving.reference, duration_s=0.4)),
        compensators=(COMPENSATORS[0], Capstan(), COMPENSATORS[1]),
    )
    assert compared.ignored is not None
    for figure in (tension_figure(result), errors_figure(compared, compared.ignored.motion)):
        panel = next(axes for axes in figure.axes if axes.get_ylabel() == "joints [rad]")
        assert [line.get_label() for line in panel.lines] == ["knuckle", "middle"]


def test_where_nothing_moves_nothing_is_said(examples: Path) -> None:
    finger = load_scenario(examples / "finger.toml")
    short = replace(finger, reference=replace(finger.reference, duration_s=0.3))
    assert design(short, compensators=COMPENSATORS).ignored is None
