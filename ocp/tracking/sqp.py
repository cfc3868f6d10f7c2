"""Sequential quadratic programming on the force's knots, judged by the true simulation.

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

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Evaluation, GaussNewtonModel, Knots, evaluate, gauss_newton_model
from tendonff.ocp.tracking.problem import TrackingProblem


class SqpStatus(StrEnum):
    """How a search on one grid of knots ended.

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
class SqpSettings:
    """Trust region of the start, and when to stop.

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
class SqpResult:
    """Where a search on one grid came to.

    Parameters
    ----------
    force_N : ndarray, shape (n,)
    evaluation : Evaluation
        Of that force.
    status : SqpStatus
    iterations : int
    promise : float
        Relative decrease of the merit that the last quadratic program promised [-].
    trust_N : float
        Last trust region [N].
    """

    force_N: Array
    evaluation: Evaluation
    status: SqpStatus
    iterations: int
    promise: float
    trust_N: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AdmissibleChange:
    """Changes of a profile, piecewise linear between knots, and the room that the limits leave for them.

    Parameters
    ----------
    shape : ndarray, shape (n, k)
        AdmissibleChange of the force for a unit change at each knot.
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


def knot_shape(knots: Knots) -> Array:
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


def step_bounds(problem: TrackingProblem, force_N: Array, knots: Knots, shape: Array) -> AdmissibleChange:
    """What may change at the knots so that every row respects the limits.

    Parameters
    ----------
    problem : TrackingProblem
    force_N : ndarray, shape (n,)
        A profile within the limits.
    knots : ndarray of int, shape (k,)
    shape : ndarray, shape (n, k)
        `knot_shape` of the knots.
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
    return AdmissibleChange(
        shape=shape,
        slope=slope,
        low_N=np.minimum(low, 0.0),
        high_N=np.maximum(high, 0.0),
        slope_low=np.minimum(-limits.rate_N_per_s - slowest, 0.0),
        slope_high=np.maximum(limits.rate_N_per_s - fastest, 0.0),
    )


def solve_qp(model: GaussNewtonModel, change: AdmissibleChange, trust_N: float, penalty_N: float) -> Array | None:
    """Solve the quadratic program: the change at the knots, shape (k,), or None where the solver fails.

    Tension rows may be missed by one common amount, at `penalty_N` per newton.

    Parameters
    ----------
    model : GaussNewtonModel
    change : AdmissibleChange
    trust_N : float
    penalty_N : float
    """
    k = len(model.gradient)
    hessian, gradient = model.hessian, model.gradient
    low, high = np.maximum(change.low_N, -trust_N), np.minimum(change.high_N, trust_N)
    rows, row_low, row_high = change.slope, change.slope_low, change.slope_high
    if len(model.low):
        missed = max(float(model.low.max()), float((-model.high).max()), 0.0)  # by no change at all
        tension, far = sp.csc_array(model.rows), 1e9
        if missed > 0:  # the last unknown is the share of that which remains
            hessian = np.pad(hessian, (0, 1))
            hessian[k, k] = 1e-6 * float(np.diag(hessian).max())
            gradient = np.append(gradient, penalty_N * missed)
            low, high = np.append(low, 0.0), np.append(high, 1.0)
            column = np.full((len(model.low), 1), missed)
            rows = sp.hstack([rows, sp.csc_array((len(row_low), 1))])
            tension = sp.vstack([sp.hstack([tension, column]), sp.hstack([tension, -column])])
            open_row = np.full(len(model.low), far)
            row_low = np.concatenate([row_low, model.low, -open_row])
            row_high = np.concatenate([row_high, open_row, np.minimum(model.high, far)])
        else:
            row_low = np.concatenate([row_low, model.low])
            row_high = np.concatenate([row_high, np.minimum(model.high, far)])
        rows = sp.vstack([rows, tension])
    solution = _solve(hessian, gradient, rows, row_low, row_high, low, high)
    return None if solution is None else solution[:k]


def _solve(
    hessian: Array, gradient: Array, constraint: sp.sparray, row_low: Array, row_high: Array, low: Array, high: Array
) -> Array | None:
    """CasADi's interface to DAQP: a dense dual active-set method; exact on active bounds, deterministic."""
    scale, k = 1 / max(float(np.diag(hessian).max()), 1e-300), len(gradient)  # its tolerances are absolute
    a = ca.DM(sp.csc_matrix(constraint))
    solver = ca.conic("change", "daqp", {"h": ca.Sparsity.dense(k, k), "a": a.sparsity()}, {"error_on_fail": False})
    for damping in (1e-9, 1e-7, 1e-5):  # where the tendon sticks the Hessian is singular
        damped = hessian * scale + damping * np.eye(k)
        h = ca.DM(ca.Sparsity.dense(k, k), damped.ravel())
        found = solver(h=h, g=gradient * scale, a=a, lba=row_low, uba=row_high, lbx=low, ubx=high)
        x: Array = np.asarray(found["x"].full()).ravel()
        if solver.stats()["success"] and np.all(np.isfinite(x)):
            inside: Array = np.clip(x, low, high)
            return inside
    return None


