"""Gains of the two cells: known where the tension is the same along the path, or the output tension is known.

Friction and a gain look alike in a log: the ratio of the cells' gains is added to mu theta one way and taken off the
other. Only a time in which friction does not act separates them; the cells' zeros must be known.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.reading import DataIssue, RawMeasurement, rows_within
from tendonff.compensator.scenario.measurement import Measurement

PARTS = 5
"""Parts of a time whose scatter tells how well a mean is known."""

MOST_OFF = 0.2
"""A gain further off than this is another unit, or a time in which friction acts."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gains:
    """Gains of the cells.

    Parameters
    ----------
    input, output : float
        Reading over tension [-].
    covariance : ndarray, shape (2, 2)
        Of the logarithms of both.
    found : tuple of str
        Keys of [measurement] of the times that identify them; empty where they are taken as stated.
    """

    input: float = 1.0
    output: float = 1.0
    covariance: Array
    found: tuple[str, ...] = ()

    @property
    def ratio_deviation(self) -> float:
        """Standard deviation of the logarithm of the ratio of both."""
        apart = np.array([1.0, -1.0])
        return float(np.sqrt(max(apart @ self.covariance @ apart, 0.0)))

    def taken_out(self, raw: RawMeasurement, how: Measurement) -> RawMeasurement:
        """A file that was read with other gains."""
        by_input, by_output = self.input / (how.input_gain or 1.0), self.output / (how.output_gain or 1.0)
        return replace(raw, input_N=raw.input_N / by_input, output_N=raw.output_N / by_output)


EXACT_GAINS = Gains(covariance=np.zeros((2, 2)))


def gains_of(files: Sequence[RawMeasurement], how: Measurement) -> Gains:
    """Gains of the cells from times in which they show; InputError where they do not show there.

    What is not found is as [measurement] states it, in doubt by `gain_uncertainty`.
    """
    doubt = ((how.gain_uncertainty or 0.0) / 2) ** 2
    stated_input, output, found = how.input_gain or 1.0, how.output_gain or 1.0, list[str]()
    variances, ratio, ratio_variance = [doubt, doubt], 0.0, 0.0
    if how.known_output_s is not None and how.known_output_N is not None:
        name = "known_output_s"
        parts = [np.log(_means(file, "output_N", how, name) / how.known_output_N) for file in files]
        level, variances[1] = _mean(parts, name)
        output, found = output * float(np.exp(level)), [name]
    if how.uniform_s is None:
        return Gains(input=stated_input, output=output, covariance=np.diag(variances), found=tuple(found))
    name = "uniform_s"
    for file in files:
        moved, span = float(np.ptp(_means(file, "input_N", how, name))), float(np.ptp(file.input_N))
        if moved > TUNED.hold_share * span:
            raise InputError(
                f"{file.name}: the input moves by {moved:.3g} N in {name}, after which friction acts; end it before "
                "the first stroke"
            )
    parts = [np.log(_means(file, "input_N", how, name) / _means(file, "output_N", how, name)) for file in files]
    ratio, ratio_variance = _mean(parts, name)
    # The output cell's gain goes into both.
    covariance = np.full((2, 2), variances[1]) + np.diag([ratio_variance, 0.0])
    by_ratio = stated_input * float(np.exp(ratio)) * output / (how.output_gain or 1.0)
    return Gains(input=by_ratio, output=output, covariance=covariance, found=(*found, name))


def _means(file: RawMeasurement, channel: str, how: Measurement, key: str) -> Array:
    """Mean tension in each part of a stated time; InputError where it says nothing of a gain."""
    values: Array = getattr(file, channel)[rows_within(file.time_s, getattr(how, key), key, file.name)]
    stated = how.input_offset_N is not None and how.output_offset_N is not None
    if not (stated or how.tare_s is not None or any(f.issue is DataIssue.OFFSET for f in file.findings)):
        raise InputError(
            f"{file.name}: {key} identifies a gain only where the cells' zeros are known; give --tare over slack "
            "samples, or --offset (0 where the readings without tension are zero)"
        )
    if not file.has_output:
        raise InputError(f"{file.name}: {key} needs the output tension; leave it out without that cell")
    means = np.array([float(part.mean()) for part in np.array_split(values, PARTS)])
    if not means.min() > 0:
        raise InputError(f"{file.name}: the tension in {key} is not above zero; choose a time under tension")
    return means


def _mean(parts: Sequence[Array], key: str) -> tuple[float, float]:
    """Mean over all parts of all files, and its variance by their scatter."""
    every = np.concatenate(parts)
    mean = float(every.mean())
    if abs(mean) > MOST_OFF:
        off, most = (100 * np.expm1(x) for x in (abs(mean), MOST_OFF))
        raise InputError(
            f"{key}: a cell would read {off:.3g} % off, more than {most:.0f} %; check the unit (--scale), and that "
            "friction does not act there"
        )
    return mean, float(every.var(ddof=1) / len(every))
