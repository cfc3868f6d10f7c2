"""Sequential quadratic programming on the force's knots, with the true simulation as judge.

Each iteration linearises the simulation exactly around the present profile (`sensitivity`), and solves a quadratic
program in the *change* of the force, piecewise linear between knots. The profile itself stays on the fine grid: what
it had there, such as the fine structure of an exact inverse, is kept, and the limits hold row by row, because within
an interval the change has one slope, which the steepest row of the profile bounds. A trust region makes up for what
the linearisation does not see: where the tendon sticks the output does not move, and where it slips again is a kink.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import casadi as ca
import numpy as np
import scipy.sparse as sp

from tendonff.ocp.limits import ForceLimits
from tendonff.ocp.plants import Goal, Judgement, LocalModel, Plant, Rows, judge, local_model
from tendonff.ocp.stepping import Array


class Ending(StrEnum):
    """How a descent ended.

    Attributes
    ----------
    CONVERGED
        The next step promises less than the tolerance.
    STALLED
        The trust region shrank to nothing at a kink, short of the tolerance.
    ITERATIONS
        The iteration limit came first.
    """

    CONVERGED = "converged"
    STALLED = "stalled"
    ITERATIONS = "iterations"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """When a descent starts, trusts and stops.

    Parameters
    ----------
    iterations : int
        At most so many quadratic programs.
    tolerance : float
        Relative decrease of the merit that is not worth another iteration [-].
    trust_N : float
        Largest change of the force in the first step [N].
    """

    iterations: int
    tolerance: float
    trust_N: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Descent:
    """Where a descent came to.

    Parameters
    ----------
    force_N : ndarray, shape (n,)
    judgement : Judgement
        Of that force.
    ending : Ending
    iterations : int
    promise : float
        Relative decrease of the merit that the last quadratic program promised [-].
    trust_N : float
        Last trust region [N].
    """

    force_N: Array
    judgement: Judgement
    ending: Ending
    iterations: int
    promise: float
    trust_N: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """Changes of a profile, piecewise linear between knots, and the room that the limits leave for them.

    Parameters
    ----------
    shape : ndarray, shape (n, k)
        Change of the force for a unit change at each knot.
    slope : csc_array, shape (k - 1, k)
        Slope of the change between the knots.
    low_N, high_N : ndarray, shape (k,)
        Room at the knots; the first row is fixed.
    slope_low, slope_high : ndarray, shape (k - 1,)
        Room for the slopes [N/s].
    """

    shape: Array
    slope: sp.csc_array
    low_N: Array
    high_N: Array
    slope_low: Array
    slope_high: Array


def knot_shape(knots: Rows) -> Array:
    """Hat functions of the knots on all rows, shape (n, k).

    Parameters
    ----------
    knots : ndarray of int, shape (k,)
    """
    n, k = int(knots[-1]) + 1, len(knots)
    rows = np.arange(n)
    left = np.clip(np.searchsorted(knots, rows, side="right") - 1, 0, k - 2)
    weight = (rows - knots[left]) / (knots[left + 1] - knots[left])
    shape = np.zeros((n, k))
    shape[rows, left] = 1 - weight
    shape[rows, left + 1] += weight
    return shape


def room_for_change(force_N: Array, step_s: float, limits: ForceLimits, knots: Rows, shape: Array) -> Change:
    """What may change at the knots so that every row respects the limits.

    Parameters
    ----------
    force_N : ndarray, shape (n,)
        A profile within the limits.
    step_s : float
    limits : ForceLimits
    knots : ndarray of int, shape (k,)
    shape : ndarray, shape (n, k)
        `knot_shape` of the knots.
    """
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
    return Change(
        shape=shape,
        slope=slope,
        low_N=np.minimum(low, 0.0),
        high_N=np.maximum(high, 0.0),
        slope_low=np.minimum(-limits.rate_N_per_s - slowest, 0.0),
        slope_high=np.maximum(limits.rate_N_per_s - fastest, 0.0),
    )


def best_change(model: LocalModel, change: Change, trust_N: float, penalty_N: float) -> Array | None:
    """Solve the quadratic program: the change at the knots, shape (k,), or None where the solver fails.

    Tension rows may be missed by one common amount, at `penalty_N` per newton.

    Parameters
    ----------
    model : LocalModel
    change : Change
    trust_N : float
    penalty_N : float
    """
    k, rows = len(model.gradient), len(model.low)
    hessian = model.hessian + 1e-9 * max(float(np.diag(model.hessian).max()), 1e-300) * np.eye(k)
    gradient, low, high = model.gradient, np.maximum(change.low_N, -trust_N), np.minimum(change.high_N, trust_N)
    constraint, row_low, row_high = change.slope, change.slope_low, change.slope_high
    if rows:  # the last unknown is by how much the tension rows are missed
        small = 1e-6 * float(np.diag(hessian).max())
        hessian = np.block([[hessian, np.zeros((k, 1))], [np.zeros((1, k)), np.full((1, 1), small)]])
        gradient = np.append(gradient, penalty_N)
        low, high = np.append(low, 0.0), np.append(high, 1e6)
        ones = np.ones((rows, 1))
        constraint = sp.vstack(
            [
                sp.hstack([change.slope, sp.csc_array((len(change.slope_low), 1))]),
                sp.csc_array(np.hstack([model.rows, ones])),
                sp.csc_array(np.hstack([model.rows, -ones])),
            ]
        ).tocsc()
        open_row = np.full(rows, np.inf)
        row_low = np.concatenate([row_low, model.low, -open_row])
        row_high = np.concatenate([row_high, open_row, model.high])
    solution = _solve(hessian, gradient, constraint, row_low, row_high, low, high)
    return None if solution is None else solution[:k]


def _solve(
    hessian: Array, gradient: Array, constraint: sp.csc_array, row_low: Array, row_high: Array, low: Array, high: Array
) -> Array | None:
    """CasADi's interface to DAQP: a dense dual active-set method; exact on active bounds, deterministic."""
    scale = 1 / max(float(np.abs(np.diag(hessian)).max()), 1e-300)  # its tolerances are absolute
    h, a = ca.DM(hessian * scale), ca.DM(sp.csc_matrix(constraint))
    solver = ca.conic("change", "daqp", {"h": h.sparsity(), "a": a.sparsity()}, {"error_on_fail": False})
    found = solver(h=h, g=gradient * scale, a=a, lba=row_low, uba=row_high, lbx=low, ubx=high)
    x = np.asarray(found["x"].full()).ravel()
    if not (solver.stats()["success"] and np.all(np.isfinite(x))):
        return None
    return np.clip(x, low, high)


