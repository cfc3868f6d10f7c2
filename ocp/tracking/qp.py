"""The quadratic program of one SQP iteration: which change of the profile, within limits, pays most.

The change is piecewise linear between knots. The limits hold on every row, because within an interval the change has
one slope, which the steepest row of the profile bounds.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy.sparse as sp

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import GaussNewtonModel, Knots
from tendonff.ocp.tracking.problem import TrackingProblem


@dataclass(frozen=True, slots=True, kw_only=True)
class StepBounds:
    """The room that the limits leave for changes of a profile at its knots.

    Parameters
    ----------
    slope : csc_array, shape (k - 1, k)
        Slope of the change between the knots.
    low_N, high_N : ndarray, shape (k,)
        Room at the knots; the first row is fixed.
    slope_low, slope_high : ndarray, shape (k - 1,)
        Room for the slopes [N/s].
    """

    slope: sp.csc_array
    low_N: Array
    high_N: Array
    slope_low: Array
    slope_high: Array


def step_bounds(problem: TrackingProblem, force_N: Array, knots: Knots) -> StepBounds:
    """What may change at the knots so that every row respects the limits.

    Parameters
    ----------
    problem : TrackingProblem
    force_N : ndarray, shape (n,)
        A profile within the limits.
    knots : ndarray of int, shape (k,)
    """
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
    count = len(gap)
    slope = sp.diags_array([-1 / gap, 1 / gap], offsets=[0, 1], shape=(count, count + 1)).tocsc()
    return StepBounds(
        slope=slope,
        low_N=np.minimum(low, 0.0),
        high_N=np.maximum(high, 0.0),
        slope_low=np.minimum(-limits.rate_N_per_s - slowest, 0.0),
        slope_high=np.maximum(limits.rate_N_per_s - fastest, 0.0),
    )


def solve_qp(model: GaussNewtonModel, room: StepBounds, trust_N: Array | float, penalty_N: float) -> Array | None:
    """Solve the quadratic program: the change at the knots, shape (k,), or None where the solver fails.

    Tension rows may be missed by one common amount, at `penalty_N` per newton.

    Parameters
    ----------
    model : GaussNewtonModel
    room : StepBounds
    trust_N : float or ndarray, shape (k,)
        Largest change [N].
    penalty_N : float
    """
    k = len(model.gradient)
    hessian, gradient = model.hessian, model.gradient
    low, high = np.maximum(room.low_N, -trust_N), np.minimum(room.high_N, trust_N)
    rows, row_low, row_high = room.slope, room.slope_low, room.slope_high
    if len(model.low):
        missed = max(float(model.low.max()), float((-model.high).max()), 0.0)  # by no change at all
        tension = sp.csc_array(model.rows)
        if missed > 0:  # the last unknown is the share of that which remains
            hessian = np.pad(hessian, (0, 1))
            hessian[k, k] = 1e-6 * float(np.diag(hessian).max())
            gradient = np.append(gradient, penalty_N * missed)
            low, high = np.append(low, 0.0), np.append(high, 1.0)
            column = sp.csc_array(np.full((len(model.low), 1), missed))
            rows = sp.hstack([rows, sp.csc_array((len(row_low), 1))])
            tension = sp.vstack([sp.hstack([tension, column]), sp.hstack([tension, -column])])
            open_row = np.full(len(model.low), _FAR)
            row_low = np.concatenate([row_low, model.low, -open_row])
            row_high = np.concatenate([row_high, open_row, np.minimum(model.high, _FAR)])
        else:
            row_low = np.concatenate([row_low, model.low])
            row_high = np.concatenate([row_high, np.minimum(model.high, _FAR)])
        rows = sp.vstack([rows, tension])
    solution = _solve(hessian, gradient, rows, row_low, row_high, low, high)
    return None if solution is None else solution[:k]


_FAR = 1e9  # no bound [N]
_PIQP: dict[str, object] = {"error_on_fail": False, "piqp": {"max_iter": 60}}
_DAQP: dict[str, object] = {"error_on_fail": False}


def _solve(
    hessian: Array, gradient: Array, constraint: sp.sparray, row_low: Array, row_high: Array, low: Array, high: Array
) -> Array | None:
    """CasADi's interfaces to PIQP, sparse, for a knot acts only for a while; and to DAQP, dense, where that fails."""
    scale, k = 1 / max(float(np.diag(hessian).max()), 1e-300), len(gradient)  # their tolerances are absolute
    a = ca.DM(sp.csc_matrix(constraint))
    bounds = {"a": a, "lba": row_low, "uba": row_high, "lbx": low, "ubx": high, "g": gradient * scale}
    dense = ca.Sparsity.dense(k, k)
    sparse = sp.csc_array(hessian + sp.eye_array(k) * 1e-300)
    pattern = ca.Sparsity(k, k, sparse.indptr.tolist(), sparse.indices.tolist())
    places = (sparse.indices, np.repeat(np.arange(k), np.diff(sparse.indptr)))
    attempts: list[tuple[str, ca.Sparsity, float, dict[str, object]]]
    attempts = [] if len(row_low) >= k else [("piqp", pattern, 1e-9, _PIQP)]  # tension rows are what it fails on
    attempts += [("daqp", dense, damping, _DAQP) for damping in (1e-8, 1e-5)]
    for name, shape, damping, options in attempts:  # where the tendon sticks the Hessian is singular
        damped = hessian * scale + damping * np.eye(k)
        solver = ca.conic("change", name, {"h": shape, "a": a.sparsity()}, options)
        found = solver(h=ca.DM(shape, damped[places] if shape is pattern else damped.ravel()), **bounds)
        x: Array = np.asarray(found["x"].full()).ravel()
        if solver.stats()["success"] and np.all(np.isfinite(x)):
            inside: Array = np.clip(x, low, high)
            return inside
    return None
