"""Which golden rows single precision repeats, and how closely a self test compares them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.export.golden import Course
from tendonff.ocp.codegen.precision import Precision

FLOAT_SHARE = 1e-3
"""Of the range: rows that need a larger tolerance in single precision are not compared."""

_FEWEST = 0.25  # share of rows below which all are compared all the same: leaving out nearly all would test nothing

_DOUBLE = 1e-9
_UNMEASURED_FLOAT = 1e-3
_FLOAT_ROUNDING = 2e-6
_MARGIN = 3.0  # compilers that contract products and sums round otherwise
_NEIGHBOURS = 11  # rows over which a difference counts, half of them before and behind


@dataclass(frozen=True, slots=True, kw_only=True)
class InFloat:
    """Answers of the exported code in single precision, by module [N]; of position drives commands [m]."""

    course: Mapping[str, FloatArray]
    jumps: Mapping[str, FloatArray]
    live: Mapping[str, FloatArray]
    other: Mapping[str, FloatArray]  # with other friction
    far: Mapping[str, FloatArray]  # of the observer, whose far end something moves
    reference: Mapping[str, FloatArray]  # the scenario's, of a cycle its third period
    tuner: Sequence[FloatArray]  # once for each nudge of its measurements


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """Rows of one module that the self test compares."""

    tolerance: float  # largest difference from the model that passes [N]; of commands [m]
    expected: FloatArray  # shape (rows,); the model's answers, NaN in rows that are not compared

    @property
    def rows(self) -> int:
        """Rows that are compared."""
        return int(np.isfinite(self.expected).sum())

    @property
    def every(self) -> bool:
        """Whether all rows are compared."""
        return self.rows == len(self.expected)

    @property
    def words(self) -> str:
        """Addition to the name of the comparison: nothing where all rows are compared."""
        return "" if self.every else f", {self.rows} of {len(self.expected)} rows"


def repeated_rows(
    expected: FloatArray, found: Sequence[FloatArray], most: float, *, neighbours: int = _NEIGHBOURS
) -> NDArray[np.bool_]:
    """Rows in which every answer and its neighbours are at most so far from what is expected, shape (rows,).

    In single precision the others depend on how a compiler rounds: where the force falls steeply at a reversal, or
    where a threshold is passed a sample sooner or later.
    """
    if not found:
        return np.ones(len(expected), dtype=np.bool_)
    apart = np.max([np.abs(answer - expected) for answer in found], axis=0)
    return np.asarray(maximum_filter1d(np.nan_to_num(apart, nan=math.inf), neighbours) <= most)


def compared(
    expected: FloatArray,
    scale: float,
    most: float,
    precision: Precision,
    found: FloatArray | None,
    *,
    neighbours: int = _NEIGHBOURS,
) -> Compared:
    """Choose the rows of a module to compare by what the exported code gave in single precision, where it was run.

    Parameters
    ----------
    scale : float
        Size of the numbers that round [N] or [m].
    most : float
        Largest tolerance in single precision [N] or [m]; rows that need more are not compared, unless few remain.
    neighbours : int, optional
        Rows over which a difference counts.
    """
    if precision is Precision.DOUBLE or found is None or not len(expected):
        share = _DOUBLE if precision is Precision.DOUBLE else _UNMEASURED_FLOAT
        return Compared(tolerance=_two_digits(share * scale), expected=expected)
    rounding = min(_FLOAT_ROUNDING * scale, 0.5 * most)
    kept = repeated_rows(expected, [found], (most - rounding) / _MARGIN, neighbours=neighbours)
    if kept.mean() < _FEWEST:
        kept, most = np.ones_like(kept), math.inf
    error = float(np.abs(found - expected)[kept].max(initial=0.0))
    return Compared(
        tolerance=min(_two_digits(_MARGIN * error + rounding), most), expected=np.where(kept, expected, np.nan)
    )


def compared_modules(
    course: Course,
    precision: Precision,
    found_N: Mapping[str, FloatArray] | None,
    per_newton: float,
    *,
    neighbours: int = _NEIGHBOURS,
) -> dict[str, Compared]:
    """Rows of each module of a course; `per_newton` is what a newton is in the unit of its answers."""
    modules = {}
    for name, expected in course.columns.items():
        unit = 1.0 if name == "plant" else per_newton
        scale = max(float(np.abs(expected).max()), unit)
        if name in ("inverse", "plant", "stream"):  # where the force before the limits rounds
            scale = max(scale, course.scale_N * unit)
        most = FLOAT_SHARE * scale_of(course.reference_N[np.isfinite(course.reference_N)]) * unit
        if name == "plant":  # its rows end where small differences grow
            most = math.inf
        found = None if found_N is None else found_N[name]
        modules[name] = compared(expected, scale, most, precision, found, neighbours=neighbours)
    return modules


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")
