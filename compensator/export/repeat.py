"""Which golden rows single precision repeats, and how closely a self test compares them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.export.golden import Course
from tendonff.ocp.codegen.precision import Precision

FLOAT_SHARE = 1e-3
"""Of the range: rows that need a larger tolerance in single precision are not compared."""

_FEW = 0.5  # share of rows below which means are compared: at such short steps rounding makes noise of forces
_FEWEST = 0.25  # below which all rows are compared all the same: leaving out nearly all would test nothing
_MEAN_OF = 8  # rows; what rounding makes of a reference is differentiated twice, and so is next to nothing in a mean

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
    mean_of: int = 1  # rows whose mean difference is compared

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
        """Addition to the name of the comparison: nothing where each row is compared."""
        means = "" if self.mean_of == 1 else f", means of {self.mean_of}"
        return means + ("" if self.every else f", {self.rows} of {len(self.expected)} rows")


def repeated_rows(
    expected: FloatArray, found: Sequence[FloatArray], most: float, *, neighbours: int = _NEIGHBOURS
) -> NDArray[np.bool_]:
    """Rows in which every answer and its neighbours are at most so far from what is expected, shape (rows,).

    In single precision the others depend on how a compiler rounds: where the force falls steeply at a reversal, or
    where a threshold is passed a sample sooner or later.
    """
    if not found:
        return np.ones(len(expected), dtype=np.bool_)
    return _quiet([np.abs(answer - expected) for answer in found], most, neighbours)


def largest_error(expected: FloatArray, found: Sequence[FloatArray]) -> float:
    """Of all rows, with the margin that rows are compared with."""
    return _MARGIN * max((float(np.abs(answer - expected).max(initial=0.0)) for answer in found), default=0.0)


def _quiet(apart: Sequence[FloatArray], most: float, neighbours: int) -> NDArray[np.bool_]:
    """Rows in which every difference and its neighbours are at most so large."""
    return np.asarray(maximum_filter1d(np.nan_to_num(np.max(apart, axis=0), nan=math.inf), neighbours) <= most)


def _means(apart: FloatArray) -> FloatArray:
    """Size of the mean difference of each row and those before it; 0 in rows with fewer before them."""
    means = np.abs(np.convolve(apart, np.full(_MEAN_OF, 1 / _MEAN_OF), mode="full")[: len(apart)])
    means[: _MEAN_OF - 1] = 0.0
    return means


def compared(
    expected: FloatArray,
    scale: float,
    most: float,
    precision: Precision,
    found: Sequence[FloatArray],
    *,
    neighbours: int = _NEIGHBOURS,
    by_means: bool = False,
) -> Compared:
    """Choose the rows of a module to compare by what the exported code gave in single precision, where it was run.

    Parameters
    ----------
    scale : float
        Size of the numbers that round [N] or [m].
    found : sequence of ndarray
        Answers of the exported code, one for each way of rounding that it was compiled with.
    most : float
        Largest tolerance in single precision [N] or [m]; rows that need more are not compared, unless few remain.
    neighbours : int, optional
        Rows over which a difference counts.
    by_means : bool, optional
        Compare means over some rows where few would remain.
    """
    if precision is Precision.DOUBLE or not len(found) or not len(expected):
        share = _DOUBLE if precision is Precision.DOUBLE else _UNMEASURED_FLOAT
        return Compared(tolerance=_two_digits(share * scale), expected=expected)
    rounding = min(_FLOAT_ROUNDING * scale, 0.5 * most)
    within, mean_of = (most - rounding) / _MARGIN, 1
    apart = [np.abs(answer - expected) for answer in found]
    kept = _quiet(apart, within, neighbours)
    if by_means and kept.mean() < _FEW:
        means = [_means(answer - expected) for answer in found]
        in_means = _quiet(means, within, neighbours)
        if in_means.mean() > kept.mean():
            apart, kept, mean_of = means, in_means, _MEAN_OF
    if kept.mean() < _FEWEST:
        apart = [np.abs(answer - expected) for answer in found]
        kept, most, mean_of = np.ones_like(kept), math.inf, 1
    error = max(float(each[kept].max(initial=0.0)) for each in apart)
    return Compared(
        tolerance=min(_two_digits(_MARGIN * error + rounding), most),
        expected=np.where(kept, expected, np.nan),
        mean_of=mean_of,
    )


def compared_modules(
    course: Course,
    precision: Precision,
    found_N: Sequence[Mapping[str, FloatArray]],
    per_newton: float,
    range_N: float,
    *,
    neighbours: int = _NEIGHBOURS,
) -> dict[str, Compared]:
    """Rows of each module of a course.

    `per_newton` is what a newton is in the unit of its answers, `range_N` the range of the scenario's reference.
    """
    modules = {}
    for name, expected in course.columns.items():
        unit = 1.0 if name == "plant" else per_newton
        scale = max(float(np.abs(expected).max()), unit)
        if name in ("inverse", "plant", "stream"):  # where the force before the limits rounds
            scale = max(scale, course.scale_N * unit)
        most = FLOAT_SHARE * range_N * unit
        found = [answers[name] for answers in found_N]
        modules[name] = compared(
            expected, scale, most, precision, found, neighbours=neighbours, by_means=neighbours > 1
        )
    return modules


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")
