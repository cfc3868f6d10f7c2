"""The quadratic program of one SQP iteration: which change of the profile, within limits, pays most.

The change is piecewise linear between knots. The limits hold on every row, because within an interval the change has
one slope, which the steepest row of the profile bounds.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import GaussNewtonModel, Knots
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.search.interior_point import KnotProgram, solve_knots


@dataclass(frozen=True, slots=True, kw_only=True)
class StepBounds:
    """The room that the limits leave for changes of a profile at its knots; 0 lies within."""

    # low_N, high_N: shape (k,); at the knots; the first row is fixed
    low_N: Array
    high_N: Array
    # rise_low_N, rise_high_N: shape (k - 1,); from each knot to the next
    rise_low_N: Array
    rise_high_N: Array


def step_bounds(problem: TrackingProblem, force_N: Array, knots: Knots) -> StepBounds:
    """What may change at the knots so that every row of a profile within the limits, shape (n,) [N], stays there."""
    limits, step_s = problem.limits, problem.step_s
    rate = np.diff(force_N) / step_s
    fastest, slowest = np.maximum.reduceat(rate, knots[:-1]), np.minimum.reduceat(rate, knots[:-1])
    up, down = limits.maximum_N - force_N, limits.minimum_N - force_N
    # Next to a knot lie two intervals; the change there is at most the larger of its values at their knots.
    up_in, down_in = (
        np.minimum(np.minimum.reduceat(up[:-1], knots[:-1]), up[knots[1:]]),
        np.maximum(np.maximum.reduceat(down[:-1], knots[:-1]), down[knots[1:]]),
    )
    high = np.minimum(np.concatenate([up_in, [np.inf]]), np.concatenate([[np.inf], up_in]))
    low = np.maximum(np.concatenate([down_in, [-np.inf]]), np.concatenate([[-np.inf], down_in]))
    high[0] = low[0] = 0.0
    gap = np.diff(knots) * step_s
    return StepBounds(
        low_N=np.minimum(low, 0.0),
        high_N=np.maximum(high, 0.0),
        rise_low_N=np.minimum(-limits.rate_N_per_s - slowest, 0.0) * gap,
        rise_high_N=np.maximum(limits.rate_N_per_s - fastest, 0.0) * gap,
    )


def solve_qp(model: GaussNewtonModel, room: StepBounds, trust_N: Array | float, penalty_N: float) -> Array | None:
    """Solve the quadratic program: the change at the knots, shape (k,), or None where the solver fails.

    No change exceeds `trust_N`, one value or one for each knot. Tension rows may be missed by one common amount, at
    `penalty_N` per newton.
    """
    low, high = np.maximum(room.low_N, -trust_N), np.minimum(room.high_N, trust_N)
    missed = max(float(model.low.max()), float((-model.high).max()), 0.0) if len(model.low) else 0.0
    move = None if missed > 0 else _banded(model, room, low, high)
    return _dense(model, room, low, high, penalty_N * missed, missed) if move is None else move


_TINY_N = 1e-9  # room below this is none
_FAR_N = 1e9  # no bound


def _banded(model: GaussNewtonModel, room: StepBounds, low: Array, high: Array) -> Array | None:
    """By the interior-point method, in the knots that have room."""
    move, free = np.zeros(len(low)), high - low > _TINY_N
    at = np.flatnonzero(free)
    if not at.size:
        return move
    rise_low, rise_high = room.rise_low_N - _TINY_N, room.rise_high_N + _TINY_N
    low, high = low.copy(), high.copy()
    before, after = np.flatnonzero(free[:-1] & ~free[1:]), np.flatnonzero(~free[:-1] & free[1:]) + 1
    low[before], high[before] = np.maximum(low[before], -rise_high[before]), np.minimum(high[before], -rise_low[before])
    low[after], high[after] = np.maximum(low[after], rise_low[after - 1]), np.minimum(high[after], rise_high[after - 1])
    apart = np.diff(at) > 1  # no rise ties these together: bounds that never bind
    rise_low = np.where(apart, 2 * (low[at[1:]] - high[at[:-1]]), rise_low[at[:-1]])
    rise_high = np.where(apart, 2 * (high[at[1:]] - low[at[:-1]]), rise_high[at[:-1]])
    far = 1e3 * float(np.max(high - low)) * max(float(np.abs(model.rows).max(initial=0.0)), 1.0)
    found = solve_knots(
        KnotProgram(
            hessian=model.hessian[np.ix_(free, free)],
            gradient=model.gradient[free],
            rows=model.rows[:, free],
            low=np.concatenate([low[at], rise_low, np.maximum(model.low, -far)]),
            high=np.concatenate([high[at], rise_high, np.minimum(model.high, far)]),
        )
    )
    if found is None:
        return None
    move[at] = found
    return np.clip(move, np.where(free, low, 0.0), np.where(free, high, 0.0))


def _dense(
    model: GaussNewtonModel, room: StepBounds, low: Array, high: Array, price: float, missed: float
) -> Array | None:
    """By CasADi's interface to DAQP: also where tension rows are missed by no change at all, by `missed` at most.

    The last unknown is the share of that which remains.
    """
    k = len(model.gradient)
    rise = np.diff(np.eye(k), axis=0)
    scale = 1 / max(float(np.diag(model.hessian).max()), 1e-300)  # its tolerances are absolute
    hessian = np.pad(model.hessian * scale, (0, 1))
    hessian[k, k] = 1e-6
    column = np.full((len(model.low), 1), missed)
    tension = np.vstack([np.hstack([model.rows, column]), np.hstack([model.rows, -column])])
    rows = np.vstack([np.pad(rise, ((0, 0), (0, 1))), tension])
    open_row = np.full(len(model.low), _FAR_N)
    bounds = {
        "a": rows,
        "g": np.append(model.gradient, price) * scale,
        "lba": np.concatenate([room.rise_low_N, model.low, -open_row]),
        "uba": np.concatenate([room.rise_high_N, open_row, np.minimum(model.high, _FAR_N)]),
        "lbx": np.append(low, 0.0),
        "ubx": np.append(high, 1.0),
    }
    shapes = {"h": ca.Sparsity.dense(k + 1, k + 1), "a": ca.Sparsity.dense(*rows.shape)}
    for damping in (1e-8, 1e-5):  # where the tendon sticks the Hessian is singular
        solver = ca.conic("change", "daqp", shapes, {"error_on_fail": False})
        found = solver(h=hessian + damping * np.eye(k + 1), **bounds)
        x: Array = np.asarray(found["x"].full()).ravel()[:k]
        if solver.stats()["success"] and np.all(np.isfinite(x)):
            inside: Array = np.clip(x, low, high)
            return inside
    return None
