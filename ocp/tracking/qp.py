"""The quadratic program of one SQP iteration: which change of the profile, within limits, pays most.

The change is piecewise linear between knots. The limits hold on every row, because within an interval the change has
one slope, which the steepest row of the profile bounds. DAQP solves it, a dual active-set method that comes with
CasADi.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import GaussNewtonModel, Knots
from tendonff.ocp.tracking.problem import TrackingProblem


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
    """Bounds of changes at the knots that keep every row of a profile, shape (n,) [N], within the limits."""
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


_TINY_N = 1e-9  # room below this is none
_FAR_N = 1e9  # no bound
_OPTIONS = {
    "error_on_fail": False,
    "daqp": {"primal_tol": 1e-10},  # it counts in directions scaled by the Hessian, which is nearly singular
}


def solve_qp(model: GaussNewtonModel, room: StepBounds, trust_N: Array | float, penalty_N: float) -> Array | None:
    """Solve the quadratic program: the change at the knots, shape (k,), or None where the solver fails.

    No change exceeds `trust_N`, one value or one for each knot. Bounds that the present profile breaks may be missed by
    one common share of what it misses, at `penalty_N` per newton.
    """
    low, high = np.maximum(room.low_N, -trust_N), np.minimum(room.high_N, trust_N)
    free = high - low > _TINY_N
    move, k = np.zeros(len(low)), int(free.sum())
    if not k:
        return move
    missed = max(float(model.low.max()), float((-model.high).max()), 0.0) if len(model.low) else 0.0
    rise, seen = np.diff(np.eye(len(low)), axis=0)[:, free], model.rows[:, free]
    tied = free[1:] | free[:-1]
    scale = 1 / max(float(np.diag(model.hessian).max()), 1e-300)  # its tolerances are absolute
    # The last unknown is the share of what is missed that remains.
    hessian = np.pad(model.hessian[np.ix_(free, free)] * scale, (0, 1))
    hessian[k, k] = 1e-6
    column, open_row = np.full((len(seen), 1), missed), np.full(len(seen), _FAR_N)
    if missed > 0:
        seen = np.vstack([np.hstack([seen, column]), np.hstack([seen, -column])])
        seen_low, seen_high = np.append(model.low, -open_row), np.append(open_row, model.high)
    else:
        seen, seen_low, seen_high = np.pad(seen, ((0, 0), (0, 1))), model.low, model.high
    rows = np.vstack([np.pad(rise[tied], ((0, 0), (0, 1))), seen])
    bounds = {
        "a": rows,
        "g": np.append(model.gradient[free], penalty_N * missed) * scale,
        "lba": np.concatenate([room.rise_low_N[tied], np.maximum(seen_low, -_FAR_N)]),
        "uba": np.concatenate([room.rise_high_N[tied], np.minimum(seen_high, _FAR_N)]),
        "lbx": np.append(low[free], 0.0),
        "ubx": np.append(high[free], 1.0),
    }
    shapes = {"h": ca.Sparsity.dense(k + 1, k + 1), "a": ca.Sparsity.dense(*rows.shape)}
    for damping in (1e-8, 1e-5):  # where the tendon sticks the Hessian is singular
        solver = ca.conic("change", "daqp", shapes, _OPTIONS)
        found = solver(h=hessian + damping * np.eye(k + 1), **bounds)
        x: Array = np.asarray(found["x"].full()).ravel()[:k]
        if solver.stats()["success"] and np.all(np.isfinite(x)):
            move[free] = np.clip(x, low[free], high[free])
            return move
    return None
