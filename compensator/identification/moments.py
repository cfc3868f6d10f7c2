"""Moments at which the output moves although the law holds it: the far end was touched, or moved by something else."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.identification.result import PieceComparison

Array = NDArray[np.float64]

STILL_SHARE, MOVED_SHARE = 0.01, 0.05
"""The law holds the output while it changes by less than the first share of the range; the measured output moves when
it changes by more than the second."""

LEAST_S = 0.1


def moved_inside(comparisons: Sequence[PieceComparison]) -> list[tuple[str, float]]:
    """File and time [s] of every stretch in which the measured output moves while the law holds it."""
    found = []
    for piece in comparisons:
        span = float(np.ptp(piece.measured))
        for start, stop in _held(piece.model, STILL_SHARE * span):
            time, measured = piece.time_s[start:stop], piece.measured[start:stop]
            if time[-1] - time[0] >= LEAST_S and float(np.ptp(measured)) > MOVED_SHARE * span:
                row = int(np.argmax(np.abs(measured - measured[0]) > MOVED_SHARE * span / 2))
                found.append((piece.name, float(time[row])))
    return found


def _held(x: Array, within: float) -> list[tuple[int, int]]:
    """Stretches over which a signal stays within a band."""
    stretches, start, low, high = [], 0, x[0], x[0]
    for k, value in enumerate(x):
        low, high = min(low, value), max(high, value)
        if high - low > within:
            if k - start > 1:
                stretches.append((start, k))
            start, low, high = k, value, value
    return [*stretches, (start, len(x))]
