"""Identification against chains whose truth is known: finest chain, noise, spikes, gaps."""

import json
from dataclasses import replace

import numpy as np
import pytest
from synthetic import DIRTY, Faults, write_synthetic

from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import read_csv
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.suggest import suggest
from tendonff.compensator.scenario.sampled.sampling import initial_tension, sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate

pytestmark = pytest.mark.compiler  # a fit takes seconds with compiled code and many minutes without

MU, MU_RELEASE, K1, K2, TAU, SIGMA = 0.25, 0.21, 1.6e4, 9e3, 0.25, 3e4


@pytest.fixture(scope="module")
def nominal(examples):
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="module")
def truth(nominal):
    t = nominal.transmission
    return replace(
        t,
        tendon=replace(t.tendon, stiffness_N_per_m=K1, relaxing_stiffness_N_per_m=K2, relaxation_time_s=TAU),
        friction=replace(
            t.friction,
            mu_dynamic=MU,
            mu_static=MU,
            mu_dynamic_release=MU_RELEASE,
            mu_static_release=MU_RELEASE,
            soft_bristle_stiffness_N_per_m=SIGMA,
        ),
    )


def excitation(seconds=16.0):
    """Strokes, two holds, small reversals, strokes again; smooth."""
    times = np.array([0, 0.5, 1.7, 2.9, 3.3, 5.0, 5.4, 7.1, 8.0, 8.6, 9.2, 9.8, 11, 12.2, 13.4, 14.7, 16])
    forces = np.array([40, 40, 75, 12, 60, 60, 25, 25, 60, 50, 60, 40, 70, 10, 62, 14, 45.0])
    time = np.arange(0, seconds + 1e-9, 0.002)
    k = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2)
    s = (time - times[k]) / (times[k + 1] - times[k])
    return time, forces[k] + (forces[k + 1] - forces[k]) * s**3 * (10 - 15 * s + 6 * s * s)


@pytest.fixture(scope="module")
def answer(nominal, truth, examples, tmp_path_factory):
    """The command's output on a dirty file."""
    folder = tmp_path_factory.mktemp("identify")
    write_synthetic(folder / "rig.csv", truth, *excitation(), replace(DIRTY, gaps_s=(0.1, 0.01), seed=4), step_s=2e-3)
    code = run(
        ["identify", str(examples / "finger.toml"), "--data", str(folder / "rig.csv"), "--out", str(folder / "out")]
    )
    assert code == 0
    return folder / "out"


def fit(answer):
    return json.loads((answer / "fit.json").read_text())


def test_the_truth_is_found_from_a_dirty_file(answer):
    estimates = fit(answer)["estimates"]
    for name, true, within in (
        ("mu_dynamic", MU, 0.02),
        ("mu_dynamic_release", MU_RELEASE, 0.02),
        ("stiffness_N_per_m", K1, 0.03),
        ("relaxing_stiffness_N_per_m", K2, 0.10),
        ("relaxation_time_s", TAU, 0.10),
        ("soft_bristle_stiffness_N_per_m", SIGMA, 0.15),
    ):
        assert estimates[name]["identifiable"], name
        assert estimates[name]["estimate"] == pytest.approx(true, rel=within), name


def test_every_value_says_where_it_comes_from(answer):
    friction = load_scenario(answer / "fitted.toml").transmission.friction
    for name, estimate in fit(answer)["estimates"].items():
        assert estimate["why"], name
        assert estimate["identifiable"] <= (estimate["interval_95"] is not None)
        if not estimate["identifiable"] and estimate["scenario"] is not None:
            # Static friction follows the dynamic one, in fitted.toml and in the report.
            kept = getattr(friction, name) if name.startswith("mu_static") else estimate["scenario"]
            assert estimate["estimate"] == pytest.approx(kept, rel=1e-12), name


def test_the_dirt_is_reported_with_counts_and_times(answer):
    [file] = fit(answer)["files"]
    found = {f["kind"]: f for f in file["findings"]}
    assert found["missing values"]["count"] == 2
    assert found["spikes"]["times_s"]
    assert "bridged" in found["gaps"]["text"]


