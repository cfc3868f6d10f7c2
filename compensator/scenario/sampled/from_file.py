"""References from files: columns, course between the samples, low-pass, and advice on noise and ripple."""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonff.compensator.files.quantities import FORCE_UNITS, LENGTH_UNITS, Quantity, read_quantities, time_quantity
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.text import InputError, discreetly
from tendonff.compensator.scenario.reference import CsvReference, Interpolation

_GAP_ROWS, _LOGGED_ROWS = 10, 100  # a logged trace, not one written by hand, whose interval is so many usual ones
_SLOW_LOG = 500  # steps between the samples of a logged trace, from where on its times may be milliseconds
_COLUMN = '{}_column = "{{}}" in [reference]'
_ORDER = 2  # of the Butterworth filter, run forwards and backwards: -6 dB at the cut-off, 24 dB per octave above
_TRIAL_CUTOFFS_HZ = (100.0, 50.0, 20.0, 10.0, 5.0)
_WORTH_A_WARNING = 0.05  # of the force's range: what noise may make up of it
_MOST_NOISE = 0.05  # of the range; a larger share is signal
_RIPPLE = 0.25  # of the mean rate, in a tenth of the moving rows; smooth references stay below 0.06


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """A trace as the file has it, in SI units."""

    # time_s, value: shape (rows,); time [s], which rises from 0, and the reference's quantity [N or m]
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
    with discreetly():
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
    """Gaps of a logged trace, and their replacement."""
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
    """Quantity of the reference at times within those of the samples [s], shape (n,)."""
    if kind is Interpolation.LINEAR or len(samples.time_s) == 2:
        return np.interp(time_s, samples.time_s, samples.value)
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


def low_pass(values: FloatArray, cutoff_Hz: float, rate_Hz: float) -> FloatArray:
    """Zero-phase low-pass of evenly spaced samples, shape (n, ...): Butterworth of second order, there and back.

    At the corner frequency it takes 6 dB.
    """
    from scipy import signal  # costs a second to import, and most references need none of it

    # Both ends are continued by point reflection, for longer than the filter remembers.
    pad = min(len(values) - 1, int(3 * rate_Hz / cutoff_Hz))
    result: FloatArray = signal.sosfiltfilt(_sections(cutoff_Hz, rate_Hz), values, axis=0, padtype="odd", padlen=pad)
    return result


@functools.lru_cache(maxsize=64)
def _sections(cutoff_Hz: float, rate_Hz: float) -> FloatArray:
    """The filter as second-order sections: a fit takes the same one hundreds of times."""
    from scipy import signal

    sections: FloatArray = signal.butter(_ORDER, cutoff_Hz, fs=rate_Hz, output="sos")
    return sections


def noise_advice(
    tension_N: FloatArray, step_s: float, force_of: Callable[[FloatArray], FloatArray], *, file: str
) -> str | None:
    """Propose a cut-off where noise in the reference would dominate the force; None when the noise does not matter.

    The inverse differentiates its reference twice and reverses the friction with every change of direction, so noise
    that is hard to see in the tension can rule the force. The samples, shape (n + 1,), are compared with themselves
    after the gentlest low-pass that removes the noise; both go through the inverse `force_of`.
    """
    tension, rate = tension_N, 1 / step_s
    found = _cutoff_at_the_noise_floor(tension, rate)
    # Noise that was logged slowly and interpolated has no floor: then the gentlest of a few filters that matters.
    for cutoff in (found,) if found is not None else [f for f in _TRIAL_CUTOFFS_HZ if f < rate / 4]:
        smooth = low_pass(tension, cutoff, rate)
        if not (smooth > 0).all():
            return None  # the filter's own overshoot would be judged, not the noise
        quiet = force_of(smooth)
        force_noise = float(np.sqrt(np.mean((force_of(tension) - quiet) ** 2)))
        # Percentiles: a jump at the start makes one huge force, unrelated to the rest.
        spread = float(np.subtract(*np.percentile(quiet, (99, 1))))
        if force_noise > _WORTH_A_WARNING * spread:
            break
    else:
        return None
    noise = float(np.sqrt(np.mean((tension - smooth) ** 2)))
    if noise > _MOST_NOISE * float(np.ptp(tension)):
        return None  # what the filter removes is the reference itself
    return (
        f"{file}: noise of {noise:.2g} N RMS in the samples becomes {force_noise:.3g} N RMS in the force "
        f"({100 * force_noise / max(spread, 1e-300):.0f} % of its range); "
        f"set cutoff_Hz = {cutoff:.2g} in [reference] to filter it"
    )


def _cutoff_at_the_noise_floor(tension: FloatArray, rate: float) -> float | None:
    """Frequency where the spectrum of the samples flattens out into noise [Hz]; None when there is no floor above 0.

    The floor is the median power of the upper third of the spectrum below the rate at which the samples really vary;
    the cut-off is where the smoothed spectrum is last ten times above it.
    """
    from scipy import signal

    if len(tension) < 64:
        return None
    frequency, power = signal.welch(np.asarray(tension), fs=rate, nperseg=min(len(tension), 4096), detrend="linear")
    frequency, power = frequency[1:], power[1:]
    # A trace logged slower than the run and interpolated carries no noise near the top: look below the fall.
    running = np.maximum.accumulate(power[::-1])[::-1]
    total = float(np.sum(power))
    carrying = np.nonzero(running > 1e-9 * total)[0]
    if len(carrying) < 16:
        return None
    top = carrying[-1] + 1
    floor = float(np.median(power[top // 2 : top]))
    above = np.nonzero(signal.medfilt(power[:top], 5) > 10 * floor)[0]
    last = above[-1] if len(above) else 0
    cutoff = 1.5 * float(frequency[last])
    return cutoff if cutoff < 0.8 * float(frequency[top - 1]) else None


def ripple_advice(force_N: FloatArray, step_s: float, interval_s: float, *, file: str) -> str | None:
    """Warn of a force, shape (n,), whose rate swings in time with the samples that the reference was interpolated from.

    None where the rate is smooth, or the samples, `interval_s` apart, are as dense as the rows.
    """
    rows = round(interval_s / step_s)
    if rows < 2 or len(force_N) <= 2 * rows:
        return None
    rate = np.diff(force_N) / step_s
    mean = np.convolve(rate, np.full(rows, 1 / rows), "same")
    moving = np.abs(mean) > 0.1 * np.percentile(np.abs(mean), 95)
    if not moving.any():
        return None
    ripple = float(np.percentile(np.abs(rate - mean)[moving] / np.abs(mean)[moving], 90))
    if ripple < _RIPPLE:
        return None
    return (
        f"{file}: the force rate swings by {100 * ripple:.2g} % about its mean within the {interval_s:.3g} s between "
        'two samples; give more samples, use interpolation = "monotone", or smooth them with cutoff_Hz = '
        f"{0.2 / interval_s:.2g} in [reference]"
    )
