"""Several joints on the interactive page."""

import pytest

from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.explore.run import Explorer

pytestmark = pytest.mark.compiler


@pytest.fixture(scope="module")
def explorer(examples):
    return Explorer(load_scenario(examples / "three_joint_finger.toml"))


def start(explorer):
    return {knob.key: knob.value for knob in explorer.knobs}


def test_where_the_knobs_start_the_curves_are_those_of_the_scenario(explorer):
    shown = explorer.explore(start(explorer), design_knows=False, curves=explorer.fast)
    task = FingerTask.of(explorer._scenario)
    reached = task.values_of(task.respond(task.finger, task.inversion.motor_rad))
    assert shown.courses["inverse"].score.peak_error == pytest.approx(abs(reached - task.wanted).max())
    assert {"linear", "stretch", "inverse"} <= set(shown.courses)


def test_a_design_that_knows_other_friction_stays_good_and_the_other_does_not(explorer):
    values = start(explorer) | {"mu": 1.5}
    curves = [curve for curve in explorer.fast if curve.name == "inverse"]
    knowing, blind = (
        explorer.explore(values, design_knows=knows, curves=curves).courses["inverse"].score.rmse
        for knows in (True, False)
    )
    assert knowing < blind / 5


def test_what_is_saved_reads_back_as_what_was_explored(explorer, tmp_path):
    values = start(explorer) | {"mu": 1.5, "stiffness": 0.7, "sharing.least_tension_N": 10.0}
    (tmp_path / "explored.toml").write_text(explorer.toml(values), encoding="utf-8")
    assert load_scenario(tmp_path / "explored.toml").mechanism == explorer.changed(values).mechanism
