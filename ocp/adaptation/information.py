"""Information content of a reference: the information matrix of the tuned factors along it."""

from dataclasses import dataclass

import numpy as np

from tendonff.ocp.adaptation.recursion import Prior
from tendonff.ocp.adaptation.tuning import SPREADS, Nuisance, Tunable, Tuning
from tendonff.ocp.step.protocol import Array

TARGET = 0.03
"""Relative standard deviation at which a factor counts as known."""

COUPLED = 0.98
"""Correlation above which two factors count as one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Information:
    """Information of the measurement on each factor, rows at the samples of the reference.

    Attributes
    ----------
    tuning : Tuning
        The recursion that would learn from it.
    time_s : Array
        Time, shape (n,) [s].
    deviation : Array
        Shape (n, parameters); standard deviation of each factor if nothing is forgotten [-].
    correlation : float
        Between the two factors at the end [-]; 0 where there is one.
    """

    tuning: Tuning
    time_s: Array
    deviation: Array
    correlation: float

    def known_after_s(self, index: int) -> float | None:
        """Time from which on the factor with that index counts as known; None where it never does."""
        rows = np.flatnonzero(self.deviation[:, index] <= TARGET)
        return float(self.time_s[rows[0]]) if rows.size else None

    def sentences(self) -> tuple[str, ...]:
        """Messages, one for each parameter and one on parameters that are not separately identifiable."""
        return (*map(self._sentence, range(len(self.tuning.parameters))), *self._together())

    def doubts(self) -> tuple[str, ...]:
        """Those of them on what is not identifiable, or not separately; empty where all is."""
        unknown = [k for k in range(len(self.tuning.parameters)) if self.known_after_s(k) is None]
        return (*map(self._sentence, unknown), *self._together())

    def _sentence(self, index: int) -> str:
        """Whether and when the factor with that index is known."""
        parameter, sensor, after = self.tuning.parameters[index], self.tuning.sensor.words, self.known_after_s(index)
        if after is None:
            return (
                f"this reference does not identify {parameter} from {sensor}: standard deviation "
                f"{_amount(parameter, self.deviation[-1, index])} at its end; let it slide further in both directions"
            )
        within = _amount(parameter, TARGET)
        return f"this reference identifies {parameter} within {within} after {after:.2g} s from {sensor}"

    def _together(self) -> tuple[str, ...]:
        """Whether two factors have one effect."""
        if abs(self.correlation) <= COUPLED:
            return ()
        names = " and ".join(self.tuning.parameters)
        sensor = self.tuning.sensor.words
        why = f"correlation {self.correlation:.3f}; tune one of them, or measure more"
        return (f"{names} cannot be separated by {sensor}: {why}",)


def _amount(parameter: Tunable, change: float) -> str:
    """Change of a factor in words; that of an exponent is no share."""
    return f"{change:.2g}" if parameter is Tunable.LOAD_EXPONENT else f"{100 * change:.2g} %"


def information(
    tuning: Tuning,
    time_s: Array,
    slopes: Array,
    weight: Array,
    nuisances: tuple[Nuisance, ...] = (),
    priors: tuple[Prior, ...] = (),
) -> Information:
    """Add up the information of every sample.

    Slopes are those of the measured quantity over each factor, and behind them over each nuisance parameter, shape
    (n, parameters + nuisance parameters); weights are from 0 to 1, priors those of the factors.
    """
    count = len(tuning.parameters)
    spreads = [p.width * tuning.start_deviation for p in priors or (Prior(),) * count] + [SPREADS[n] for n in nuisances]
    scaled = slopes * np.array(spreads)
    each = weight[:, None, None] * scaled[:, :, None] * scaled[:, None, :] / tuning.variance
    # In units of what is known at the start every eigenvalue of the information is at least 1, rounding apart.
    value, vector = np.linalg.eigh(np.cumsum(each, axis=0) + np.eye(len(spreads)))
    unit = (vector / np.maximum(value, 1.0)[:, None, :]) @ np.swapaxes(vector, 1, 2)
    covariance = unit * np.outer(spreads, spreads)
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))[:, :count]
    last = covariance[-1, :count, :count]
    correlation = float(last[0, 1] / np.sqrt(last[0, 0] * last[1, 1])) if len(last) > 1 else 0.0
    return Information(tuning=tuning, time_s=time_s, deviation=deviation, correlation=correlation)
