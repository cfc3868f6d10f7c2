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

import numpy as np

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Evaluation, GaussNewtonModel, Knots, evaluate, gauss_newton_model
from tendonff.ocp.tracking.diagnosis import reversals
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.search.qp import solve_qp, step_bounds


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
    """Trust region of the start, and when to stop."""

    iterations: int  # at most so many quadratic programs
    tolerance: float  # relative decrease of the merit that is not worth another iteration [-]
    trust_N: float  # largest change of the force in the first step [N]
    # searches from moved profiles in a row that may bring next to nothing before a block is left as it is
    restarts: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SqpResult:
    """Where a search on one grid came to."""

    force_N: Array  # shape (n,)
    evaluation: Evaluation  # of that force
    status: SqpStatus
    iterations: int
    promise: float  # relative decrease of the merit that the last quadratic program promised [-]
    gain: float  # relative decrease of the merit that the last iteration brought [-]


def solve_sqp(
    problem: TrackingProblem,
    force_N: Array,
    evaluation: Evaluation,
    knots: Knots,
    settings: SqpSettings,
    tell: Callable[[], None] | None = None,
    held_rows: np.typing.NDArray[np.bool_] | None = None,
    rival: float = np.inf,
) -> SqpResult:
    """Improve a profile within the limits, shape (n,) [N], until it does not pay any more; the result is never worse.

    Blocks in the rows `held_rows`, shape (n,), stay as they are. A search whose merit is still far from that of a
    `rival` after a few iterations ends there. `tell` is called after each iteration.
    """
    blocks = Blocks.between_reversals(problem, knots)
    trust = np.full(blocks.count, settings.trust_N)
    # A block cannot gain more than what it has.
    poor = np.where(blocks.sums(evaluation.density) < settings.tolerance / blocks.count * evaluation.merit, _POOR, 0)
    if held_rows is not None:
        poor[np.logical_and.reduceat(held_rows, blocks.starts)] = _POOR
    promise, iteration, status, gain = np.inf, 0, SqpStatus.ITERATIONS, np.zeros(blocks.count)
    while iteration < settings.iterations and status is SqpStatus.ITERATIONS:
        iteration += 1
        free, active = blocks.free_knots(poor < _POOR)
        model = gauss_newton_model(problem, force_N, evaluation, free, reach_N=2 * float(trust.max()))
        step = _step(problem, force_N, evaluation, model, blocks, _Unknowns(knots=free, active=active), trust, settings)
        trust, promise = step.trust_N, step.promise
        gain = np.zeros(blocks.count)
        if step.evaluation is not None:
            gain = (blocks.sums(evaluation.density) - blocks.sums(step.evaluation.density)) / evaluation.merit
            gain[0] += 1 - step.evaluation.merit / evaluation.merit - gain.sum()  # what belongs to no row
            force_N, evaluation = step.force_N, step.evaluation
        if tell is not None:
            tell()
        poor = np.where(gain < settings.tolerance / blocks.count, poor + 1, np.where(poor < _POOR, 0, poor))
        stuck = step.evaluation is None
        if promise <= 0.1 * settings.tolerance or np.all(poor >= _POOR) or (stuck and promise <= settings.tolerance):
            status = SqpStatus.CONVERGED
        elif stuck:
            status = SqpStatus.STALLED
        elif any(iteration >= late and evaluation.merit > share * rival for late, share in _HOPELESS):
            break
    return SqpResult(
        force_N=force_N,
        evaluation=evaluation,
        status=status,
        iterations=iteration,
        promise=promise,
        gain=float(gain.sum()),
    )


_HOPELESS = ((3, 1.5), (5, 1.15))  # iterations, and how many times the merit to beat
_POOR = 2  # a block that gains next to nothing so many times in a row is left as it is


