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
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.scenarios import load_scenario
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
