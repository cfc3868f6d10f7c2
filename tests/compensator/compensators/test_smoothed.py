"""The baseline: the capstan law with its sign change smoothed at best."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.closed_form import Capstan
from tendonff.compensator.compensators.smoothed import Smoothed, centred, lagged
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.tendon.simulate import simulate


@pytest.fixture(scope="module")
def problem(examples):
    scenario = load_scenario(examples / "finger.toml")
    return Problem.of(replace(scenario, run=replace(scenario.run, step_s=2e-3)))


def rms(problem, force):
    reference = problem.reference
    run = simulate(problem.chain, force, reference.step_s, initial_tension_N=reference.initial_tension_N)
    return np.sqrt(np.mean((run.output_tension_N - reference.tension_N) ** 2))


def test_smoothing_the_sign_change_does_better_than_the_jumps(problem):
    jumping, smoothed = Capstan().profile(problem).force_N, Smoothed().profile(problem).force_N
    assert rms(problem, smoothed) < 0.3 * rms(problem, jumping)


def test_no_single_smoothing_time_does_better_than_the_one_found(problem):
    """Times that the search itself did not try, of either smoother."""
    reference = problem.reference
    exponent = np.log(Capstan().profile(problem).force_N / reference.tension_N)  # the limits do not bind here
    best = rms(problem, Smoothed().profile(problem).force_N)
    for smoother in (lagged, centred):
        for steps in (3.3, 17.0, 45.0, 120.0):
            force = problem.limited(reference.tension_N * np.exp(smoother(exponent, steps)))
            assert rms(problem, force) > 0.85 * best


@pytest.mark.parametrize("smoother", [lagged, centred])
def test_what_does_not_change_is_left_as_it_is_and_steps_become_ramps(smoother):
    flat = np.full(400, 0.3)
    assert smoother(flat, 20.0)[200:] == pytest.approx(flat[200:], rel=1e-4)
    step = np.where(np.arange(400) < 200, -0.5, 0.5)
    smooth = smoother(step, 20.0)
    assert np.max(np.abs(np.diff(smooth))) < 0.06
    assert smooth[-1] == pytest.approx(0.5, abs=1e-3)


def test_it_respects_the_actuator(problem):
    actuator = replace(problem.transmission.actuator, force_rate_max_N_per_s=300.0)
    limited = replace(problem, transmission=replace(problem.transmission, actuator=actuator))
    force = Smoothed().profile(limited).force_N
    assert np.max(np.abs(np.diff(force))) <= 300.0 * problem.reference.step_s * (1 + 1e-9)