def test_the_law_is_chosen_by_the_error_where_it_was_not_fitted(answer):
    """The truth has two coefficients and presliding, and nothing else."""
    found = fit(answer)
    assert found["law"] == "asymmetric with presliding"
    by_name = {law["name"]: law["validation_percent_of_range"] for law in found["laws"]}
    assert by_name["asymmetric with presliding"] < 0.5 * by_name["asymmetric"]
    assert by_name["asymmetric with presliding"] < by_name["symmetric with presliding"]


def test_a_profile_designed_with_the_fit_works_on_the_hidden_plant(answer, truth):
    fitted = load_scenario(answer / "fitted.toml")
    reference = sample_reference(fitted)
    chain = Chain.of(fitted.transmission, fitted.run.level)
    force = invert(chain, reference.tension_N, reference.step_s).force_N
    hidden = simulate(Chain.of(truth, Level.PRESLIDING, 40), force, reference.step_s)
    left = np.sqrt(np.mean((hidden.output_tension_N - reference.tension_N) ** 2)) / np.ptp(reference.tension_N)
    assert left < 0.02


def test_figures_and_a_force_file_come_with_the_answer(answer):
    for name in ("time", "loop", "residuals", "relaxation", "suggested_force"):
        assert (answer / f"{name}.svg").stat().st_size > 5000
    read_csv(answer / "suggested_force.csv", ["time_s", "force_N"], starts_at_zero=True)


def test_without_positions_the_tendon_is_named_as_not_identifiable(nominal, truth, tmp_path):
    time, force = excitation(7.0)
    write_synthetic(tmp_path / "rig.csv", truth, time, force, Faults(seed=1), step_s=2e-3, positions=False)
    found = identify(nominal, [tmp_path / "rig.csv"])
    for name in ("stiffness_N_per_m", "relaxing_stiffness_N_per_m", "relaxation_time_s"):
        estimate = found.estimate(name)
        assert not estimate.identifiable
        assert "measure both positions" in estimate.why
        assert estimate.value == estimate.scenario
    assert found.estimate("mu_dynamic").identifiable
    assert found.scenario.transmission.tendon == nominal.transmission.tendon


def slow_strokes():
    """Straight strokes of 2 s each between random loads."""
    rng = np.random.default_rng(2)
    turns = np.concatenate([[40.0], np.ravel([[h, low] for h, low in rng.uniform([30, 5], [90, 25], (6, 2))])])
    time = np.linspace(0, 24, 2401)
    return time, np.interp(time, np.arange(len(turns)) * 2.0, turns)


