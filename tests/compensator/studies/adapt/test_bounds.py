"""The interval that `adapt` states holds the output of every plant whose directions are within what was stated."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.tuning import BOUND_SPREAD, certified, friction_spread
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.reference import Shape, SineReference, WaypointReference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.parameters.uncertainty import Spread, Uncertainty
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import simulate


@pytest.fixture(scope="module")
def finger(examples):
    scenario = load_scenario(examples / "finger.toml")
    problem = Problem.of(scenario)
    return problem, certified(problem), scenario


@pytest.mark.parametrize("elastic", [0.8, 1.0, 1.2])
@pytest.mark.parametrize(("pull", "release"), [(-1, 1), (1, -1), (0.4, -0.9), (0, 1)])
def test_directions_that_are_off_apart_stay_inside_on_other_rigs(finger, pull, release, elastic):
    """60 masses, another tendon and load: none of the plants that the margin was measured on."""
    problem, found, _ = finger
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


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        (Uncertainty(mu=0.1), BOUND_SPREAD),
        (Uncertainty(mu=0.3), 0.3),
        (Uncertainty(stiffness=0.4), BOUND_SPREAD),
        (Uncertainty(mu=0.3, spread=(Spread(keys=("path.total_angle_rad",), half_width=0.1),)), 0.4),
        (Uncertainty(spread=(Spread(keys=("friction.mu_dynamic",), low=0.12, high=0.22),)), 0.4),
    ],
)
def test_friction_that_is_known_less_well_than_usual_widens_the_interval(finger, stated, expected):
    assert friction_spread(replace(finger[0], uncertainty=stated)) == pytest.approx(expected)


def test_friction_that_may_vanish_has_no_interval(finger):
    stated = Uncertainty(mu=0.9, spread=(Spread(keys=("path.total_angle_rad",), half_width=0.2),))
    with pytest.raises(InputError, match=r"\[robust\] admits mu theta within 110 % .* narrow the spreads"):
        friction_spread(replace(finger[0], uncertainty=stated))


def test_plants_that_robust_states_stay_inside_also_where_the_tendon_goes_slack(finger):
    """Friction 30 % off, adhesion and the load anywhere in their intervals, a force that falls to nothing."""
    t = finger[0].transmission
    spread = Spread(keys=("load.stiffness_N_per_m",), low=2000.0, high=4500.0)
    fall = WaypointReference(
        initial_tension_N=20.0, times_s=(0.0, 0.15, 0.3), tensions_N=(20.0, 0.5, 10.0), shape=Shape.LINEAR
    )
    scenario = replace(finger[2], reference=fall, robust=Uncertainty(mu=0.3, spread=(spread,)))
    problem = Problem.of(scenario)
    found, force = certified(problem), problem.limited(problem.inversion.force_N)
    assert found.interval.spread == pytest.approx(0.3)
    assert force.min() == 0
    for factor, load in ((0.7, 2000.0), (1.3, 4500.0), (1.3, 2400.0)):
        mu = factor * t.friction.mu_dynamic
        friction = replace(t.friction, mu_dynamic=mu, mu_static=mu)
        plant = replace(t, friction=friction, load=replace(t.load, stiffness_N_per_m=load))
        chain = Chain.of(plant, problem.level, 40)
        out = simulate(chain, force, problem.reference.step_s, initial_tension_N=20.0).require().output_tension_N
        assert np.all(out >= found.low_N)
        assert np.all(out <= found.high_N)


def test_a_tendon_that_goes_slack_while_the_force_pulls_has_an_interval_that_holds(finger):
    """Inertia empties it at a quick reversal: there no ratio to the capstan law's output is enough."""
    quick = SineReference(
        initial_tension_N=30.0, amplitudes_N=(29.9,), frequencies_Hz=(3.0,), duration_s=1.0, fade_in_s=0.5
    )
    problem = Problem.of(replace(finger[2], reference=quick))
    found, force = certified(problem), problem.limited(problem.inversion.force_N)
    assert force.min() > 0
    assert 0 < found.interval.noise_N < 0.05 * problem.reference.range_N
    chain = Chain.of(problem.transmission, problem.level, 40)
    out = simulate(chain, force, problem.reference.step_s, initial_tension_N=30.0).require().output_tension_N
    assert np.all((out >= found.low_N) & (out <= found.high_N))