def solve_sqp(
    problem: TrackingProblem,
    force_N: Array,
    evaluation: Evaluation,
    knots: Knots,
    settings: SqpSettings,
    tell: Callable[[], None] | None = None,
) -> SqpResult:
    """Improve a profile until it does not pay any more.

    Parameters
    ----------
    problem : TrackingProblem
    force_N : ndarray, shape (n,)
        A profile within the limits.
    evaluation : Evaluation
        Of that profile.
    knots : ndarray of int, shape (k,)
        From 0 to n - 1.
    settings : SqpSettings
    tell : callable, optional
        Called after each iteration.

    Returns
    -------
    SqpResult
        Never worse than the profile it started from.
    """
    shape = knot_shape(knots)
    trust, promise, poor, iteration, status = settings.trust_N, np.inf, 0, 0, SqpStatus.ITERATIONS
    while iteration < settings.iterations and status is SqpStatus.ITERATIONS:
        iteration += 1
        model = gauss_newton_model(problem, force_N, evaluation, knots, shape, reach_N=2 * trust)
        room = step_bounds(problem, force_N, knots, shape)
        step = _step(problem, force_N, evaluation, model, room, trust, settings)
        trust, promise, gain = step.trust_N, step.promise, 0.0
        if step.evaluation is not None:
            gain = 1 - step.evaluation.merit / evaluation.merit
            force_N, evaluation = step.force_N, step.evaluation
        if tell is not None:
            tell()
        poor = poor + 1 if gain < settings.tolerance else 0
        stuck = step.evaluation is None
        if promise <= 0.1 * settings.tolerance or poor >= 2 or (stuck and promise <= settings.tolerance):
            status = SqpStatus.CONVERGED
        elif stuck:
            status = SqpStatus.STALLED
    return SqpResult(
        force_N=force_N, evaluation=evaluation, status=status, iterations=iteration, promise=promise, trust_N=trust
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Step:
    """Outcome of one iteration; no evaluation where nothing better was found."""

    force_N: Array
    evaluation: Evaluation | None
    promise: float
    trust_N: float


_SHARES = (1.0, 0.5, 0.25, 0.1)  # of a change, tried in turn: the limits are convex, so any share keeps them
_TRIALS = 4  # quadratic programs for one linearisation


def _step(
    problem: TrackingProblem,
    force_N: Array,
    evaluation: Evaluation,
    model: GaussNewtonModel,
    room: AdmissibleChange,
    trust: float,
    settings: SqpSettings,
) -> _Step:
    """Solve the quadratic program, and go as far along its answer as the simulation agrees."""
    promise = np.inf
    for _ in range(_TRIALS):
        move = solve_qp(model, room, trust, problem.goal.penalty_N)
        if move is None:
            trust /= 4
            continue
        promise = _promise(model, problem, move, evaluation)
        if promise <= 0.1 * settings.tolerance:
            break
        size, change = float(np.abs(move).max()), room.shape @ move
        best: tuple[Array, Evaluation, float] | None = None
        for share in _SHARES:
            trial = np.clip(force_N + share * change, problem.limits.minimum_N, problem.limits.maximum_N)  # rounding
            outcome = evaluate(problem, trial)
            if best is not None and outcome.merit >= best[1].merit:
                break
            if outcome.merit < evaluation.merit:
                best = (trial, outcome, share)
            if evaluation.merit - outcome.merit > 0.5 * promise * evaluation.merit * share * (2 - share):
                break
        if best is None:
            trust = _SHARES[-1] * size / 2
            continue
        if best[2] == 1 and size > 0.9 * trust:
            trust *= 2
        elif best[2] < 1:
            trust = 2 * best[2] * size
        return _Step(force_N=best[0], evaluation=best[1], promise=promise, trust_N=trust)
    return _Step(force_N=force_N, evaluation=None, promise=promise, trust_N=trust)


def _promise(model: GaussNewtonModel, problem: TrackingProblem, move: Array, evaluation: Evaluation) -> float:
    """Relative decrease of the merit that the quadratic model promises."""
    decrease = -float(model.gradient @ move + 0.5 * move @ model.hessian @ move)
    if len(model.low):
        at = model.rows @ move
        beyond = max(float(np.max(model.low - at)), float(np.max(at - model.high)), 0.0)
        decrease += problem.goal.penalty_N * (evaluation.beyond_N - beyond)
    return decrease / evaluation.merit
