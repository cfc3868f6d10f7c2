"""The interval that `adapt` states holds the output of every plant whose directions are within what was stated."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.adapt.setup import BOUND_SPREAD, certified
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.scenario.scenario import load_scenario
from tendonff.models.chain import Chain
from tendonff.ocp.simulate import simulate


@pytest.mark.parametrize(("pull", "release"), [(-1, 1), (1, -1), (1, 1), (-1, -1), (0, 1)])
def test_directions_that_are_off_apart_stay_inside(examples, pull, release):
    problem = Problem.of(load_scenario(examples / "finger.toml"))
    found = certified(problem)
    t, reference = problem.transmission, problem.reference
    high, low = t.friction.mu_dynamic * (1 + pull * BOUND_SPREAD), t.friction.mu_dynamic * (1 + release * BOUND_SPREAD)
    friction = replace(t.friction, mu_dynamic=high, mu_static=high, mu_dynamic_release=low, mu_static_release=low)
    force = problem.limited(problem.inversion.force_N)
    chain = Chain.of(replace(t, friction=friction), problem.level)
    run = simulate(chain, force, reference.step_s, initial_tension_N=reference.initial_tension_N).require()
    span = float(np.ptp(reference.tension_N))
    assert np.all(run.output_tension_N >= found.low_N - 1e-6 * span)
    assert np.all(run.output_tension_N <= found.high_N + 1e-6 * span)
