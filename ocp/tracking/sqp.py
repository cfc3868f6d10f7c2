"""Sequential quadratic programming on the force's knots, judged by the true simulation.

Each iteration linearises the simulation exactly around the present profile (`sensitivity`), and solves a quadratic
program in the *change* of the force, piecewise linear between knots. The profile itself stays on the fine grid: what
it had there, such as the fine structure of an exact inverse, is kept, and the limits hold row by row, because within
an interval the change has one slope, which the steepest row of the profile bounds. A trust region makes up for what
the linearisation does not see: where the tendon sticks the output does not move, and where it slips again is a kink.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Evaluation, GaussNewtonModel, Knots, evaluate, gauss_newton_model
from tendonff.ocp.tracking.diagnosis import reversals
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.qp import solve_qp, step_bounds

Profile = tuple[Evaluation, Array]
"""Force, shape (n,) [N], and its errors."""

Mask = np.typing.NDArray[np.bool_]

_TOLERANCE = 3e-3  # relative decrease of the merit that is not worth another iteration
_SHARES = (1.0, 0.5, 0.25, 0.1)  # of a change, tried in turn: the limits are convex, so any share keeps them
_WAYS_BACK = (0.05, 0.1, 0.2, 0.4, 0.7)  # shares of the way back to a profile within the bounds, tried in turn
_TRIALS = 4  # quadratic programs for one linearisation
_POOR = 2  # a block that gains next to nothing so many times in a row is left as it is


@dataclass(frozen=True, slots=True, kw_only=True)
class SqpResult:
    """Where a search on one grid came to."""

    force_N: Array  # shape (n,)
    evaluation: Evaluation  # of that force
    converged: bool  # not cut short by the limit of iterations
    iterations: int
    gain: float  # relative decrease of the merit that the last iteration brought [-]


@dataclass(frozen=True, slots=True, kw_only=True)
class Blocks:
    """Stretches of time, one a reversal of the reference: full slip between them wipes out what was before.

    So each has a trust region and a share of the step of its own: one reversal that is hard holds up no other.
    """

    starts: Knots  # shape (b,); first rows

    @classmethod
    def between_reversals(cls, reference_N: Array) -> "Blocks":
        """From the middle between two reversals to the next."""
        turns = reversals(reference_N)
        return cls(starts=np.unique(np.append(0, (turns[1:] + turns[:-1]) // 2)))

    def of(self, rows: Knots) -> Knots:
        """Block of each row."""
        return np.searchsorted(self.starts, rows, side="right") - 1

    def sums(self, rows: Array) -> Array:
        """Of a quantity on all rows, shape (b,)."""
        return np.add.reduceat(rows, self.starts)

    def largest(self, knots: Knots, move: Array) -> Array:
        """Largest change at the knots of each block, shape (b,)."""
        most = np.zeros(len(self.starts))
        np.maximum.at(most, self.of(knots), np.abs(move))
        return most

    def free_knots(self, knots: Knots, searched: Mask) -> tuple[Knots, Mask]:
        """Knots of the blocks still searched and those next to them, and which of these may change."""
        free = searched[self.of(knots)]
        kept = free.copy()
        kept[1:] |= free[:-1]
        kept[:-1] |= free[1:]
        kept[[0, -1]] = True
        return knots[kept], free[kept]


def best_of_blocks(problem: TrackingProblem, profiles: list[Profile]) -> Profile:
    """The best of some profiles and of what takes the best of them between each two reversals."""
    blocks = Blocks.between_reversals(problem.reference_N)
    best = np.argmin([blocks.sums(evaluation.density) for evaluation, _ in profiles], axis=0)
    forces, rows = np.array([force for _, force in profiles]), np.arange(len(problem.reference_N))
    mixed = problem.clipped(forces[best[blocks.of(rows)], rows])
    return min([*profiles, (evaluate(problem, mixed), mixed)], key=lambda profile: profile[0].merit)


def solve_sqp(
    problem: TrackingProblem,
    profile: Profile,
    knots: Knots,
    iterations: int,
    trust_N: float,
    tell: Callable[[], None] = lambda: None,
) -> SqpResult:
    """Improve a profile within the limits until it does not pay any more; the result is never worse.

    `trust_N` is the largest change of the force in the first step; `tell` is called after each iteration.
    """
    blocks, kept = Blocks.between_reversals(problem.reference_N), profile
    count, (evaluation, force_N) = len(blocks.starts), profile
    trust, gain, done = np.full(count, trust_N), np.zeros(count), 0
    converged = not np.isfinite(evaluation.merit)  # nothing to linearise about
    # A block cannot gain more than what it has.
    poor = np.where(blocks.sums(evaluation.density) < _TOLERANCE / count * evaluation.merit, _POOR, 0)
    while done < iterations and not converged:
        done += 1
        free, active = blocks.free_knots(knots, poor < _POOR)
        model = gauss_newton_model(problem, force_N, evaluation, free, reach_N=2 * float(trust.max()))
        step = _step(problem, force_N, evaluation, model, blocks, free, active, trust)
        trust, gain = step.trust_N, np.zeros(count)
        if step.evaluation is not None:
            gain = (blocks.sums(evaluation.density) - blocks.sums(step.evaluation.density)) / evaluation.merit
            gain[0] += 1 - step.evaluation.merit / evaluation.merit - gain.sum()  # what belongs to no row
            force_N, evaluation = step.force_N, step.evaluation
            if evaluation.beyond_N == 0:
                kept = evaluation, force_N
        tell()
        poor = np.where(gain < _TOLERANCE / count, poor + 1, np.where(poor < _POOR, 0, poor))
        converged = step.evaluation is None or gain.sum() < _TOLERANCE or bool(np.all(poor >= _POOR))
    if evaluation.beyond_N > 0 and kept[0].beyond_N == 0:
        evaluation, force_N = _drawn_back(problem, kept, force_N)
    return SqpResult(
        force_N=force_N, evaluation=evaluation, converged=converged, iterations=done, gain=float(gain.sum())
    )


def _drawn_back(problem: TrackingProblem, kept: Profile, force_N: Array) -> Profile:
    """From a profile beyond the bounds towards the last that keeps them, as far as it takes.

    The penalty is finite: beyond a bound by a thousandth of a newton the error can be smaller by more.
    """
    for share in _WAYS_BACK:
        trial = problem.clipped(force_N + share * (kept[1] - force_N))
        found = evaluate(problem, trial)
        if found.beyond_N == 0 and found.merit < kept[0].merit:
            return found, trial
    return kept


@dataclass(frozen=True, slots=True, kw_only=True)
class _Step:
    """Outcome of one iteration; no evaluation where nothing better was found."""

    force_N: Array
    evaluation: Evaluation | None
    promise: float  # relative decrease of the merit by the quadratic model [-]
    trust_N: Array


def _step(
    problem: TrackingProblem,
    force_N: Array,
    evaluation: Evaluation,
    model: GaussNewtonModel,
    blocks: Blocks,
    knots: Knots,
    active: Mask,
    trust: Array,
) -> _Step:
    """Solve the quadratic program, and go as far along its answer as the simulation agrees, in each block."""
    promise, room, rows = np.inf, step_bounds(problem, force_N, knots), np.arange(len(force_N))
    home, before = blocks.of(knots), blocks.sums(evaluation.density)
    for _ in range(_TRIALS):
        move = solve_qp(model, room, np.where(active, trust[home], 0.0), problem.penalty_N)
        if move is None:
            trust = trust / 4
            continue
        promise = _promise(model, problem, move, evaluation)
        if promise <= 0.1 * _TOLERANCE:
            break
        size, change = blocks.largest(knots, move), np.interp(rows, knots, move)
        trials: list[tuple[Array, Evaluation]] = []
        for share in _SHARES:
            trial = problem.clipped(force_N + share * change)  # rounding
            trials.append((trial, evaluate(problem, trial)))
            if evaluation.merit - trials[-1][1].merit > 0.5 * promise * evaluation.merit * share * (2 - share):
                break
        left = np.array([blocks.sums(found.density) for _, found in trials])
        shares = np.array(_SHARES)[left.argmin(axis=0)]
        shares[left.min(axis=0) >= before] = 0.0
        if np.ptp(shares) > 0:
            mixed = problem.clipped(force_N + np.interp(rows, knots, shares[home]) * change)
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
    decrease = -float(np.einsum("i,i", model.gradient, move) + 0.5 * np.einsum("i,ij,j", move, model.hessian, move))
    if len(model.low):
        at = np.einsum("ij,j", model.rows, move)
        beyond = max(float(np.max(model.low - at)), float(np.max(at - model.high)), 0.0)
        decrease += problem.penalty_N * (evaluation.beyond_N - beyond)
    return decrease / evaluation.merit
