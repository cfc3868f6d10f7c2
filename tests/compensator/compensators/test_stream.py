"""References that arrive live: the filter, its choice, and the exported module on a plant that was not designed for."""

import math
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.independent_plant import Plant
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.score import scale_of, score
from tendonff.compensator.compensators.stream import (
    StreamDesign,
    StreamFilter,
    choose_stream,
    followed_range,
    smoothed,
)
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_hash, scenario_to_toml
from tendonff.compensator.scenario.settings import Stream
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError
from tendonff.ocp.codegen.precision import Precision

STEP, START, PEAK = 1e-3, 15.0, 60.0
TIME = np.arange(4000) * STEP
LSB = 100.0 / 4096


def a_filter(half, ahead=0, flat=False):
    return StreamFilter(half=half, is_flat=flat, corner_per_sample=0.13, ahead=ahead, step_s=STEP)


def a_design(half=6, ahead=0, flat=False, band=0.0):
    return StreamDesign(filter=a_filter(half, ahead, flat), band_N=band, low_N=1.0, high_N=100.0)


def gait():
    """Two bells a step, one step a second, faded in."""
    phase, fade = TIME % 1.0, np.clip(2 * TIME, 0, 1)
    bells = np.exp(-(((phase - 0.45) / 0.1) ** 2)) + 0.35 * np.exp(-(((phase - 0.22) / 0.07) ** 2))
    return START + (PEAK - START) * bells * fade**3 * (10 - 15 * fade + 6 * fade**2)


def measured(clean):
    """12 bits, and one bit of noise."""
    noise = np.random.default_rng(5).integers(-1, 2, len(clean))
    rough = (np.round(clean / LSB) + noise) * LSB
    rough[0] = clean[0]
    return rough


def above_30_Hz(values):
    spectrum = np.fft.rfft((values - values.mean()) * np.hanning(len(values)))
    return math.sqrt(np.sum(np.abs(spectrum[np.fft.rfftfreq(len(values), STEP) > 30]) ** 2))


@pytest.mark.parametrize("half", [1, 4, 15])
@pytest.mark.parametrize("flat", [False, True])
def test_a_filter_is_symmetric_and_passes_constants_and_slopes_unchanged(half, flat):
    taps, place = a_filter(half, flat=flat).taps, np.arange(-half, half + 1)
    assert np.array_equal(taps, taps[::-1])
    assert taps.sum() == pytest.approx(1, abs=1e-14)
    assert taps @ place == pytest.approx(0, abs=1e-12)
    if flat and half > 1:
        assert taps @ place**2 == pytest.approx(0, abs=1e-9 * half**2)


@pytest.mark.parametrize("window", [np.ones, np.hanning, np.hamming, np.blackman, np.bartlett])
def test_a_filter_passes_less_noise_to_the_force_than_any_usual_window(window):
    """White noise through 1 + (w/w_m)^2, summed over the frequencies."""

    def noise(taps):
        angle = np.linspace(0, np.pi, 4000)
        response = np.exp(-1j * np.outer(angle, np.arange(len(taps)))) @ taps
        return float(np.sum((1 + (angle / 0.13) ** 2) ** 2 * np.abs(response) ** 2))

    usual = window(21)
    assert noise(a_filter(10).taps) < noise(usual / usual.sum())


def test_the_lag_is_that_of_the_filter_and_with_preview_there_is_none():
    ramp = START + 2.0 * TIME[:300]
    lagging = smoothed(a_design(half=6), ramp, START)
    assert lagging[100:] == pytest.approx(ramp[94:-6], abs=1e-10)
    assert a_filter(6).lag_s == pytest.approx(0.006)
    ahead = smoothed(a_design(half=6, ahead=20), ramp, START)
    assert ahead[100:] == pytest.approx(ramp[80:-20], abs=1e-10)
    assert a_filter(6, 20).lag_s == pytest.approx(-0.02)


def test_the_last_bit_moves_nothing_inside_the_dead_band():
    noise = np.random.default_rng(1).integers(-1, 2, 500) * LSB
    assert np.ptp(smoothed(a_design(band=LSB), START + noise, START)[50:]) == 0
    assert np.ptp(smoothed(a_design(), START + noise, START)[50:]) > 0


def test_a_lost_reference_comes_back_without_a_jump():
    """20 N further after the gap: no sample moves by more than the polynomial's largest slope, 1.875/100 of it."""
    course = np.concatenate([np.full(100, START), np.full(50, np.nan), np.full(200, START + 20)])
    found = smoothed(a_design(), course, START)
    assert np.all(np.isfinite(found))
    assert found[149] == START
    assert np.abs(np.diff(found)).max() < 1.05 * 1.875 * 20 / 100
    assert found[-1] == pytest.approx(START + 20, abs=1e-9)


@pytest.fixture(scope="module")
def finger(examples):
    return load_scenario(examples / "finger.toml")


