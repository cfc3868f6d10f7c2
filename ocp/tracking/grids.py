"""From coarse to fine: where the knots of a force profile go (grid refinement), and where the search starts.

Coarse knots first: they see over a dead zone, and cost little. Then twice as many, then more where the profile meets
or leaves a limit. Where limits bind, the profile is straightened between knots before each search, so that a ramp may
begin and end at a knot; elsewhere it keeps its fine structure.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Evaluation, GaussNewtonModel, Knots, evaluate
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.sqp import SqpResult, SqpSettings, SqpStatus, knot_shape, solve_qp, solve_sqp, step_bounds

KNOTS_PER_SWING = 12
"""Coarse knots between two reversals of the reference."""

_AT_LIMIT = 1e-3  # a row counts as limited within this share of the limit
_NEIGHBOURS = 2  # intervals on either side of a limit's end that are refined too


@dataclass(frozen=True, slots=True, kw_only=True)
class GridRefinement:
    """What the search on all grids made of a profile.

    Parameters
    ----------
    force_N : ndarray, shape (n,)
    evaluation : Evaluation
    searches : tuple of SqpResult
        One per grid.
    knots : int
        On the last grid.
    """

    force_N: Array
    evaluation: Evaluation
    searches: tuple[SqpResult, ...]
    knots: int

    @property
    def iterations(self) -> int:
        """Quadratic programs in all."""
        return sum(s.iterations for s in self.searches)

    @property
    def converged(self) -> bool:
        """The last search was not cut short by the iteration limit."""
        return self.searches[-1].status is not SqpStatus.ITERATIONS

    @property
    def promise(self) -> float:
        """Relative decrease of the merit that the last quadratic program promised [-]."""
        return self.searches[-1].promise


def even_knots(rows: int, spacing: int) -> Knots:
    """Knots every `spacing` rows, and at the last row.

    Parameters
    ----------
    rows, spacing : int
    """
    return np.unique(np.append(np.arange(0, rows - 1, spacing), rows - 1))


def coarse_spacing(reference_N: Array) -> int:
    """Knots between coarse knots: a share of the time between two reversals of the reference.

    Parameters
    ----------
    reference_N : ndarray, shape (n,)
    """
    n = len(reference_N)
    change = np.diff(reference_N)
    moving = np.abs(change) > 1e-9 * max(float(np.ptp(reference_N)), 1e-300)
    signs = np.sign(change[moving])
    turns = int(np.count_nonzero(np.diff(signs)))
    return int(np.clip(n / (KNOTS_PER_SWING * (turns + 1)), 1, max(n // 60, 1)))


def limited_rows(force_N: Array, step_s: float, limits: ForceLimits) -> np.typing.NDArray[np.bool_]:
    """Whether the step into each row 1 .. n - 1 is at a limit, shape (n - 1,).

    Parameters
    ----------
    force_N : ndarray, shape (n,)
    step_s : float
    limits : ForceLimits
    """
    rate, force = np.abs(np.diff(force_N)) / step_s, force_N[1:]
    margin = _AT_LIMIT * min(limits.maximum_N - limits.minimum_N, float(np.ptp(force_N)) + 1e-12)
    return np.asarray(
        (rate > (1 - _AT_LIMIT) * limits.rate_N_per_s)
        | (force > limits.maximum_N - margin)
        | (force < limits.minimum_N + margin)
    )


def refined_knots(knots: Knots, limited: np.typing.NDArray[np.bool_]) -> Knots:
    """Halve the intervals around the rows where a limit begins or ceases to bind.

    Parameters
    ----------
    knots : ndarray of int, shape (k,)
    limited : ndarray of bool, shape (n - 1,)
    """
    edges = np.flatnonzero(limited[1:] != limited[:-1]) + 1
    interval = np.clip(np.searchsorted(knots, edges, side="right") - 1, 0, len(knots) - 2)
    near = np.unique(np.add.outer(interval, np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1)))
    near = near[(near >= 0) & (near < len(knots) - 1)]
    middles = (knots[near] + knots[near + 1]) // 2
    return np.unique(np.concatenate([knots, middles]))


def straightened(force_N: Array, knots: Knots, limited: np.typing.NDArray[np.bool_]) -> Array:
    """The profile made linear between knots in and next to the intervals where a limit binds.

    Parameters
    ----------
    force_N : ndarray, shape (n,)
    knots : ndarray of int, shape (k,)
    limited : ndarray of bool, shape (n - 1,)
    """
    hit = np.logical_or.reduceat(limited, knots[:-1])
    near = hit.copy()
    near[1:] |= hit[:-1]
    near[:-1] |= hit[1:]
    rows = np.arange(len(force_N))
    inside = np.append(False, np.repeat(near, np.diff(knots)))
    return np.where(inside, np.interp(rows, knots, force_N[knots]), force_N)


def nearest_profile(problem: TrackingProblem, wanted_N: Array, knots: Knots) -> Array:
    """The profile within the limits that comes closest to a wanted force: ramps lie astride its jumps.

    Parameters
    ----------
    problem : TrackingProblem
    wanted_N : ndarray, shape (n,)
    knots : ndarray of int, shape (k,)
    """
    clipped, limits, shape = problem.clipped(wanted_N), problem.limits, knot_shape(knots)
    model = GaussNewtonModel(
        hessian=shape.T @ shape,
        gradient=shape.T @ (clipped - wanted_N),
        rows=np.empty((0, len(knots))),
        low=np.empty(0),
        high=np.empty(0),
    )
    room = step_bounds(problem, clipped, knots, shape)
    move = solve_qp(model, room, 2 * (limits.maximum_N - limits.minimum_N), problem.goal.penalty_N)
    return clipped if move is None else problem.clipped(clipped + shape @ move)


def _taut_start(problem: TrackingProblem, clipped_N: Array) -> tuple[Evaluation, Array]:
    """The clipped profile, or the largest share of its changes that breaks no tension bound."""
    first = (evaluate(problem, clipped_N), clipped_N)
    if first[0].beyond_N == 0:
        return first
    for share in (0.95, 0.8, 0.6, 0.4, 0.2, 0.0):
        mixed = clipped_N[0] + share * (clipped_N - clipped_N[0])
        evaluation = evaluate(problem, mixed)
        if evaluation.beyond_N == 0:
            return evaluation, mixed
    return first


def _as_far_as_taut(
    problem: TrackingProblem, best: tuple[Evaluation, Array], force_N: Array
) -> tuple[Evaluation, Array]:
    """The profile, or as much of its difference from the best one as breaks no bound that the best one keeps."""
    for share in (1.0, 0.7, 0.4, 0.1):
        mixed = best[1] + share * (force_N - best[1])
        evaluation = evaluate(problem, mixed)
        if np.isfinite(evaluation.merit) and evaluation.beyond_N <= best[0].beyond_N:
            return evaluation, mixed
    return best


def refine(
    problem: TrackingProblem,
    wanted_N: Array,
    settings: SqpSettings,
    spacing: int,
    tell: Callable[[], None] | None = None,
) -> GridRefinement:
    """Search on three grids, from the profile closest to the wanted force.

    Parameters
    ----------
    problem : TrackingProblem
    wanted_N : ndarray, shape (n,)
        Exact inverse; as the actuator would give it, it is what to beat.
    settings : SqpSettings
        The iteration limit is for all grids together.
    spacing : int
        Rows between coarse knots.
    tell : callable, optional
        Called after each iteration.

    Returns
    -------
    GridRefinement
        Never worse than the clipped force.
    """
    n, h, limits = len(wanted_N), problem.step_s, problem.limits
    best = _taut_start(problem, problem.clipped(wanted_N))
    start = nearest_profile(problem, wanted_N, even_knots(n, max(spacing // 4, 1)))
    searches: list[SqpResult] = []
    left = settings.iterations
    knots = even_knots(n, spacing)
    for stage in range(3):
        if stage == 1:
            knots = even_knots(n, max(spacing // 2, 1))
        elif stage == 2:
            knots = refined_knots(knots, limited_rows(best[1], h, limits))
        force = start if stage == 0 else best[1]
        force = straightened(force, knots, limited_rows(force, h, limits))
        evaluation, force = _as_far_as_taut(problem, best, force)
        rules = replace(settings, iterations=max(left // (3 - stage), 1))
        found = solve_sqp(problem, force, evaluation, knots, rules, tell)
        left -= found.iterations
        searches.append(found)
        if found.evaluation.merit < best[0].merit:
            best = (found.evaluation, found.force_N)
    force = problem.clipped(best[1])  # what rounding of the quadratic programs left
    return GridRefinement(force_N=force, evaluation=best[0], searches=tuple(searches), knots=len(knots))
