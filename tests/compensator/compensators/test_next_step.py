"""The next step removes the largest part of the expected error."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.expectation import ErrorBand, expectation_of
from tendonff.compensator.compensators.live import expect_live
from tendonff.compensator.compensators.next_step import limited_by, next_step, within_reach
from tendonff.compensator.compensators.score import Score
from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.scenario.doubts import out_of_reach
from tendonff.compensator.scenario.unit import RADIAN
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.fidelity import Level
from tendonff.models.parameters.uncertainty import Spread, Uncertainty

EXPORT = "tendonff export-c rig.toml --out c"
SUGGEST = "tendonff identify rig.toml --suggest --out excite"


@pytest.fixture(scope="module")
def transmission(examples):
    return load_scenario(examples / "finger.toml").transmission


def expected(system, spreads, added, *, nominal=0.1, **others):
    """An expectation in which each of the intervals adds so much to the error [% of range]."""
    doubt = Doubt.of(system, Uncertainty(spread=spreads, samples=1 + 2 * len(spreads)))
    errors = [nominal]
    for more in added:
        errors += [nominal + more] * 2
    scores = tuple(Score(rmse=e, rmse_percent_of_range=e, peak_error=2 * e) for e in errors)
    total = nominal + sum(added)
    band = ErrorBand(
        scores=scores,
        worst=Score(rmse=total, rmse_percent_of_range=total, peak_error=2 * total),
        worst_sample=doubt.samples[-1],
        expected_rmse=nominal,
        expected_percent=nominal,
        likely_rmse=(nominal, nominal),
        likely_percent=(nominal, nominal),
        worst_peak=2 * total,
        amplification=0.0,
        amplified_sample=doubt.samples[-1],
        slack_samples=0,
        low=np.zeros(2),
        high=np.zeros(2),
        errors=None,
    )
    return expectation_of(doubt, Level.PRESLIDING, {"inverse": band}, **others)


MU = Spread(keys=("friction.mu_dynamic",), half_width=0.25)
DRIVE = Spread(keys=("actuator.coulomb_N",), low=0.0, high=10.0)
LOAD = Spread(keys=("load.stiffness_N_per_m",), half_width=0.3)


@pytest.mark.parametrize(
    ("added", "said"),
    [
        ((6.0, 2.0, 1.0), SUGGEST),
        ((1.0, 6.0, 2.0), f"{SUGGEST}, and log actuator_force_N beside the tension"),
        ((1.0, 2.0, 6.0), "measure load.stiffness_N_per_m (pull at the load"),
    ],
)
def test_the_next_step_measures_the_number_with_the_largest_contribution(transmission, added, said):
    found = expected(transmission, (MU, DRIVE, LOAD), added)
    assert next_step(found, "rig.toml", EXPORT).startswith(said)


def test_the_controller_comes_next_only_where_no_single_measurement_pays(transmission):
    measured = Spread(keys=("friction.mu_dynamic",), half_width=0.03)
    assert next_step(expected(transmission, (measured, DRIVE), (3.0, 0.2)), "rig.toml", EXPORT) == EXPORT
    assert next_step(expected(transmission, (MU,), (0.5,)), "rig.toml", EXPORT) == EXPORT  # small as it is
    assert next_step(expected(transmission, (MU,), (1.0,), nominal=8.0), "rig.toml", EXPORT) == EXPORT
    assert next_step(expected(transmission, (measured, DRIVE), (3.0, 1.5)), "rig.toml", EXPORT).startswith(SUGGEST)


def test_a_law_that_the_measurements_do_not_exclude_asks_for_a_log_that_decides(transmission):
    """Each number is known well; the other law has an error of 3 %, or one that noise explains as well."""
    measured = Spread(keys=("friction.mu_dynamic",), half_width=0.03)
    found = expected(transmission, (measured,), (1.0,))
    for percent, step in ((3.0, SUGGEST), (0.05, EXPORT)):
        other = Score(rmse=percent, rmse_percent_of_range=percent, peak_error=percent)
        band = replace(found.best, other=other, worst=max(other, found.best.worst, key=lambda each: each.rmse))
        both = replace(found, bands={found.recommended: band})
        assert next_step(both, "rig.toml", EXPORT) == step
        assert any("[robust.other_law]" in each for each in both.warnings) == (step == SUGGEST)


def test_what_is_only_assumed_is_measured_first_even_where_the_error_is_small(examples):
    mechanism = load_scenario(examples / "hand_joint.toml").mechanism
    found = expected(mechanism, (Spread(keys=("stiffness",), half_width=0.2),), (0.5,), unit=RADIAN)
    assert next_step(found, "rig.toml", EXPORT) == EXPORT
    assumed = replace(found, doubt=replace(found.doubt, is_assumed=True))
    assert next_step(assumed, "rig.toml", EXPORT) == SUGGEST


def test_an_unknown_friction_of_a_joint_s_drive_is_logged_as_the_motor_s_torque(examples):
    mechanism = load_scenario(examples / "hand_joint.toml").mechanism
    drive = Spread(keys=("drive.coulomb_N_m",), low=0.0, high=0.05)
    found = expected(mechanism, (drive,), (6.0,), unit=RADIAN)
    assert next_step(found, "rig.toml", EXPORT).startswith(f"{SUGGEST}, and log motor_torque_N_m")


def test_a_reference_out_of_reach_says_what_to_change(transmission):
    law, most = CapstanLaw.of(transmission), transmission.actuator.largest_force_N
    within = law.largest_output_N(most)
    assert within_reach(transmission, 0.99 * within) == ""
    needed = float(law.input_for_N(1.2 * within, Branch.PULL))
    change = within_reach(transmission, 1.2 * within)
    assert change == (
        f"lower the reference to at most {within:.4g} N, or raise force_max_N from {most:g} to {needed:.4g}"
    )
    assert needed == pytest.approx(1.2 * within * math.exp(law.pull_exponent), rel=1e-9)
    found = expected(transmission, (MU,), (6.0,))
    assert next_step(found, "rig.toml", EXPORT, change=change) == change


def test_an_actuator_of_which_nothing_arrives_is_not_asked_for_a_lower_reference(transmission):
    """4.6e-14 N as the most says nothing."""
    path = replace(transmission.path, total_angle_rad=100.0)
    lost = replace(transmission, path=path)
    change, said = within_reach(lost, 30.0), out_of_reach(lost, 1.0, 30.0)
    assert "lower the reference" not in change + said
    assert change.startswith("raise force_max_N from ")
    assert "nothing arrives" in change
    assert "nothing arrives" in said


def test_table_and_export_say_so_as_design_does(examples):
    """The expectation of a problem carries the change, whichever command shows it."""
    scenario = load_scenario(examples / "finger.toml")
    weak = replace(scenario.transmission, actuator=replace(scenario.transmission.actuator, force_max_N=30.0))
    problem = Problem.of(replace(scenario, transmission=weak, run=replace(scenario.run, step_s=4e-3)))
    found = expect_live(problem)
    assert found.change == within_reach(weak, float(problem.reference.tension_N.max())) != ""
    assert next_step(found, "rig.toml", EXPORT) == found.change


def test_a_number_that_changes_nothing_is_no_contribution(transmission):
    """As friction is over a tendon of mu = 0."""
    said = expected(transmission, (MU,), (0.0,)).headline("exact inverse", EXPORT)
    assert "What is uncertain adds nothing to the error." in said
    assert "Largest contribution: friction.mu" in expected(transmission, (MU,), (5.0,)).headline("x", EXPORT)


def test_a_limit_of_the_drive_is_named_where_it_causes_most_of_the_error(transmission):
    reasons = ("a rate limit of 808 N/s would keep that below 1 % of the range",)
    assert limited_by(expected(transmission, (MU,), (1.0,), nominal=5.0), reasons).endswith(reasons[0])
    assert limited_by(expected(transmission, (MU,), (5.0,), nominal=1.0), reasons) == ""


@pytest.mark.parametrize(("unit", "purpose"), [({}, "force control"), ({"unit": RADIAN}, "positioning")])
def test_a_large_error_is_called_not_good_enough(transmission, unit, purpose):
    said = expected(transmission, (MU,), (15.0,), **unit).headline("exact inverse", EXPORT)
    assert said.startswith(f"Not good enough for {purpose}: tracking error up to ")
    assert expected(transmission, (MU,), (9.0,), **unit).headline("exact inverse", EXPORT).startswith("Tracking error")