def descend(
    plants: tuple[Plant, ...],
    goal: Goal,
    limits: ForceLimits,
    force_N: Array,
    judgement: Judgement,
    knots: Rows,
    rules: Rules,
    tell: Callable[[], None] | None = None,
) -> Descent:
    """Improve a profile until it does not pay any more.

    Parameters
    ----------
    plants : tuple of Plant
    goal : Goal
    limits : ForceLimits
    force_N : ndarray, shape (n,)
        A profile within the limits.
    judgement : Judgement
        Of that profile.
    knots : ndarray of int, shape (k,)
        Rows from 0 to n - 1.
    rules : Rules
    tell : callable, optional
        Called after each iteration.

    Returns
    -------
    Descent
        Never worse than the profile it started from.
    """
    shape = knot_shape(knots)
    trust, smallest = rules.trust_N, 1e-4 * rules.trust_N
    promise, poor = np.inf, 0
    for iteration in range(1, rules.iterations + 1):
        model = local_model(plants, goal, force_N, judgement, knots, shape, reach_N=2 * trust)
        room = room_for_change(force_N, goal.step_s, limits, knots, shape)
        improved, gain = False, 0.0
        while trust >= smallest:
            move = best_change(model, room, trust, goal.penalty_N)
            if move is None:
                trust /= 4
                continue
            promise = _promise(model, goal, move, judgement)
            trial = limits.apply(force_N + shape @ move, goal.step_s, float(force_N[0]))  # only rounding is left to clip
            if promise <= 0.1 * rules.tolerance:
                break
            outcome = judge(plants, goal, trial)
            gain = (judgement.merit - outcome.merit) / judgement.merit
            ratio, size = gain / promise, float(np.abs(move).max())
            if ratio > 0.75 and size > 0.9 * trust:
                trust *= 2
            elif ratio < 0.25:
                trust = size / 3
            if gain > 0:
                force_N, judgement, improved = trial, outcome, True
                break
        if tell is not None:
            tell()
        poor = poor + 1 if gain < rules.tolerance else 0
        if promise <= 0.1 * rules.tolerance or poor >= 2:
            return _descent(force_N, judgement, Ending.CONVERGED, iteration, promise, trust)
        if not improved:
            ending = Ending.CONVERGED if promise <= rules.tolerance else Ending.STALLED
            return _descent(force_N, judgement, ending, iteration, promise, trust)
    return _descent(force_N, judgement, Ending.ITERATIONS, rules.iterations, promise, trust)


def _promise(model: LocalModel, goal: Goal, move: Array, judgement: Judgement) -> float:
    """Relative decrease of the merit that the quadratic model promises."""
    decrease = -float(model.gradient @ move + 0.5 * move @ model.hessian @ move)
    if len(model.low):
        at = model.rows @ move
        beyond = max(float(np.max(model.low - at)), float(np.max(at - model.high)), 0.0)
        decrease += goal.penalty_N * (judgement.beyond_N - beyond)
    return decrease / judgement.merit


def _descent(
    force_N: Array, judgement: Judgement, ending: Ending, iterations: int, promise: float, trust_N: float
) -> Descent:
    return Descent(
        force_N=force_N,
        judgement=judgement,
        ending=ending,
        iterations=iterations,
        promise=promise,
        trust_N=trust_N,
    )
