"""The exported code in single precision against the model in double."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.compensators.stream import choose_stream, quantised, stream_force
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.export.modules import c_modules
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.scenario.scenario import load_scenario
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.inverse import invert

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
    design = choose_stream(problem, finger.stream).picked.design
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
