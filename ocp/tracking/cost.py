"""Cost of a profile, and its Gauss-Newton model in changes of the force at knots."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonff.ocp.sensitivity import force_sensitivity
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.diagnosis import reversals
from tendonff.ocp.tracking.motion import INSIDE
from tendonff.ocp.tracking.problem import MotionBound, TrackingProblem

Knots = NDArray[np.int_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Errors of a profile on every plant."""

    merit: float  # what is made small: error, effort and penalty [N^2]; infinite where a simulation fails
    squares: Array  # shape (plants,); mean squared tension errors [N^2]
    slopes: Array  # shape (plants,); of the merit over each plant's errors [-]
    density: Array  # shape (n,); share of each row in the merit, without penalties [N^2]
    # largest excess over the tension bounds, or over those of the motion by `MotionBound` [N], 0 inside
    beyond_N: float
    tensions_N: tuple[Array, ...]
    travels_m: tuple[Array, ...] = ()  # position of the near end relative to rest


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussNewtonModel:
    """Quadratic model of the merit around a profile, in changes of the force at the knots."""

    hessian: Array  # shape (k, k)
    gradient: Array  # shape (k,)
    # tension rows: low <= rows @ change <= high, if they can be met
    rows: Array  # shape (c, k)
    low: Array  # shape (c,)
    high: Array  # shape (c,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hats:
    """Hat functions of knots: in row r the change is (1 - share) of that at knot `left` and share of the next one's."""

    left: Knots  # shape (n,)
    share: Array  # shape (n,)
    gap: Knots  # shape (k - 1,); rows between knots

    @classmethod
    def of(cls, knots: Knots) -> "Hats":
        """Of knots from 0 to n - 1."""
        gap = np.diff(knots)
        left = np.append(np.repeat(np.arange(len(gap)), gap), len(gap) - 1)
        return cls(left=left, share=(np.arange(len(left)) - knots[left]) / gap[left], gap=gap)

    def dense(self) -> Array:
        """The change in every row, of those at the knots, shape (n, k)."""
        rows, found = np.arange(len(self.left)), np.zeros((len(self.left), len(self.gap) + 1))
        found[rows, self.left], found[rows, self.left + 1] = 1 - self.share, self.share
        return found


def add_pairs(hessian: Array, gradient: Array, left: Knots, near: Array, far: Array, weight: Array, at: Array) -> None:
    """Add weight/2 (at + near x[left] + far x[left + 1])^2, summed over all rows, as a function of x."""
    k = len(gradient)
    diagonal, knots = np.einsum("ii->i", hessian), left + 1
    diagonal += np.bincount(left, weight * near**2, k) + np.bincount(knots, weight * far**2, k)
    mixed = np.bincount(left, weight * near * far, k)[:-1]
    np.einsum("ii->i", hessian[:-1, 1:])[:] += mixed
    np.einsum("ii->i", hessian[1:, :-1])[:] += mixed
    gradient += np.bincount(left, weight * near * at, k) + np.bincount(knots, weight * far * at, k)


def power_mean(squares: Array, power: float) -> tuple[float, Array]:
    """Mean of order `power` of the values, shape (s,), and its slopes over them."""
    top = float(squares.max())
    if top == 0:
        return 0.0, np.full(len(squares), 1 / len(squares))
    share = squares / top
    mean = float(np.mean(share**power)) ** (1 / power)
    return top * mean, share ** (power - 1) * mean ** (1 - power) / len(squares)


