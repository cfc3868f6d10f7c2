"""The interval that `adapt` states holds the output of every plant whose directions are within what was stated."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.adapt.setup import BOUND_SPREAD, certified
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.scenario.scenario import load_scenario
from tendonff.models.chain import Chain
from tendonff.ocp.simulate import simulate


@pytest.fixture(scope="module")
def finger(examples):
    problem = Problem.of(load_scenario(examples / "finger.toml"))
    return problem, certified(problem)


@pytest.mark.parametrize("elastic", [0.8, 1.0, 1.2])
@pytest.mark.parametrize(("pull", "release"), [(-1, 1), (1, -1), (0.4, -0.9), (0, 1)])
def test_directions_that_are_off_apart_stay_inside_on_other_rigs(finger, pull, release, elastic):
    """60 masses, another tendon and load: none of the plants that the margin was measured on."""
    problem, found = finger
    t, reference = problem.transmission, problem.reference
    high, low = t.friction.mu_dynamic * (1 + pull * BOUND_SPREAD), t.friction.mu_dynamic * (1 + release * BOUND_SPREAD)
    friction = replace(t.friction, mu_dynamic=high, mu_static=high, mu_dynamic_release=low, mu_static_release=low)
    tendon = replace(t.tendon, stiffness_N_per_m=elastic * t.tendon.stiffness_N_per_m)
    load = replace(t.load, stiffness_N_per_m=elastic * t.load.stiffness_N_per_m)
    force = problem.limited(problem.inversion.force_N)
    chain = Chain.of(replace(t, friction=friction, tendon=tendon, load=load), problem.level, 60)
    run = simulate(chain, force, reference.step_s, initial_tension_N=reference.initial_tension_N).require()
    assert np.all(run.output_tension_N >= found.low_N)
    assert np.all(run.output_tension_N <= found.high_N)
