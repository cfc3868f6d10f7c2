"""Long horizons in pieces that overlap: cost grows with the length, not with its cube."""

from collections.abc import Iterator
from dataclasses import dataclass

KNOTS_PER_WINDOW = 110
"""Coarse knots that one piece keeps."""

KNOTS_OF_OVERLAP = 30
"""Coarse knots that a piece sees beyond what it keeps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """One piece: solved from `start` to `end`, kept up to `keep`; the next one starts there.

    Parameters
    ----------
    start, keep, end : int
        Rows; start < keep <= end.
    """

    start: int
    keep: int
    end: int


def windows(rows: int, length: int, overlap: int) -> Iterator[Window]:
    """Cut a horizon into windows.

    Parameters
    ----------
    rows : int
        Rows of the horizon, the last included.
    length : int
        Rows that a window keeps.
    overlap : int
        Rows that it sees beyond.
    """
    start = 0
    while start < rows - 1:
        # A last piece shorter than the overlap is not worth a window of its own.
        keep = rows - 1 if start + length + overlap >= rows - 1 else start + length
        yield Window(start=start, keep=keep, end=min(keep + overlap, rows - 1))
        start = keep
