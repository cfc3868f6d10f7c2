"""Held-out parts of the measured files, in turn: every law is judged on rows that it was not fitted to.

Values of the chain without a part are one Gauss-Newton step from those of the whole fit: refits would cost as many fits
as there are parts. The quasi-static laws are fitted again.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.parameters import BIASES
from tendonff.ocp.fits.least_squares import Solution, gauss_newton_step

Folds = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputError:
    """Error of a predicted channel over some rows.

    Parameters
    ----------
    rms : float
        RMS error, N or m.
    robust_rms : float
        The same with large deviations counted linearly.
    """

    rms: float
    robust_rms: float


FAILED = OutputError(rms=float("inf"), robust_rms=float("inf"))


def error_of(parts: Sequence[Array], unit: float) -> OutputError:
    """Error from deviations; those above the unit count linearly in the robust one."""
    off = np.concatenate(parts) / unit if parts else np.zeros(0)
    if not len(off) or not np.isfinite(off).all():
        return FAILED
    robust = float(np.mean(2 * (np.sqrt(1 + off**2) - 1)))
    return OutputError(rms=unit * float(np.sqrt(np.mean(off**2))), robust_rms=unit * float(np.sqrt(robust)))


def folds_of(clocks: Sequence[tuple[str, Array]]) -> list[Folds]:
    """Part of every row of pieces, given by the name of their file and their clock.

    Each of several files is a part, a single one falls into parts of equal time.
    """
    names = list(dict.fromkeys(name for name, _ in clocks))
    if len(names) > 1:
        return [np.full(len(time), names.index(name)) for name, time in clocks]
    lengths = [float(np.ptp(time)) if len(time) else 0.0 for _, time in clocks]
    before = np.cumsum([0.0, *lengths])
    places = [
        (done + time - time[0]) / max(before[-1], 1e-300) if len(time) else time
        for (_, time), done in zip(clocks, before[:-1], strict=True)
    ]
    return [np.minimum((TUNED.folds * place).astype(np.int64), TUNED.folds - 1) for place in places]


def values_without(solution: Solution, folds: Folds) -> dict[int, dict[str, float]]:
    """Values that a fit would have without each part of its residuals."""
    found, values = solution.residuals, np.array(list(solution.values.values()))
    signed = np.array([name in BIASES for name in solution.values])
    without = {}
    for fold in np.unique(folds).tolist():
        rest = folds != fold
        step = gauss_newton_step(found.values[rest], found.slopes[rest]) if rest.any() else np.zeros(len(values))
        moved = np.where(signed, values + step, np.clip(values + step, values / 2, 2 * values))
        without[fold] = dict(zip(solution.values, moved.tolist(), strict=True))
    return without
