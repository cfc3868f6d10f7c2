"""What to expect on a rig: the first sentence of a design."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.closed_form import Capstan, Frictionless, Inverse, Uncompensated
from tendonff.compensator.compensators.expectation import expectation_of
from tendonff.compensator.compensators.plant import FINE_SEGMENTS, Plant
from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.report import fine_print
from tendonff.compensator.studies.design.run import design
from tendonff.models.fidelity import Level
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import simulate

QUICK = (Uncompensated(), Frictionless(), Capstan(), Inverse())


@pytest.fixture(scope="module")
def finger(examples):
    scenario = load_scenario(examples / "finger.toml")
    return replace(scenario, run=replace(scenario.run, step_s=2e-3))


@pytest.fixture(scope="module")
def assumed(finger):
    return design(finger, compensators=QUICK)


def error_percent(scenario, force, factor):
    """RMS error on a plant whose friction differs, computed here by hand."""
    friction = scenario.transmission.friction
    mu = factor * friction.mu_dynamic
    plant = replace(scenario.transmission, friction=replace(friction, mu_dynamic=mu, mu_static=mu))
    reference = Problem.of(scenario).reference
    run = simulate(
        Chain.of(plant, scenario.run.level, FINE_SEGMENTS),
        force,
        reference.step_s,
        initial_tension_N=reference.initial_tension_N,
    )
    return 100 * np.sqrt(np.mean((run.output_tension_N - reference.tension_N) ** 2)) / reference.range_N


def test_without_a_statement_friction_is_assumed_to_be_known_to_ten_percent_and_that_is_said(finger, assumed):
    found = assumed.expectation
    assert found.doubt.is_assumed
    for name in ("none", "inverse"):
        worst = max(error_percent(finger, assumed.forces_N[name], factor) for factor in (0.9, 1.0, 1.1))
        assert found.worst_percent[name] == pytest.approx(worst, rel=1e-6)
    assert "mu ±10 % (assumed; set [robust])" in assumed.headline


def test_the_first_sentence_has_the_worst_case_and_the_small_print_the_model_against_itself(assumed):
    worst = assumed.expectation.worst_percent["inverse"]
    assert worst > 3  # per cent, where the model against itself has less than a tenth
    band, said = assumed.expectation.bands["inverse"], assumed.headline
    assert said.startswith(f"Tracking error up to {band.worst.rmse:.2g} N RMS ({worst:.1f} % of range), peak ")
    assert f"peak {band.worst_peak:.2g} N" in said
    own = assumed.on_proof("inverse").score.percent
    assert float(own) < 0.1
    assert own not in said
    assert own in fine_print(assumed)


def test_the_profile_with_the_least_worst_error_is_recommended(assumed):
    worst = assumed.expectation.worst_percent
    shown = {name: float(f"{value:.2g}") for name, value in worst.items()}
    assert shown[assumed.recommended.name] == min(shown.values())
    assert assumed.recommended.label in assumed.headline


def test_of_profiles_that_do_equally_well_there_the_one_that_is_best_with_the_design_s_parameters_is_recommended(
    examples,
):
    """Of two profiles with the same two digits; a third digit would turn the choice round."""
    scenario = load_scenario(examples / "finger.toml")
    made = design(scenario, compensators=QUICK)
    good, poor = made.expectation.bands["inverse"], made.expectation.bands["capstan"]
    less = replace(good.worst, rmse_percent_of_range=0.999 * good.worst.rmse_percent_of_range)
    doubt = Doubt.of(scenario.transmission, Uncertainty())
    bands = {"a": replace(poor, worst=less), "b": good}
    assert expectation_of(doubt, Level.PRESLIDING, bands).recommended == "b"


def test_the_band_holds_the_output_of_every_sample(finger, assumed):
    found = assumed.expectation
    assert np.all(found.best.low <= found.best.high)
    plant = Plant(finger.transmission, finger.run.level, FINE_SEGMENTS)
    nominal = plant.respond(assumed.profiles[found.recommended], assumed.reference).output_N
    assert np.all((found.best.low <= nominal + 1e-9) & (nominal <= found.best.high + 1e-9))
    assert np.max(found.best.high - found.best.low) > 1


def test_what_the_scenario_states_is_used_and_said(finger):
    stated = design(replace(finger, robust=Uncertainty(mu=0.25, samples=3)), compensators=QUICK)
    assert not stated.expectation.doubt.is_assumed
    assert "mu ±25 % (as [robust] states)" in stated.headline
    worst = max(error_percent(finger, stated.forces_N["inverse"], factor) for factor in (0.75, 1.0, 1.25))
    assert stated.expectation.worst_percent["inverse"] == pytest.approx(worst, rel=1e-6)


def test_a_headline_names_a_reference_that_was_raised(assumed):
    found, label = assumed.expectation, assumed.recommended.label
    raised = replace(found, share_of=replace(assumed.reference, raised_N=2.5).share_of)
    assert "% of range), peak" in found.headline(label, "stop")
    assert "% of range of the reference raised to 2.5 N), peak" in raised.headline(label, "stop")


def test_doubt_names_every_width(finger):
    found = Doubt.of(finger.transmission, Uncertainty(stiffness=0.1, bristle_stiffness=0.3, samples=7))
    assert found.widths == "stiffness ±10 %, bristle_stiffness ±30 %"
    assert len(found.samples) == 7


def test_no_profile_beyond_the_actuator_is_recommended_where_the_reference_is_out_of_reach(examples):
    """Ten times too high: all that is applied is within the limits, and the optimal profile gives its best there."""
    bowden = load_scenario(examples / "bowden.toml")
    most = bowden.transmission.actuator.largest_force_N
    far = replace(bowden.reference, tensions_N=tuple(10 * each for each in bowden.reference.tensions_N))
    found = design(
        replace(bowden, reference=far, run=replace(bowden.run, step_s=4e-3)),
        compensators=("none", "inverse", "optimal"),
    )
    for profile in found.profiles.values():
        assert profile.force_N.max() <= most * (1 + 1e-9)
    errors = {name: band.worst.rmse for name, band in found.expectation.bands.items()}
    assert errors["optimal"] <= 1.01 * min(errors.values())
    assert "lower the reference to at most" in found.headline
