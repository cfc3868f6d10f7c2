"""Zero of the cells from a slack tendon: what both read while nothing pulls."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

Array = NDArray[np.float64]

NEAR_SHARE = 0.02
"""A slack cell reads less than this share of its range."""

FLAT_SIGMAS, FLAT_SHARE = 4.0, 2e-4
"""Slack readings scatter by no more than so many deviations of the noise, or than a share of the range."""

LEAST_SHARE, LEAST_ROWS = 0.01, 30


@dataclass(frozen=True, slots=True, kw_only=True)
class SlackOffsets:
    """What the cells read without tension."""

    offsets_N: tuple[float, float]  # of the input and the output cell
    rows: int  # samples that are slack


def slack_offsets(input_N: Array, output_N: Array) -> SlackOffsets | None:
    """Offsets of both cells from readings, shape (n,), in which the tendon is slack; None where it never is for long.

    Slack shows as a floor of both tensions at once, near zero and flat: a tendon cannot push.
    """
    slack = np.ones(len(input_N), dtype=bool)
    for x in (input_N, output_N):
        slack &= _on_the_floor(x)
    rows = int(slack.sum())
    if rows < max(LEAST_ROWS, LEAST_SHARE * len(input_N)):
        return None
    return SlackOffsets(offsets_N=(float(np.median(input_N[slack])), float(np.median(output_N[slack]))), rows=rows)


def _on_the_floor(x: Array) -> NDArray[np.bool_]:
    """Samples within the noise of the lowest readings, where these are near zero and last."""
    low, high = np.percentile(x, [0.5, 99.5])
    span = float(high - low)
    noise = 1.4826 * float(np.median(np.abs(np.diff(x)))) / np.sqrt(2)
    width = max(FLAT_SIGMAS * noise, FLAT_SHARE * span)
    smooth = uniform_filter1d(x, 9, mode="nearest")
    floor = float(np.percentile(smooth, 0.5))
    if abs(floor) > NEAR_SHARE * span + width:
        return np.zeros(len(x), dtype=bool)
    near = np.abs(smooth - floor) < width
    level = float(np.median(x[near]))
    return np.asarray(np.abs(smooth - level) < width)
