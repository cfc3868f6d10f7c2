"""Precomputed index that replaces the search in the C of a table."""

from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.lookup_table import FloatArray, halves
from tendonff.ocp.codegen.precision import Precision

_FEWEST_BINS, _MOST_BINS = 16, 256
_SLACK = 1e-6  # the controller's product share*bins_per_share may fall into the next bin by rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class ShareIndex:
    """Cell of a share by one product: the last cell that begins in a bin, and how many before it may be meant."""

    bins_per_share: float  # equal bins from 0 to the last share, per unit of share [-]
    cell: list[int]  # last cell that begins no later than the end of each bin, and one more for the last share itself
    rounds: int  # most steps down from there to the cell of any share in the bin
    halves: tuple[int, ...]  # steps of the search for a ratio over the nodes of a branch


def rounded(values: FloatArray, precision: Precision) -> FloatArray:
    """The nearest numbers of the real type."""
    if precision is Precision.DOUBLE:
        return values
    return values.astype(np.float32).astype(np.float64)


def share_index(share: FloatArray, precision: Precision) -> ShareIndex:
    """The fewest bins (a power of two) in which at most one cell of the share begins, or the most bins allowed."""
    nodes = rounded(share, precision)
    bins = _FEWEST_BINS
    while True:
        per_share = bins / float(nodes[-1])
        first = _cell(nodes, np.arange(bins + 1) / per_share * (1 - _SLACK))
        last = _cell(nodes, np.arange(1, bins + 2) / per_share * (1 + _SLACK))
        rounds = int((last - first).max())
        if rounds <= 1 or bins >= _MOST_BINS:
            return ShareIndex(
                bins_per_share=per_share, cell=[int(c) for c in last], rounds=rounds, halves=halves(nodes.size)
            )
        bins *= 2


def _cell(nodes: FloatArray, values: FloatArray) -> FloatArray:
    return np.clip(np.searchsorted(nodes, values, side="right") - 1, 0, nodes.size - 2)
