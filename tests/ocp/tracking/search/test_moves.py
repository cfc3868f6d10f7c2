"""Searches from moved profiles, and what they are made of."""

import numpy as np
import pytest

from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.inverse import invert
from tendonff.ocp.tracking.cost import Hats, add_pairs, evaluate
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackingProblem, TrackOptions
from tendonff.ocp.tracking.search.grids import early_profile
from tendonff.ocp.tracking.search.knots import even_knots
from tendonff.ocp.tracking.search.moves import Moves, Sizes, Stretch
from tendonff.ocp.tracking.search.sqp import Blocks, SqpSettings, SqpStatus, solve_sqp

STEP = 4e-3
TIME = np.arange(0, 2 + STEP / 2, STEP)
REFERENCE = 30 + 10 * np.sin(2 * np.pi * TIME) * np.minimum(TIME / 0.3, 1)
LIMITS = ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=250.0)
SETTINGS = SqpSettings(iterations=20, tolerance=3e-3, trust_N=2.0, restarts=2)
KNOTS = even_knots(len(TIME), 5)


@pytest.fixture(scope="module")
def problem(generic: Transmission) -> TrackingProblem:
    chain = Chain.of(generic, Level.PRESLIDING)
    inverse = invert(chain, REFERENCE, STEP).force_N
    return TrackingProblem.of(
        (chain,), REFERENCE, STEP, LIMITS, TrackOptions(), initial_tension_N=30.0, inverse_N=inverse
    )


@pytest.fixture(scope="module")
def clipped(problem: TrackingProblem) -> np.ndarray:
    return problem.clipped(invert(problem.plants[0].chain, REFERENCE, STEP).force_N)


@pytest.fixture(scope="module")
def moves(problem: TrackingProblem) -> Moves:
    return Moves(
        problem=problem,
        settings=SETTINGS,
        spacing=10,
        prepare=lambda _, force: (even_knots(len(force), 5), force),
        tell=None,
    )


def test_a_row_costs_in_its_stretch_what_it_costs_in_the_whole(problem: TrackingProblem, clipped: np.ndarray) -> None:
    whole = evaluate(problem, clipped).density * len(TIME)
    starts = Blocks.between_reversals(problem, np.arange(len(TIME))).starts
    assert len(starts) == 4
    for index, start in enumerate(starts):
        stretch = Stretch.of(problem, clipped, starts, index)
        part = evaluate(stretch.problem, clipped[stretch.rows]).density * len(stretch.own)
        assert np.count_nonzero(stretch.own) == np.diff(np.append(starts, len(TIME)))[index]
        assert (stretch.rows.start, len(part)) == (start, min(stretch.rows.stop, len(TIME)) - start)
        # The scheme begins anew in the first step.
        np.testing.assert_allclose(part[1:], whole[stretch.rows][1:], atol=2e-2 * whole.max())
        assert part[1:].sum() == pytest.approx(whole[stretch.rows][1:].sum(), rel=1e-2, abs=3e-4 * whole.sum())


def test_moves_find_what_a_search_from_the_late_profile_does_not(
    problem: TrackingProblem, clipped: np.ndarray, moves: Moves
) -> None:
    """The clipped inverse leaves every reversal late: searched alone it ends in a local optimum."""
    alone = solve_sqp(problem, clipped, evaluate(problem, clipped), KNOTS, SETTINGS)
    walk = moves.improve((alone.evaluation, alone.force_N), 2, 120, 0)
    (evaluation, force) = walk.best
    assert walk.won
    assert evaluation.merit < 0.8 * alone.evaluation.merit
    assert evaluation.merit == evaluate(problem, force).merit
    assert LIMITS.admits(force, STEP)


def test_closer_knots_find_what_wide_ones_cannot_form(
    problem: TrackingProblem, clipped: np.ndarray, moves: Moves
) -> None:
    alone = solve_sqp(problem, clipped, evaluate(problem, clipped), KNOTS, SETTINGS)
    best, won, _ = moves.polish((alone.evaluation, alone.force_N), lambda _, force: even_knots(len(force), 2))
    assert won
    assert best[0].merit < 0.98 * alone.evaluation.merit
    assert best[0].merit == evaluate(problem, best[1]).merit
    assert LIMITS.admits(best[1], STEP)


def test_small_random_changes_need_no_slope(problem: TrackingProblem, clipped: np.ndarray, moves: Moves) -> None:
    starts = Blocks.between_reversals(problem, np.arange(len(TIME))).starts
    stretch = Stretch.of(problem, clipped, starts, 2)
    changed = moves._changed(stretch, clipped, Sizes(force_N=0.5, rows=5.0), np.random.default_rng(0))
    before, after = (evaluate(stretch.problem, force) for force in (clipped[stretch.rows], changed))
    assert after.merit < 0.6 * before.merit
    assert changed[0] == clipped[stretch.rows][0]  # where the stretch joins what is before it
    assert LIMITS.admits(changed, STEP)


def test_a_search_far_from_what_it_should_beat_ends(problem: TrackingProblem, clipped: np.ndarray) -> None:
    found = solve_sqp(problem, clipped, evaluate(problem, clipped), KNOTS, SETTINGS, rival=1e-9)
    assert (found.status, found.iterations) == (SqpStatus.ITERATIONS, 3)


def test_an_early_profile_arrives_when_the_wanted_force_jumps(problem: TrackingProblem) -> None:
    """A jump of 40 N at 250 N/s takes 40 steps of 4 ms: the ramp ends in the first row after the jump."""
    wanted = np.where(np.arange(len(TIME)) < 300, 30.0, 70.0)
    found = early_profile(problem, wanted)
    np.testing.assert_allclose(found, np.clip(70.0 - (300 - np.arange(len(TIME))), 30.0, 70.0), atol=1e-9)


def test_pairs_add_the_squares_of_a_function_that_is_linear_between_knots() -> None:
    rng = np.random.default_rng(2)
    knots = np.array([0, 3, 4, 9, 15])
    hats, k, n = Hats.of(knots), 5, 16
    weight, at = rng.uniform(1, 2, n), rng.normal(size=n)
    hessian, gradient = np.zeros((k, k)), np.zeros(k)
    add_pairs(hessian, gradient, hats.left, 1 - hats.share, hats.share, weight, at)

    def cost(x: np.ndarray) -> float:
        return float(np.sum(weight / 2 * (at + np.interp(np.arange(n), knots, x)) ** 2))

    x = rng.normal(size=k)
    assert cost(x) - cost(np.zeros(k)) == pytest.approx(gradient @ x + 0.5 * x @ hessian @ x)
    np.testing.assert_allclose(hats.dense() @ x, np.interp(np.arange(n), knots, x))
