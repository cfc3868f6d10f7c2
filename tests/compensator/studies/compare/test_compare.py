"""The comparison of levels on a short scenario."""

import contextlib
import csv
import io
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.base import CAPSTAN_PLANT, Problem
from tendonff.compensator.compensators.expectation import ErrorBand
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.compensators.registry import COMPENSATORS, compensator
from tendonff.compensator.compensators.score import Score
from tendonff.compensator.compensators.uncertain import Sample
from tendonff.compensator.files.text import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_to_toml
from tendonff.compensator.scenario.settings import Compare
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.compare.levels import level_traits
from tendonff.compensator.studies.compare.matrix import Entry, lag, recommend
from tendonff.compensator.studies.compare.run import SIMPLE, compare
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.fidelity import Level

COLUMNS = "compensator,design_level,plant_level,rmse_percent_of_range,peak_error_N,lag_s,spread_percent_of_range"


def short(scenario):
    """One second of the reference, coarser: enough to compare, quick to compute."""
    reference = replace(scenario.reference, duration_s=1.2, fade_in_s=0.2)
    return replace(scenario, reference=reference, run=replace(scenario.run, step_s=2e-3))


@pytest.fixture(scope="module")
def finger(examples):
    return short(load_scenario(examples / "finger.toml"))


@pytest.fixture(scope="module")
def result(finger):
    return compare(finger)


@pytest.fixture(scope="module")
def folder(finger, tmp_path_factory):
    """What the command writes, and what it says in `said.txt`."""
    target = tmp_path_factory.mktemp("compare")
    scenario, said = target / "s.toml", io.StringIO()
    scenario.write_text(scenario_to_toml(finger), encoding="utf-8")
    with contextlib.redirect_stderr(said):
        assert run(["compare", str(scenario), "--out", str(target / "out")]) == 0
    (target / "out" / "said.txt").write_text(said.getvalue(), encoding="utf-8")
    return target / "out"


@pytest.mark.compiler
def test_every_design_meets_every_plant(result):
    cells = [(e.compensator, e.design_level, e.plant_level) for e in result.entries]
    assert cells == [
        (c.name, level, plant) for c in COMPENSATORS if c.is_compared for level in Level for plant in result.plants
    ]


@pytest.mark.compiler
def test_each_inverse_is_best_on_its_own_level(result):
    for plant in Level:
        errors = {design: result.entry("inverse", design, plant).rmse_percent_of_range for design in Level}
        spread = max(result.entry("inverse", design, plant).spread_percent_of_range for design in Level)
        assert errors[plant] <= min(errors.values()) + spread
        assert errors[plant] < 0.2


@pytest.mark.compiler
def test_the_static_inverse_is_exact_on_the_static_law_and_nowhere_else(result):
    own = result.entry("capstan", Level.ELASTIC, CAPSTAN_PLANT)
    assert own.rmse_percent_of_range < 1e-9
    assert own.spread_percent_of_range == 0
    assert result.entry("capstan", Level.ELASTIC, Level.PRESLIDING).rmse_percent_of_range > 5


@pytest.mark.compiler
def test_the_spread_covers_what_a_finer_step_changes(finger, result):
    """A third of the step is none of those that the spread was made of."""
    for name, design in (("inverse", Level.ELASTIC), ("capstan", Level.ELASTIC)):
        reference = Problem.of(finger).reference
        force = compensator(name).profile(Problem.of(finger, level=design)).force_N
        plant = Plant(finger.transmission, Level.ELASTIC, refinement=3)
        other = plant.respond(Profile(force_N=force), reference).output_N
        shown = result.outputs[name, design, Level.ELASTIC.value]
        difference = 100 * float(np.sqrt(np.mean((other - shown) ** 2))) / reference.range_N
        assert 0 < difference <= result.entry(name, design, Level.ELASTIC).spread_percent_of_range


@pytest.mark.compiler
def test_stick_slip_shows_as_spread_and_is_warned_of(examples):
    result = compare(short(load_scenario(examples / "finger_stribeck.toml")))
    stiff = result.entry("inverse", Level.PRESLIDING, Level.ELASTIC)
    assert stiff.spread_percent_of_range > 0.1
    assert any("depends on the time step" in warning for warning in result.warnings)


