"""Parts of a recording besides the test: a slack tendon, which shows the cells' zero, and a load being switched on.

What both cells read while nothing pulls is their zero. A load that is switched on as the recording starts shows as a
jump of the output that nothing at the input explains.
"""

import numpy as np

from tendonff.compensator.identification.measured import LEAST_ROWS, Array, Mask
from tendonff.compensator.identification.measured.smoothing import LEAST_NOISE, noise_of

NEAR_SHARE = 0.02
"""A slack cell reads less than this share of its range."""

FLAT_SIGMAS = 4.0
"""Slack readings scatter by no more than so many deviations of the noise."""

LEAST_SHARE = 0.01
"""A tendon that is slack for less of the rows may have passed by zero."""

FIRST_ROWS = 5
"""The jump lies between two of so many first rows."""

LONGEST_S = 1.0
"""Ringing is looked for in so much of the start; what comes later says how large and how quick the output is."""

JUMP_SHARE = 0.5
"""The jump is larger than this share of the output's later range, and the input moves by less than that of it. Driven
from the near end, the output moves no more than the input, times e^{mu theta} when released."""

RUNG_DOWN, QUIET_S = 0.05, 0.1
"""Ringing is over when for so long no row differs from the next by more than this share of the jump."""

ROOM = 2.0
"""Omitted start, in units of the time until the oscillation has decayed: its tail is slower than its rows show."""


def slack_rows(input_N: Array, output_N: Array) -> Mask | None:
    """Rows in which the tendon is slack, shape (n,); None where it never is for long.

    Slack shows as a floor of both tensions at once, near zero and flat: a tendon cannot push.
    """
    slack = _on_the_floor(input_N) & _on_the_floor(output_N)
    return slack if slack.sum() >= max(LEAST_ROWS, LEAST_SHARE * len(slack)) else None


def _on_the_floor(x: Array) -> Mask:
    """Samples within the noise of the lowest readings, where these are near zero and last."""
    low, high = np.percentile(x, [0.5, 99.5])  # without spikes
    width = FLAT_SIGMAS * max(noise_of(x), LEAST_NOISE * (high - low))
    if abs(low) > NEAR_SHARE * (high - low) + width:
        return np.zeros(len(x), dtype=bool)
    level = float(np.median(x[np.abs(x - low) < width]))
    return np.asarray(np.abs(x - level) < width)


def switched_on_s(time_s: Array, input_N: Array, output_N: Array) -> float:
    """Length of the start that shows a load being switched on [s]; 0 where there is none.

    The jump is seen at sampling rates up to some 1 kHz, where it takes a row or two, and in records, shape (n,), of at
    least 4 s.
    """
    start = time_s < time_s[0] + LONGEST_S
    count = int(start.sum())
    if count <= 4 * FIRST_ROWS or len(time_s) < 4 * count:
        return 0.0
    change = np.abs(np.diff(output_N))
    row = int(np.argmax(change[:FIRST_ROWS]))
    jump, pushed = float(change[row]), float(np.ptp(input_N[: row + 2]))
    stays = abs(float(np.median(output_N[2 * FIRST_ROWS : count])) - float(output_N[0])) > jump / 2
    if jump <= JUMP_SHARE * float(np.ptp(output_N[~start])) or pushed >= JUMP_SHARE * jump or not stays:
        return 0.0
    loud = np.append(time_s[1 : count + 1][change[:count] > RUNG_DOWN * jump], time_s[0] + LONGEST_S)
    pauses = np.flatnonzero(np.diff(loud) > QUIET_S)
    over = float(loud[pauses[0]] if len(pauses) else loud[-1]) - float(time_s[0])
    return min(ROOM * over, LONGEST_S)
