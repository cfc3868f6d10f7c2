"""Friction that falls with the load, found from a log and used by a design, on a plant of its own."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from test_synthetic import excitation

from tendonff.compensator.compensators.base import Problem, with_motion
from tendonff.compensator.compensators.expectation import ErrorBand
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification import pace
from tendonff.compensator.identification.answer.result import Identification
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import simulate
from tests.independent_plant import respond

pytestmark = [pytest.mark.compiler, pytest.mark.nightly]  # a fit of half a minute


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A fit to a log, and its design on the rig."""

    found: Identification
    band: ErrorBand
    percent: float  # RMS error on the rig [% of range]
    warnings: list[str]


@pytest.fixture
def tried(examples, tmp_path, monkeypatch) -> Callable[[float, int], Tried]:
    """A rig of that load exponent, and the noise of a seed on its log."""
    monkeypatch.setattr(pace, "MOST", 1e3)  # tests compile quickly, and compute slowly
    scenario = load_scenario(examples / "finger.toml")
    return lambda exponent, seed: _tried(scenario, tmp_path / "log.csv", exponent, seed)


def _tried(scenario, log, exponent, seed) -> Tried:
    t = scenario.transmission
    friction = replace(
        t.friction,
        mu_dynamic=0.24,
        mu_static=0.24,
        mu_dynamic_release=0.22,
        mu_static_release=0.22,
        soft_bristle_stiffness_N_per_m=3e4,
        load_exponent=exponent,
        reference_tension_N=40.0,
    )
    truth = replace(t, friction=friction, tendon=replace(t.tendon, stiffness_N_per_m=1.6e4))
    time, force = excitation()
    fine = np.arange(0, time[-1], 5e-4)
    run = simulate(
        Chain.of(truth, Level.PRESLIDING, 40), np.interp(fine, time, force), 5e-4, initial_tension_N=40.0
    ).require()
    noise = np.random.default_rng(seed)

    def logged(channel):
        kept = channel[::4]
        return kept + 0.002 * np.ptp(kept) * noise.standard_normal(len(kept))

    write_csv(
        log,
        {
            "time_s": fine[::4],
            "input_tension_N": logged(run.tension_N[:, 0]),
            "output_tension_N": logged(run.output_tension_N),
            "input_position_m": logged(run.near_position_m),
            "output_position_m": logged(run.far_position_m),
        },
    )
    found = identify(scenario, [log])
    problem = Problem.of(found.scenario)
    profile = with_motion(problem, "inverse", compensator("inverse").profile(problem))
    reference = problem.reference
    seen = respond(truth, reference.time_s, profile.force_N, reference.initial_tension_N, masses=12)
    error = seen.output_N - reference.tension_N
    percent = 100 * float(np.sqrt(np.mean(error**2))) / reference.range_N
    expectation = problem.expect({"inverse": profile})
    return Tried(found=found, band=expectation.best, percent=percent, warnings=expectation.warnings)


@pytest.mark.parametrize("seed", [0, 11, 12])
def test_a_polymer_tendon_is_identified_and_compensated(tried, record_property, seed):
    """mu ~ T^-0.2: the exponent within 5 %, 0.1 % of range left after design, and the promise holds and is small.

    With the noise of the last two the law was adhesion, or had an offset that the cell has not: 1.7 and 0.4 % left.
    """
    rig = tried(0.2, seed)
    exponent = rig.found.estimate("load_exponent")
    assert exponent.identifiable
    assert exponent.value == pytest.approx(0.2, rel=0.05)
    band, percent = rig.band, rig.percent
    said, expected = band.worst.rmse_percent_of_range, band.expected_percent
    text = f"{percent:.2g} % of range, {expected:.2g} % expected, {said:.2g} % at most"
    record_property("figure", f"mu ~ T^-0.2, identified and designed: {text}")
    assert percent < 0.1
    assert percent < said < 0.35
    assert 0.04 < expected < 0.075


def test_a_log_that_does_not_tell_adhesion_from_friction_that_falls_is_answered_with_both(tried):
    """mu ~ T^-0.1: 0.78 % of range left of 0.16 expected, 0.46 at most, before the other law was counted."""
    rig = tried(0.1, 108)
    friction, other = rig.found.scenario.transmission.friction, rig.found.scenario.robust.other_law.numbers
    assert (friction.load_exponent, other["friction.adhesion_N"]) == (None, 0.0)
    assert other["friction.load_exponent"] == pytest.approx(0.1, rel=0.1)
    assert any("explain these files alike" in each for each in rig.found.warnings)
    assert rig.band.expected_percent < rig.percent / 2
    assert rig.band.likely_percent[1] == pytest.approx(rig.percent, rel=0.1)
    assert rig.band.worst.rmse_percent_of_range > 0.95 * rig.percent
    assert any("[robust.other_law]" in each for each in rig.warnings)