@pytest.mark.parametrize("delay", [-0.9, -0.1, 0.0, 0.0125, 0.2, 0.95])
def test_a_delay_is_found_as_lag(delay):
    time = np.arange(0, 4, 1e-3)
    wanted = 30 + 10 * np.sin(2 * np.pi * 0.7 * time) + 3 * np.sin(2 * np.pi * 1.9 * time)
    late = time - delay
    got = 25 + 4 * np.sin(2 * np.pi * 0.7 * late) + 1.2 * np.sin(2 * np.pi * 1.9 * late)
    assert lag(wanted, got, 1e-3) == pytest.approx(delay, abs=5e-4)


def test_a_whole_period_is_no_lag():
    """A sine of 1.25 s looks the same a period later; lags are sought within a quarter of the duration."""
    wave = 30 + 10 * np.sin(2 * np.pi * np.arange(0, 4, 1e-3) / 1.25)
    assert lag(wave, wave, 1e-3) == pytest.approx(0, abs=5e-4)


def test_a_constant_has_no_lag():
    assert lag(np.full(100, 3.0), np.full(100, 3.0), 1e-3) == 0


def test_the_levels_differ_in_what_they_are_made_for(finger):
    reference, t = sample_reference(finger), finger.transmission
    elastic, viscoelastic, presliding = (level_traits(t, level, reference) for level in Level)
    static = level_traits(t, None, reference)
    assert elastic.relaxation_percent < 0.5 < viscoelastic.relaxation_percent
    assert presliding.deadband_N < 0.7 * elastic.deadband_N
    assert presliding.reversal_width_N > 5 * elastic.reversal_width_N
    assert elastic.loop_area_percent == pytest.approx(static.loop_area_percent, abs=2)
    # The capstan law in closed form: the output moves when the force has fallen by 1 - e^{-2 mu theta}.
    law = CapstanLaw.of(t)
    high = float(law.input_for_N(float(reference.tension_N.max()), Branch.PULL))
    exact = high * (1 - math.exp(-law.pull_exponent - law.release_exponent))
    assert static.deadband_N == pytest.approx(exact, rel=0.03)
    assert static.reversal_width_N <= 0.03 * high


def entries(**errors):
    """Matrix column of the presliding plant: errors of none, capstan and the three designs."""
    values = {"none": [errors["none"]] * 3, "capstan": [errors["capstan"]] * 3}
    values["inverse"] = values["optimal"] = [errors[level.value] for level in Level]
    return tuple(
        Entry(
            compensator=name,
            design_level=level,
            plant_level="presliding",
            rmse_percent_of_range=error,
            peak_error=1.0,
            lag_s=0.0,
            spread_percent_of_range=errors.get("spread", 0.0),
        )
        for name, column in values.items()
        for level, error in zip(Level, column, strict=True)
    )


def band(percent):
    """An error band of which only the worst error counts."""
    worst = Score(rmse=percent, rmse_percent_of_range=percent, peak_error=percent)
    nothing = Sample(system=None)
    return ErrorBand(
        scores=(worst,),
        worst=worst,
        worst_sample=nothing,
        expected_rmse=percent,
        expected_percent=percent,
        likely_rmse=(percent, percent),
        likely_percent=(percent, percent),
        worst_peak=percent,
        amplification=0.0,
        amplified_sample=nothing,
        slack_samples=0,
        low=np.zeros(1),
        high=np.zeros(1),
        errors=None,
    )


@pytest.mark.parametrize(
    ("errors", "sentence"),
    [
        (
            {"none": 20, "capstan": 8, "elastic": 0.2, "viscoelastic": 0.2, "presliding": 0.1},
            (
                "The elastic level is enough here: RMS error 0.20 % of range on the presliding plant, for mu ±10 %; "
                "the best design 0.10 %."
            ),
        ),
        (
            {"none": 20, "capstan": 8, "elastic": 3.0, "viscoelastic": 0.4, "presliding": 0.1},
            "The viscoelastic level is enough here: RMS error 0.40 %",
        ),
        (
            {"none": 20, "capstan": 8, "elastic": 4.0, "viscoelastic": 4.1, "presliding": 0.1},
            "Design on the presliding level: RMS error 0.10 % of range on the presliding plant, for mu ±10 %, against",
        ),
        (
            {"none": 20, "capstan": 0.3, "elastic": 0.2, "viscoelastic": 0.2, "presliding": 0.1},
            "The capstan law is enough here",
        ),
        (
            {"none": 0.4, "capstan": 0.3, "elastic": 0.2, "viscoelastic": 0.2, "presliding": 0.1},
            "The reference applied directly is enough here",
        ),
        (  # what the spread hides does not count
            {"none": 20, "capstan": 8, "elastic": 3.0, "viscoelastic": 3, "presliding": 0.1, "spread": 4.0},
            "The elastic level is enough here",
        ),
        (  # a large error is not called enough
            {"none": 40, "capstan": 15, "elastic": 20, "viscoelastic": 20, "presliding": 15},
            "The capstan law is as good as any here: RMS error 15 %",
        ),
    ],
)
def test_the_simplest_level_that_loses_nothing_is_recommended(errors, sentence):
    rows = entries(**errors)
    bands = {(e.compensator, e.design_level): band(e.rmse_percent_of_range) for e in rows}
    said, level = recommend(rows, COMPENSATORS, bands, "mu ±10 %", SIMPLE)
    assert said.startswith(sentence)
    assert "Not good enough" not in said  # the expectation that follows says it
    assert level in said or level is Level.ELASTIC


