"""From coarse to fine: where the knots of a force profile go (grid refinement), and where the search starts.

First grids that are coarse in time: they see over a dead zone, and cost little. Then all rows, with more knots where
the profile meets or leaves a limit. Where limits bind, the profile is straightened between knots before each search,
so that a ramp may begin and end at a knot; elsewhere it keeps its fine structure.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Evaluation, GaussNewtonModel, Hats, Knots, add_pairs, evaluate
from tendonff.ocp.tracking.problem import TrackingProblem, every
from tendonff.ocp.tracking.search.knots import even_knots, limited_rows, local_knots, straightened
from tendonff.ocp.tracking.search.moves import Moves, Profile
from tendonff.ocp.tracking.search.qp import solve_qp, step_bounds
from tendonff.ocp.tracking.search.sqp import Blocks, SqpResult, SqpSettings, SqpStatus, solve_sqp


@dataclass(frozen=True, slots=True, kw_only=True)
class GridRefinement:
    """What the search on all grids made of a profile."""

    force_N: Array  # shape (n,)
    evaluation: Evaluation
    searches: tuple[SqpResult, ...]  # of all grids, each of the start that won there
    improved: bool  # better than the clipped inverse
    converged: bool  # the last searches were not cut short by the iteration limit

    @property
    def iterations(self) -> int:
        """Quadratic programs of the search that won."""
        return sum(s.iterations for s in self.searches)

    @property
    def gain(self) -> float:
        """Relative decrease of the merit that the last iteration brought [-]."""
        return self.searches[-1].gain


def nearest_profile(problem: TrackingProblem, wanted_N: Array, knots: Knots) -> Array:
    """The profile within the limits that comes closest to a wanted force: ramps lie astride its jumps."""
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


def _taut_start(problem: TrackingProblem, clipped_N: Array) -> Profile:
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


def _as_far_as_taut(problem: TrackingProblem, best: Profile, force_N: Array) -> Profile:
    """The profile, or as much of its difference from the best one as breaks no bound that the best one keeps."""
    for share in (1.0, 0.7, 0.4, 0.1):
        mixed = best[1] + share * (force_N - best[1])
        evaluation = evaluate(problem, mixed)
        if np.isfinite(evaluation.merit) and evaluation.beyond_N <= best[0].beyond_N:
            return evaluation, mixed
    return best


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stage:
    """One grid."""

    rows: int  # rows of time to a coarse spacing of knots; 0 for all there are
    base: int  # knots everywhere: so many to a coarse spacing
    edge: int  # knots near the edges of limits: so many to a coarse spacing; 0 for none more
    iterations: int | None  # at most so many; None: all that are left


_SCOUT = _Stage(rows=4, base=1, edge=0, iterations=6)
_STAGES = (
    _Stage(rows=8, base=2, edge=0, iterations=12),
    _Stage(rows=0, base=2, edge=4, iterations=12),
    _Stage(rows=0, base=2, edge=8, iterations=None),
)
_CLOSE = _Stage(rows=0, base=4, edge=16, iterations=None)


def refine(
    problem: TrackingProblem,
    starts_N: tuple[Array, ...],
    settings: SqpSettings,
    spacing: int,
    tell: Callable[[], None] | None = None,
) -> GridRefinement:
    """Search from coarse to fine: on the first grid from every start, on the others from the best of them.

    The first grids are coarse in time too, which costs little and hardly moves the optimum; what counts is decided on
    all rows. The starts are forces of shape (n,) [N], whatever the limits. The first is the exact inverse: as the
    actuator would give it, it is what to beat, and its fine structure is kept where the search follows it. `spacing` is
    the number of rows between coarse knots; `tell` is called after each iteration.
    """
    inverse = starts_N[0]
    search = _Search(problem=problem, settings=settings, spacing=spacing, tell=tell)
    first = best = _taut_start(problem, problem.clipped(inverse))
    near = even_knots(len(inverse), max(spacing // 4, 1))
    starts = [*(nearest_profile(problem, start, near) for start in starts_N), early_profile(problem, inverse)]
    lines = search.scouted(starts, best)
    if problem.goal.power > 1:  # the mean is smoother than the worst: what is best for it is a start as well
        mean = replace(problem, goal=replace(problem.goal, power=1.0))
        if settings.restarts:
            smooth = refine(mean, starts_N, settings, spacing, tell).force_N
            best = min(best, (evaluate(problem, smooth), smooth), key=lambda profile: profile[0].merit)
        else:
            smooth = replace(search, problem=mean).scouted(starts, best)[0]
        lines = search.scouted([lines[0], smooth], best)
    ends = [search.line(line, best, inverse) for line in (lines if settings.restarts else lines[:1])]
    searches = min(ends, key=lambda end: end[0][0].merit)[1]
    best = reduce(lambda one, other: best_of_both(problem, one, other), (end[0] for end in ends), best)
    ended = searches[-1].status is not SqpStatus.ITERATIONS
    if settings.restarts and np.isfinite(best[0].merit):
        best, won, ended = _walked(search, best, [end[0] for end in ends], inverse)
        searches += won
    best = _joined(problem, best, inverse)
    force = problem.clipped(best[1])  # what rounding of the quadratic programs left
    return GridRefinement(
        force_N=force,
        evaluation=best[0],
        searches=tuple(searches),
        improved=best is not first,
        converged=ended,
    )


def _walked(
    search: "_Search", best: Profile, ends: list[Profile], inverse_N: Array
) -> tuple[Profile, list[SqpResult], bool]:
    """Moves from the end of each line of searches and from the best of all, then searches on the closest knots.

    Returns the best profile, the searches that led to it, and whether the last were not cut short.
    """
    problem, spacing, restarts = search.problem, search.spacing, search.settings.restarts
    moves = Moves(
        problem=problem,
        settings=search.settings,
        prepare=lambda part, force: _knots_and_start(part, force, _STAGES[-1], spacing),
        spacing=spacing,
        tell=search.tell,
    )
    won: list[SqpResult] = []
    for seed, end in enumerate([*ends, None]):
        start, vain, most = (best, restarts, search.left) if end is None else (end, -(-restarts // 2), search.left // 2)
        walk = moves.improve(_joined(problem, start, inverse_N), vain, most, seed)
        search.spent += walk.iterations
        won = list(walk.won) if walk.best[0].merit < best[0].merit else won
        best = best_of_both(problem, best, walk.best)
    best, closer, ended = moves.polish(best, lambda part, force: _knots_and_start(part, force, _CLOSE, spacing)[0])
    return best, [*won, *closer], ended


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

    def on(self, stage: _Stage, force_N: Array, best: Profile) -> SqpResult:
        """The search on a stage from a profile on all rows."""
        factor = self.factor(stage)
        grid = self.problem.coarsened(factor)
        knots, start = _knots_and_start(grid, every(force_N, factor), stage, max(self.spacing // factor, 1))
        evaluation = evaluate(grid, start)
        if factor == 1:
            evaluation, start = _as_far_as_taut(self.problem, best, start)
        rules = replace(self.settings, iterations=max(min(self.left, stage.iterations or self.left), 1))
        found = solve_sqp(grid, start, evaluation, knots, rules, self.tell)
        self.spent += found.iterations
        return found

    def scouted(self, starts: list[Array], best: Profile) -> list[Array]:
        """What is best of short searches from all starts between each two reversals, and the best start as it is."""
        problem = self.problem
        stage = _SCOUT if len(problem.plants) == 1 else _STAGES[0]
        factor = self.factor(stage)
        tried = [self.on(stage, start, best) for start in starts]
        grid = problem.coarsened(factor)
        found = reduce(lambda one, other: _best_of_blocks(grid, one, other), tried)
        mixed = np.interp(np.arange(len(starts[0])), np.arange(len(found.force_N)) * factor, found.force_N)
        return [mixed, min(starts, key=lambda start: evaluate(problem, start).merit)]

    def line(self, force_N: Array, best: Profile, inverse_N: Array) -> tuple[Profile, list[SqpResult]]:
        """The searches on all stages, one from where the other ended."""
        searches: list[SqpResult] = []
        for stage in _STAGES:
            searches.append(self.on(stage, force_N, best))
            force_N = _on_rows(searches[-1].force_N, self.factor(stage), inverse_N, self.problem)
            if self.factor(stage) == 1 and searches[-1].evaluation.merit < best[0].merit:
                best = (searches[-1].evaluation, force_N)
        if searches[-1].evaluation.merit > best[0].merit and self.problem.goal.power > 1:
            searches.append(self.on(_STAGES[-1], best[1], best))
            best = min(best, (searches[-1].evaluation, searches[-1].force_N), key=lambda profile: profile[0].merit)
        return best, searches


_NEAR = (0.003, 0.01, 0.03)  # of the range of the inverse: as good as on it


def _joined(problem: TrackingProblem, best: Profile, inverse_N: Array) -> Profile:
    """The profile on the exact inverse in the blocks where it comes close to that, if that is better."""
    for share in _NEAR:
        force = best[1]
        on = np.abs(force - inverse_N) < share * float(np.ptp(problem.clipped(inverse_N)))
        joined = problem.clipped(np.where(on, inverse_N, force))
        evaluation = evaluate(problem, joined)
        if np.isfinite(evaluation.merit) and np.isfinite(best[0].merit):
            best = best_of_both(problem, best, (evaluation, joined))
    return best


def _best_of_blocks(problem: TrackingProblem, one: SqpResult, other: SqpResult) -> SqpResult:
    """As `best_of_both`, of searches."""
    if not (len(one.evaluation.density) and len(other.evaluation.density)):
        return min(one, other, key=lambda result: result.evaluation.merit)
    evaluation, force = best_of_both(problem, (one.evaluation, one.force_N), (other.evaluation, other.force_N))
    return replace(one, evaluation=evaluation, force_N=force)


def best_of_both(problem: TrackingProblem, one: Profile, other: Profile) -> Profile:
    """The best of two profiles and of what takes the better of them between each two reversals."""
    blocks = Blocks.between_reversals(problem, np.arange(len(one[1])))
    better = blocks.sums(other[0].density) < blocks.sums(one[0].density)
    force = problem.clipped(np.where(better[blocks.of_knot], other[1], one[1]))
    return min(one, other, (evaluate(problem, force), force), key=lambda profile: profile[0].merit)


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
