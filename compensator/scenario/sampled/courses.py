"""Courses over time that a few numbers describe: sums of sines, and waypoints."""

from collections.abc import Sequence

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.scenario.reference import Shape


def along_sines(
    amplitudes: Sequence[float], frequencies_Hz: Sequence[float], fade_in_s: float, time_s: FloatArray
) -> FloatArray:
    """min(t/fade_in_s, 1) sum_i a_i sin(2 pi f_i t), in the unit of the amplitudes."""
    waves = np.zeros_like(time_s)
    for amplitude, frequency in zip(amplitudes, frequencies_Hz, strict=True):
        waves += amplitude * np.sin(2 * np.pi * frequency * time_s)
    return waves * np.minimum(time_s / fade_in_s, 1.0) if fade_in_s > 0 else waves


def along_waypoints(
    times_s: Sequence[float], waypoints: Sequence[float], shape: Shape, time_s: FloatArray
) -> FloatArray:
    """A course through waypoints, held beyond them.

    Parameters
    ----------
    time_s : ndarray
        Where it is wanted [s].
    """
    times, values, time = np.array(times_s), np.array(waypoints), time_s
    if shape is Shape.LINEAR:
        straight: FloatArray = np.interp(time, times, values)
        return straight
    # 10 u^3 - 15 u^4 + 6 u^5 is the lowest polynomial with zero velocity and acceleration at both ends: the pieces
    # join with two continuous derivatives, and each is monotone, so no piece leaves the range of its two waypoints.
    piece = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2)
    u = np.clip((time - times[piece]) / (times[piece + 1] - times[piece]), 0.0, 1.0)
    result: FloatArray = values[piece] + (values[piece + 1] - values[piece]) * u**3 * (10 - 15 * u + 6 * u * u)
    return result