@pytest.mark.compiler
def test_the_files_say_the_same_as_the_result(result, folder):
    assert {"matrix.csv", "summary.json", "report.html", "matrix.svg", "levels.svg"} <= {
        path.name for path in folder.iterdir()
    }
    text = (folder / "matrix.csv").read_text(encoding="utf-8")
    assert text.splitlines()[0] == COLUMNS
    rows = list(csv.DictReader(text.splitlines()))
    assert len(rows) == len(result.entries) == 72
    assert float(rows[5]["lag_s"]) == result.entries[5].lag_s
    assert all(value != "" for row in rows for value in row.values())
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["recommendation"] == result.recommendation
    assert set(summary["levels"]) == {*map(str, Level), "capstan"}
    assert result.recommendation in (folder / "report.html").read_text(encoding="utf-8")
    assert result.recommendation in (folder / "said.txt").read_text(encoding="utf-8")


def test_the_lag_is_the_shift_of_the_largest_correlation_over_the_common_rows():
    """Against the correlation of each shift by itself."""
    rng = np.random.default_rng(1)
    wanted = np.cumsum(rng.normal(size=400)) + 30
    for moved, unlike in ((np.roll(wanted, 7), 0.1), (np.roll(wanted, -11), 0.1), (wanted, 0.0)):
        got = moved + unlike * rng.normal(size=400)
        shifts = range(-100, 101)
        alike = [
            np.corrcoef(wanted[max(-k, 0) : 400 - max(k, 0)], got[max(k, 0) : 400 - max(-k, 0)])[0, 1] for k in shifts
        ]
        assert lag(wanted, got, 1.0) == pytest.approx(shifts[int(np.argmax(alike))], abs=0.5)
    assert lag(wanted, np.full(400, 3.0), 1.0) == 0


@pytest.mark.parametrize(("name", "is_said"), [("finger", False), ("finger_fast", True)])
def test_where_limits_bind_it_is_said_that_the_optimal_profile_is_not_compared(examples, name, is_said):
    scenario = short(load_scenario(examples / f"{name}.toml"))
    quick = [compensator(each) for each in ("none", "capstan", "inverse")]
    said = " ".join(compare(scenario, compensators=quick).warnings)
    assert ("the optimal profile, which is made for them, is not compared here; --compensators " in said) == is_said


@pytest.mark.compiler
def test_a_force_of_the_users_own_is_compared_as_a_compensator(examples, tmp_path):
    """The reference as the user's force is what "none" commands; a force that ends early is refused."""
    scenario = load_scenario(examples / "finger_fast.toml")
    reference = sample_reference(scenario)
    write_csv(tmp_path / "mine.csv", {"time_s": reference.time_s, "force_N": reference.tension_N})
    own = replace(scenario, compare=Compare(force=str(tmp_path / "mine.csv")))
    assert parse_scenario(scenario_to_toml(own)).compare == own.compare
    names = ("none", "capstan", "smoothed", "inverse")
    found = compare(own, compensators=[compensator(name) for name in names])
    assert [each.name for each in found.compensators] == [*names, "own"]
    for level in Level:
        for plant in found.plants:
            mine, none = (found.entry(name, level, plant).rmse_percent_of_range for name in ("own", "none"))
            assert mine == pytest.approx(none, rel=1e-9)
    write_csv(tmp_path / "mine.csv", {"time_s": [0.0, 0.1], "force_N": [30.0, 31.0]})
    with pytest.raises(InputError, match=r"\[compare\]: .*mine.csv ends at 0.1 s, the reference at .*; give it"):
        compare(own)
