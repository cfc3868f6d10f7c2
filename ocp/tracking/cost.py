"""What a profile costs, and the Gauss-Newton model of the cost in changes of the force at knots."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonff.ocp.sensitivity import Links, force_sensitivity
from tendonff.ocp.simulate import Outcome, simulate
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.problem import TensionBounds, TrackingProblem

Knots = NDArray[np.int_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """What a profile achieves on every plant.

    Parameters
    ----------
    merit : float
        What is made small: error, effort and penalty [N^2]; infinite where a simulation fails.
    squares : ndarray, shape (plants,)
        Mean squared tension errors [N^2].
    beyond_N : float
        Largest excess over the tension bounds, or over those of the motion by `MotionScale` [N], 0 inside.
    tensions_N : tuple of ndarray, each (n, N + 1)
    travels_m : tuple of ndarray, each (n,)
        Position of the near end relative to rest.
    """

    merit: float
    squares: Array
    beyond_N: float
    tensions_N: tuple[Array, ...]
    travels_m: tuple[Array, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussNewtonModel:
    """Quadratic model of the merit around a profile, in changes of the force at the knots.

    Parameters
    ----------
    hessian, gradient : ndarray, shape (k, k), (k,)
    rows, low, high : ndarray, shape (c, k), (c,), (c,)
        Tension rows: low <= rows @ change <= high, if they can be met.
    """

    hessian: Array
    gradient: Array
    rows: Array
    low: Array
    high: Array


def power_mean(squares: Array, power: float) -> tuple[float, Array]:
    """Mean of order `power` and its slopes over the values.

    Parameters
    ----------
    squares : ndarray, shape (s,)
    power : float
    """
    top = float(squares.max())
    if top == 0:
        return 0.0, np.full(len(squares), 1 / len(squares))
    share = squares / top
    mean = float(np.mean(share**power)) ** (1 / power)
    return top * mean, share ** (power - 1) * mean ** (1 - power) / len(squares)


def evaluate(problem: TrackingProblem, force_N: Array) -> Evaluation:
    """Simulate every plant and evaluate the profile.

    Parameters
    ----------
    problem : TrackingProblem
    force_N : ndarray, shape (n,)
    """
    goal, bounds, tensions, travels = problem.goal, problem.bounds, [], []
    for plant in problem.plants:
        run = simulate(plant.chain, force_N, problem.step_s, state=plant.state)
        if run.outcome is Outcome.FAILED:
            squares = np.full(len(problem.plants), np.inf)
            return Evaluation(merit=np.inf, squares=squares, beyond_N=np.inf, tensions_N=())
        tensions.append(run.tension_N)
        travels.append(run.near_position_m - plant.origin_m)
    squares = np.array([np.mean((t[:, -1] - goal.reference_N) ** 2) for t in tensions])
    low, high = min(float(t[1:].min()) for t in tensions), max(float(t[1:].max()) for t in tensions)
    beyond = max(bounds.low_N - low, high - bounds.high_N, *(_motion_beyond_N(problem, x) for x in travels), 0.0)
    effort = goal.effort_weight * float(np.mean(force_N**2))
    # A slack link carries no force however slack it is, so its depth says nothing: the cost of slack is its own.
    slack = goal.penalty_N * float(np.ptp(goal.reference_N)) if low <= 0 else 0.0
    merit = power_mean(squares, goal.power)[0] + effort + goal.penalty_N * beyond + slack
    return Evaluation(
        merit=merit, squares=squares, beyond_N=beyond, tensions_N=tuple(tensions), travels_m=tuple(travels)
    )


INSIDE = 5e-3
"""The search aims so far inside the speed and the travel, so that other plants than the model keep them too."""


def _motion_beyond_N(problem: TrackingProblem, travel_m: Array) -> float:
    """Largest excess of a motion over its limits, as a tension [N]."""
    motion, scale = problem.limits.motion, problem.newtons
    if not motion.binds:
        return 0.0
    speed, range_m = motion.excess(travel_m, problem.step_s)
    found = (float(speed.max()) * scale.per_speed_N_s_per_m, float(range_m.max()) * scale.per_travel_N_per_m)
    return max((x for x in found if x > 0), default=0.0)  # an excess over an infinite limit is no number


def gauss_newton_model(
    problem: TrackingProblem, force_N: Array, evaluation: Evaluation, knots: Knots, shape: Array, reach_N: float
) -> GaussNewtonModel:
    """Gauss-Newton model of the merit, from exact sensitivities.

    Parameters
    ----------
    problem : TrackingProblem
    force_N : ndarray, shape (n,)
    evaluation : Evaluation
        Of that force.
    knots : ndarray of int, shape (k,)
        Rows where the change of the force has its corners.
    shape : ndarray, shape (n, k)
        The change of the force for a unit change at each knot.
    reach_N : float
        Tensions that come this close to a bound are watched [N].
    """
    goal, bounds, (n, k) = problem.goal, problem.bounds, shape.shape
    _, slopes = power_mean(evaluation.squares, goal.power)
    hessian, gradient = np.zeros((k, k)), np.zeros(k)
    rows, lows, highs = [np.empty((0, k))], [np.empty(0)], [np.empty(0)]
    plants = zip(problem.plants, evaluation.tensions_N, evaluation.travels_m, slopes, strict=True)
    for plant, tension, travel, slope in plants:
        watched = _watched(tension, bounds, reach_N)
        found = force_sensitivity(
            plant.chain,
            force_N,
            problem.step_s,
            knots,
            state=plant.state,
            links=Links.ALL if watched.size else Links.OUTPUT,
            ends=problem.limits.motion.binds,
            window=_MEMORY,
        )
        output = found.tension_slopes[:, -1, :]
        weight = 2 * slope / n
        _add_gram(hessian, output, knots, weight)
        gradient += weight * (output.T @ (tension[:, -1] - goal.reference_N))
        if watched.size:
            at, link = watched.T
            rows.append(found.tension_slopes[at, link, :])
            lows.append(bounds.low_N - tension[at, link])
            highs.append(bounds.high_N - tension[at, link])
        if found.ends_slopes is not None and problem.limits.motion.binds:
            for row, low, high in _motion_rows(problem, travel, found.ends_slopes[:, 0, :], reach_N):
                rows.append(row)
                lows.append(low)
                highs.append(high)
    if goal.effort_weight > 0:
        hessian += 2 * goal.effort_weight / n * (shape.T @ shape)
        gradient += 2 * goal.effort_weight / n * (shape.T @ force_N)
    return GaussNewtonModel(
        hessian=hessian,
        gradient=gradient,
        rows=np.vstack(rows),
        low=np.concatenate(lows),
        high=np.concatenate(highs),
    )


_MEMORY = 120  # a knot's influence is followed over so many later ones: several reversals, which wipe it out
_BLOCK_ROWS = 16


def _add_gram(hessian: Array, slopes: Array, knots: Knots, weight: float) -> None:
    """Add weight * slopes^T slopes, shape (k, k), in blocks of the few knots that matter at a time.

    Blocks this small are also too small for the matrix library to start threads, which would wait for busy processors.
    """
    for i in range(len(knots) - 1):
        last = i + 2
        alive = slice(max(last - _MEMORY, 0), last)
        for row in range(int(knots[i]) + 1, int(knots[i + 1]) + 1, _BLOCK_ROWS):
            block = slopes[row : min(row + _BLOCK_ROWS, int(knots[i + 1]) + 1), alive]
            hessian[alive, alive] += weight * (block.T @ block)


_PIECE_ROWS = 10  # of so many successive rows, and all links, only the worst becomes a constraint


def _motion_rows(
    problem: TrackingProblem, travel_m: Array, slopes: Array, reach_N: float
) -> list[tuple[Array, Array, Array]]:
    """Rows, low and high of the limits of the motion that come close: speed and travel, as tensions [N]."""
    motion, scale, h = problem.limits.motion, problem.newtons, problem.step_s
    found = []
    speed, speed_slopes = np.diff(travel_m, prepend=travel_m[0]) / h, np.diff(slopes, axis=0, prepend=slopes[:1]) / h
    top, span = motion.speed_m_per_s * (1 - INSIDE), motion.high_m - motion.low_m
    inside = INSIDE * span if np.isfinite(span) else 0.0
    for value, slope, low, high, unit in (
        (speed, speed_slopes, -top, top, scale.per_speed_N_s_per_m),
        (travel_m, slopes, motion.low_m + inside, motion.high_m - inside, scale.per_travel_N_per_m),
    ):
        if not (np.isfinite(low) or np.isfinite(high)):
            continue
        room = np.minimum(value - low, high - value) * unit
        starts = range(1, len(value), _PIECE_ROWS)
        at = np.array([start + int(np.argmin(room[start : start + _PIECE_ROWS])) for start in starts], dtype=np.int64)
        at = at[room[at] < reach_N]
        if at.size:
            bounds = (np.nan_to_num((bound - value[at]) * unit, posinf=_FAR_N, neginf=-_FAR_N) for bound in (low, high))
            found.append((slope[at] * unit, *bounds))
    return found  # type: ignore[return-value]


_FAR_N = 1e9


def _watched(tension_N: Array, bounds: TensionBounds, reach_N: float) -> Knots:
    """Pairs (row, link) near a bound, the worst of each piece; shape (c, 2)."""
    room = np.minimum(tension_N - bounds.low_N, bounds.high_N - tension_N)
    pairs: list[tuple[int, int]] = []
    for start in range(1, len(room), _PIECE_ROWS):
        piece = room[start : start + _PIECE_ROWS]
        row, link = divmod(int(piece.argmin()), piece.shape[1])
        if piece[row, link] < reach_N:
            pairs.append((start + row, link))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)
