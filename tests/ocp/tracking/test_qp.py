"""The quadratic program of one iteration against another method, and closed forms."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import LinearConstraint, minimize

from tendonff.ocp.tracking.cost import GaussNewtonModel, Hats, add_pairs
from tendonff.ocp.tracking.qp import StepBounds, solve_qp

Array = NDArray[np.float64]


def program(seed: int, k: int = 40, rows: int = 0) -> tuple[GaussNewtonModel, StepBounds]:
    """A random one of which some directions cost nothing, some knots are tied and the first is fixed."""
    rng = np.random.default_rng(seed)
    factor = np.triu(np.tril(rng.normal(size=(k, k)), 3), -3) * (rng.random(k) < 0.8)
    low, high = -(10.0 ** rng.uniform(-3, 0, k)), 10.0 ** rng.uniform(-3, 0, k)
    low[0] = high[0] = 0.0
    rise = 10.0 ** rng.uniform(-2, 0, (2, k - 1))
    seen = rng.normal(size=(rows, k))
    model = GaussNewtonModel(
        hessian=factor.T @ factor,
        gradient=rng.normal(size=k),
        rows=seen,
        low=np.full(rows, -0.1),
        high=np.full(rows, 0.2),
    )
    return model, StepBounds(low_N=low, high_N=high, rise_low_N=-rise[0], rise_high_N=rise[1])


def cost(model: GaussNewtonModel, x: Array) -> float:
    return float(0.5 * x @ model.hessian @ x + model.gradient @ x)


@pytest.mark.parametrize("rows", [0, 6])
@pytest.mark.parametrize("seed", range(4))
def test_no_other_method_finds_less(seed: int, rows: int) -> None:
    model, room = program(seed, rows=rows)
    found = solve_qp(model, room, 0.5, 1.0)
    assert found is not None
    assert found[0] == 0
    matrix = np.vstack([np.eye(40), np.diff(np.eye(40), axis=0), model.rows])
    low = np.concatenate([np.maximum(room.low_N, -0.5), room.rise_low_N, model.low])
    high = np.concatenate([np.minimum(room.high_N, 0.5), room.rise_high_N, model.high])
    at = matrix @ found
    assert np.all(at >= low - 1e-6)
    assert np.all(at <= high + 1e-6)
    other = minimize(
        lambda x: cost(model, x),
        np.zeros(40),
        bounds=list(zip(low[:40], high[:40], strict=True)),
        jac=lambda x: model.hessian @ x + model.gradient,
        method="SLSQP",
        constraints=LinearConstraint(matrix[40:], low[40:], high[40:]),
        options={"maxiter": 500, "ftol": 1e-12},
    )
    assert cost(model, found) < 0
    assert cost(model, found) <= cost(model, other.x) + 1e-3 * abs(other.fun)


def test_without_ties_each_unknown_goes_to_its_own_bound_or_minimum() -> None:
    """H = I, wide rises: x = clip(-g, low, high), and no further than the trust region."""
    gradient, wide = np.linspace(-3, 3, 30), np.full(29, 100.0)
    model = GaussNewtonModel(
        hessian=np.eye(30), gradient=gradient, rows=np.empty((0, 30)), low=np.empty(0), high=np.empty(0)
    )
    room = StepBounds(low_N=np.full(30, -1.0), high_N=np.full(30, 2.0), rise_low_N=-wide, rise_high_N=wide)
    assert solve_qp(model, room, 9.0, 1.0) == pytest.approx(np.clip(-gradient, -1, 2), abs=1e-6)
    assert solve_qp(model, room, 0.5, 1.0) == pytest.approx(np.clip(-gradient, -0.5, 0.5), abs=1e-6)


def test_a_bound_out_of_reach_is_missed_by_as_little_as_can_be() -> None:
    """One knot that may rise by 1 N where 3 N are needed, at a price far above the gradient."""
    model = GaussNewtonModel(
        hessian=np.eye(2),
        gradient=np.array([0.0, 0.5]),
        rows=np.array([[0.0, 1.0]]),
        low=np.array([3.0]),
        high=np.array([5.0]),
    )
    room = StepBounds(
        low_N=np.array([0.0, -1.0]), high_N=np.array([0.0, 1.0]), rise_low_N=np.full(1, -9.0), rise_high_N=np.full(1, 9)
    )
    assert solve_qp(model, room, 2.0, 100.0) == pytest.approx([0.0, 1.0], abs=1e-6)


def test_pairs_add_the_squares_of_a_function_that_is_linear_between_knots() -> None:
    rng = np.random.default_rng(2)
    knots = np.array([0, 3, 4, 9, 15])
    hats, k, n = Hats.of(knots), 5, 16
    weight, at = rng.uniform(1, 2, n), rng.normal(size=n)
    hessian, gradient = np.zeros((k, k)), np.zeros(k)
    add_pairs(hessian, gradient, hats.left, 1 - hats.share, hats.share, weight, at)

    def total(x: Array) -> float:
        return float(np.sum(weight / 2 * (at + np.interp(np.arange(n), knots, x)) ** 2))

    x = rng.normal(size=k)
    assert total(x) - total(np.zeros(k)) == pytest.approx(gradient @ x + 0.5 * x @ hessian @ x)
    np.testing.assert_allclose(hats.dense() @ x, np.interp(np.arange(n), knots, x))
