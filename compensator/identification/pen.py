"""Commands over time, drawn as smooth moves and holds: what suggested excitations consist of."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tendonff.compensator.identification.measured import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """Shape of a move: from 0 to 1 in a time of 1, and its top speed."""

    at: Callable[[Array], Array]
    steepest: float


QUINTIC = Shape(at=lambda s: s**3 * (10 - 15 * s + 6 * s * s), steepest=15 / 8)
COSINE = Shape(at=lambda s: (1 - np.cos(np.pi * s)) / 2, steepest=math.pi / 2)
"""Quicker at its ends than the quintic: an angle read in counts still tells where it turns."""


class Pen:
    """Draws a command, of one drive or of several side by side.

    Parameters
    ----------
    start : float or ndarray, shape (drives,)
        The first row.
    step_s : float
        Between rows [s].
    shape : Shape, optional
        Of the moves.
    most_per_s : float, optional
        Top speed of the moves.
    """

    def __init__(
        self, start: ArrayLike, step_s: float, *, shape: Shape = QUINTIC, most_per_s: float = math.inf
    ) -> None:
        self._pieces, self.parts = [np.asarray(start, dtype=np.float64)[None]], list[str]()
        self._step_s, self._shape, self._most_per_s = step_s, shape, most_per_s

    @property
    def drawn(self) -> Array:
        """All rows so far."""
        return np.concatenate(self._pieces)

    @property
    def time_s(self) -> Array:
        """Times of the rows."""
        return np.arange(len(self.drawn), dtype=np.float64) * self._step_s

    @property
    def last(self) -> Array:
        """The last row."""
        found: Array = self._pieces[-1][-1]
        return found

    def note(self, text: str) -> None:
        """Say what follows."""
        self.parts.append(f"{self.time_s[-1]:.4g} s: {text}")

    def add(self, rows: Array) -> None:
        """Append rows."""
        self._pieces.append(rows)

    def hold(self, seconds: float) -> None:
        """Stay."""
        self.move(self.last, seconds)

    def move(self, to: ArrayLike, seconds: float) -> None:
        """Move, as slowly as asked or as the top speed demands."""
        way = np.asarray(to) - self.last
        seconds = max(seconds, self._shape.steepest * float(np.abs(way).max()) / self._most_per_s)
        rows = max(1, math.ceil(seconds / self._step_s - 1e-9))  # of an even number of steps none more
        self.add(self.last + np.multiply.outer(self._shape.at(np.arange(1, rows + 1) / rows), way))
