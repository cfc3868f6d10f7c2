"""The tuner in single precision: what rounding leaves of its golden vectors."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.export.adaptive import adaptive_golden
from tendonff.compensator.export.golden import Course
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.export.modules import ADAPTIVE
from tendonff.compensator.export.repeat import compared, repeated_rows
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.scenario.scenario import load_scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.adaptation.tuning import Sensor
from tendonff.ocp.codegen.precision import Precision


@pytest.mark.compiler
def test_the_integral_action_in_float_is_that_of_the_model(examples, record_property):
    """Stiff bristles turn changes of the reference into force: its product with the correction may not round them."""
    scenario = load_scenario(examples / "finger.toml")
    settings = replace(load_scenario(examples / "finger_adaptive.toml").adaptation, noise=0.05, parameters=())
    settings = replace(settings, sensor=Sensor.OUTPUT_TENSION)
    reference = replace(scenario.reference, duration_s=0.7, fade_in_s=0.05)
    run = replace(scenario.run, level=Level.ELASTIC)
    scenario = replace(scenario, reference=reference, run=run, adaptation=settings)
    problem = Problem.of(scenario)
    wanted = rounded(problem.reference.tension_N, Precision.FLOAT)
    course = Course(reference_N=wanted, plant_force_N=wanted, columns={}, scale_N=100.0, chain=problem.chain)
    golden = adaptive_golden(problem, settings, course, Precision.FLOAT)
    sources = c_sources(scenario, problem, (ADAPTIVE,), Precision.FLOAT, "tff")
    (found,) = run_on_host(sources, "tff", Precision.FLOAT, [{ADAPTIVE.name: golden.given(wanted)}])
    apart = np.abs(found[ADAPTIVE.name] - golden.force_N) / scale_of(wanted)
    record_property(
        "figure", f"tuner in float: {apart.max():.1g} of range at most, {np.sqrt(np.mean(apart**2)):.1g} RMS"
    )
    assert apart.max() < 1e-3


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
    rows = compared(expected, 1.0, most, Precision.FLOAT, found)
    assert rows.tolerance <= most
    kept = np.isfinite(rows.expected)
    assert rows.rows == (60 if error <= 3e-4 else 49)
    assert 3 * np.abs(found[kept]).max() <= rows.tolerance
    assert rows.words == ("" if rows.every else ", 49 of 60 rows")


def test_all_rows_are_compared_in_double_and_where_the_code_was_not_run():
    for precision, found in ((Precision.DOUBLE, np.ones(5)), (Precision.FLOAT, None)):
        assert compared(np.zeros(5), 1.0, 1e-3, precision, found).every


def test_where_nearly_every_row_needs_more_all_are_compared_with_what_they_need():
    rows = compared(np.zeros(60), 1.0, 1e-3, Precision.FLOAT, np.full(60, 0.01))
    assert rows.every
    assert rows.tolerance == pytest.approx(0.03, rel=0.05)