def evaluate(problem: TrackingProblem, force_N: Array) -> Evaluation:
    """Simulate every plant under a force, shape (n,) [N], and evaluate it."""
    tensions, travels, count, n = [], [], len(problem.plants), len(force_N)
    for run in problem.runs:
        response = run.respond(force_N)
        if response is None:
            bad, none = np.full(count, np.inf), np.full(n, np.inf)
            return Evaluation(merit=np.inf, squares=bad, slopes=bad, density=none, beyond_N=np.inf, tensions_N=())
        tensions.append(response[0])
        travels.append(response[1])
    errors = np.array([(t[:, -1] - p.wanted_N) ** 2 for t, p in zip(tensions, problem.plants, strict=True)])
    weights, squares = np.array([p.weight for p in problem.plants]), errors.mean(axis=1)
    mean, slopes = power_mean(weights * squares, problem.power)
    slopes *= weights
    judged = tensions[: problem.chains]  # stiffer bristles count for the error alone
    low, high = min(float(t[1:].min()) for t in judged), max(float(t[1:].max()) for t in judged)
    beyond = max(problem.low_N - low, high - problem.high_N, *_motion_beyond_N(problem, force_N, travels), 0.0)
    cost = problem.effort_weight * force_N**2 / n
    cost[1:] += problem.travel_weight * _smooth_travel(problem, force_N)[0]
    # A slack link carries no force however slack it is, so its depth says nothing: the cost of slack is its own.
    slack = problem.penalty_N * float(np.ptp(problem.reference_N)) if low <= 0 else 0.0
    return Evaluation(
        merit=mean + float(cost.sum()) + problem.penalty_N * beyond + slack,
        squares=squares,
        slopes=slopes,
        density=np.einsum("s,sn", slopes, errors) / n + cost,
        beyond_N=beyond,
        tensions_N=tuple(tensions),
        travels_m=tuple(travels),
    )


def _smooth_travel(problem: TrackingProblem, force_N: Array) -> tuple[Array, Array]:
    """Travel of each step, rounded off near 0, and the weight of its quadratic bound; shape (n - 1,) each."""
    steps = np.diff(force_N)
    size = np.hypot(steps, problem.least_travel_N)
    return size - problem.least_travel_N, 1 / size


def _motion_beyond_N(problem: TrackingProblem, force_N: Array, travels_m: list[Array]) -> Iterator[float]:
    """Largest excess of each plant's motion over each of its bounds, as a tension [N]."""
    for plant, travel in zip(problem.plants, travels_m, strict=True):
        for bound in plant.bounds:
            value = bound.sums(force_N, travel, problem.step_s)
            yield bound.newtons * max(bound.low - float(value.min()), float(value.max()) - bound.high)


def gauss_newton_model(
    problem: TrackingProblem, force_N: Array, evaluation: Evaluation, knots: Knots, reach_N: float
) -> GaussNewtonModel:
    """Gauss-Newton model of the merit, from exact sensitivities, around a force of shape (n,) and its evaluation.

    The change of the force has its corners in the rows `knots`, shape (k,); tensions that come within `reach_N` of a
    bound are watched.
    """
    n, k = len(force_N), len(knots)
    # A position depends on the whole history: cut off, its slopes would jump and show speeds that do not occur.
    moves = any(plant.bounds for plant in problem.plants)
    wiped = np.full(k, n) if moves else _wiped_rows(problem.reference_N, knots)
    hessian, gradient, hats = np.zeros((k, k)), np.zeros(k), Hats.of(knots)
    rows, lows, highs = [np.empty((0, k))], [np.empty(0)], [np.empty(0)]
    plants = zip(problem.plants, evaluation.tensions_N, evaluation.travels_m, evaluation.slopes, strict=True)
    for number, (plant, tension, travel, slope) in enumerate(plants):
        watched = _watched(tension, problem, reach_N if number < problem.chains else -np.inf)
        seen, place = np.unique(watched[:, 0], return_inverse=True)
        found = force_sensitivity(
            plant.chain,
            force_N,
            problem.step_s,
            knots,
            state=plant.state,
            watched_rows=seen,
            ends=bool(plant.bounds),
            wiped_rows=wiped,
        )
        error = tension[:, -1] - plant.wanted_N
        _add_squares(hessian, gradient, found.tension_slopes[:, -1, :], 2 * slope / n, error, knots, wiped)
        if watched.size:
            at, link = watched.T
            rows.append(found.watched_slopes[place, link, :])
            lows.append(problem.low_N - tension[at, link])
            highs.append(problem.high_N - tension[at, link])
        if found.ends_slopes is not None:
            slopes = found.ends_slopes[:, 0, :]
            for row, low, high in _motion_rows(plant.bounds, force_N, travel, slopes, knots, problem.step_s):
                rows.append(row)
                lows.append(low)
                highs.append(high)
    if problem.effort_weight > 0:
        weights = np.full(n, 2 * problem.effort_weight / n)
        add_pairs(hessian, gradient, hats.left, 1 - hats.share, hats.share, weights, force_N)
    if problem.travel_weight > 0:  # the quadratic function that touches the travel here and lies above it everywhere
        weights, slope_of = problem.travel_weight * _smooth_travel(problem, force_N)[1], 1 / hats.gap[hats.left[:-1]]
        add_pairs(hessian, gradient, hats.left[:-1], -slope_of, slope_of, weights, np.diff(force_N))
    return GaussNewtonModel(
        hessian=hessian,
        gradient=gradient,
        rows=np.vstack(rows),
        low=np.concatenate(lows),
        high=np.concatenate(highs),
    )


