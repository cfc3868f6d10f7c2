"""A joint on the interactive page; the page itself is that of a tension."""

import math
from pathlib import Path

import pytest

from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.explore.run import Explorer
from tendonff.models.errors import TendonffError
from tendonff.models.parameters.numbers import with_numbers

pytestmark = pytest.mark.compiler


@pytest.fixture(scope="module", params=["hand_joint", "instrument_pair"])
def explorer(request: pytest.FixtureRequest, examples: Path) -> Explorer:
    return Explorer(load_scenario(examples / f"{request.param}.toml"))


def test_where_the_knobs_start_the_curves_are_those_of_the_scenario(explorer: Explorer) -> None:
    start = {knob.key: knob.value for knob in explorer.knobs}
    shown = explorer.explore(start, design_knows=False, curves=explorer.fast)
    task = JointTask.of(explorer._scenario)
    reached = task.values_of(task.respond(task.mechanism, task.commanded(task.inversion.motor_rad)))
    assert shown.courses["inverse"].score.peak_error == pytest.approx(abs(reached - task.wanted).max())
    assert set(shown.courses) == {"linear", "static", "inverse"}
    assert abs(shown.courses["linear"].given).max() < 1e-9


def test_a_design_that_knows_other_friction_stays_good_and_the_other_does_not(explorer: Explorer) -> None:
    values = {knob.key: knob.value for knob in explorer.knobs} | {"mu": 1.5}
    knowing, blind = (
        explorer.explore(values, design_knows=knows, curves=explorer.fast).courses["inverse"].score.rmse
        for knows in (True, False)
    )
    assert knowing < blind / 2
    assert "deg RMS" in explorer.worst_case(values, design_knows=True)


def test_what_is_out_of_bounds_is_refused(explorer: Explorer) -> None:
    values = {knob.key: knob.value for knob in explorer.knobs} | {"stiffness": -1.0}
    with pytest.raises(TendonffError):
        explorer.explore(values, design_knows=True, curves=explorer.fast)


def test_what_is_saved_reads_back_as_what_was_explored(explorer: Explorer, tmp_path: Path) -> None:
    values = {knob.key: knob.value for knob in explorer.knobs} | {"mu": 1.5, "stiffness": 0.7}
    (tmp_path / "explored.toml").write_text(explorer.toml(values), encoding="utf-8")
    assert load_scenario(tmp_path / "explored.toml").mechanism == explorer.changed(values).mechanism


def test_another_joint_is_turned_and_saved_with_the_wrap_that_follows_it(examples: Path, tmp_path: Path) -> None:
    """The wrap angle keeps the shares of the sections, the pose is the file's own number."""
    text = (examples / "hand_joint.toml").read_text(encoding="utf-8")
    sections = '[[path.sections]]\nname = "a"\nangle_rad = 1.0\n\n'
    sections += '[[path.sections]]\nname = "b"\nangle_rad = 2.0\njoint = "wrist"\nangle_per_rad = 1.0\n\n'
    wrist = '[joints.wrist]\nkind = "sine"\noffset_rad = 0.1\namplitudes_rad = [0.1]\nfrequencies_Hz = [0.5]\n\n'
    wrap = next(line for line in text.splitlines() if line.startswith("total_angle_rad"))
    text = text.replace(wrap + "\n", "").replace("[tendon]", sections + wrist + "[tendon]", 1)
    (tmp_path / "turned.toml").write_text(text, encoding="utf-8")
    explorer = Explorer(load_scenario(tmp_path / "turned.toml"))
    values = {knob.key: knob.value for knob in explorer.knobs} | {"pose of wrist": 20.0}
    changed = explorer.changed(values)
    assert changed.joints["wrist"].offset_rad == pytest.approx(0.1 + math.radians(20.0))
    numbers = {"path.total_angle_rad": 1.5}
    halved = changed.with_system(with_numbers(changed.system, numbers), numbers)
    (tmp_path / "saved.toml").write_text(halved.saved(), encoding="utf-8")
    saved = load_scenario(tmp_path / "saved.toml")
    assert saved.joints == halved.joints
    assert [section.angle_rad for section in saved.mechanism.tendons[0].path.sections] == pytest.approx([0.5, 1.0])
