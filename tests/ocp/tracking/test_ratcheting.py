"""Profiles that would pump the bristles: seen, replaced, and said."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.inverse import invert
from tendonff.ocp.simulate import simulate
from tendonff.ocp.tracking.cost import evaluate, gauss_newton_model
from tendonff.ocp.tracking.diagnosis import law_of, reversals
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackingProblem, TrackOptions
from tendonff.ocp.tracking.ratcheting import Disagreement, StaticGoal, disagreement
from tendonff.ocp.tracking.track import TrackStatus, track

STEP = 4e-3
TIME = np.arange(0, 1.2 + STEP / 2, STEP)
REFERENCE = 30 + np.minimum(TIME / 0.3, 1) * 12 * np.sin(2 * np.pi * TIME)

LIMITED = ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=250.0)


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


@pytest.fixture(scope="module")
def rig(generic: Transmission) -> Transmission:
    friction = replace(generic.friction, mu_static=generic.friction.mu_dynamic, mu_static_release=None)
    return replace(generic, friction=friction)


def test_a_force_that_shakes_disagrees_with_stiff_bristles_more_than_the_inverse_does(rig: Transmission) -> None:
    chain = Chain.of(rig, Level.PRESLIDING)
    force = invert(chain, REFERENCE, STEP).force_N
    usual = disagreement(chain, force, STEP, 30.0)
    shaken = 45 + 14 * np.sign(np.sin(2 * np.pi * 12 * TIME))
    shaken[0] = 30.0
    assert disagreement(chain, shaken, STEP, 30.0).stiff_N > 2 * usual.stiff_N
    assert not usual.exceeds(usual, 24.0)


def test_both_models_must_deny_a_profile_before_it_is_suspect() -> None:
    usual = Disagreement(stiff_N=1.0, play_N=1.0)
    assert Disagreement(stiff_N=2.1, play_N=2.1).exceeds(usual, 24.0)
    assert not Disagreement(stiff_N=2.1, play_N=1.9).exceeds(usual, 24.0)
    assert not Disagreement(stiff_N=2.1, play_N=2.1).exceeds(usual, 100.0)  # below 3 % of range


def test_a_reference_out_of_reach_gets_a_profile_that_keeps_its_promise_on_stiff_bristles_too(
    rig: Transmission,
) -> None:
    """e^{mu theta} lets 60 N pull less than 42 N; what the profile promises holds within a factor of 2 everywhere."""
    limits = ForceLimits(minimum_N=0.0, maximum_N=60.0, rate_N_per_s=2000.0)
    chain = Chain.of(rig, Level.PRESLIDING)
    found = track(chain, REFERENCE, STEP, limits)
    assert law_of(chain).largest_output_N(60.0) < REFERENCE.max()
    assert found.status is TrackStatus.BEST_ACHIEVABLE
    assert "out of reach" in found.message
    promised = found.rms_error_N
    if found.cautions:
        assert "pumping the bristles" in found.cautions[0]
        promised = float(found.cautions[0].split("leaves ")[1].split()[0])
    for level in Level:
        run = simulate(Chain.of(rig, level), found.force_N, STEP, initial_tension_N=30.0)
        assert rms(run.output_tension_N - REFERENCE) < 2 * promised
    assert rms(law_of(chain).output_history_N(found.force_N, 30.0) - REFERENCE) < 2 * promised


def test_slopes_of_the_static_law_are_those_of_its_output(rig: Transmission) -> None:
    chain = Chain.of(rig, Level.PRESLIDING)
    inverse = invert(chain, REFERENCE, STEP).force_N
    goal = StaticGoal.of(chain, inverse, STEP, 30.0, 0.1)
    force = LIMITED.apply(inverse, STEP, 30.0)
    at, rise = goal.slopes(force, goal.output_N(force))
    change = np.random.default_rng(1).normal(size=len(force))
    moved = (goal.output_N(force + 1e-7 * change) - goal.output_N(force)) / 1e-7
    assert 0.2 < np.mean(at != np.arange(len(force))) < 0.8  # it sticks in some rows and slips in others
    np.testing.assert_allclose(rise * change[at], moved, atol=1e-5)


def test_the_gradient_of_the_goal_has_the_static_law_in_it(rig: Transmission) -> None:
    chain = Chain.of(rig, Level.PRESLIDING)
    inverse = invert(chain, REFERENCE, STEP).force_N
    slopes = []
    for weight in (0.0, 0.5):
        problem = TrackingProblem.of(
            (chain,),
            REFERENCE,
            STEP,
            LIMITED,
            TrackOptions(static_weight=weight),
            initial_tension_N=30.0,
            inverse_N=inverse,
        )
        force, knots = problem.clipped(inverse), np.arange(0, len(REFERENCE), 10)
        model = gauss_newton_model(problem, force, evaluate(problem, force), knots, 0.0)
        change = np.sin(np.arange(len(knots)))
        change[0] = 0.0
        step = 1e-5 * np.interp(np.arange(len(force)), knots, change)
        ahead, behind = evaluate(problem, force + step).merit, evaluate(problem, force - step).merit
        assert float(model.gradient @ change) == pytest.approx((ahead - behind) / 2e-5, rel=2e-3)
        slopes.append(float(model.gradient @ change))
    assert abs(slopes[1] - slopes[0]) > 0.05 * abs(slopes[0])


def test_the_static_law_has_a_say_only_where_stiff_bristles_obey_it(rig: Transmission) -> None:
    """A heavy, well damped tendon with stiff bristles is far from the static law for other reasons."""
    heavy = replace(rig, tendon=replace(rig.tendon, mass_kg=1.0), load=replace(rig.load, mass_kg=2.0))
    weights = []
    for each, level in ((rig, Level.PRESLIDING), (heavy, Level.ELASTIC)):
        chain = Chain.of(each, level)
        inverse = invert(chain, REFERENCE, STEP).force_N
        weights.append(StaticGoal.of(chain, inverse, STEP, 30.0, 0.1).weight)
    assert weights[0] > 0.08
    assert weights[1] == 0


def test_the_static_law_keeps_the_force_from_shaking(rig: Transmission) -> None:
    chain = Chain.of(rig, Level.PRESLIDING)
    usual = disagreement(chain, invert(chain, REFERENCE, STEP).force_N, STEP, 30.0)
    calm, shaking = (
        track(chain, REFERENCE, STEP, LIMITED, TrackOptions(static_weight=weight)).force_N for weight in (0.1, 0.0)
    )
    assert 2 * len(reversals(calm)) <= len(reversals(shaking))
    assert disagreement(chain, calm, STEP, 30.0).stiff_N < 1.1 * usual.stiff_N
    assert disagreement(chain, shaking, STEP, 30.0).stiff_N > 1.4 * usual.stiff_N
