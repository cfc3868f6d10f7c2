"""The banded interior-point method against conditions that only a minimiser meets, and a closed form."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import LinearConstraint, minimize

from tendonff.ocp.tracking.search.interior_point import KnotProgram, solve_knots

Array = NDArray[np.float64]


def program(seed: int, k: int = 40, rows: int = 0) -> KnotProgram:
    """A random one with a band of seven, of which some directions cost nothing."""
    rng = np.random.default_rng(seed)
    factor = np.triu(np.tril(rng.normal(size=(k, k)), 3), -3) * (rng.random(k) < 0.8)
    seen = np.triu(np.tril(rng.normal(size=(k, k)), 3), -3)[:rows]
    room = 10.0 ** rng.uniform(-3, 0, (2, 2 * k - 1 + rows)) * (rng.random((2, 2 * k - 1 + rows)) < 0.9)
    room[1] += 1e-3 * (room.sum(axis=0) == 0)
    return KnotProgram(hessian=factor.T @ factor, gradient=rng.normal(size=k), rows=seen, low=-room[0], high=room[1])


def cost(p: KnotProgram, x: Array) -> float:
    return float(0.5 * x @ p.hessian @ x + p.gradient @ x)


@pytest.mark.parametrize("rows", [0, 6])
@pytest.mark.parametrize("seed", range(6))
def test_no_other_method_finds_less(seed: int, rows: int) -> None:
    p = program(seed, rows=rows)
    found = solve_knots(p)
    assert found is not None
    at = p.at(found)
    assert np.all(at >= p.low - 1e-8)
    assert np.all(at <= p.high + 1e-8)
    matrix = np.array([p.at(e) for e in np.eye(40)]).T
    other = minimize(
        lambda x: cost(p, x),
        np.zeros(40),
        jac=lambda x: p.hessian @ x + p.gradient,
        method="SLSQP",
        constraints=LinearConstraint(matrix, p.low, p.high),
        options={"maxiter": 500, "ftol": 1e-12},
    )
    assert cost(p, found) < 0
    assert cost(p, found) <= cost(p, other.x) + 1e-4 * abs(other.fun)


def test_without_ties_each_unknown_goes_to_its_own_bound_or_minimum() -> None:
    """H = I, wide rises: x = clip(-g, low, high)."""
    k, gradient = 30, np.linspace(-3, 3, 30)
    wide = np.full(k - 1, 100.0)
    p = KnotProgram(
        hessian=np.eye(k),
        gradient=gradient,
        rows=np.empty((0, k)),
        low=np.concatenate([np.full(k, -1.0), -wide]),
        high=np.concatenate([np.full(k, 2.0), wide]),
    )
    found = solve_knots(p)
    assert found == pytest.approx(np.clip(-gradient, -1, 2), abs=2e-3)
