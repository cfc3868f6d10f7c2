import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.closed_form import Capstan
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.compensators.score import score
from tendonff.compensator.scenario.reference import Shape, SineReference, WaypointReference
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.figures import error_figure
from tendonff.compensator.studies.design.run import Design, design
from tendonff.models.fidelity import Level
from tendonff.models.parameters.uncertainty import Uncertainty

WITHOUT_STRIBECK = ["finger", *(pytest.param(name, marks=pytest.mark.compiler) for name in ("bowden", "surgical"))]
COLUMNS = [
    "time_s",
    "reference_N",
    "force_none_N",
    "force_frictionless_N",
    "force_capstan_N",
    "force_smoothed_N",
    "force_inverse_N",
    "force_optimal_N",
    "force_table_N",
    "travel_inverse_m",
    "travel_optimal_m",
]


@pytest.fixture
def percent(output):
    """RMS error, % of the reference's range, that a design states on its own level."""

    def of(name, compensator, part="design"):
        written = summary_of(output("design", name))
        level = written["design_level"]
        return (written["proof"] if part == "proof" else written)["compensators"][compensator][level][
            "rmse_percent_of_range"
        ]

    return of


def named(*names):
    """Compensators by their names."""
    return [c for c in COMPENSATORS if c.name in names]


def summary_of(made):
    return json.loads((made.folder / "summary.json").read_text(encoding="utf-8"))


@pytest.mark.compiler
@pytest.mark.each_value
@pytest.mark.parametrize("name", WITHOUT_STRIBECK)
@pytest.mark.parametrize("compensator", ["inverse", "optimal"])
def test_a_design_leaves_at_most_0_3_percent_on_its_own_level(percent, name, compensator):
    assert percent(name, compensator) <= 0.3


@pytest.mark.compiler
@pytest.mark.parametrize("name", WITHOUT_STRIBECK)
@pytest.mark.parametrize("compensator", ["inverse", "optimal"])
def test_a_design_leaves_at_most_0_3_percent_on_a_chain_of_40_masses_at_a_tenth_of_the_step(percent, name, compensator):
    assert percent(name, compensator, "proof") <= 0.3


@pytest.mark.parametrize("name", WITHOUT_STRIBECK)
def test_without_compensation_more_than_15_percent_is_lost(percent, name):
    assert percent(name, "none") > 15


@pytest.mark.parametrize("level", list(Level))
def test_the_finger_can_be_designed_on_every_level(examples, level):
    scenario = load_scenario(examples / "finger.toml")
    result = design(replace(scenario, run=replace(scenario.run, level=level)), compensators=named("inverse", "optimal"))
    for compensator in ("inverse", "optimal"):
        assert result.on_level(compensator, level).score.rmse_percent_of_range <= 0.3


@pytest.mark.parametrize(
    "name",
    [
        *WITHOUT_STRIBECK,
        pytest.param("finger_fast", marks=pytest.mark.compiler),
        pytest.param("finger_stribeck", marks=[pytest.mark.compiler, pytest.mark.nightly]),
    ],
)
def test_every_profile_but_the_uncompensated_respects_the_actuator(output, examples, name):
    profile = pd.read_csv(output("design", name).folder / "profile.csv")
    scenario = load_scenario(examples / f"{name}.toml")
    actuator, step = scenario.transmission.actuator, scenario.run.step_s
    for compensator in ("capstan", "smoothed", "inverse", "optimal", "table"):
        force = profile[f"force_{compensator}_N"].to_numpy()
        slack = 1e-6 * actuator.force_max_N
        assert force.min() >= actuator.force_min_N - slack
        assert force.max() <= actuator.force_max_N + slack
        assert np.abs(np.diff(force)).max() <= actuator.force_rate_max_N_per_s * step * (1 + 1e-6)


@pytest.mark.compiler
def test_where_the_rate_limit_binds_the_optimal_profile_beats_the_clipped_inverse(output, percent):
    errors = {c: percent("finger_fast", c) for c in ("inverse", "capstan", "optimal")}
    assert errors["optimal"] <= 0.6 * min(errors["inverse"], errors["capstan"])
    assert any("actuator limits are active" in w for w in summary_of(output("design", "finger_fast"))["warnings"])


