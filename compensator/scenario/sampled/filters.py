"""Low-pass filters, and advice on noise and on ripple in a sampled reference."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_ORDER = 2  # of the Butterworth filter, run forwards and backwards: -6 dB at the cut-off, 24 dB per octave above
_TRIAL_CUTOFFS_HZ = (100.0, 50.0, 20.0, 10.0, 5.0)
_MOST_NOISE = 0.05  # of the range; a larger share is signal
_RIPPLE = 0.25  # of the mean rate, in a tenth of the moving rows; smooth references stay below 0.06


def low_pass(values: FloatArray, cutoff_Hz: float, rate_Hz: float) -> FloatArray:
    """Zero-phase low-pass of evenly spaced samples, shape (n,): Butterworth of second order, forwards and backwards.

    At the corner frequency it takes 6 dB.
    """
    from scipy import signal  # costs a second to import, and most references need none of it

    sections = signal.butter(_ORDER, cutoff_Hz, fs=rate_Hz, output="sos")
    # Both ends are continued by point reflection, for longer than the filter remembers.
    pad = min(len(values) - 1, math.ceil(3 * rate_Hz / cutoff_Hz))
    result: FloatArray = signal.sosfiltfilt(sections, values, padtype="odd", padlen=pad)
    return result


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseAdvice:
    """What to do about a noisy reference."""

    cutoff_Hz: float  # proposed corner frequency [Hz]
    noise_N: float  # noise of the samples, root mean square [N]
    force_noise_N: float  # what that noise makes of the force, root mean square [N]
    message: str  # the warning for the user


def noise_advice(
    tension_N: FloatArray,
    step_s: float,
    force_of: Callable[[FloatArray], FloatArray],
    *,
    file: str = "reference",
    share: float = 0.05,
) -> NoiseAdvice | None:
    """Propose a cut-off where noise in the reference would dominate the force; None when the noise does not matter.

    The inverse differentiates its reference twice and reverses the friction with every change of direction, so noise
    that is hard to see in the tension can rule the force. The samples, shape (n + 1,), are compared with themselves
    after the gentlest low-pass that removes the noise; both go through the inverse `force_of`. The noise may make up a
    share of the force's range before it is worth a warning.
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
        # Percentiles: a jump at the start makes one huge force that says nothing of the rest.
        spread = float(np.subtract(*np.percentile(quiet, (99, 1))))
        if force_noise > share * spread:
            break
    else:
        return None
    noise = float(np.sqrt(np.mean((tension - smooth) ** 2)))
    if noise > _MOST_NOISE * float(np.ptp(tension)):
        return None  # what the filter removes is the reference itself
    message = (
        f"{file}: noise of {noise:.2g} N RMS in the samples becomes {force_noise:.3g} N RMS in the force "
        f"({100 * force_noise / max(spread, 1e-300):.0f} % of its range); "
        f"set cutoff_Hz = {cutoff:.2g} in [reference] to filter it"
    )
    return NoiseAdvice(cutoff_Hz=float(f"{cutoff:.2g}"), noise_N=noise, force_noise_N=force_noise, message=message)


def _cutoff_at_the_noise_floor(tension: FloatArray, rate: float) -> float | None:
    """Frequency where the spectrum of the samples flattens out into noise [Hz]; None when there is no floor above 0.

    The floor is the median power of the upper third of the spectrum below the rate at which the samples really vary;
    the cut-off is where the smoothed spectrum last stands ten times above it.
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
