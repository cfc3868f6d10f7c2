"""Profiles hold on plants that the search did not own, and do not shake."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.capstan import held_within
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.path import Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.optimal.track import TrackStatus, track
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate
from tendonff.ocp.tracking.cost import evaluate, gauss_newton_model
from tendonff.ocp.tracking.diagnosis import law_of, reversals
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.options import TrackOptions
from tendonff.ocp.tracking.problem import TrackingProblem

STEP = 4e-3
TIME = np.arange(0, 1.2 + STEP / 2, STEP)
REFERENCE = 30 + np.minimum(TIME / 0.3, 1) * 12 * np.sin(2 * np.pi * TIME)
LIMITED = ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=250.0)
BOUND = ForceLimits(minimum_N=0.0, maximum_N=60.0, rate_N_per_s=250.0)


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def turns(force: np.ndarray) -> int:
    """By more than 0.2 N."""
    lazy = held_within(float(force[0]), force - 0.1, force + 0.1)
    way = np.sign(np.diff(lazy))
    return int(np.count_nonzero(np.diff(way[way != 0])))


@pytest.fixture(scope="module")
def rig(generic: Transmission) -> Transmission:
    friction = replace(generic.friction, mu_static=generic.friction.mu_dynamic, mu_static_release=None)
    return replace(generic, friction=friction)


def in_sections(rig: Transmission) -> Transmission:
    """The same path, in two sections."""
    half = 0.5 * rig.path.total_angle_rad
    sections = (Section(name="near", angle_rad=half), Section(name="far", angle_rad=half))
    return replace(rig, path=replace(rig.path, sections=sections))


def problem_of(chain: Chain, limits: ForceLimits, options: TrackOptions) -> TrackingProblem:
    inverse = invert(chain, REFERENCE, STEP).force_N
    return TrackingProblem.of(
        (chain,),
        (chain.rest_state(30.0),),
        (REFERENCE,),
        STEP,
        limits,
        options,
        initial_tension_N=30.0,
        start_N=30.0,
        inverse_N=inverse,
    )


@pytest.mark.parametrize("is_cut", [False, True])
def test_stiffer_bristles_than_assumed_cost_little_and_the_force_does_not_shake(
    rig: Transmission, is_cut: bool
) -> None:
    """On 40 masses at a tenth of the step; a path in sections is no exception."""
    whole = in_sections(rig) if is_cut else rig
    chain = Chain.of(whole, Level.PRESLIDING)
    force = track(chain, REFERENCE, STEP, LIMITED).force_N
    trusting = track(chain, REFERENCE, STEP, LIMITED, TrackOptions(stiffer_weight=0.0, travel_weight=0.0)).force_N
    fine = np.arange(10 * (len(TIME) - 1) + 1) * STEP / 10

    def error(level: Level, profile: np.ndarray) -> float:
        plant = Chain.of(whole, level, 40)
        played = simulate(plant, np.interp(fine, TIME, profile), STEP / 10, initial_tension_N=30.0)
        return rms(played.output_tension_N[::10] - REFERENCE)

    clipped = LIMITED.apply(invert(chain, REFERENCE, STEP).force_N, STEP, 30.0)
    assert turns(force) <= 2 * len(reversals(REFERENCE)) + 2
    assert error(Level.PRESLIDING, force) < 0.5 * error(Level.PRESLIDING, clipped)
    assert error(Level.VISCOELASTIC, force) < min(
        error(Level.VISCOELASTIC, clipped), 1.02 * error(Level.VISCOELASTIC, trusting)
    )


def test_a_reference_out_of_reach_is_not_shaken_towards(rig: Transmission) -> None:
    """e^{mu theta} lets 60 N pull less than 42 N."""
    chain = Chain.of(rig, Level.PRESLIDING)
    assert law_of(chain).largest_output_N(60.0) < REFERENCE.max()
    found = track(chain, REFERENCE, STEP, BOUND)
    assert found.status is TrackStatus.BEST_ACHIEVABLE
    assert "out of reach" in found.message
    shaken = track(chain, REFERENCE, STEP, BOUND, TrackOptions(stiffer_weight=0.0, travel_weight=0.0))
    assert np.abs(np.diff(found.force_N)).sum() < 0.9 * np.abs(np.diff(shaken.force_N)).sum()
    stiff = simulate(Chain.of(rig, Level.VISCOELASTIC), found.force_N, STEP, initial_tension_N=30.0)
    clipped = BOUND.apply(invert(chain, REFERENCE, STEP).force_N, STEP, 30.0)
    late = simulate(Chain.of(rig, Level.VISCOELASTIC), clipped, STEP, initial_tension_N=30.0)
    assert rms(stiff.output_tension_N - REFERENCE) < rms(late.output_tension_N - REFERENCE)


def test_bristles_that_are_stiff_already_need_no_stiffer_plant(rig: Transmission) -> None:
    plants = {level: problem_of(Chain.of(rig, level), LIMITED, TrackOptions()).plants for level in Level}
    assert {level: len(found) for level, found in plants.items()} == {
        Level.ELASTIC: 1,
        Level.VISCOELASTIC: 1,
        Level.PRESLIDING: 2,
    }


@pytest.mark.parametrize("effort", [0.0, 0.1])
def test_the_gradient_of_the_goal_is_that_of_its_merit(rig: Transmission, effort: float) -> None:
    """Central differences along a change of the force; error of both plants, travel and effort."""
    chain = Chain.of(rig, Level.PRESLIDING)
    problem = problem_of(chain, LIMITED, TrackOptions(stiffer_weight=0.5, effort_weight=effort, travel_weight=1e-2))
    force, knots = problem.clipped(invert(chain, REFERENCE, STEP).force_N), np.arange(0, len(REFERENCE), 10)
    model = gauss_newton_model(problem, force, evaluate(problem, force), knots, 0.0)
    change = np.sin(np.arange(len(knots)))
    change[0] = 0.0
    step = 1e-5 * np.interp(np.arange(len(force)), knots, change)
    ahead, behind = evaluate(problem, force + step).merit, evaluate(problem, force - step).merit
    assert float(model.gradient @ change) == pytest.approx((ahead - behind) / 2e-5, rel=2e-3)
