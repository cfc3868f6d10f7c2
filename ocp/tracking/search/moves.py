"""Out of a local optimum: the profile between two reversals is moved and searched again, on the rows it acts on."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tendonff.ocp.simulate import simulate
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Evaluation, Knots, evaluate
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.search.sqp import Blocks, SqpResult, SqpSettings, SqpStatus, solve_sqp

Profile = tuple[Evaluation, Array]

_WORTH = 0.03  # of the merit: a block that has less is not searched again
_GAINED = 0.005  # of the merit: a search that brings less was in vain
_SPREADS = (0.3, 1.0, 2.0)  # of the coarse spacing: how far a profile is moved, one of these at a time
_DRAWS = 8  # moves to choose from: what is far worse once simulated hardly ever becomes the best
_FOLLOWING = 1  # blocks that a change of the force still acts on
_ITERATIONS = 8  # of a search
_POLISH = 30  # iterations of a search on closer knots
_SWEEPS = 4  # over all blocks
_TRIALS = 80  # small changes in a row, without slopes
_VAIN = 2  # turns that may bring next to nothing before one has brought more; then as many as the settings say
_WIDER, _NARROWER = 1.5, 0.9  # a change that pays makes the next ones larger: in balance where one in five does


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A block by itself, with those after it that its force still acts on."""

    rows: slice
    own: np.typing.NDArray[np.bool_]  # shape (rows,); which of them are the block's
    problem: TrackingProblem  # the problem on these rows

    @classmethod
    def of(cls, problem: TrackingProblem, force_N: Array, starts: Knots, index: int) -> "Stretch":
        """The block of that number, entered as a profile over the whole horizon enters it."""
        bounds = np.append(starts, len(force_N))
        start, end = int(bounds[index]), int(bounds[min(index + 1 + _FOLLOWING, len(starts))])
        states, static = tuple(p.state for p in problem.plants), tuple(p.static.start_N for p in problem.plants)
        if start:
            before = force_N[: start + 1]
            runs = [simulate(p.chain, before, problem.step_s, state=p.state) for p in problem.plants]
            states = tuple(run.final for run in runs)
            static = tuple(float(p.static.output_N(before)[-1]) for p in problem.plants)
        part = problem.piece(slice(start, end), states, static, float(force_N[start]))
        return cls(rows=slice(start, end), own=np.arange(start, end) < bounds[index + 1], problem=part)


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """Where a walk of moves came to."""

    best: Profile
    won: tuple[SqpResult, ...]  # the searches that improved the profile
    iterations: int  # of all searches


