"""What the interactive page computes; tests/test_reports_in_browser.py looks at the page itself."""

import gc
import socket
import sys
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.scenario.sampled.joint_motion import sample_joints
from tendonff.compensator.scenario.scenario import parse_scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.run import design
from tendonff.compensator.studies.explore.run import Explorer
from tendonff.models.errors import TendonffError
from tendonff.models.fidelity import Level
from tendonff.models.parameters.uncertainty import Uncertainty


@pytest.fixture(scope="module")
def scenario(examples):
    return load_scenario(examples / "finger.toml")


def start(explorer):
    return {knob.key: knob.value for knob in explorer.knobs}


def shown(explorer, *, design_knows=True, curves=None, **changed):
    """Courses with some knobs elsewhere, by key with "__" for a dot."""
    values = start(explorer) | {key.replace("__", "."): value for key, value in changed.items()}
    return explorer.explore(values, design_knows=design_knows, curves=curves or explorer.fast).courses


@pytest.mark.parametrize("name", ["finger", "bowden", "finger_moving", "hand_joint", "three_joint_finger"])
def test_the_knobs_start_at_the_scenario(examples, name):
    scenario = load_scenario(examples / f"{name}.toml")
    for level in Level:
        explorer = Explorer(replace(scenario, run=replace(scenario.run, level=level)))
        assert explorer.changed(start(explorer)) is explorer._scenario


def test_every_friction_coefficient_follows_mu(scenario):
    friction = replace(scenario.transmission.friction, mu_dynamic=0.2, mu_static=0.3, mu_dynamic_release=0.1)
    own = replace(scenario, transmission=replace(scenario.transmission, friction=friction))
    moved = Explorer(own).changed({"mu": 0.4}).transmission.friction
    assert [moved.mu_dynamic, moved.mu_static, moved.release_dynamic, moved.release_static] == pytest.approx(
        [0.4, 0.6, 0.2, 2 * friction.release_static]
    )


def test_a_pose_turns_every_joint_and_sections_keep_their_shares(examples):
    scenario = load_scenario(examples / "finger_moving.toml")
    explorer = Explorer(scenario)
    poses = [key for key in start(explorer) if key.startswith("pose of ")]
    assert poses
    half = {"path.total_angle_rad": 0.5 * start(explorer)["path.total_angle_rad"]}
    changed = explorer.changed(half | dict.fromkeys(poses, 10.0))
    for name in scenario.joints:
        before, after = (sample_joints(one, 1.0).angle_rad for one in (scenario, changed))
        assert after - before == pytest.approx(np.full_like(before, np.radians(10.0)), abs=1e-12), name
    halves = zip(changed.transmission.path.parts, scenario.transmission.path.parts, strict=True)
    assert all(after.angle_rad == pytest.approx(before.angle_rad / 2) for after, before in halves)
    assert shown(explorer)["inverse"].score.rmse_percent_of_range < 1


def test_what_is_saved_is_the_changed_scenario(scenario):
    explorer = Explorer(scenario)
    values = start(explorer) | {"mu": 0.25, "load.stiffness_N_per_m": 2500.0}
    again = parse_scenario(explorer.toml(values), scenario.source)
    assert again == explorer.changed(values)
    assert again.transmission.load.stiffness_N_per_m == 2500.0
    assert again.transmission.friction.mu_dynamic == pytest.approx(0.25)


@pytest.mark.compiler
def test_self_tuning_recovers_most_of_what_a_design_for_other_friction_misses(scenario):
    """Over the whole run, the time in which it learns at a limited rate included: three fifths."""
    explorer = Explorer(scenario)
    plain = shown(explorer, mu=0.24, design_knows=False)["inverse"].score.rmse
    slow = shown(explorer, mu=0.24, design_knows=False, curves=explorer.slow)
    assert set(slow) == {"smoothed", "optimal", "table", "self_tuning"}
    assert slow["self_tuning"].score.rmse < plain / 2.5
    assert slow["optimal"].score.rmse > plain / 2


def test_the_inverse_that_knows_the_change_stays_exact_and_the_other_does_not(scenario):
    knowing, blind = (shown(Explorer(scenario), mu=0.25, design_knows=knows)["inverse"] for knows in (True, False))
    assert knowing.score.rmse_percent_of_range < 1e-6
    assert blind.score.rmse_percent_of_range > 1
    assert np.abs(blind.error).max() == pytest.approx(blind.score.peak_error, rel=0.05)


def test_a_slower_actuator_costs_accuracy_and_every_design_knows_it(scenario):
    explorer = Explorer(scenario)
    for knows in (True, False):
        errors = [
            shown(explorer, actuator__force_rate_max_N_per_s=rate, design_knows=knows)["inverse"].score.rmse
            for rate in (1e5, 300.0, 100.0)
        ]
        assert errors == sorted(errors)
        assert errors[-1] > 1
    blind = explorer._posed({"actuator.force_rate_max_N_per_s": 100.0, "mu": 0.3}, design_knows=False)[0]
    assert blind.transmission.actuator.force_rate_max_N_per_s == pytest.approx(100.0)
    assert blind.transmission.friction == scenario.transmission.friction


def test_what_cannot_be_delivered_is_said_and_not_drawn(scenario):
    with pytest.raises(TendonffError, match="force_max_N = 200 delivers at most"):
        shown(Explorer(scenario), mu=1.0)


# Tornado leaves the socket that it could not bind to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_port_that_is_taken_is_one_message(examples, capsys):
    pytest.importorskip("bokeh", reason="bokeh is not installed")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert run(["explore", str(examples / "finger.toml"), "--port", str(port), "--no-browser"]) == 2
        gc.collect()
    assert f"error: --port {port} cannot be used" in capsys.readouterr().err


def test_without_bokeh_the_command_says_what_to_install(examples, capsys, monkeypatch):
    class Missing:
        """An importer that knows of no bokeh."""

        @staticmethod
        def find_spec(name, *_):
            if name.partition(".")[0] == "bokeh":
                raise ModuleNotFoundError("No module named 'bokeh'", name="bokeh")

    for name in [name for name in sys.modules if name.partition(".")[0] == "bokeh"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "tendonff.compensator.studies.explore.page", raising=False)
    monkeypatch.setattr("sys.meta_path", [Missing, *sys.meta_path])
    assert run(["explore", str(examples / "finger.toml"), "--no-browser"]) == 2
    assert "pip install bokeh" in capsys.readouterr().err


def test_the_worst_case_is_that_of_a_design_of_the_same_profiles(scenario):
    unsure = replace(scenario, robust=Uncertainty(mu=0.15, samples=3))
    explorer = Explorer(unsure)
    found = design(unsure, compensators=[curve.name for curve in explorer.fast]).expectation
    stated = explorer.worst_case(start(explorer), design_knows=True)
    assert f"({two_digits(found.best.worst.rmse_percent_of_range)} % of range)" in stated
    assert "mu ±15 % (as [robust] states)" in stated
