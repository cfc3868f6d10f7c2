"""A joint on the interactive page; the page itself is that of a tension."""

from pathlib import Path

import pytest

from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.explore.motors import MotorExplorer
from tendonff.models.errors import TendonffError

pytestmark = pytest.mark.compiler


@pytest.fixture(scope="module", params=["hand_joint", "instrument_pair"])
def explorer(request: pytest.FixtureRequest, examples: Path) -> MotorExplorer:
    return MotorExplorer(load_scenario(examples / f"{request.param}.toml"))


def test_where_the_knobs_start_the_curves_are_those_of_the_scenario(explorer: MotorExplorer) -> None:
    start = {knob.key: knob.value for knob in explorer.knobs}
    shown = explorer.explore(start, design_knows=False, curves=explorer.fast)
    task = JointTask.of(explorer._task.scenario)
    reached = task.values_of(task.respond(task.mechanism, task.commanded(task.inversion.motor_rad)))
    assert shown.courses["inverse"].score.peak_error == pytest.approx(abs(reached - task.wanted).max())
    assert set(shown.courses) == {"linear", "static", "inverse"}
    assert abs(shown.courses["linear"].given).max() < 1e-9


def test_a_design_that_knows_other_friction_stays_good_and_the_other_does_not(explorer: MotorExplorer) -> None:
    values = {knob.key: knob.value for knob in explorer.knobs} | {"mu": 1.5}
    knowing, blind = (
        explorer.explore(values, design_knows=knows, curves=explorer.fast).courses["inverse"].score.rmse
        for knows in (True, False)
    )
    assert knowing < blind / 2
    assert "deg RMS" in explorer.worst_case(values, design_knows=True)


def test_what_is_out_of_bounds_is_refused(explorer: MotorExplorer) -> None:
    values = {knob.key: knob.value for knob in explorer.knobs} | {"stiffness": -1.0}
    with pytest.raises(TendonffError):
        explorer.explore(values, design_knows=True, curves=explorer.fast)


def test_what_is_saved_reads_back_as_what_was_explored(explorer: MotorExplorer, tmp_path: Path) -> None:
    values = {knob.key: knob.value for knob in explorer.knobs} | {"mu": 1.5, "stiffness": 0.7}
    (tmp_path / "explored.toml").write_text(explorer.toml(values), encoding="utf-8")
    assert load_scenario(tmp_path / "explored.toml").mechanism == explorer._changed(values).mechanism
