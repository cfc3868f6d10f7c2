"""Smoothing of measured channels: how much of a signal is noise, and a low-pass that spares what is not.

A friction model remembers every extreme of its input, so noise on the input ratchets: it opens hysteresis loops that
were never there, most of all while the input is held. What drives the model is therefore smoothed harder where nothing
happens (`adaptive_low_pass`); what it is compared with goes through one linear low-pass, as the model's answer does.
"""

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.stats import median_abs_deviation

from tendonff.compensator.identification.measured import Array
from tendonff.compensator.scenario.sampled.from_file import low_pass

CUTOFFS_HZ, HIGHEST_CUTOFF_HZ, CUTOFF_WINDOW_S = (5.0, 7.0, 10.0, 14.0, 20.0, 28.0), 40.0, 0.1
"""Cut-offs of what models are compared with, and the windows by which they are judged: no tendon is quicker."""

CHANCE = 6.0
"""Power of a window that is no noise, in standard deviations beyond that of noise: of hundreds one comes near it."""

QUIET_CUTOFFS_HZ = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
"""Cut-offs for quiet places; one is low enough where all higher ones differ from it by no more than noise does."""

RESOLVED = 0.2
"""Highest cut-off, as a share of the sampling rate: what lies above is not resolved."""

LEAST_NOISE = 1e-4
"""Noise that counts as none, as a share of the range."""

FOLDS = 0.4
"""Corner of the filter before rows are left out, as a share of the rate that is left."""

LEAST_FILTERED, PASSES = 16, 0.45
"""Rows that a filter needs for its ends; cut-offs from this share of the rate on take nothing away."""

COUNT_SHARE = 0.6
"""Of a count, that two versions of a channel may differ by: rounding leaves half of it."""

SCATTER = 0.3
"""Of the largest of many normal values, in standard deviations."""

AROUND_S = 0.05
"""Surroundings of a sharp place that keep its cut-off."""


def noise_of(x: Array) -> float:
    """Standard deviation of white noise under a smooth signal, shape (n,), from third differences."""
    third = np.diff(x, 3)  # of white noise with 1 + 9 + 9 + 1 = 20 times its variance
    return float(median_abs_deviation(third, scale="normal") / np.sqrt(20)) if len(third) else 0.0


def find_cutoff_Hz(channels: list[Array], step_s: float) -> float:
    """Lowest cut-off that takes away nothing but noise, anywhere in the file [Hz].

    What a cut-off takes away is compared with the white noise of the channel window by window: where it exceeds the
    noise, a reversal or a step was rounded, and friction would remember the wrong extreme.
    """
    highest = min(HIGHEST_CUTOFF_HZ, RESOLVED / step_s)
    enough = (f for f in CUTOFFS_HZ if f < highest and all(_only_noise(x, step_s, f) for x in channels))
    return next(enough, highest)


def _only_noise(x: Array, step_s: float, cutoff_Hz: float) -> bool:
    """No window loses more than the channel's own noise to the low-pass."""
    width = max(LEAST_FILTERED, int(CUTOFF_WINDOW_S / step_s))
    if len(x) < 2 * width:
        return False
    taken = x - low_pass_piece(x, step_s, cutoff_Hz)
    power = uniform_filter1d(taken**2, width)[width // 2 : len(x) - width // 2]
    noise = max(noise_of(x), LEAST_NOISE * float(np.ptp(x)))
    return bool(power.max() < noise**2 * (1 + CHANCE * np.sqrt(2 / width)))


def low_pass_piece(x: Array, step_s: float, cutoff_Hz: float) -> Array:
    """Second-order zero-phase Butterworth low-pass along the first axis; short pieces stay as they are."""
    if len(x) < LEAST_FILTERED or cutoff_Hz >= PASSES / step_s:
        return x
    return low_pass(x, cutoff_Hz, 1 / step_s)


def even_times(time_s: Array, step_s: float) -> Array:
    """Times of rows at an even step, from the first on."""
    return np.asarray(time_s[0] + step_s * np.arange(int((time_s[-1] - time_s[0]) / step_s * (1 + 1e-9)) + 1))


def thinned(x: Array, step_s: float, every: int) -> Array:
    """Every so many rows, without what would fold."""
    return low_pass_piece(x, step_s, FOLDS / (every * step_s))[::every]


def adaptive_low_pass(x: Array, step_s: float, count: float = 0.0) -> Array:
    """Smooth a channel by the lowest cut-off at each place that differs from all higher ones by noise only (Lepski).

    The error of a reading in counts is no white noise: slow moves keep it for long, so its bound is allowed everywhere.
    """
    highest = RESOLVED / step_s
    cutoffs = (*(f for f in QUIET_CUTOFFS_HZ if 2 / (len(x) * step_s) < f < highest), highest)
    noise = max(noise_of(x), count / np.sqrt(12))
    if not noise > LEAST_NOISE * float(np.ptp(x)):
        return low_pass_piece(x, step_s, highest)
    versions = [low_pass_piece(x, step_s, f) for f in cutoffs]
    level = np.full(len(x), float(len(cutoffs) - 1))  # place among the cut-offs at each sample, fractional
    blocked = np.zeros(len(x), dtype=bool)
    for k in range(len(cutoffs) - 2, -1, -1):
        width = max(3, int(1 / (cutoffs[k] * step_s)))
        for higher in range(k + 1, len(cutoffs)):
            deviation = noise * np.sqrt(min(1.0, 2 * cutoffs[higher] * step_s))
            # What the largest of so many independent values reaches by chance.
            reach = np.sqrt(2 * np.log(2 * cutoffs[higher] * len(x) * step_s)) + SCATTER
            off = np.abs(versions[k] - versions[higher]) > max(reach * deviation, COUNT_SHARE * count)
            blocked |= maximum_filter1d(off, width)
        level[~blocked] = k
    # Sharp places keep their cut-off, its surroundings come down to theirs gradually.
    around = max(3, int(AROUND_S / step_s))
    level = uniform_filter1d(maximum_filter1d(level, 2 * around + 1), around)
    smooth = np.zeros_like(x)
    for k, version in enumerate(versions):
        smooth += np.clip(1 - np.abs(level - k), 0, 1) * version
    return smooth