_REVERSALS = 2  # a change of the force is followed over so many later ones: they wipe it out
_ROWS_OF_INTERVAL = 4  # that enter the Hessian
_TILE_ROWS = 64  # of a block


def _wiped_rows(reference_N: Array, knots: Knots) -> Knots:
    """Where the influence of each knot ends."""
    turns = np.append(reversals(reference_N), np.full(_REVERSALS + 1, knots[-1] + 1))
    ends = np.append(knots[1:], knots[-1])
    wiped: Knots = turns[np.searchsorted(turns, ends, side="right") + _REVERSALS - 1]
    return wiped


def _add_squares(
    hessian: Array, gradient: Array, slopes: Array, weight: float, error: Array, knots: Knots, wiped: Knots
) -> None:
    """Add weight/2 * (error + slopes x)^2, row by row, as a function of x.

    It goes in blocks of the few knots that matter at a time. In the Hessian a few rows stand for all between two knots:
    the output moves smoothly there.
    """
    gap = np.diff(knots)
    stride = np.maximum(gap // _ROWS_OF_INTERVAL, 1)
    share = np.sqrt(weight * gap / -(-gap // stride))
    rows = np.arange(len(slopes))
    interval = np.maximum(np.searchsorted(knots, rows) - 1, 0)
    sampled = (knots[interval + 1] - rows) % stride[interval] == 0
    sampled[0] = False  # there the force is given
    for start in range(1, len(slopes), _TILE_ROWS):
        end = min(start + _TILE_ROWS, len(slopes))
        first = int(np.searchsorted(wiped, start, side="right"))
        alive = slice(min(first, interval[start]), interval[end - 1] + 2)
        part, taken = slopes[start:end, alive], sampled[start:end]
        gradient[alive] += weight * (error[start:end] @ part)
        few = part[taken] * share[interval[start:end][taken], None]
        hessian[alive, alive] += few.T @ few


_PIECE_ROWS = 10  # of so many successive rows, and all links, only the worst becomes a constraint


def _motion_rows(
    bounds: tuple[MotionBound, ...], force_N: Array, travel_m: Array, slopes: Array, knots: Knots, step_s: float
) -> Iterator[tuple[Array, Array, Array]]:
    """Rows, low and high of the bounds of the motion that come close, as tensions [N]."""
    apart = max(int(np.diff(knots).min()) // 2, 1)  # between two knots the speed may swing
    starts = range(1, len(travel_m), apart)
    for bound in bounds:
        value = bound.sums(force_N, travel_m, step_s)
        wide = 0.5 * (bound.high - bound.low)
        inside = INSIDE * (wide if np.isfinite(wide) else min(abs(bound.low), abs(bound.high)))
        low, high = bound.low + inside, bound.high - inside
        room = np.minimum(value - low, high - value)
        at = np.array([start + int(np.argmin(room[start : start + apart])) for start in starts], dtype=np.int64)
        at = at[room[at] < _NEAR * min(wide, max(float(np.ptp(value)), 1e-9))]
        if at.size:
            shape = Hats.of(knots).dense() if bound.per_force else np.zeros(1)
            slope = bound.sums(shape, slopes, step_s)[at]
            below, above = (np.clip((x - value[at]) * bound.newtons, -_FAR_N, _FAR_N) for x in (low, high))
            yield slope * bound.newtons, below, above


_FAR_N = 1e9
_NEAR = 0.5  # of a limit of the motion: what is this close to it is watched


def _watched(tension_N: Array, problem: TrackingProblem, reach_N: float) -> Knots:
    """Pairs (row, link) near a bound, the worst of each piece; shape (c, 2)."""
    room = np.minimum(tension_N - problem.low_N, problem.high_N - tension_N)
    pairs: list[tuple[int, int]] = []
    for start in range(1, len(room), _PIECE_ROWS):
        piece = room[start : start + _PIECE_ROWS]
        row, link = divmod(int(piece.argmin()), piece.shape[1])
        if piece[row, link] < reach_N:
            pairs.append((start + row, link))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)
