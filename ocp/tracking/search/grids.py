"""From coarse to fine: where the knots of a force profile go (grid refinement), and where the search starts.

First a grid that is coarse in time: it sees over a dead zone, and costs little. Then all rows, with more knots where
the profile meets or leaves a limit. Where limits bind, the profile is straightened between knots before each search,
so that a ramp may begin and end at a knot; elsewhere it keeps its fine structure.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Evaluation, GaussNewtonModel, Hats, Knots, add_pairs, evaluate
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackingProblem, every
from tendonff.ocp.tracking.search.qp import solve_qp, step_bounds
from tendonff.ocp.tracking.search.sqp import Blocks, SqpResult, SqpSettings, SqpStatus, solve_sqp

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
        Of all grids, each of the start that won there.
    improved : bool
        Better than the clipped inverse.
    converged : bool
        Neither the last search nor those from moved profiles were cut short by the iteration limit.
    """

    force_N: Array
    evaluation: Evaluation
    searches: tuple[SqpResult, ...]
    improved: bool
    converged: bool

    @property
    def iterations(self) -> int:
        """Quadratic programs of the search that won."""
        return sum(s.iterations for s in self.searches)

    @property
    def gain(self) -> float:
        """Relative decrease of the merit that the last iteration brought [-]."""
        return self.searches[-1].gain


def even_knots(rows: int, spacing: int) -> Knots:
    """Knots every `spacing` rows, and at the last row."""
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


