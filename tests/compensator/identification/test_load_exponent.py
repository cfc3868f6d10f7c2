"""Friction that falls with the load, found from a log and used by a design, on a plant of its own."""

from dataclasses import replace

import numpy as np
import pytest
from test_synthetic import excitation

from tendonff.compensator.compensators.base import Problem, with_motion
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification import pace
from tendonff.compensator.identification.run import identify
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import simulate
from tests.independent_plant import respond

pytestmark = [pytest.mark.compiler, pytest.mark.nightly]  # a fit of half a minute


@pytest.mark.parametrize("seed", [0, 11, 12])
def test_a_polymer_tendon_is_identified_and_compensated(examples, tmp_path, monkeypatch, record_property, seed):
    """mu ~ T^-0.2: the exponent within 5 %, 0.1 % of range left after design, and the promise holds and is small.

    With the noise of the last two the law was adhesion, or had an offset that the cell has not: 1.7 and 0.4 % left.
    """
    monkeypatch.setattr(pace, "MOST", 1e3)  # tests compile quickly, and compute slowly
    scenario = load_scenario(examples / "finger.toml")
    t = scenario.transmission
    friction = replace(
        t.friction,
        mu_dynamic=0.24,
        mu_static=0.24,
        mu_dynamic_release=0.22,
        mu_static_release=0.22,
        soft_bristle_stiffness_N_per_m=3e4,
        load_exponent=0.2,
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
        tmp_path / "log.csv",
        {
            "time_s": fine[::4],
            "input_tension_N": logged(run.tension_N[:, 0]),
            "output_tension_N": logged(run.output_tension_N),
            "input_position_m": logged(run.near_position_m),
            "output_position_m": logged(run.far_position_m),
        },
    )
    found = identify(scenario, [tmp_path / "log.csv"])
    exponent = next(e for e in found.estimates if e.name == "load_exponent")
    assert exponent.identifiable
    assert exponent.value == pytest.approx(0.2, rel=0.05)
    problem = Problem.of(found.scenario)
    profile = with_motion(problem, "inverse", compensator("inverse").profile(problem))
    reference = problem.reference
    seen = respond(truth, reference.time_s, profile.force_N, reference.initial_tension_N, masses=12)
    error = seen.output_N - reference.tension_N
    percent = 100 * float(np.sqrt(np.mean(error**2))) / reference.range_N
    band = problem.expect({"inverse": profile}).best
    said, expected = band.worst.rmse_percent_of_range, band.expected_percent
    text = f"{percent:.2g} % of range, {expected:.2g} % expected, {said:.2g} % at most"
    record_property("figure", f"mu ~ T^-0.2, identified and designed: {text}")
    assert percent < 0.1
    assert percent < said < 0.35
    assert 0.04 < expected < 0.075
