"""Smoothing of measured channels: how much of a signal is noise, and a low-pass that spares what is not.

A friction model remembers every extreme of its input, so noise on the input ratchets: it opens hysteresis loops that
were never there, most of all while the input is held. What drives the model is therefore smoothed harder where nothing
happens (`adaptive_low_pass`); what it is compared with goes through one linear low-pass, as the model's answer does.
"""

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from tendonff.compensator.identification.measured import Array
from tendonff.compensator.scenario.sampled.from_file import low_pass

CUTOFFS_HZ = (5.0, 7.0, 10.0, 14.0, 20.0, 28.0)
HIGHEST_CUTOFF_HZ, CUTOFF_WINDOW_S, LEAST_NOISE = 40.0, 0.1, 1e-4
"""Cut-offs that are tried, and the noise that counts as none, as a share of the range."""

QUIET_CUTOFFS_HZ = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
"""Cut-offs for quiet places; one is low enough where all higher ones differ from it by no more than noise does."""


COUNT_SHARE = 0.6
"""Of a count, that two versions of a channel may differ by."""


def noise_of(x: Array) -> float:
    """Standard deviation of white noise under a smooth signal, shape (n,), from third differences."""
    if len(x) < 8:
        return 0.0
    third = np.diff(x, 3)
    return float(1.4826 * np.median(np.abs(third - np.median(third))) / np.sqrt(20.0))


def find_cutoff_Hz(channels: list[Array], step_s: float) -> float:
    """Lowest cut-off that takes away nothing but noise, anywhere in the file [Hz].

    What a cut-off takes away is compared with the white noise of the channel window by window: where it exceeds the
    noise, a reversal or a step was rounded, and friction would remember the wrong extreme.
    """
    rate = 1 / step_s
    highest = min(HIGHEST_CUTOFF_HZ, 0.2 * rate)
    width = max(16, int(CUTOFF_WINDOW_S * rate))
    enough = (f for f in CUTOFFS_HZ if f < highest and all(_only_noise(x, step_s, f, width) for x in channels))
    return next(enough, highest)


def _only_noise(x: Array, step_s: float, cutoff_Hz: float, width: int) -> bool:
    """No window loses more than the channel's own noise to the low-pass."""
    if len(x) < 2 * width:
        return False
    taken = x - low_pass_piece(x, step_s, cutoff_Hz)
    windows = np.cumsum(np.concatenate([[0.0], taken**2]))
    power = (windows[width:] - windows[:-width]) / width
    noise = max(noise_of(x), LEAST_NOISE * float(np.ptp(x)))
    return bool(power.max() < noise**2 * (1 + 6 * np.sqrt(2 / width)))


def low_pass_piece(x: Array, step_s: float, cutoff_Hz: float) -> Array:
    """Second-order zero-phase Butterworth low-pass along the first axis; short pieces stay as they are."""
    if len(x) < 16 or cutoff_Hz >= 0.45 / step_s:
        return x
    return low_pass(x, cutoff_Hz, 1 / step_s)


def adaptive_low_pass(x: Array, step_s: float, count: float = 0.0) -> Array:
    """Smooth a channel by the lowest cut-off at each place that differs from all higher ones by noise only (Lepski).

    The error of a reading in counts is no white noise: slow moves keep it for long, so its bound is allowed everywhere.
    """
    highest = 0.2 / step_s
    cutoffs = (*(f for f in QUIET_CUTOFFS_HZ if 2 / (len(x) * step_s) < f < 0.8 * highest), highest)
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
            reach = np.sqrt(2 * np.log(2 * cutoffs[higher] * len(x) * step_s)) + 0.3
            off = np.abs(versions[k] - versions[higher]) > max(reach * deviation, COUNT_SHARE * count)
            blocked |= maximum_filter1d(off, width)
        level[~blocked] = k
    # Sharp places keep their cut-off, its surroundings come down to theirs gradually.
    around = max(3, int(0.05 / step_s))
    level = uniform_filter1d(maximum_filter1d(level, 2 * around + 1), around)
    smooth = np.zeros_like(x)
    for k, version in enumerate(versions):
        smooth += np.clip(1 - np.abs(level - k), 0, 1) * version
    return smooth