@dataclass(slots=True, kw_only=True)
class Sizes:
    """How large the small changes of a block are at present."""

    # force_N, rows: standard deviations of a change of the force and of one in time
    force_N: float
    rows: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Moves:
    """Searches from moved profiles, always of the block with the largest error that is still worth it.

    Where the tendon slips smoothly, quadratic programs find the way from a moved profile. Where it sticks and slips,
    slopes tell little, and small changes that are simulated and kept if they pay lead further; so both take turns.
    """

    problem: TrackingProblem
    settings: SqpSettings
    spacing: int  # rows between coarse knots
    # knots for a profile on a part of the problem, and the profile made ready for them
    prepare: Callable[[TrackingProblem, Array], tuple[Knots, Array]]
    tell: Callable[[], None] | None  # called after each iteration

    def improve(self, best: Profile, restarts: int, most: int, seed: int) -> Walk:
        """Search until no block is worth it, or for `most` iterations.

        `restarts` turns in a row may bring next to nothing before a block is left as it is.
        """
        rng, won, spent = np.random.default_rng(seed), list[SqpResult](), 0
        blocks = Blocks.between_reversals(self.problem, np.arange(len(best[1])))
        vain, allowed = np.zeros((2, blocks.count), dtype=int), np.full((2, blocks.count), restarts)
        allowed[1] = min(_VAIN, restarts)
        sizes = [Sizes(force_N=0.02 * float(np.ptp(best[1])), rows=0.5 * self.spacing) for _ in range(blocks.count)]
        turn = 0
        while spent + _ITERATIONS <= most:
            share = blocks.sums(best[0].density) / best[0].merit
            worth = (share > _WORTH) & (vain < allowed)
            if not worth.any():
                break
            index = int(np.where(worth.any(axis=0), share, 0.0).argmax())
            turn = 1 - turn if worth[1 - turn, index] else turn
            stretch = Stretch.of(self.problem, best[1], blocks.starts, index)
            if turn:
                found, moved_N = None, self._changed(stretch, best[1], sizes[index], rng)
            else:
                found = self._again(stretch, best[1], rng)
                moved_N, spent = found.force_N, spent + found.iterations
            before, best = best, self._placed(best, stretch, moved_N)
            if best is not before and found:
                won.append(found)
            gained = best[0].merit < (1 - _GAINED) * before[0].merit
            vain[turn, index] = 0 if gained else vain[turn, index] + 1
            if gained:
                allowed[turn, index] = restarts
        return Walk(best=best, won=tuple(won), iterations=spent)

    def _placed(self, best: Profile, stretch: Stretch, force_N: Array) -> Profile:
        """The profile with a stretch of it replaced, if that is better as a whole."""
        force = best[1].copy()
        force[stretch.rows] = force_N
        force = self.problem.clipped(force)
        evaluation = evaluate(self.problem, force)
        better = evaluation.merit < best[0].merit and evaluation.beyond_N <= best[0].beyond_N
        return (evaluation, force) if better else best

    def polish(
        self, best: Profile, knots_of: Callable[[TrackingProblem, Array], Knots]
    ) -> tuple[Profile, list[SqpResult], bool]:
        """Search each block that is worth it on closer knots, the largest error first, and all again while that pays.

        Returns the best profile, the searches that improved it, and whether none of the last was cut short. `knots_of`
        gives the knots for a profile on a part of the problem.
        """
        blocks, won, ended = Blocks.between_reversals(self.problem, np.arange(len(best[1]))), list[SqpResult](), True
        rules = replace(self.settings, iterations=_POLISH)
        for _ in range(_SWEEPS):
            first, ended = best, True
            share = blocks.sums(best[0].density) / best[0].merit
            for index in [int(i) for i in np.argsort(-share) if share[i] > _WORTH]:
                stretch = Stretch.of(self.problem, best[1], blocks.starts, index)
                part, old = stretch.problem, best[1][stretch.rows]
                knots, at_old = knots_of(part, old), evaluate(part, old)
                found = solve_sqp(part, old, at_old, knots, rules, self.tell, held_rows=~stretch.own)
                before, best = best, self._placed(best, stretch, found.force_N)
                won += [found] if best is not before else []
                ended &= found.status is not SqpStatus.ITERATIONS
            if best[0].merit > (1 - _GAINED) * first[0].merit:
                break
        return best, won, ended

    def _again(self, stretch: Stretch, force_N: Array, rng: np.random.Generator) -> SqpResult:
        """The search from the best of a few random moves."""
        part, own, old = stretch.problem, stretch.own, force_N[stretch.rows]
        trials = [part.clipped(np.where(own, self._moved(stretch, force_N, rng), old)) for _ in range(_DRAWS)]
        knots, start = self.prepare(part, min(trials, key=lambda trial: evaluate(part, trial).merit))
        return solve_sqp(
            part,
            start,
            evaluate(part, start),
            knots,
            replace(self.settings, iterations=_ITERATIONS),
            self.tell,
            held_rows=~own,
            rival=evaluate(part, old).merit,
        )

    def _moved(self, stretch: Stretch, force_N: Array, rng: np.random.Generator) -> Array:
        """The profile in these rows, moved by one time or by two, at the block's start and at its end."""
        times = rng.normal(0, rng.choice(_SPREADS) * self.spacing, 2)
        times[1] = times[rng.integers(2)]
        rows = np.arange(len(force_N))[stretch.rows]
        shift = np.interp(np.arange(len(rows)), (0, int(stretch.own.sum())), times)
        moved: Array = force_N[np.clip(rows + np.round(shift).astype(int), 0, len(force_N) - 1)]
        return moved

    def _changed(self, stretch: Stretch, force_N: Array, sizes: Sizes, rng: np.random.Generator) -> Array:
        """The profile after small changes, in force or in time around one instant, of which those that pay are kept.

        An evolution strategy with one parent and one child, whose step size follows the success.
        """
        part, own, span = stretch.problem, int(stretch.own.sum()), float(np.ptp(force_N))
        force, rows = force_N[stretch.rows], np.arange(len(stretch.own))
        best = evaluate(part, force)
        for _ in range(_TRIALS):
            error = np.cumsum(best.density[:own])
            early = int(rng.integers(0, 2 * self.spacing + 1))
            middle = int(np.searchsorted(error, rng.random() * error[-1])) - early
            if rng.random() < _ANYWHERE:
                middle = int(rng.integers(0, own))
            hat = np.clip(
                1 - np.abs(rows - middle) / np.exp(rng.uniform(np.log(2), np.log(3 * self.spacing + 2))), 0, 1
            )
            in_time = rng.random() < 0.5
            if in_time:
                child = np.interp(np.clip(rows + rng.normal(0, sizes.rows) * hat, 0, rows[-1]), rows, force)
            else:
                child = force + rng.normal(0, sizes.force_N) * hat
            child = part.clipped(child)
            found = evaluate(part, child)
            pays = found.merit < best.merit and found.beyond_N <= best.beyond_N
            if pays:
                force, best = child, found
            factor = _WIDER if pays else _NARROWER
            if in_time:
                sizes.rows = float(np.clip(factor * sizes.rows, 0.05, 4 * self.spacing))
            else:
                sizes.force_N = float(np.clip(factor * sizes.force_N, 1e-4 * span, 0.2 * span))
        return force


_ANYWHERE = 0.4  # of the changes: not where the error is or shortly before