@dataclass(frozen=True, slots=True, kw_only=True)
class _Unknowns:
    """Knots of the blocks that are still searched, with those next to them, whose change is 0."""

    knots: Knots  # shape (k,)
    active: np.typing.NDArray[np.bool_]  # shape (k,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Blocks:
    """Stretches of time, one a reversal of the reference: full slip between them wipes out what was before.

    So each has a trust region and a share of the step of its own: one reversal that is hard holds up no other.
    """

    knots: Knots  # shape (k,)
    starts: Knots  # shape (b,); first rows
    of_knot: Knots  # shape (k,); block of each knot

    @classmethod
    def between_reversals(cls, problem: TrackingProblem, knots: Knots) -> "Blocks":
        """From the middle between two reversals to the next."""
        turns = reversals(problem.goal.reference_N)
        starts = np.unique(np.append(0, (turns[1:] + turns[:-1]) // 2))
        return cls(knots=knots, starts=starts, of_knot=np.searchsorted(starts, knots, side="right") - 1)

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.starts)

    def free_knots(self, searched: np.typing.NDArray[np.bool_]) -> tuple[Knots, np.typing.NDArray[np.bool_]]:
        """Knots of the blocks still searched and their neighbours, and which of them may change."""
        free = searched[self.of_knot]
        kept = free.copy()
        kept[1:] |= free[:-1]
        kept[:-1] |= free[1:]
        kept[[0, -1]] = True
        return self.knots[kept], free[kept]

    def of(self, rows: Knots) -> Knots:
        """Block of each row."""
        return np.searchsorted(self.starts, rows, side="right") - 1

    def sums(self, rows: Array) -> Array:
        """Of a quantity on all rows, shape (b,)."""
        return np.add.reduceat(rows, self.starts)

    def largest(self, knots: Knots, move: Array) -> Array:
        """Largest change at the knots of each block, shape (b,)."""
        most = np.zeros(self.count)
        np.maximum.at(most, self.of(knots), np.abs(move))
        return most


@dataclass(frozen=True, slots=True, kw_only=True)
class _Step:
    """Outcome of one iteration; no evaluation where nothing better was found."""

    force_N: Array
    evaluation: Evaluation | None
    promise: float
    trust_N: Array


_SHARES = (1.0, 0.5, 0.25, 0.1)  # of a change, tried in turn: the limits are convex, so any share keeps them
_TRIALS = 4  # quadratic programs for one linearisation


def _step(
    problem: TrackingProblem,
    force_N: Array,
    evaluation: Evaluation,
    model: GaussNewtonModel,
    blocks: Blocks,
    unknowns: _Unknowns,
    trust: Array,
    settings: SqpSettings,
) -> _Step:
    """Solve the quadratic program, and go as far along its answer as the simulation agrees, in each block."""
    promise, room, rows = np.inf, step_bounds(problem, force_N, unknowns.knots), np.arange(len(force_N))
    home = blocks.of(unknowns.knots)
    before = blocks.sums(evaluation.density)
    for _ in range(_TRIALS):
        move = solve_qp(model, room, np.where(unknowns.active, trust[home], 0.0), problem.goal.penalty_N)
        if move is None:
            trust = trust / 4
            continue
        promise = _promise(model, problem, move, evaluation)
        if promise <= 0.1 * settings.tolerance:
            break
        size, change = blocks.largest(unknowns.knots, move), np.interp(rows, unknowns.knots, move)
        trials: list[tuple[Array, Evaluation]] = []
        for share in _SHARES:
            trial = problem.clipped(force_N + share * change)  # rounding
            trials.append((trial, evaluate(problem, trial)))
            if evaluation.merit - trials[-1][1].merit > 0.5 * promise * evaluation.merit * share * (2 - share):
                break
        left = np.array([blocks.sums(found.density) if found.tensions_N else before + np.inf for _, found in trials])
        best_of_block = left.argmin(axis=0)
        shares = np.array(_SHARES)[best_of_block]
        shares[left.min(axis=0) >= before] = 0.0
        if np.ptp(shares) > 0:
            mixed = problem.clipped(force_N + np.interp(rows, unknowns.knots, shares[home]) * change)
            trials.append((mixed, evaluate(problem, mixed)))
        best = min(trials, key=lambda t: t[1].merit)
        full = shares == 1
        grown = np.where(full & (size > 0.9 * trust), 2 * trust, trust)
        trust = np.where(full | (size < 0.01 * trust), grown, np.maximum(2 * shares, 0.05) * size)
        if best[1].merit < evaluation.merit:
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
