"""Units that the names of columns tell, and magnitudes that do not fit the scenario: what was read as N may be none."""

import re
from collections.abc import Sequence

from tendonff.compensator.settings.measurement import Measurement

EXPECTED = {
    "time": ("s", "sec", "seconds"),
    "input": ("N", "newton"),
    "output": ("N", "newton"),
    "input_position": ("m", "metre", "meter"),
    "output_position": ("m", "metre", "meter"),
}
OTHERS = {
    "time": ("ms", "us", "min", "h"),
    "input": ("Nm", "mNm", "kN", "mN", "lbf", "lb", "kg", "g", "V", "mV", "A", "mA"),
    "output": ("Nm", "mNm", "kN", "mN", "lbf", "lb", "kg", "g", "V", "mV", "A", "mA"),
    "input_position": ("rad", "deg", "mm", "cm", "um", "in", "counts"),
    "output_position": ("rad", "deg", "mm", "cm", "um", "in", "counts"),
}
"""Last words of column names that tell another unit than the one expected."""

MOST_APART = 20.0
"""A measured tension so many times above or below what the scenario knows is in another unit or of another rig."""


def unit_warnings(how: Measurement, positions: Sequence[str]) -> list[str]:
    """Columns whose names tell another unit than the one they are read in.

    Parameters
    ----------
    how : Measurement
    positions : sequence of str
        Those of "input_position" and "output_position" that were read.
    """
    found = []
    for key, others in OTHERS.items():
        name, scale = getattr(how, f"{key}_column"), getattr(how, f"{key}_scale")
        if scale != 1 or (key.endswith("position") and key not in positions):
            continue
        word = re.split(r"[^A-Za-z]+", name.rstrip(" ])"))[-1]
        if word in others:
            found.append(f"{name} as {EXPECTED[key][0]} (--scale {key}=FACTOR)")
    if not found:
        return []
    message = (
        f"read without a factor: {', '.join(found)}; estimates with N and m in their names are then in the file's own "
        "units. A torque over the drum's radius is a tension, an angle times it a position"
    )
    return [message]


def magnitude_warning(largest_N: float, low_N: float, high_N: float) -> str | None:
    """What to say where the measured tensions are far from those of the scenario.

    Parameters
    ----------
    largest_N : float
        Largest measured tension.
    low_N, high_N : float
        Smallest and largest tension that the scenario speaks of.
    """
    if low_N / MOST_APART <= largest_N <= high_N * MOST_APART:
        return None
    return (
        f"the measured tensions reach {largest_N:.3g}, the scenario speaks of {low_N:.3g} to {high_N:.3g} N: is this "
        "its rig, and the unit N (--scale)? Masses, load and limits are the scenario's; no excitation is suggested"
    )