def local_knots(limited: np.typing.NDArray[np.bool_], base: Knots, reach: int, spacing: int) -> Knots:
    """Knots closer together where a limit begins or ceases to bind, and at those edges.

    Parameters
    ----------
    limited : ndarray of bool, shape (n - 1,)
    base : ndarray of int, shape (k,)
        Knots everywhere.
    reach, spacing : int
        Rows on either side of such an edge, and between the knots there.
    """
    n = int(base[-1]) + 1
    edges = np.flatnonzero(limited[1:] != limited[:-1]) + 1
    near = np.zeros(n, dtype=bool)
    for edge in edges.tolist():
        near[max(edge - reach, 0) : edge + reach + 1] = True
    rows = np.flatnonzero(near)
    wanted = np.zeros(n, dtype=bool)
    wanted[base] = wanted[edges] = True
    wanted[rows[rows % spacing == 0]] = True
    kept, last = [0], 0
    firm = np.zeros(n, dtype=bool)
    firm[edges] = True
    for row in np.flatnonzero(wanted)[1:-1].tolist():
        if row - last >= max(spacing // 2, 1):
            kept.append(row)
        elif firm[row] and last and not firm[last]:
            kept[-1] = row
        else:
            continue
        last = row
    return np.array([*kept, n - 1])


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
    clipped, limits, k, hats = problem.clipped(wanted_N), problem.limits, len(knots), Hats.of(knots)
    hessian, gradient, weights = np.zeros((k, k)), np.zeros(k), np.ones(len(wanted_N))
    add_pairs(hessian, gradient, hats.left, 1 - hats.share, hats.share, weights, clipped - wanted_N)
    model = GaussNewtonModel(
        hessian=hessian, gradient=gradient, rows=np.empty((0, k)), low=np.empty(0), high=np.empty(0)
    )
    room = step_bounds(problem, clipped, knots)
    move = solve_qp(model, room, 2 * (limits.maximum_N - limits.minimum_N), problem.goal.penalty_N)
    return clipped if move is None else problem.clipped(clipped + np.interp(np.arange(len(clipped)), knots, move))


def early_profile(problem: TrackingProblem, wanted_N: Array) -> Array:
    """The profile within the limits whose ramps end where a wanted force jumps."""
    back = problem.limits.apply(wanted_N[::-1], problem.step_s, float(wanted_N[-1]))
    return problem.clipped(back[::-1])


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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stage:
    """One grid.

    Parameters
    ----------
    rows : int
        Rows of time to a coarse spacing of knots; 0 for all there are.
    base : int
        Knots everywhere: so many to a coarse spacing.
    edge : int
        Knots near the edges of limits: so many to a coarse spacing; 0 for none more.
    iterations : int
        At most so many.
    """

    rows: int
    base: int
    edge: int
    iterations: int


_COARSE = _Stage(rows=8, base=2, edge=0, iterations=12)
_FINE = (
    _Stage(rows=0, base=2, edge=4, iterations=12),
    _Stage(rows=0, base=2, edge=8, iterations=20),
)


def refine(
    problem: TrackingProblem,
    starts_N: tuple[Array, ...],
    settings: SqpSettings,
    spacing: int,
    tell: Callable[[], None] | None = None,
) -> GridRefinement:
    """Search from coarse to fine: on the first grid from every start, on the others from the best of them.

    The first grids are coarse in time too, which costs little and hardly moves the optimum; what counts is decided on
    all rows.

    Parameters
    ----------
    problem : TrackingProblem
    starts_N : tuple of ndarray, shape (n,)
        Forces to start from, whatever the limits. The first is the exact inverse: as the actuator would give it, it is
        what to beat, and its fine structure is kept where the search follows it.
    settings : SqpSettings
    spacing : int
        Rows between coarse knots.
    tell : callable, optional
        Called after each iteration.

    Returns
    -------
    GridRefinement
        Never worse than the clipped inverse.
    """
    inverse = starts_N[0]
    search = _Search(problem=problem, settings=settings, spacing=spacing, tell=tell)
    first = best = _taut_start(problem, problem.clipped(inverse))
    near = even_knots(len(inverse), max(spacing // 4, 1))
    starts, alone = [nearest_profile(problem, start, near) for start in starts_N], len(problem.plants) == 1
    if alone:
        starts.append(early_profile(problem, inverse))
    tried = [search.on(_COARSE, start, best) for start in starts]
    if problem.goal.power > 1:  # the mean is smoother than the worst: what is best for it is a start as well
        mean = replace(search, problem=replace(problem, goal=replace(problem.goal, power=1.0)))
        smooth = min((mean.on(_COARSE, start, best) for start in starts), key=lambda result: result.evaluation.merit)
        smooth_N = _on_rows(smooth.force_N, search.factor(_COARSE), inverse, problem)
        tried.append(search.on(_COARSE, smooth_N, best))
    coarse, searches = problem.coarsened(search.factor(_COARSE)), list[SqpResult]()
    # What is best of all starts on the coarse grid may end in a poorer optimum than the best of the first two.
    lines = [tried, tried[:2]] if alone and settings.restarts and len(tried) > 2 else [tried]
    for line in lines:
        found = reduce(lambda one, other: _best_of_blocks(coarse, one, other), line)
        found = replace(found, force_N=_on_rows(found.force_N, search.factor(_COARSE), inverse, problem))
        before, of_line = best[0].merit, [found]
        for stage in _FINE:
            found = search.on(stage, found.force_N, best)
            of_line.append(found)
            mixed = _best_of_blocks(problem, found, replace(found, evaluation=best[0], force_N=best[1]))
            if mixed.evaluation.merit < best[0].merit:
                best = (mixed.evaluation, mixed.force_N)
        if best[0].merit < before or not searches:
            searches = of_line
    ended = found.status is not SqpStatus.ITERATIONS
    rng, vain = np.random.default_rng(0), 0
    while vain < settings.restarts and search.left >= 1:
        moved, held = _moved(problem, best, spacing, rng)
        again = search.on(_FINE[-1], moved, best, _AGAIN, held)
        again = _best_of_blocks(problem, again, replace(again, evaluation=best[0], force_N=best[1]))
        vain = 0 if again.evaluation.merit < (1 - _GAINED) * best[0].merit else vain + 1
        if again.evaluation.merit < best[0].merit:
            best = (again.evaluation, again.force_N)
            searches.append(again)
    force = problem.clipped(best[1])  # what rounding of the quadratic programs left
    return GridRefinement(
        force_N=force,
        evaluation=best[0],
        searches=tuple(searches),
        improved=best is not first,
        converged=vain == settings.restarts if settings.restarts else ended,
    )


_AGAIN = 8  # iterations of a search from a shifted profile
_GAINED = 0.005  # of the merit: a search that brings less was in vain
_SPREADS = (0.3, 1.0, 2.0)  # of the coarse spacing: how far profiles are moved in time, one of these at a time
_MOVED = 0.6  # of the blocks at a time


@dataclass(slots=True, kw_only=True)
class _Search:
    """Searches on the stages' grids within one limit of iterations."""

    problem: TrackingProblem
    settings: SqpSettings
    spacing: int
    tell: Callable[[], None] | None
    spent: int = 0

    @property
    def left(self) -> int:
        return self.settings.iterations - self.spent

    def factor(self, stage: _Stage) -> int:
        """Rows of time in one of the stage's."""
        return max(self.spacing // stage.rows, 1) if stage.rows else 1

    def on(
        self,
        stage: _Stage,
        force_N: Array,
        best: tuple[Evaluation, Array],
        most: int | None = None,
        held: np.typing.NDArray[np.bool_] | None = None,
    ) -> SqpResult:
        """The search on a stage from a profile on all rows."""
        factor = self.factor(stage)
        grid = self.problem.coarsened(factor)
        knots, start = _knots_and_start(grid, every(force_N, factor), stage, max(self.spacing // factor, 1))
        evaluation = evaluate(grid, start)
        if factor == 1:
            evaluation, start = _as_far_as_taut(self.problem, best, start)
        rules = replace(self.settings, iterations=max(min(self.left, most or stage.iterations), 1))
        found = solve_sqp(grid, start, evaluation, knots, rules, self.tell, held)
        self.spent += found.iterations
        return found


_WORTH = 0.01  # of the merit: a block that has less is not searched again


def _moved(
    problem: TrackingProblem, best: tuple[Evaluation, Array], spacing: int, rng: np.random.Generator
) -> tuple[Array, np.typing.NDArray[np.bool_]]:
    """The profile moved in time in some blocks where an error is left, and the blocks that are not moved."""
    evaluation, force = best
    rows = np.arange(len(force))
    blocks = Blocks.between_reversals(problem, rows)
    open_ = blocks.sums(evaluation.density) > _WORTH * evaluation.merit
    chosen = open_ & (rng.random(blocks.count) < _MOVED)
    chosen = chosen if chosen.any() else open_
    shift = np.round(rng.normal(0, rng.choice(_SPREADS) * spacing, blocks.count)).astype(int) * chosen
    return problem.clipped(force[np.clip(rows + shift[blocks.of_knot], 0, len(force) - 1)]), ~chosen


def _best_of_blocks(problem: TrackingProblem, one: SqpResult, other: SqpResult) -> SqpResult:
    """The best of two profiles and of what takes the better of them between each two reversals."""
    if not (len(one.evaluation.density) and len(other.evaluation.density)):
        return min(one, other, key=lambda result: result.evaluation.merit)
    blocks = Blocks.between_reversals(problem, np.arange(len(one.force_N)))
    better = blocks.sums(other.evaluation.density) < blocks.sums(one.evaluation.density)
    force = problem.clipped(np.where(better[blocks.of_knot], other.force_N, one.force_N))
    mixed = replace(one, force_N=force, evaluation=evaluate(problem, force))
    return min(one, other, mixed, key=lambda result: result.evaluation.merit)


def _knots_and_start(grid: TrackingProblem, force_N: Array, stage: _Stage, spacing: int) -> tuple[Knots, Array]:
    """Knots of a stage, and the profile straightened between them where limits bind."""
    limited = limited_rows(force_N, grid.step_s, grid.limits)
    knots = even_knots(len(force_N), max(spacing // stage.base, 1))
    if stage.edge:
        knots = local_knots(limited, knots, spacing, max(spacing // stage.edge, 1))
    return knots, straightened(force_N, knots, limited)


def _on_rows(coarse_N: Array, factor: int, inverse_N: Array, problem: TrackingProblem) -> Array:
    """A profile of a coarse grid on all rows, with the fine structure of the inverse where it follows that."""
    if factor == 1:
        return coarse_N
    rows, at = np.arange(len(inverse_N)), np.arange(len(coarse_N)) * factor
    detail = inverse_N - np.interp(rows, at, every(inverse_N, factor))
    fine = np.abs(detail) < 1e-3 * float(np.ptp(problem.goal.reference_N))
    return problem.clipped(np.interp(rows, at, coarse_N) + np.where(fine, detail, 0.0))
