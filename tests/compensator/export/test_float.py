"""The exported code in single precision against the model in double."""

import ctypes
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.compensators.stream import choose_stream, quantised, stream_force
from tendonff.compensator.export.host import compile_on_host, run_on_host
from tendonff.compensator.export.modules import c_modules
from tendonff.compensator.export.repeat import compared, repeated_rows
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.scenario.settings import Stream
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.tendon.inverse import invert

STEP_S = 2e-4  # so short that the motor's inertia makes newtons of what rounding leaves of a reference


@pytest.fixture(scope="module")
def finger(examples):
    scenario = load_scenario(examples / "finger.toml")
    reference = replace(scenario.reference, duration_s=0.4, fade_in_s=0.05)
    transmission = replace(scenario.transmission, actuator=replace(scenario.transmission.actuator, mass_kg=0.5))
    return replace(scenario, reference=reference, transmission=transmission, run=replace(scenario.run, step_s=STEP_S))


def in_float(scenario, problem, name, reference_N, stream=None):
    modules = [m for m in c_modules(scenario, stream is not None) if m.name in ("inverse", name)]
    sources = c_sources(scenario, problem, modules, Precision.FLOAT, "tff", {"stream": stream})
    return run_on_host(sources, "tff", Precision.FLOAT, [{name: reference_N}])[0][name]


@pytest.mark.compiler
def test_a_live_reference_in_float_is_smoothed_to_more_digits_than_a_float_has(finger, record_property):
    """The inverse differentiates the smoothed reference twice: rounded to a float it made 0.4 % of range of noise."""
    problem = Problem.of(finger)
    design = choose_stream(problem, Stream()).picked.design
    wanted = problem.reference.tension_N
    rough = rounded(quantised(wanted, 1e-3 * scale_of(wanted)), Precision.FLOAT)
    rough[0] = wanted[0]
    expected = stream_force(design, problem, rough)
    apart = np.abs(in_float(finger, problem, "stream", rough, design) - expected) / scale_of(wanted)
    rms = float(np.sqrt(np.mean(apart**2)))
    record_property("figure", f"live reference in float: {rms:.1g} of range RMS, {apart.max():.1g} at most")
    assert rms < 2e-4


@pytest.mark.compiler
def test_a_tendon_that_went_slack_in_float_is_forgotten_as_in_the_model(finger, record_property):
    """Its force ends at zero, and so does the change from which its states are made."""
    actuator = replace(finger.transmission.actuator, force_max_N=1e6, force_rate_max_N_per_s=1e12)
    free = replace(finger, transmission=replace(finger.transmission, actuator=actuator))
    problem = Problem.of(free)
    jumps = rounded(np.repeat([40.0, 2.0, 40.0, 10.0, 2.0, 40.0], 4), Precision.FLOAT)
    expected = invert(problem.chain, jumps, STEP_S, initial_tension_N=float(jumps[0]))
    assert expected.least_tension_N.min() == 0
    force = problem.limits.apply(expected.force_N, STEP_S, float(jumps[0]))
    apart = np.abs(in_float(free, problem, "inverse", jumps) - force).max() / np.ptp(force)
    record_property("figure", f"inverse in float after the tendon was slack: {apart:.1g} of its force")
    assert apart < 1e-4


def test_rows_are_compared_where_every_rounding_and_its_neighbours_stay_within_a_bound():
    expected, one, other = np.zeros(40), np.zeros(40), np.full(40, 0.4)
    one[20], other[38] = 0.6, np.nan
    kept = repeated_rows(expected, [one, other], 0.5)
    assert np.flatnonzero(~kept).tolist() == [*range(15, 26), *range(33, 40)]
    assert repeated_rows(expected, [], 0.5).all()


@pytest.mark.parametrize("error", [0.0, 1e-5, 3e-4, 4e-4, 1.0, np.nan])
def test_no_tolerance_in_float_is_above_the_bound_and_three_times_every_difference_passes(error):
    expected, found, most = np.zeros(60), np.zeros(60), 1e-3
    found[30] = error
    rows = compared(expected, 1.0, most, Precision.FLOAT, [found])
    assert rows.tolerance <= most
    kept = np.isfinite(rows.expected)
    assert rows.rows == (60 if error <= 3e-4 else 49)
    assert 3 * np.abs(found[kept]).max() <= rows.tolerance
    assert rows.words == ("" if rows.every else ", 49 of 60 rows")


def test_all_rows_are_compared_in_double_and_where_the_code_was_not_run():
    for precision, found in ((Precision.DOUBLE, [np.ones(5)]), (Precision.FLOAT, [])):
        assert compared(np.zeros(5), 1.0, 1e-3, precision, found).every


def test_where_nearly_every_row_needs_more_all_are_compared_with_what_they_need():
    rows = compared(np.zeros(60), 1.0, 1e-3, Precision.FLOAT, [np.full(60, 0.01)], by_means=True)
    assert rows.every
    assert rows.tolerance == pytest.approx(0.03, rel=0.05)


def test_where_rounding_makes_noise_of_nearly_every_row_means_over_eight_of_them_are_compared():
    noise = 2e-3 * np.random.default_rng(0).uniform(-1, 1, 601)
    twice = np.diff(noise, prepend=0.0)  # as of a reference that is differentiated
    rows = compared(np.zeros(601), 1.0, 2e-2, Precision.FLOAT, [0.0 * twice, twice], by_means=True)
    assert (rows.mean_of, rows.every) == (1, True)
    rows = compared(np.zeros(601), 1.0, 2e-3, Precision.FLOAT, [0.0 * twice, twice], by_means=True)
    assert (rows.mean_of, rows.every, rows.words) == (8, True, ", means of 8")
    means = np.convolve(twice, np.full(8, 1 / 8), mode="valid")
    assert 3 * np.abs(means).max() <= rows.tolerance <= 2e-3
    assert compared(np.zeros(601), 1.0, 2e-3, Precision.FLOAT, [twice]).mean_of == 1


def test_rows_are_compared_where_each_way_of_rounding_stays_within_the_bound():
    one, other = np.zeros(60), np.zeros(60)
    one[10], other[40], other[50] = 1.0, 1.0, 2e-4
    rows = compared(np.zeros(60), 1.0, 1e-3, Precision.FLOAT, [one, other])
    assert np.flatnonzero(np.isnan(rows.expected)).tolist() == [*range(5, 16), *range(35, 46)]
    assert rows.tolerance == pytest.approx(3 * 2e-4 + 2e-6, rel=0.02)


@pytest.mark.compiler
def test_products_and_sums_are_rounded_in_one_only_where_that_is_asked_for():
    one = float(np.float32(1) + np.finfo(np.float32).eps)
    text = "float sum(float a, float b, float c);\nfloat sum(float a, float b, float c) { return (a * b) + c; }\n"
    float_of = ctypes.c_float
    found = {}
    for contracted in (False, True):
        code = compile_on_host({}, text, Precision.FLOAT, contracted=contracted)
        found[contracted] = code.function("sum", float_of, float_of, float_of, result=float_of)(one, one, -1.0)
    twice, once = float(np.float32(one * one) - np.float32(1)), one * one - 1
    assert found[False] == twice
    described = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    allowed = [np.float32(once)] if " fma " in described else [np.float32(once), np.float32(twice)]
    assert np.float32(found[True]) in allowed
