"""An estimate: the record of one number that was looked for, with its unit, interval, and what identifies it."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tendonff.compensator.identification.constants import TUNED

EXPONENTS = {"mu_dynamic": "mu_theta", "mu_dynamic_release": "mu_theta_release"}
"""Friction as ln(T_in/T_out) in gross sliding, which follows from the coefficients."""

_UNIT = r"(?:N|m|s|rad|kg|A|Hz)"
_UNIT_AT_END = re.compile(rf"_({_UNIT}(?:_{_UNIT})*)(?:_per_({_UNIT}(?:_{_UNIT})*))?$")
_SHORT = 30  # characters of a reason that is shorter than a reference to another row


def unit_of(name: str) -> str:
    """Unit that a name ends in, "-" where there is none."""
    found = _UNIT_AT_END.search(name)
    if found is None:
        return "-"
    over, under = (None if part is None else part.replace("_", " ") for part in found.groups())
    return f"{over}" if under is None else f"{over}/({under})" if " " in under else f"{over}/{under}"


def is_known(standard_error: float, size: float) -> bool:
    """Whether a value of a size is identifiable; what is not a number is not."""
    return standard_error < TUNED.identifiable_share * size


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Estimated value.

    Attributes
    ----------
    name : str
        Key of the scenario file, or what it is; it ends in its unit.
    value : float
        Estimate; the scenario's value where it was not fitted.
    standard_error, interval : float or None
        95 %; None where it was not fitted or is not identifiable.
    identifiable : bool
        Whether the data identify it separately.
    why : str
        Where the value comes from, or why the data do not identify it and which experiment would.
    scenario : float or None
        The scenario's own value.
    fitted : bool
        The value is the joint estimate, which fitted.toml has.
    note : str
        What the value belongs to, where its name does not tell.
    interval_as_measured : tuple of float, optional
        Interval of a force or torque if the torque constant is right, by which all of them are off alike; None where
        it is `interval`.
    """

    name: str
    value: float
    standard_error: float | None = None
    interval: tuple[float, float] | None = None
    identifiable: bool = False
    why: str
    scenario: float | None = None
    fitted: bool = False
    note: str = ""
    interval_as_measured: tuple[float, float] | None = None

    @property
    def unit(self) -> str:
        """Of the value."""
        return unit_of(self.name)

    @property
    def own_half_width(self) -> float | None:
        """Half of the interval over the value, apart from the torque constant; None without an interval."""
        interval = self.interval_as_measured or self.interval
        return None if interval is None or not self.value else (interval[1] - interval[0]) / 2 / abs(self.value)

    @property
    def relative(self) -> float:
        """Half of the interval over the value; infinite without an interval."""
        if self.interval is None or not self.value:
            return math.inf
        return (self.interval[1] - self.interval[0]) / 2 / abs(self.value)

    @property
    def standing(self) -> str:
        """Whether the data identify it: yes, doubtful where it is fitted with the others alone, or no."""
        return "yes" if self.identifiable else "doubtful" if self.fitted else "no"

    @property
    def advice(self) -> str:
        """Measurement to add, where the reason ends with it."""
        return self.why.rpartition("; ")[2] if "; " in self.why and not self.identifiable else ""

    @property
    def reason(self) -> str:
        """Why, and what the value belongs to."""
        return f"{self.why}; {self.note}" if self.note else self.why

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "estimate": self.value,
            "unit": self.unit,
            "standard_error": self.standard_error,
            "interval_95": None if self.interval is None else list(self.interval),
            "identifiable": self.identifiable,
            "fitted": self.fitted,
            "why": self.reason,
            "scenario": self.scenario,
        }


def reasons_of(estimates: Sequence[Estimate]) -> list[str]:
    """Reasons for a column: what all stands in an earlier row already is a reference to that."""
    found, said = list[str](), dict[str, str]()
    for each in estimates:
        parts = each.reason.replace(each.name, "it").split("; ")
        first = said.get(parts[-1])
        again = first is not None and len(each.reason) > _SHORT and all(part in said for part in parts)
        found.append(f"as {first}" if again else each.reason)
        said = dict.fromkeys(parts, each.name) | said
    return found
