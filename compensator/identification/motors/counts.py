"""Angles of motors that were read in counts: the smooth angle behind the readings.

The dry friction of a gear builds up within about a count, so an angle that swings by a part of a count while the motor
slows down turns it over. What moves a mechanism is therefore the smoothest angle that each reading could be of, and
that turns back only where the readings do.
"""

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import median_filter

from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.smoothing import LEAST_NOISE, adaptive_low_pass

SMOOTH_S = 7e-3
"""Time in which a motor's jerk may change by about a count: the shortest move that is no error of a reading."""

ROUGHEST = 1e6
"""Largest weight of the jerk: with more, faster rows leave no digits."""

KEPT = 1e-3
"""Weight of a reading within its count, beside 1 beyond: no reading of a count is likelier than another."""

ONE_WAY = 100.0
"""Weight of a way back between two reversals."""

FLICKER_S = 0.1
"""A reading that stays for half of it at most is a flicker between two counts, and no reversal."""

BEYOND, RELAXED, AROUND_ROWS, MOST_RELAXED = 0.1, 0.01, 10, 8
"""Where the angle is more counts beyond a reading's, jerk weighs so much less in so many rows about, again and again:
the motor is quick there.
"""

MOST_BACK = 0.05
"""Share of the moves between readings that go back where counts show; with noise beside them, many do."""

STAYS, WHOLE, MOST_PARTS = 0.1, 0.1, 0.1
"""Readings in counts: so many stay as they were, and of the gaps between levels no more than a share are further than
this from whole ones.
"""

FINE_RAD = 3e-4
"""Finer counts tell where a joint or a motor stands."""

_ORDER, _STEPS, _ENOUGH = 3, 60, 1e-3  # the difference that is jerk; Newton's steps; counts by which the last moves


def smooth_angle(read_rad: Array, step_s: float) -> Array:
    """The angle that moved a mechanism: from counts, or from readings with noise, shape (n,)."""
    count = count_of(read_rad)
    moves = np.sign(moved_by(read_rad))
    if not count or (moves[1:] != moves[:-1]).mean() > MOST_BACK:
        return adaptive_low_pass(read_rad, step_s, count)
    return between_counts(read_rad, step_s, count)


def moved_by(x: Array) -> Array:
    """Moves between readings that are not the same."""
    moved = np.diff(x)
    return moved[np.abs(moved) > LEAST_NOISE * np.ptp(x)]


def count_of(x: Array) -> float:
    """Count of a channel, shape (n,); 0 where it has none that shows."""
    span, moves = float(np.ptp(x)), moved_by(x)
    gaps = np.diff(np.sort(x))
    gaps = gaps[gaps > LEAST_NOISE * span]
    if not len(moves) or len(moves) > (1 - STAYS) * len(x):
        return 0.0
    count = float(gaps[gaps < 1.5 * gaps.min()].mean())  # files round angles: no single step is exact
    off = np.abs(gaps / count - np.rint(gaps / count))
    return count if float((off > WHOLE).mean()) <= MOST_PARTS else 0.0


def ways(counts: Array, rows: int) -> Array:
    """Which way a motor goes between readings, 1 or -1, from one reversal to the next; shape (n - 1,).

    A reading that leaves the others for half of `rows` or less is none.
    """
    steady = median_filter(counts, size=rows, mode="nearest")
    moves = np.sign(np.diff(steady))
    at = np.flatnonzero(moves)
    found = np.zeros(len(moves))
    if not len(at):
        return found
    turns = np.flatnonzero(np.diff(moves[at]))
    middle = (at[turns] + at[turns + 1] + 1) // 2  # of the rows at the farthest reading
    for first, last, way in zip(
        [0, *middle], [*middle, len(moves)], [moves[at[0]], *moves[at[turns + 1]]], strict=True
    ):
        found[first:last] = way
    return found


def reading_share(read_rad: Array) -> Array:
    """Share of a reading that each row has, shape (n,): its error is one error for as long as it stays."""
    if count_of(read_rad) < FINE_RAD:
        return np.ones(len(read_rad))
    starts = np.flatnonzero(np.diff(read_rad, prepend=np.nan) != 0)
    rows = np.diff(starts, append=len(read_rad))
    return np.repeat(1 / rows, rows)


def between_counts(read_rad: Array, step_s: float, count: float) -> Array:
    """The smoothest angle within half a count of each reading that goes one way between reversals, shape (n,).

    Smooth is little jerk. Both bounds give way a little, so that one reading of another count does no harm.
    """
    read = (read_rad - read_rad[0]) / count
    if len(read) < 2 * (_ORDER + 1):
        return read_rad
    way = ways(np.rint(read), 2 * round(FLICKER_S / step_s / 2) + 1)
    rough = np.full(len(read) - _ORDER, min((SMOOTH_S / step_s) ** (2 * _ORDER), ROUGHEST))
    found = read
    for _ in range(MOST_RELAXED):
        found = _smoothest(read, way, rough, found)
        beyond = np.abs(found - read) > 0.5 + BEYOND
        if not beyond.any():
            break
        near = np.convolve(beyond, np.ones(2 * AROUND_ROWS + _ORDER + 1), "same") > 0
        rough = np.where(near[: len(rough)] | near[_ORDER:], RELAXED * rough, rough)
    return np.asarray(read_rad[0] + count * found)


def _smoothest(read: Array, way: Array, rough: Array, start: Array) -> Array:
    """Least weighted squares of jerk, of what is beyond a count and of ways back, by Newton's method [counts]."""
    smooth = _bands(rough, len(read))

    def cost(x: Array) -> float:
        off = x - read
        beyond, back = np.maximum(np.abs(off) - 0.5, 0.0), np.minimum(way * np.diff(x), 0.0)
        squares = (rough * np.diff(x, _ORDER) ** 2).sum() + KEPT * (off**2).sum() + (beyond**2).sum()
        return float(squares + ONE_WAY * (back**2).sum())

    found, least = start, cost(start)
    for _ in range(_STEPS):
        off = found - read
        outside, back = np.abs(off) > 0.5, ONE_WAY * (way * np.diff(found) < 0)
        bands = smooth.copy()
        bands[0] += KEPT + outside
        bands[0, :-1] += back
        bands[0, 1:] += back
        bands[1, :-1] -= back
        move = solveh_banded(bands, KEPT * read + outside * (read + 0.5 * np.sign(off)), lower=True) - found
        share = 1.0
        while (reached := cost(found + share * move)) > least and share > _ENOUGH:
            share /= 2
        if reached > least:
            break
        found, least = found + share * move, reached
        if float(np.abs(share * move).max()) < _ENOUGH:
            break
    return found


def _bands(weight: Array, rows: int) -> Array:
    """Lower bands of the squares of weighted third differences, shape (4, rows)."""
    stencil = np.diff(np.eye(_ORDER + 1), _ORDER, axis=0)[0]
    bands = np.zeros((_ORDER + 1, rows))
    for below in range(_ORDER + 1):
        for at in range(_ORDER + 1 - below):
            bands[below, at : at + len(weight)] += stencil[at] * stencil[at + below] * weight
    return bands
