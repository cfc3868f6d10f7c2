"""One expectation of a live reference: design, compare, export-c and Runtime state the same."""

import pytest

import tendonff as tf
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.live import expect_live
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.export.c_project import export_project

pytestmark = pytest.mark.compiler


@pytest.mark.parametrize("example", ["finger", "bowden"])
def test_design_compare_export_and_runtime_expect_the_same_of_a_tension(examples, example):
    scenario = tf.load_scenario(examples / f"{example}.toml")
    inverse = next(each for each in tf.COMPENSATORS if each.name == "inverse")
    plain = next(each for each in tf.COMPENSATORS if each.name == "none")
    live = tf.Runtime(scenario).expectation
    design = tf.design(scenario, compensators=(plain, inverse))
    assert design.live.error == live.error
    exported = export_project(scenario, profile_N=design.profiles["inverse"].force_N)
    assert exported.expectation.error == live.error
    assert f"For a reference that arrives live: Tracking error up to {live.error}" in exported.files["README.md"]
    compared = tf.compare(scenario, compensators=(plain, inverse))
    if scenario.run.level is tf.Level.PRESLIDING and compared.recommended_level is scenario.run.level:
        assert compared.bands["inverse", scenario.run.level].worst.rmse == pytest.approx(
            live.best.worst.rmse, rel=0.02, abs=0
        )


@pytest.mark.nightly  # as of a tension
def test_export_and_runtime_expect_the_same_of_a_joint(examples):
    scenario = tf.load_scenario(examples / "hand_joint.toml")
    live = tf.Runtime(scenario).expectation
    exported = tf.export_c(scenario)
    assert f"error up to {live.error}, with the exact inverse" in exported.headlines[0]
    assert exported.headlines[0] in exported.files["README.md"]
    designed = tf.design(scenario).expectation
    assert live.best.worst.rmse == pytest.approx(designed.bands["inverse"].worst.rmse, rel=0.05)


def test_a_live_reference_is_never_promised_the_optimal_profile(examples):
    """Limits bind: the optimal profile, which knows the reference in advance, does better than anything live."""
    design = tf.design(tf.load_scenario(examples / "finger_fast.toml"))
    assert design.expectation.recommended == "optimal"
    assert design.live.recommended == "inverse"
    assert design.live.best.worst.rmse > design.expectation.best.worst.rmse


def test_errors_that_are_known_are_not_simulated_again(examples, monkeypatch):
    problem = Problem.of(tf.load_scenario(examples / "finger.toml"))
    profiles = {each.name: problem.answer(each) for each in tf.COMPENSATORS if each.name in ("frictionless", "inverse")}
    known = problem.expect(profiles, "inverse").bands
    monkeypatch.setattr(Plant, "respond", None)
    assert expect_live(problem, profiles).bands == known
