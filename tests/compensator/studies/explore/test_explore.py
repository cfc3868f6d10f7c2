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
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_to_toml
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.run import design
from tendonff.compensator.studies.explore.run import FAST, SLOW, ExploreParameters, Explorer
from tendonff.models.errors import TendonffError
from tendonff.models.fidelity import Level
from tendonff.models.parameters.uncertainty import Uncertainty


@pytest.fixture(scope="module")
def scenario(examples):
    return load_scenario(examples / "finger.toml")


@pytest.mark.parametrize("name", ["finger", "bowden", "finger_moving"])
def test_the_parameters_start_at_the_scenario(examples, name):
    scenario = load_scenario(examples / f"{name}.toml")
    for level in Level:
        there = replace(scenario, run=replace(scenario.run, level=level))
        parameters = ExploreParameters.of(there)
        moved = parameters.apply(there)
        back = ExploreParameters.of(moved)
        assert back.total_angle_deg == pytest.approx(parameters.total_angle_deg, rel=1e-14)
        assert replace(back, total_angle_deg=parameters.total_angle_deg) == parameters
        assert moved.joints == there.joints
        path, before = moved.transmission.path, there.transmission.path
        assert [s.angle_rad for s in path.parts] == pytest.approx([s.angle_rad for s in before.parts], rel=1e-12)


def test_every_friction_coefficient_follows_mu(scenario):
    friction = replace(scenario.transmission.friction, mu_dynamic=0.2, mu_static=0.3, mu_dynamic_release=0.1)
    own = replace(scenario, transmission=replace(scenario.transmission, friction=friction))
    moved = replace(ExploreParameters.of(own), mu=0.4).apply(own).transmission.friction
    assert [moved.mu_dynamic, moved.mu_static, moved.release_dynamic, moved.release_static] == pytest.approx(
        [0.4, 0.6, 0.2, 2 * friction.release_static]
    )


def test_a_pose_turns_every_joint_and_sections_keep_their_shares(examples):
    scenario = load_scenario(examples / "finger_moving.toml")
    start = ExploreParameters.of(scenario)
    assert start.pose_deg
    turned = replace(start, total_angle_deg=0.5 * start.total_angle_deg, pose_deg=dict.fromkeys(start.pose_deg, 10.0))
    changed = turned.apply(scenario)
    for name in scenario.joints:
        before, after = (sample_joints(one, 1.0).angle_rad for one in (scenario, changed))
        assert after - before == pytest.approx(np.full_like(before, np.radians(10.0)), abs=1e-12), name
    halves = zip(changed.transmission.path.parts, scenario.transmission.path.parts, strict=True)
    assert all(after.angle_rad == pytest.approx(before.angle_rad / 2) for after, before in halves)
    assert Explorer(scenario).at(start).courses["inverse"].score.rmse_percent_of_range < 1


def test_what_is_saved_is_the_changed_scenario(scenario):
    explorer = Explorer(scenario)
    changed = replace(explorer.start, mu=0.25, load_stiffness_N_per_m=2500.0).apply(scenario)
    again = parse_scenario(scenario_to_toml(changed), scenario.source)
    assert again == changed
    assert again.transmission.load.stiffness_N_per_m == 2500.0


@pytest.mark.compiler
def test_self_tuning_recovers_most_of_what_a_design_for_other_friction_misses(scenario):
    """Over the whole run, the time in which it learns at a limited rate included: three fifths."""
    explorer = Explorer(scenario)
    changed = replace(explorer.start, mu=0.24)
    plain = explorer.at(changed, design_knows=False).courses["inverse"].score.rmse
    slow = explorer.at(changed, design_knows=False, curves=SLOW).courses
    assert set(slow) == {"smoothed", "optimal", "table", "self_tuning"}
    assert slow["self_tuning"].score.rmse < plain / 2.5
    assert slow["optimal"].score.rmse > plain / 2


def test_the_inverse_that_knows_the_change_stays_exact_and_the_other_does_not(scenario):
    explorer = Explorer(scenario)
    changed = replace(explorer.start, mu=0.25)
    knowing, blind = (explorer.at(changed, design_knows=knows).courses for knows in (True, False))
    assert knowing["inverse"].score.rmse_percent_of_range < 1e-6
    assert blind["inverse"].score.rmse_percent_of_range > 1
    assert np.abs(blind["inverse"].error).max() == pytest.approx(blind["inverse"].score.peak_error, rel=0.05)


def test_a_slower_actuator_costs_accuracy(scenario):
    explorer = Explorer(scenario)
    errors = [
        explorer.at(replace(explorer.start, force_rate_max_N_per_s=rate)).courses["inverse"].score.rmse
        for rate in (1e5, 300.0, 100.0)
    ]
    assert errors == sorted(errors)
    assert errors[-1] > 1


def test_what_cannot_be_delivered_is_said_and_not_drawn(scenario):
    explorer = Explorer(scenario)
    with pytest.raises(TendonffError, match="force_max_N = 200 delivers at most"):
        explorer.at(replace(explorer.start, mu=1.0))


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
    fast = [curve.compensator for curve in FAST]
    found = design(unsure, compensators=fast).expectation
    stated = explorer.worst_case_at(explorer.start)
    assert f"({two_digits(found.best.worst.rmse_percent_of_range)} % of range)" in stated
    assert "mu ±15 % (as [robust] states)" in stated