def test_the_capstan_force_is_the_static_law_where_the_limits_allow_it(examples):
    """T_in = T_out e^{mu theta} while the reference rises; the Bowden cable's limits leave room for it."""
    scenario = load_scenario(examples / "bowden.toml")
    reference = sample_reference(scenario)
    force = Capstan().profile(Problem.of(scenario)).force_N
    friction, theta = scenario.transmission.friction, scenario.transmission.path.total_angle_rad
    late = int(np.argmax(reference.tension_N))  # the top of a smooth rise: the rate limit has long let go
    lifted = reference.tension_N[late] + friction.adhesion_N
    assert force[late] == pytest.approx(lifted * math.exp(friction.mu_dynamic * theta) - friction.adhesion_N)


def test_a_score_counts_rms_over_the_range_and_the_worst_error():
    reference, output = np.array([10.0, 20.0, 30.0]), np.array([10.0, 17.0, 34.0])
    result = score(reference, output)
    assert result.rmse == pytest.approx(math.sqrt(25 / 3))
    assert result.rmse_percent_of_range == pytest.approx(100 * math.sqrt(25 / 3) / 20)
    assert result.peak_error == 4.0


def test_a_refined_plant_reads_the_profile_as_linear_between_its_rows(examples):
    """A refined simulation differs from the coarse one by the scheme's own error only."""
    scenario = load_scenario(examples / "finger.toml")
    reference = sample_reference(scenario)
    force = 30.0 + 1.2 * (reference.tension_N - 30.0)
    coarse, fine = (
        Plant(scenario.transmission, Level.PRESLIDING, refinement=k).respond(Profile(force_N=force), reference)
        for k in (1, 4)
    )
    difference = coarse.output_N - fine.output_N
    assert 0 < np.sqrt(np.mean(difference**2)) < 5e-4 * np.ptp(coarse.output_N)


@pytest.mark.compiler
def test_the_command_writes_everything_in_the_contract(output):
    made = output("design", "finger")
    profile = pd.read_csv(made.folder / "profile.csv")
    assert list(profile.columns) == COLUMNS
    assert len(profile) == 4001
    assert profile.notna().all().all()
    written = summary_of(made)
    assert written["schema"] == 1
    for name in ("none", "capstan", "smoothed", "inverse", "optimal", "table"):
        for level in ("elastic", "viscoelastic", "presliding"):
            assert set(written["compensators"][name][level]) == {"rmse_N", "rmse_percent_of_range", "peak_error_N"}
    assert {"status", "iterations", "build_s", "solve_s"} <= set(written["ocp"])
    assert isinstance(written["warnings"], list)
    for figure in ("tension", "force", "drive", "loop", "error"):
        assert (made.folder / f"{figure}.svg").stat().st_size > 10_000
    assert "presliding*" in made.messages


def test_a_constant_reference_is_drawn_without_a_warning(examples, recwarn):
    scenario = load_scenario(examples / "finger.toml")
    still = replace(
        scenario,
        reference=WaypointReference(times_s=(0.0, 0.2), tensions_N=(30.0, 30.0), shape=Shape.LINEAR),
    )
    error_figure(design(still, compensators=named("none", "capstan", "inverse")))
    assert not [w for w in recwarn if "identical low and high" in str(w.message)]


def test_a_compensator_that_is_worse_than_none_is_called_so(examples):
    """At 40 Hz the rate limit leaves of the inverse a force that does more harm than good."""
    scenario = load_scenario(examples / "finger_fast.toml")
    quick = SineReference(
        initial_tension_N=30.0, amplitudes_N=(3.0,), frequencies_Hz=(40.0,), duration_s=0.5, fade_in_s=0.1
    )
    fast = replace(
        scenario,
        reference=quick,
        transmission=replace(
            scenario.transmission, actuator=replace(scenario.transmission.actuator, force_rate_max_N_per_s=2000.0)
        ),
    )
    result = design(fast)
    [worse] = [w for w in result.warnings if "more than the reference applied directly" in w]
    assert all(f"{name} " in worse for name in ("frictionless", "capstan", "inverse", "table"))
    assert "smoothed" not in worse
    assert "optimal" not in worse


@pytest.mark.compiler
@pytest.mark.usefixtures("unpainted")
def test_a_reference_out_of_reach_gets_the_best_profile_and_is_refused_where_design_is_strict(
    examples, tmp_path, capsys
):
    text = (examples / "finger.toml").read_text().replace("force_max_N = 200.0", "force_max_N = 60.0")
    (tmp_path / "weak.toml").write_text(text)
    command = ["design", str(tmp_path / "weak.toml"), "--out", str(tmp_path / "out")]
    largest = f"{60 * math.exp(-0.2 * math.pi):.4g} N"
    assert run([*command, "--strict"]) == 2
    message = capsys.readouterr().err
    assert largest in message
    assert message.count("\n") == 1
    assert not (tmp_path / "out").exists()
    assert run(command) == 0
    assert largest in capsys.readouterr().err
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["ocp"]["status"] == "best_achievable"
    rmse = {name: levels["presliding"]["rmse_N"] for name, levels in summary["compensators"].items()}
    assert rmse["optimal"] == min(rmse.values())


