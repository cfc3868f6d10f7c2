"""A load that is switched on as the recording starts: the jump of the output that nothing at the input explains."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FIRST_ROWS = 5
"""The jump lies between two of so many first rows."""

LONGEST_S = 1.0
"""Ringing is looked for in so much of the start; what comes later says how large and how quick the output is."""

JUMP_SHARE, INPUT_SHARE = 0.5, 0.5
"""The jump is larger than the first share of the output's later range; the input moves by less than the second share
of it. Driven from the input end, the output moves no more than the input, times e^{mu theta} when released."""

RUNG_DOWN, QUIET_S = 0.05, 0.1
"""Ringing is over when for so long no row differs from the next by more than this share of the jump."""

ROOM = 2.0
"""What is left out, in units of the time until the ringing is over: its tail is slower than its rows show."""


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
    if jump <= JUMP_SHARE * float(np.ptp(output_N[~start])) or pushed >= INPUT_SHARE * jump or not stays:
        return 0.0
    loud = np.append(time_s[1 : count + 1][change[:count] > RUNG_DOWN * jump], time_s[0] + LONGEST_S)
    pauses = np.flatnonzero(np.diff(loud) > QUIET_S)
    over = float(loud[pauses[0]] if len(pauses) else loud[-1]) - float(time_s[0])
    return min(ROOM * over, LONGEST_S)
