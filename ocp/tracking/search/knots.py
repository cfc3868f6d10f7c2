"""Where the knots of a force profile go."""

import numpy as np

from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.cost import Knots
from tendonff.ocp.tracking.limits import ForceLimits

KNOTS_PER_SWING = 12
"""Coarse knots between two reversals of the reference."""

_AT_LIMIT = 1e-3  # a row counts as limited within this share of the limit


def even_knots(rows: int, spacing: int) -> Knots:
    """Knots every `spacing` rows, and at the last row."""
    return np.unique(np.append(np.arange(0, rows - 1, spacing), rows - 1))


def coarse_spacing(reference_N: Array) -> int:
    """Rows between coarse knots: a share of the time between two reversals of the reference."""
    n = len(reference_N)
    change = np.diff(reference_N)
    moving = np.abs(change) > 1e-9 * max(float(np.ptp(reference_N)), 1e-300)
    signs = np.sign(change[moving])
    turns = int(np.count_nonzero(np.diff(signs)))
    return int(np.clip(n / (KNOTS_PER_SWING * (turns + 1)), 1, max(n // 60, 1)))


def limited_rows(force_N: Array, step_s: float, limits: ForceLimits) -> np.typing.NDArray[np.bool_]:
    """Whether the step into each row 1 .. n - 1 is at a limit, shape (n - 1,)."""
    rate, force = np.abs(np.diff(force_N)) / step_s, force_N[1:]
    margin = _AT_LIMIT * min(limits.maximum_N - limits.minimum_N, float(np.ptp(force_N)) + 1e-12)
    return np.asarray(
        (rate > (1 - _AT_LIMIT) * limits.rate_N_per_s)
        | (force > limits.maximum_N - margin)
        | (force < limits.minimum_N + margin)
    )


def local_knots(limited: np.typing.NDArray[np.bool_], base: Knots, reach: int, spacing: int) -> Knots:
    """Knots everywhere, `base`, and closer ones where a limit begins or ceases to bind, and at those edges.

    The step into row k + 1 is at a limit where `limited[k]`. `reach` and `spacing` are the rows on either side of such
    an edge, and between the knots there.
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
    """The profile made linear between knots in and next to the intervals where a limit binds; see `local_knots`."""
    hit = np.logical_or.reduceat(limited, knots[:-1])
    near = hit.copy()
    near[1:] |= hit[:-1]
    near[:-1] |= hit[1:]
    rows = np.arange(len(force_N))
    inside = np.append(False, np.repeat(near, np.diff(knots)))
    return np.where(inside, np.interp(rows, knots, force_N[knots]), force_N)
