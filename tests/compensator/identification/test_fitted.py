"""The answer is the model it reports: fitted.toml is one consistent set, and its own error is the one printed."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import Faults, write_synthetic

from tendonff.compensator.identification import outcome
from tendonff.compensator.identification.answer.messages import moved_inside
from tendonff.compensator.identification.answer.records import Channel
from tendonff.compensator.identification.fitting.dynamic import ChainLaw
from tendonff.compensator.identification.fitting.errors import FileError
from tendonff.compensator.identification.fitting.parametric_chain import ParametricChain
from tendonff.compensator.identification.fitting.static import respond
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.cleaning import clean
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.identification.measured.smoothing import low_pass_piece
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.measurement import Explain
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.path import Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate

pytestmark = pytest.mark.compiler

MU, MU_RELEASE, ADHESION = 0.25, 0.21, 2.5
STEP = 2e-3


@pytest.fixture(scope="module")
def nominal(examples):
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="module")
def truth(nominal):
    t = nominal.transmission
    friction = replace(
        t.friction,
        mu_dynamic=MU,
        mu_static=MU,
        mu_dynamic_release=MU_RELEASE,
        mu_static_release=MU_RELEASE,
        adhesion_N=ADHESION,
    )
    return replace(t, friction=friction)


def rms(x):
    return float(np.sqrt(np.mean(x**2)))


def strokes(seed, seconds=9.0):
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds + 1e-9, STEP)
    turns = np.arange(0, seconds + 1.1, 1.1)
    levels = np.where(
        np.arange(len(turns) + 1) % 2, rng.uniform(60, 90, len(turns) + 1), rng.uniform(8, 30, len(turns) + 1)
    )
    levels[0] = 40
    k = np.clip(np.searchsorted(turns, time, side="right") - 1, 0, len(turns) - 2)
    s = np.clip((time - turns[k]) / 1.0, 0, 1)
    return time, levels[k] + (levels[k + 1] - levels[k]) * s**3 * (10 - 15 * s + 6 * s * s)


@pytest.fixture(scope="module")
def logs(truth, tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    for k, name in enumerate(("wet.csv", "dry.csv")):
        write_synthetic(folder / name, truth, *strokes(k + 5), Faults(noise=0.002, seed=k), step_s=STEP)
    return [folder / "wet.csv", folder / "dry.csv"]


@pytest.fixture(scope="module")
def arguments():
    """What the comparison of laws was given, and its answer."""
    return []


@pytest.fixture(scope="module")
def found(nominal, logs, arguments):
    def compared(*given):
        arguments.append((given, outcome.compared(*given)))
        return arguments[-1][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tendonff.compensator.identification.run.compared", compared)
        return identify(nominal, logs)


@pytest.fixture(scope="module")
def laws_compared(found, arguments):
    [one] = arguments
    return one


def test_adhesion_is_found_and_goes_on(found):
    """Half of it would pass unnoticed in the error of the fit, and costs the design several percent."""
    assert found.law == "asymmetric with presliding, load-independent friction"
    estimate = found.estimate("adhesion_N")
    assert estimate.identifiable
    assert estimate.interval[0] <= ADHESION <= estimate.interval[1]
    assert found.scenario.transmission.friction.adhesion_N == estimate.value == pytest.approx(ADHESION, rel=0.2)


def test_the_fitted_scenario_has_every_value_of_the_fit(found, nominal):
    friction, tendon = found.scenario.transmission.friction, found.scenario.transmission.tendon
    for name in ("mu_dynamic", "soft_bristle_stiffness_N_per_m"):
        assert getattr(friction, name) == found.estimate(name).value
    for name in ("stiffness_N_per_m", "relaxing_stiffness_N_per_m", "relaxation_time_s"):
        assert found.estimate(name).fitted
        assert getattr(tendon, name) == found.estimate(name).value != getattr(nominal.transmission.tendon, name)
    assert found.scenario.run.level is Level.PRESLIDING


def test_what_is_printed_is_what_is_written(found):
    """Also where a value was not fitted: static friction follows the dynamic one, and that is said."""
    t = found.scenario.transmission
    estimates = [e for e in found.estimates if hasattr(t.friction, e.name) or hasattr(t.tendon, e.name)]
    for each in estimates:
        assert each.value == pytest.approx(getattr(t.friction, each.name, getattr(t.tendon, each.name, None))), each
    assert {"mu_static", "mu_dynamic_release"} <= {each.name for each in estimates}
    assert found.estimate("mu_static").value == pytest.approx(MU, rel=0.02)
    assert found.estimate("mu_static").value == pytest.approx(t.friction.mu_static)


@pytest.mark.usefixtures("unpainted")
def test_simulating_the_fitted_scenario_again_gives_the_error_that_is_printed(found, tmp_path, logs):
    found.write(tmp_path / "out")
    fitted = load_scenario(tmp_path / "out" / "fitted.toml")
    assert found.replay_percent == pytest.approx(found.fit_percent, rel=1e-3)
    assert any(f"fitted.toml, read back: RMS error {found.replay_percent:.2f} %" in s for s in found.lines())
    model = ParametricChain(
        transmission=fitted.transmission, level=fitted.run.level, count=fitted.transmission.path.segments
    )
    assert model.values()[Parameter.ADHESION] == found.estimate("adhesion_N").value


def test_a_design_with_it_works_on_the_hidden_plant(found, truth):
    fitted = found.scenario
    reference = sample_reference(fitted)
    force = invert(Chain.of(fitted.transmission, fitted.run.level), reference.tension_N, reference.step_s).force_N
    hidden = simulate(Chain.of(truth, Level.PRESLIDING, 40), force, reference.step_s).require()
    off = hidden.output_tension_N - reference.tension_N
    assert 100 * np.sqrt(np.mean(off**2)) / np.ptp(reference.tension_N) < 0.6


def test_mu_theta_is_an_answer_of_its_own(found):
    estimate, mu = found.estimate("mu_theta"), found.estimate("mu_dynamic")
    assert estimate.value == pytest.approx(np.pi * MU, rel=0.01)
    assert estimate.interval == pytest.approx((np.pi * mu.interval[0], np.pi * mu.interval[1]))


def test_each_of_several_files_says_its_own(found):
    assert [f.file for f in found.by_file] == ["wet.csv", "dry.csv"]
    for file in found.by_file:
        assert file.values["mu_dynamic"] == pytest.approx(MU, rel=0.05)
    assert set(found.as_json()["by_file"]) == {"wet.csv", "dry.csv"}


def test_the_law_that_validates_better_is_chosen_across_the_stages(found):
    by_name = {law.name: law for law in found.laws}
    assert by_name["asymmetric with presliding, load-independent friction"].chosen
    assert (
        by_name["asymmetric with load-independent friction"].validation_percent > by_name[found.law].validation_percent
    )


def test_laws_are_compared_on_the_same_rows_and_range(laws_compared):
    """Each error again, by hand: the same rows of the same low-passed output, in percent of its range in all files."""
    (stage, chain, records), laws = laws_compared
    output = np.concatenate([r.joined("output_N") for r in records])
    for law, fit in zip(laws, stage.tried, strict=False):
        off = []
        for run in chain.law.task.pieces:
            play = respond(fit.values, run.piece, Explain.OUTPUT, fit.middle_m).prediction_N
            smooth = low_pass_piece(play, run.record.step_s, run.record.cutoff_Hz)
            off.append((smooth - run.piece.output_N)[:: run.thin][run.good])
        assert law.fit_percent == pytest.approx(100 * rms(np.concatenate(off)) / np.ptp(output))
    assert len(laws) == len(stage.tried) + len(chain.law.candidates)
    for law, candidate in zip(laws[len(stage.tried) :], chain.law.candidates, strict=True):
        assert law.fit_percent == pytest.approx(100 * candidate.fit.rms / np.ptp(output))


@pytest.mark.nightly
def test_a_path_that_is_not_even_widens_the_stiffness_and_is_named(nominal, truth, tmp_path):
    """The elongation tells it; an interval from the scatter alone would miss the stiffness by several widths."""
    theta = truth.path.total_angle_rad
    halves = (
        Section(name="near", angle_rad=0.75 * theta, length_m=0.5),
        Section(name="far", angle_rad=0.25 * theta, length_m=0.5),
    )
    uneven = replace(truth, path=replace(truth.path, sections=halves), friction=replace(truth.friction, adhesion_N=0.0))
    write_synthetic(tmp_path / "a.csv", uneven, *strokes(5, seconds=13.0), Faults(noise=0.003), step_s=STEP)
    found = identify(nominal, [tmp_path / "a.csv"])
    [message] = [w for w in found.warnings if "the elongation fits better" in w]
    near_rad = float(message.partition("actuator has ")[2].split()[0])
    assert near_rad == pytest.approx(0.75 * theta, rel=0.1)
    for name in ("stiffness_N_per_m", "relaxing_stiffness_N_per_m"):
        estimate, true = found.estimate(name), getattr(truth.tendon, name)
        assert estimate.value > 1.05 * true
        assert estimate.interval[0] <= true <= estimate.interval[1]
    assert found.estimate("mu_dynamic").value == pytest.approx(MU, rel=0.01)


def write_delayed(path, truth, noise, delay):
    """A log whose far end is read so many samples later."""
    write_synthetic(path, truth, *strokes(5), Faults(noise=noise), step_s=STEP)
    lines = path.read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    for k in reversed(range(delay, len(rows))):
        rows[k][2], rows[k][4] = rows[k - delay][2], rows[k - delay][4]
    path.write_text("\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n")
    return path


@pytest.mark.nightly
def test_a_delay_of_one_sample_is_seen_in_the_elongation_and_taken_out(nominal, truth, tmp_path):
    """The output hardly shows it, and the relaxing stiffness would be 10 % off."""
    found = identify(nominal, [write_delayed(tmp_path / "a.csv", truth, 0.01, 1)])
    assert found.output_delay_s == pytest.approx(STEP, abs=0.2 * STEP)
    assert any("ms later than the input" in w for w in found.warnings), found.warnings
    low, high = found.estimate("relaxing_stiffness_N_per_m").interval
    assert low <= truth.tendon.relaxing_stiffness_N_per_m <= high


def test_a_piece_behind_a_gap_starts_as_a_stroke_left_it(nominal, truth, tmp_path):
    """Not from rest: the tendon slid before. The values are the true ones, so that all that is left is the start."""
    write_synthetic(tmp_path / "a.csv", truth, *strokes(5), Faults(noise=0.0, gaps_s=(1.3,)), step_s=STEP)
    record = clean(read_measurement(tmp_path / "a.csv", nominal.measurement), nominal.measurement)
    first, second = record.pieces
    model = ParametricChain(transmission=truth, level=Level.PRESLIDING, count=20)
    law = ChainLaw(model=model, values=model.values(), explain=Explain.OUTPUT)
    left = [
        rms(found.explained - piece.output_N)
        for found, piece in zip(law.predicted(record), (first, second), strict=True)
    ]
    from_rest = law.predicted(replace(record, pieces=(second,)))[0].explained
    assert left[1] < 0.5 * rms(from_rest - second.output_N)


@pytest.mark.parametrize("noise", [pytest.param(0.001, marks=pytest.mark.nightly), 0.005])
def test_a_delay_of_the_output_is_measured_and_taken_out(nominal, truth, tmp_path, noise):
    """The far cell is logged 12 ms later, which in short files looks much like viscous friction and hides adhesion."""
    found = identify(nominal, [write_delayed(tmp_path / "a.csv", truth, noise, 6)])
    assert found.output_delay_s == pytest.approx(0.012, abs=0.001)
    assert any("the output is read" in w and "ms later than the input" in w for w in found.warnings), found.warnings
    assert found.law.startswith("asymmetric with presliding, load-independent friction")
    assert found.estimate("mu_dynamic").value == pytest.approx(MU, rel=0.02)
    viscous = found.estimate("viscous_N_s_per_m")  # with little noise it is seen beside the delay, at its true value
    assert viscous.value == pytest.approx(truth.friction.viscous_N_s_per_m, abs=0.5)


@pytest.mark.nightly
def test_viscous_friction_is_not_taken_for_a_delay(nominal, truth, tmp_path):
    viscous = replace(truth, friction=replace(truth.friction, viscous_N_s_per_m=25.0))
    write_synthetic(tmp_path / "a.csv", viscous, *strokes(5, seconds=13.0), Faults(noise=0.005), step_s=STEP)
    found = identify(nominal, [tmp_path / "a.csv"])
    assert not any("the output is read" in w for w in found.warnings)
    assert "viscous friction" in found.law
    assert found.estimate("viscous_N_s_per_m").value == pytest.approx(25.0, rel=0.1)


def test_moments_at_which_the_output_moves_although_the_law_holds_it_are_named():
    time = np.arange(0, 4, 0.01)
    model = np.clip(20 * np.sin(2 * np.pi * 0.25 * time), -10, 10)
    touched = model + np.where((time > 0.6) & (time < 0.9), 3.0, 0.0)

    def piece(measured):
        return Channel(
            figure="time",
            file="a.csv",
            role="fit",
            name="output",
            unit="N",
            time_s=time,
            measured=measured,
            model=model,
        )

    assert moved_inside([piece(model)]) == []
    [(name, when)] = moved_inside([piece(touched)])
    assert (name, when) == ("a.csv", pytest.approx(0.6, abs=0.02))


def test_an_error_in_percent_of_its_own_range():
    assert FileError(name="a", rms=0.5, span=20.0).percent == pytest.approx(2.5)
