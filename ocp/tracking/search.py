"""Where the search starts and where its knots go, and how a long horizon is cut into pieces.

What decides how good the answer is: how early the force leaves the inverse at each reversal. So the search starts from
the exact inverse with its jumps spread over several times, within the limits, and takes the best of them between each
two reversals.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from tendonff.models.layout import ChainInputs
from tendonff.ocp.batch import Progress
from tendonff.ocp.simulate import Simulator
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Knots, evaluate
from tendonff.ocp.tracking.diagnosis import reversals
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.sqp import Profile, SqpResult, best_of_blocks, solve_sqp

_PER_SWING = 24  # knots between two reversals of the reference
_LEAST = 120  # knots of the whole horizon
_AT_LIMIT = 1e-3  # a row counts as limited within this share of the limit
_KNOTS_KEPT, _KNOTS_SEEN = 144, 36  # of a piece: that it keeps, and that it sees beyond
_KNOTS_ALONE = 300  # of a horizon that is one piece
_WIDTHS = 8  # over which jumps are spread, between 2 rows and ...
_WIDEST = 24  # ... so many knots: a swing
_TRUST = 0.1  # of the reference's range: largest change of the first step
_SHARES = (0.95, 0.8, 0.6, 0.4, 0.2, 0.0)  # of a start's changes, tried in turn where all of them go slack


def search(
    problem: TrackingProblem, inverse_N: Array, law_N: Array, iterations: int, progress: Progress | None = None
) -> tuple[Array, tuple[SqpResult, ...]]:
    """Search for the best profile, piece by piece; the plants keep moving on what was kept.

    Parameters
    ----------
    problem : TrackingProblem
    inverse_N, law_N : ndarray, shape (n,)
        Exact inverse and inverted capstan law, whatever the limits [N].
    iterations : int
        Most quadratic programs of a piece.
    progress : callable, optional
        Callback(completed, total), in iterations.

    Returns
    -------
    force_N : ndarray, shape (n,)
    results : tuple of SqpResult
        Of each piece.
    """
    spacing, rows = knot_spacing(problem.reference_N), len(inverse_N)
    length = rows if rows <= _KNOTS_ALONE * spacing else _KNOTS_KEPT * spacing
    pieces = list(windows(rows, length, _KNOTS_SEEN * spacing))
    counted, total = 0, iterations * len(pieces)

    def tell() -> None:
        nonlocal counted
        counted += 1
        if progress is not None:
            progress(counted, total)

    start = ChainInputs.of_force(np.array([problem.start_N]))
    simulators = [Simulator(p.chain, problem.step_s, p.state, start) for p in problem.plants]
    force, results = np.array([problem.start_N]), []
    for first, keep, end in pieces:
        here = slice(first, end + 1)
        part = problem.piece(here, tuple(s.state for s in simulators), float(force[-1]))
        results.append(_search_piece(part, inverse_N[here], law_N[here], spacing, iterations, tell))
        kept = results[-1].force_N[1 : keep - first + 1]
        force = np.concatenate([force, kept])
        if end > keep:
            for simulator in simulators:
                simulator.advance(ChainInputs.of_force(kept))
    if progress is not None:
        progress(total, total)
    return force, tuple(results)


def windows(rows: int, length: int, overlap: int) -> Iterator[tuple[int, int, int]]:
    """First row, last row kept and last row seen of pieces that keep `length` rows and see `overlap` rows beyond."""
    start = 0
    while start < rows - 1:
        # A last piece shorter than the overlap is not worth a piece of its own.
        keep = rows - 1 if start + length + overlap >= rows - 1 else start + length
        yield start, keep, min(keep + overlap, rows - 1)
        start = keep


def _search_piece(
    problem: TrackingProblem, inverse_N: Array, law_N: Array, spacing: int, iterations: int, tell: Callable[[], None]
) -> SqpResult:
    """The best start, and the descent from there."""
    best = best_of_blocks(problem, [_taut(problem, start) for start in starts(problem, inverse_N, law_N, spacing)])
    knots, trust = even_knots(len(inverse_N), spacing), _TRUST * float(np.ptp(problem.reference_N)) + 1e-6
    force = straightened(best[1], knots, problem.limits, problem.step_s)
    straight = (evaluate(problem, force), force)
    begun = straight if straight[0].beyond_N <= best[0].beyond_N else best
    found = solve_sqp(problem, begun, knots, iterations, trust, tell)
    return replace(found, force_N=best[1], evaluation=best[0]) if best[0].merit < found.evaluation.merit else found


def starts(problem: TrackingProblem, inverse_N: Array, law_N: Array, spacing: int) -> list[Array]:
    """Profiles within the limits: inverse, law, the inverse early, and with its jumps spread over several times."""
    early = problem.limits.apply(inverse_N[::-1], problem.step_s, float(inverse_N[-1]))[::-1]
    adhesion = problem.plants[0].chain.elements.piece.adhesion_N
    lifted = problem.reference_N + adhesion
    exponent = np.log(np.maximum(inverse_N + adhesion, 1e-3 * lifted) / lifted)
    spread = [
        lifted * np.exp(uniform_filter1d(exponent, round(width), mode="nearest")) - adhesion
        for width in np.geomspace(2, max(_WIDEST * spacing, 3), _WIDTHS)
    ]
    return [problem.clipped(wanted) for wanted in (inverse_N, law_N, early, *spread)]


def _taut(problem: TrackingProblem, force_N: Array) -> Profile:
    """The profile, or the largest share of its changes that breaks no bound: a slack tendon shows no slope."""
    first = (evaluate(problem, force_N), force_N)
    for share in _SHARES if first[0].beyond_N > 0 else ():
        mixed = problem.start_N + share * (force_N - problem.start_N)
        evaluation = evaluate(problem, mixed)
        if evaluation.beyond_N == 0:
            return evaluation, mixed
    return first


def knot_spacing(reference_N: Array) -> int:
    """Rows between knots."""
    n, swings = len(reference_N), len(reversals(reference_N)) + 1
    return int(np.clip(n / (_PER_SWING * swings), 1, max(n // _LEAST, 1)))


def even_knots(rows: int, spacing: int) -> Knots:
    """Knots every `spacing` rows, and at the last row."""
    return np.unique(np.append(np.arange(0, rows - 1, spacing), rows - 1))


def limited_rows(force_N: Array, step_s: float, limits: ForceLimits) -> np.typing.NDArray[np.bool_]:
    """Whether the step into each row 1 .. n - 1 is at a limit, shape (n - 1,)."""
    rate, force = np.abs(np.diff(force_N)) / step_s, force_N[1:]
    margin = _AT_LIMIT * min(limits.maximum_N - limits.minimum_N, float(np.ptp(force_N)) + 1e-12)
    return np.asarray(
        (rate > (1 - _AT_LIMIT) * limits.rate_N_per_s)
        | (force > limits.maximum_N - margin)
        | (force < limits.minimum_N + margin)
    )


def straightened(force_N: Array, knots: Knots, limits: ForceLimits, step_s: float) -> Array:
    """The profile made linear between knots in and next to the intervals where a limit binds.

    So a ramp may begin and end at a knot; elsewhere the profile keeps its fine structure.
    """
    hit = np.logical_or.reduceat(limited_rows(force_N, step_s, limits), knots[:-1])
    near = hit.copy()
    near[1:] |= hit[:-1]
    near[:-1] |= hit[1:]
    inside = np.append(False, np.repeat(near, np.diff(knots)))
    return np.where(inside, np.interp(np.arange(len(force_N)), knots, force_N[knots]), force_N)
