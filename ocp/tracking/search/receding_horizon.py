"""Receding horizon: a long problem in pieces that overlap, so that cost grows with the length, not with its cube."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.layout import ChainInputs
from tendonff.ocp.batch import Progress
from tendonff.ocp.simulate import Simulator
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.problem import TrackingProblem, TrackOptions
from tendonff.ocp.tracking.search.grids import GridRefinement, refine
from tendonff.ocp.tracking.search.knots import coarse_spacing
from tendonff.ocp.tracking.search.sqp import SqpSettings

KNOTS_PER_WINDOW = 110
"""Coarse knots that one piece keeps."""

KNOTS_OF_OVERLAP = 30
"""Coarse knots that a piece sees beyond what it keeps."""

KNOTS_ALONE = 190
"""Coarse knots of a horizon that is one piece: there the search may move what it found."""

_RESTARTS, _RESTARTS_OF_SEVERAL = 6, 5  # unless told otherwise; the latter are shared by the plants


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """One piece: solved from `start` to `end`, kept up to `keep`; the next one starts there."""

    # start, keep, end: rows; start < keep <= end
    start: int
    keep: int
    end: int


def windows(rows: int, length: int, overlap: int) -> Iterator[Window]:
    """Cut a horizon of so many rows into windows that keep `length` rows and see `overlap` rows beyond."""
    start = 0
    while start < rows - 1:
        # A last piece shorter than the overlap is not worth a window of its own.
        keep = rows - 1 if start + length + overlap >= rows - 1 else start + length
        yield Window(start=start, keep=keep, end=min(keep + overlap, rows - 1))
        start = keep


def solve(
    problem: TrackingProblem, starts_N: tuple[Array, ...], options: TrackOptions, progress: Progress | None = None
) -> tuple[Array, tuple[GridRefinement, ...]]:
    """Solve window by window; the plants keep moving on the profile that was kept.

    The search starts from the forces `starts_N`, each of shape (n,); the first is the exact inverse. Progress is
    counted in iterations. Returns the profile, shape (n,) [N], and the search in each window.
    """
    spacing, step_s = coarse_spacing(problem.goal.reference_N), problem.step_s
    rows = len(starts_N[0])
    length = rows if rows <= KNOTS_ALONE * spacing else KNOTS_PER_WINDOW * spacing
    overlap = KNOTS_OF_OVERLAP * spacing
    if options.window_s is not None:
        length = max(round(options.window_s / step_s), 2)
        overlap = max(min(overlap, length), 1)
    pieces = list(windows(rows, length, overlap))
    start = ChainInputs.of_force(np.array([problem.start_N]))
    simulators = [Simulator(p.chain, step_s, p.state, start) for p in problem.plants]
    static = tuple(p.static.start_N for p in problem.plants)
    force, refinements = np.array([problem.start_N]), []
    restarts = options.restarts
    if restarts is None:
        count = len(problem.plants)
        restarts = 0 if len(pieces) > 1 else _RESTARTS if count == 1 else _RESTARTS_OF_SEVERAL // count
    settings = SqpSettings(
        iterations=options.max_iterations,
        tolerance=options.tolerance,
        trust_N=0.1 * float(np.ptp(problem.goal.reference_N)) + 1e-6,
        restarts=restarts,
    )
    counter = _Counter(progress, options.max_iterations * len(pieces))
    for piece in pieces:
        here = slice(piece.start, piece.end + 1)
        part = problem.piece(here, tuple(s.state for s in simulators), static, float(force[-1]))
        found = refine(part, tuple(start[here] for start in starts_N), settings, spacing, counter.tick)
        refinements.append(found)
        kept = found.force_N[1 : piece.keep - piece.start + 1]
        force = np.concatenate([force, kept])
        if piece.end > piece.keep:
            for simulator in simulators:
                simulator.advance(ChainInputs.of_force(kept))
            outputs = (
                replace(p.static, start_N=at).output_N(kept) for p, at in zip(problem.plants, static, strict=True)
            )
            static = tuple(float(output[-1]) for output in outputs)
    counter.finish()
    return force, tuple(refinements)


class _Counter:
    """Turns iterations into progress."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._total, self._done = progress, total, 0

    def tick(self) -> None:
        self._done += 1
        if self._progress is not None:
            self._progress(self._done, self._total)

    def finish(self) -> None:
        if self._progress is not None:
            self._progress(self._total, self._total)