def test_the_table_is_read_checked_and_written_only_where_it_says_something(finger):
    assert "[stream]" not in scenario_to_toml(finger)
    other = replace(finger, stream=Stream(preview_s=0.03, resolution_N=0.02))
    assert parse_scenario(scenario_to_toml(other)).stream == other.stream
    assert scenario_hash(other) != scenario_hash(finger)
    for name in ("lag_max_s", "preview_s", "resolution_N"):
        with pytest.raises(ParameterError, match=f"{name} must be"):
            Stream(**{name: -1.0})


def test_the_choice_is_the_least_error_of_what_is_quiet_enough(finger):
    problem = Problem.of(finger)
    choice = choose_stream(problem, Stream())
    quiet = [each for each in choice.candidates if each.noise_dB <= 0]
    assert 0 < len(quiet) < len(choice.candidates)
    assert choice.picked.score.rmse == min(each.score.rmse for each in quiet)
    assert choice.picked.design.filter.lag_s <= 0.015
    none = choose_stream(problem, Stream(lag_max_s=0.0))
    assert none.picked.design.filter.half == 0


@pytest.mark.compiler
@pytest.mark.parametrize(
    ("stream", "largest_percent"),
    [
        pytest.param(Stream(), 0.4, marks=pytest.mark.nightly),
        pytest.param(Stream(resolution_N=LSB), 0.4, marks=pytest.mark.nightly),
        pytest.param(Stream(preview_s=0.03), 0.3, marks=pytest.mark.nightly),
        (Stream(preview_s=0.03, resolution_N=LSB), 0.3),
    ],
)
def test_the_exported_module_follows_a_noisy_gait_on_a_plant_apart(finger, stream, largest_percent, record_property):
    """40 masses in C of its own at a twentieth of the step; noise is what the reference's own adds to the force."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    # Its own reference covers what arrives: a live one is followed no farther.
    covering = replace(finger.reference, initial_tension_N=(START + PEAK) / 2, amplitudes_N=((PEAK - START) / 2, 0.0))
    scenario = replace(finger, stream=stream, reference=covering)
    files = export_project(scenario, precision=Precision.FLOAT, profile_N=np.ones(3)).files
    sources = {name: text for name, text in files.items() if name.startswith("tff_")}
    lag_s = float(re.search(r"STREAM_LAG_S (\S+?)f?\n", files["tff_stream.h"])[1])
    clean = gait()
    rough, shift = measured(clean), round(abs(lag_s) / STEP)
    if lag_s < 0:
        passed = [np.append(values[shift:], np.full(shift, values[-1])) for values in (rough, clean)]
        wanted = clean
    else:
        passed = [rough, clean]
        wanted = np.append(np.full(shift, clean[0]), clean)[: len(clean)]
    noisy, quiet = (
        run["stream"] for run in run_on_host(sources, "tff", Precision.FLOAT, [{"stream": p} for p in passed])
    )
    output = Plant(transmission=finger.transmission).respond(noisy, STEP, START)[:, 1]
    kept = slice(None, -50)
    error = 100 * score(wanted[kept], output[kept]).rmse / scale_of(clean)
    noise = 20 * math.log10(above_30_Hz((noisy - quiet)[kept]) / above_30_Hz((rough - clean)[kept]))
    record_property(
        "figure", f"live gait, {stream}: lag {1e3 * lag_s:.3g} ms, error {error:.2g} %, noise {noise:+.1f} dB"
    )
    assert lag_s <= 0.015
    assert error <= largest_percent
    assert noise <= 6


def test_a_live_reference_is_followed_no_farther_than_the_scenario_and_a_quarter_of_its_range(examples):
    """A sensor that reads full scale is not: the drive could hold 120 N, the scenario asks for 47."""
    problem = Problem.of(load_scenario(examples / "finger.toml"))
    low, high = followed_range(problem)
    tension = problem.reference.tension_N
    least, most = float(tension.min()), float(tension.max())
    assert low == pytest.approx(least - 0.25 * (most - least))
    assert high == pytest.approx(most + 0.25 * (most - least))
    held = replace(problem.reference, tension_N=np.full(len(tension), 30.0))
    low, high = followed_range(replace(problem, reference=held))
    assert low < 30 < high < 60


def test_what_was_lost_for_a_sample_is_back_after_two_and_nothing_leaves_what_was_held_and_what_arrives():
    design = StreamDesign(filter=a_filter(0), band_N=0.0, low_N=1.0, high_N=100.0)
    given = np.array([10.0, 10.0, np.nan, 20.0, 20.0, 20.0])
    assert smoothed(design, given, 10.0) == pytest.approx([10, 10, 10, 10, 15, 20])
    long = np.concatenate([np.full(5, 10.0), np.full(400, np.nan), np.full(150, 20.0)])
    found = smoothed(design, long, 10.0)
    assert np.all(np.diff(found) >= 0)
    assert np.abs(np.diff(found)).max() < 0.2
    assert found[404] == 10
    assert found[405 + design.re_entry] == 20
