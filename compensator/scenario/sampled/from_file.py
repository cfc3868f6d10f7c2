"""References from files: which column is what, and the course between the samples."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonff.compensator.files.quantities import FORCE_UNITS, LENGTH_UNITS, Quantity, read_quantities, time_quantity
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenario.reference import CsvReference, Interpolation
from tendonff.compensator.scenario.sampled.filters import low_pass

_GAP_ROWS, _LOGGED_ROWS = 10, 100  # a logged trace, not one written by hand, whose interval is so many usual ones
_SLOW_LOG = 500  # steps between the samples of a logged trace, from where on its times may be milliseconds
_COLUMN = '{}_column = "{{}}" in [reference]'


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """A trace as the file has it, in SI units."""

    # time_s, value: shape (rows,); time [s], which rises from 0, and the wanted quantity [N or m]
    time_s: FloatArray
    value: FloatArray
    notes: tuple[str, ...]  # what the user should know of the file

    @property
    def interval_s(self) -> float:
        """Usual time between two samples [s]."""
        return float(np.median(np.diff(self.time_s)))


def read_samples(spec: CsvReference, path: Path, step_s: float) -> Samples:
    """Read the trace of a reference; InputError where the file is refused or seems to count milliseconds as seconds."""
    wanted = (
        time_quantity(_COLUMN.format("time"), spec.time_column),
        Quantity(
            name="position_m",
            words=("position", "load_position", "weg"),
            units=LENGTH_UNITS,
            option=_COLUMN.format("position"),
            column=spec.position_column,
        )
        if spec.wants_position
        else Quantity(
            name="tension_N",
            words=("tension", "force", "reference", "kraft"),
            units=FORCE_UNITS,
            option=_COLUMN.format("tension"),
            column=spec.tension_column,
        ),
    )
    read = read_quantities(path, wanted, starts_at_zero=True)
    time, value = (read.values[quantity.name] for quantity in wanted)
    if len(time) < 2:
        raise InputError(f"{path.name} has {len(time)} row; a reference needs at least two")
    samples = Samples(time_s=time, value=value, notes=(*read.notes, *_gaps(time, path.name)))
    if spec.time_column is None and len(time) >= _LOGGED_ROWS and samples.interval_s > _SLOW_LOG * step_s:
        raise InputError(
            f"{path.name}: {len(time)} rows {samples.interval_s:g} s apart are {time[-1] / step_s:.0f} steps of "
            f'step_s = {step_s:g}: are the times milliseconds? Then name the column "time_ms"; if they are seconds, '
            'say so with time_column = "time_s" in [reference]'
        )
    return samples


def _gaps(time: FloatArray, name: str) -> list[str]:
    """What is missing of a logged trace, and what stands in for it."""
    intervals = np.diff(time)
    usual = float(np.median(intervals))
    wide = np.flatnonzero(intervals > _GAP_ROWS * usual)
    if len(time) < _LOGGED_ROWS or not len(wide):
        return []
    longest = int(wide[np.argmax(intervals[wide])])
    message = (
        f"{name}: {len(wide)} {'gap' if len(wide) == 1 else 'gaps'} in rows that are {usual:.3g} s apart, the longest "
        f"from {time[longest]:.4g} to {time[longest + 1]:.4g} s; interpolated"
    )
    return [message]


def interpolate(samples: Samples, time_s: FloatArray, kind: Interpolation) -> FloatArray:
    """The wanted quantity at times within those of the samples [s], shape (n,)."""
    if kind is Interpolation.LINEAR or len(samples.time_s) == 2:
        straight: FloatArray = np.interp(time_s, samples.time_s, samples.value)
        return straight
    from scipy.interpolate import PchipInterpolator

    inside = np.minimum(time_s, samples.time_s[-1])  # the last step may end a rounding error behind the last sample
    smooth: FloatArray = PchipInterpolator(samples.time_s, samples.value)(inside)
    return smooth


def resample(
    spec: CsvReference, samples: Samples, time_s: FloatArray, step_s: float, file: str
) -> tuple[FloatArray, float]:
    """The trace at the times of the run, shape (n,), and the RMS of what the low-pass removed; messages name `file`."""
    if spec.cutoff_Hz is None:
        return interpolate(samples, time_s, spec.interpolation), 0.0
    # Filtered on a grid at least as fine as the samples, so that nothing above the run's rate folds down.
    finer = max(1, min(math.ceil(step_s / samples.interval_s - 1e-9), 1000))
    rate = finer / step_s
    if not spec.cutoff_Hz < rate / 2:
        raise InputError(
            f"{file} [reference]: cutoff_Hz must be < {rate / 2:g} (half the sampling rate), got {spec.cutoff_Hz:g}; "
            "leave it out to take the samples as they are"
        )
    fine_time: FloatArray = np.arange((len(time_s) - 1) * finer + 1, dtype=np.float64) * (step_s / finer)
    fine = interpolate(samples, fine_time, spec.interpolation)
    filtered = low_pass(fine, spec.cutoff_Hz, rate)
    return filtered[::finer], float(np.sqrt(np.mean((fine - filtered) ** 2)))