def test_a_really_measured_trace_can_be_the_reference(examples, measured_data, tmp_path):
    """A band brake's tension, scaled to the finger's range: noisy as measured, and conditioned."""
    trace = pd.read_csv(measured_data / "band_capstan" / "dataset4_harmonic.csv")
    trace = trace[trace["time_s"] <= 4]
    tension = trace["input_tension_N"]
    scaled = 15 + 40 * (tension - tension.min()) / (tension.max() - tension.min())
    pd.DataFrame({"time_s": trace["time_s"], "tension_N": scaled}).to_csv(tmp_path / "trace.csv", index=False)
    head = (examples / "finger.toml").read_text().split("[reference]")[0]
    run_table = '[run]\nstep_s = 0.001\nlevel = "presliding"\n'
    results = {}
    for cutoff in ("", "cutoff_Hz = 10.0\n"):
        path = tmp_path / f"scenario{len(cutoff)}.toml"
        path.write_text(f'{head}[reference]\nkind = "csv"\nfile = "trace.csv"\n{cutoff}\n{run_table}')
        results[cutoff] = design(load_scenario(path), compensators=named("none", "inverse"))
    raw, conditioned = results.values()
    assert any("set cutoff_Hz" in w for w in raw.warnings)
    assert any("removed" in w for w in conditioned.warnings)
    inverse = next(p for p in conditioned.proof if p.compensator == "inverse")
    assert inverse.score.rmse_percent_of_range <= 0.3


@pytest.fixture(scope="module")
def uncertain(examples: Path) -> Design:
    scenario = load_scenario(examples / "finger.toml")
    uncertainty = Uncertainty(mu=0.15, bristle_stiffness=0.2, samples=4)
    return design(replace(scenario, reference=replace(scenario.reference, duration_s=2.0), robust=uncertainty))


def test_under_uncertainty_every_compensator_gets_an_error_band(uncertain):
    assert set(uncertain.expectation.bands) == {c.name for c in COMPENSATORS}
    for band in uncertain.expectation.bands.values():
        assert band.rms().min() <= band.nominal.rmse <= band.rms().max() <= band.worst.rmse
        assert band.worst.rmse <= band.worst_peak


def test_the_robust_profile_is_better_than_the_inverse_in_the_worst_case(uncertain):
    bands = uncertain.expectation.bands
    assert bands["optimal"].worst.rmse < bands["inverse"].worst.rmse


def test_over_compensation_is_warned_of_where_friction_is_less_than_thought(uncertain):
    inverse = uncertain.expectation.bands["inverse"]
    assert inverse.amplification > 0
    assert inverse.amplified_sample.numbers["mu"] < 1
    assert len([w for w in uncertain.warnings if w.startswith("over-compensation") and "inverse" in w]) == 1


def test_sliding_that_weakens_with_speed_is_foreseen_with_the_error_to_expect(examples):
    """A stiff bristle, slow sliding and mu_static = 1.5 mu_dynamic: unstable under any feedforward."""
    scenario = load_scenario(examples / "finger_stribeck.toml")
    friction = replace(scenario.transmission.friction, mu_static=1.5 * scenario.transmission.friction.mu_dynamic)
    stiff = replace(
        scenario,
        transmission=replace(scenario.transmission, friction=friction),
        run=replace(scenario.run, level=Level.ELASTIC),
    )
    result = design(stiff, compensators=named("none", "inverse"))
    assert result.stick_slip.stretches
    assert any("unstable" in w or "stick" in w for w in result.warnings)
    assert result.stick_slip.expected_error_N > 0.01 * result.reference.range_N


def test_what_is_enlarged_leaves_out_profiles_that_do_not_compensate_friction(examples):
    """They would set the scale, and nothing would be enlarged."""
    scenario = load_scenario(examples / "finger.toml")
    scenario = replace(scenario, run=replace(scenario.run, step_s=4e-3))
    figure = error_figure(design(scenario, compensators=named("none", "frictionless", "capstan", "inverse")))
    whole, zoom = figure.axes[:2]
    assert (len(whole.lines), len(zoom.lines)) == (4, 2)
    assert np.ptp(zoom.get_ylim()) < 0.6 * np.ptp(whole.get_ylim())
