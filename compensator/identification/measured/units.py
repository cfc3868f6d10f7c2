"""Units that the names of columns tell, and magnitudes that do not fit the scenario: what was read as N may be none."""

import re
from collections.abc import Sequence

from tendonff.compensator.scenario.measurement import Measurement

_FORCES = ("Nm", "mNm", "kN", "mN", "lbf", "lb", "kg", "V", "mV", "mA")
_LENGTHS = ("rad", "deg", "mm", "cm", "um", "counts")
OTHERS = {
    "time": ("s", ("ms", "us")),
    "input": ("N", _FORCES),
    "output": ("N", _FORCES),
    "input_position": ("m", _LENGTHS),
    "output_position": ("m", _LENGTHS),
    "actuator_force": ("N", _FORCES),
}
"""For each column the unit it is read in, and last words of names that tell another one; `A`, `g` and `in` may as well
name a place."""

MOST_ABOVE, MOST_BELOW = 20.0, 400.0
"""A largest tension so many times above, or below, what the actuator can do is in another unit or of another rig."""


def unit_warning(how: Measurement, positions: Sequence[str]) -> str:
    """Columns, of positions those in `positions`, whose names tell another unit than they are read in; else empty."""
    found = []
    for key, (unit, others) in OTHERS.items():
        name, scale = getattr(how, f"{key}_column"), getattr(how, f"{key}_scale")
        if name is None or (scale or 1) != 1 or (key.endswith("position") and key not in positions):
            continue
        word = re.split(r"[^A-Za-z]+", name.rstrip(" ])"))[-1]
        if word in others:
            found.append(f"{name} as {unit} (--scale {key}=FACTOR)")
    if not found:
        return ""
    return (
        f"read without a factor: {', '.join(found)}; estimates with N and m in their names are then in the file's own "
        "units. A torque over the drum's radius is a tension, an angle times it a position"
    )


def magnitude_warning(largest_N: float, force_max_N: float) -> str:
    """What to say where the measured tensions are far from what the scenario's actuator can do; else empty."""
    if force_max_N / MOST_BELOW <= largest_N <= force_max_N * MOST_ABOVE:
        return ""
    return (
        f"the measured tensions reach {largest_N:.3g} N, the scenario's actuator {force_max_N:.3g} N: is this its rig, "
        "and the unit N (--scale)? Masses, load and limits are the scenario's; no excitation is suggested"
    )
