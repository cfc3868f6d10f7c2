"""Runs of compiled code in blocks of rows: between them an interrupt is heard, and one without end is given up."""

from collections.abc import Callable
from typing import TypeVar

R = TypeVar("R")

BLOCK_ROWS = 200
"""Rows of a block."""
LEAST_WORK, WORK_PER_ROW = 50_000, 25
"""Linear solves that a run may take, and for each of its rows; three to ten for a row are usual."""


def in_blocks(rows: int, advance: Callable[[slice], R], done: Callable[[R], int], work: Callable[[R], int]) -> list[R]:
    """Results of successive blocks, at least one, of so many rows together; fewer where a run ends early.

    Parameters
    ----------
    advance : callable
        Run of the rows of a slice.
    done, work : callable
        Rows of a result, and the solves that it took.
    """
    found, spent = list[R](), 0
    for first in range(0, max(rows, 1), BLOCK_ROWS):
        block = slice(first, min(first + BLOCK_ROWS, rows))
        found.append(advance(block))
        spent += work(found[-1])
        if done(found[-1]) < block.stop - block.start or spent > LEAST_WORK + WORK_PER_ROW * rows:
            break
    return found