def test_intervals_of_the_static_law_hold_the_truth_although_it_knows_no_presliding(nominal, truth, tmp_path):
    """A soft bristle shows alike after every reversal: an error that the scatter between blocks does not see."""
    soft = replace(truth, friction=replace(truth.friction, soft_bristle_stiffness_N_per_m=5e4))
    file = tmp_path / "rig.csv"
    write_synthetic(file, soft, *slow_strokes(), Faults(noise=0.001, seed=1), step_s=5e-3, positions=False)
    found = identify(nominal, [file], static_only=True)
    for name, true in (("mu_dynamic", MU), ("mu_dynamic_release", MU_RELEASE)):
        low, high = found.estimate(name).interval
        assert low <= true <= high
        assert high - low < 0.2 * true


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "law"),
    [
        # As `test_fitted.py` does too.
        pytest.param(
            {"adhesion_N": 3.0}, "asymmetric with presliding, load-independent friction", marks=pytest.mark.nightly
        ),
        pytest.param(
            {"mu_static": 1.3 * MU, "mu_static_release": 1.3 * MU_RELEASE},
            "asymmetric with presliding, Stribeck effect",
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_an_effect_that_is_there_is_found_by_the_choice_of_the_law(nominal, truth, effect, law, tmp_path):
    hidden = replace(truth, friction=replace(truth.friction, **effect))
    write_synthetic(tmp_path / "rig.csv", hidden, *excitation(), Faults(seed=3), step_s=2e-3)
    found = identify(nominal, [tmp_path / "rig.csv"])
    assert found.law.startswith(law)
    assert found.estimate("mu_dynamic").value == pytest.approx(MU, rel=0.03)
    for name, true in effect.items():
        low, high = found.estimate(name).interval
        assert low <= true <= high


@pytest.mark.parametrize("quantity", ["adhesion", "bias"])
def test_static_constants_are_found_by_the_play_law(nominal, quantity, tmp_path):
    """A stiff bristle and slow strokes are the play law itself; adhesion and the input cell's bias act alike in it."""
    t = nominal.transmission
    friction = replace(t.friction, adhesion_N=4.0 if quantity == "adhesion" else 0.0)
    faults = Faults(noise=0.001, input_offset_N=3.0 if quantity == "bias" else 0.0)
    file = tmp_path / "rig.csv"
    write_synthetic(file, replace(t, friction=friction), *slow_strokes(), faults, level=Level.ELASTIC, step_s=5e-3)
    found = identify(nominal, [file], static_only=True)
    assert "with load-independent friction" in found.law
    law = CapstanLaw.of(replace(t, friction=friction))
    estimate = found.estimate("mu_dynamic")
    assert estimate.value * np.pi == pytest.approx(law.pull_exponent, rel=0.02)
    assert np.ptp(estimate.interval) < 0.1 * estimate.value  # without presliding there is little to doubt
    if quantity == "adhesion":
        assert found.estimate("adhesion_N").value == pytest.approx(4.0, abs=0.4)
    else:
        assert found.estimate("input_offset_N").value == pytest.approx(3.0, abs=0.4)


def test_the_suggested_excitation_respects_the_actuator(nominal):
    for scenario in (nominal, replace(nominal, transmission=_weaker(nominal.transmission))):
        force, actuator = suggest(scenario), scenario.transmission.actuator
        assert force.force_N.min() >= actuator.force_min_N
        assert force.force_N.max() <= actuator.force_max_N
        assert force.force_N[0] == pytest.approx(initial_tension(scenario))
        rate = np.abs(np.diff(force.force_N) / np.diff(force.time_s)).max()
        assert rate <= actuator.force_rate_max_N_per_s
        hold = 3 * scenario.transmission.tendon.relaxation_time_s
        still = np.convolve(np.diff(force.force_N) == 0, np.ones(int(hold / 0.005)), "valid")
        assert still.max() == int(hold / 0.005)


def test_the_suggested_excitation_goes_as_deep_as_the_reference(examples):
    scenario = load_scenario(examples / "surgical.toml")
    law, lowest = CapstanLaw.of(scenario.transmission), sample_reference(scenario).tension_N.min()
    wanted = float(law.input_for_N(lowest, Branch.RELEASE))
    assert wanted < 0.05 * scenario.transmission.actuator.force_max_N
    assert suggest(scenario).force_N.min() == pytest.approx(wanted, rel=1e-6)


def _weaker(transmission):
    actuator = replace(transmission.actuator, force_min_N=5.0, force_max_N=60.0, force_rate_max_N_per_s=40.0)
    return replace(transmission, actuator=actuator)


def test_suggest_alone_writes_a_force_file(examples, tmp_path):
    assert run(["identify", str(examples / "bowden.toml"), "--suggest", "--out", str(tmp_path / "s")]) == 0
    assert {p.name for p in (tmp_path / "s").iterdir()} == {
        "suggested_drive.csv",
        "suggested_force.csv",
        "suggested_force.svg",
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "name at least one with --data"),
        (["--data", "nowhere.csv"], "no such file"),
        (["--data", "x.csv", "--scale", "inptu=2"], 'unknown column "inptu", did you mean "input"'),
        (["--data", "x.csv", "--scale", "two"], "--scale must be a number"),
    ],
)
def test_bad_arguments_are_one_message(examples, tmp_path, capsys, arguments, message):
    code = run(["identify", str(examples / "finger.toml"), *arguments, "--out", str(tmp_path / "o")])
    assert code == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "o").exists()
