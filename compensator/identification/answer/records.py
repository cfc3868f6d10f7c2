"""Records of what an identification compared: laws, effects, files, and channels of files, measured and by the law."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.reading import Finding

ELONGATION = "relaxation"
"""Figure of the tendon's elongation."""

Numbers = Mapping[str, float | Mapping[str, float | None]]


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateLaw:
    """Compared law.

    Attributes
    ----------
    name : str
        Name of the law.
    stage : str
        "static" or "dynamic".
    free_values : int
        Number of values that were fitted.
    fit_percent, validation_percent : float
        RMS error in percent of the range of the explained channel.
    chosen : bool
        Whether it is the law of the fit.
    """

    name: str
    stage: str
    free_values: int
    fit_percent: float
    validation_percent: float
    chosen: bool

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        percents = (self.fit_percent, self.validation_percent)
        fit, validation = (percent if math.isfinite(percent) else None for percent in percents)
        return {
            "name": self.name,
            "stage": self.stage,
            "free_values": self.free_values,
            "fit_percent_of_range": fit,
            "validation_percent_of_range": validation,
            "chosen": self.chosen,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """An effect that a law was tried with.

    Attributes
    ----------
    name : str
    gain_of_log_likelihood : float
        What it promised.
    taken_up : bool
        The law has it.
    """

    name: str
    gain_of_log_likelihood: float
    taken_up: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class FileResult:
    """Measured file.

    Attributes
    ----------
    name, role : str
        Of the file; "fit" or "validate".
    numbers : mapping of str to (float or mapping of str to (float or None))
        Errors of the chosen law on it, and what holds for this file alone, by their keys in `fit.json`: one number, or
        those of motors, joints or tendons by name.
    findings : tuple of Finding
        Data issues in it.
    """

    name: str
    role: str
    numbers: Numbers
    findings: tuple[Finding, ...]

    def named(self, key: str) -> Mapping[str, float | None]:
        """Numbers of motors, joints or tendons; empty where there are none."""
        found = self.numbers.get(key, {})
        return found if isinstance(found, Mapping) else {}

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        numbers = {key: dict(value) if isinstance(value, Mapping) else value for key, value in self.numbers.items()}
        findings = [
            {"kind": str(f.issue), "count": f.count, "times_s": list(f.times_s), "text": f.text} for f in self.findings
        ]
        return {"name": self.name, "role": self.role, **numbers, "findings": findings}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Channel:
    """A channel of a file, or of a piece of it, measured and by the law.

    Attributes
    ----------
    figure : str
        Figure that shows it.
    file, role : str
        Name of the file; "fit" or "validate".
    name, unit : str
        Of the channel.
    time_s, measured, model : Array
        Shape (n,).
    over : Array, optional
        Shape (n,); what drives the law, the abscissa of a loop.
    over_name, over_unit : str
    turned : bool
        A loop has the channel on its abscissa.
    band : tuple of Array, optional
        Shape (n,); ends of the law's 95 % band.
    percent : float, optional
        RMS error in % of the channel's range where not all rows count.
    """

    figure: str
    file: str
    role: str
    name: str
    unit: str
    time_s: Array
    measured: Array
    model: Array
    over: Array | None = None
    over_name: str = ""
    over_unit: str = ""
    turned: bool = False
    band: tuple[Array, Array] | None = None
    percent: float | None = None

    @property
    def label(self) -> str:
        """Channel and unit."""
        return f"{self.name} [{self.unit}]"

    @property
    def over_label(self) -> str:
        """Cause that drives the law, and its unit."""
        return f"{self.over_name} [{self.over_unit}]"

    @property
    def title(self) -> str:
        """File and role."""
        return f"{self.file} ({'validation' if self.role == 'validate' else 'fitted'})"


def shown(channels: Sequence[Channel], most: int) -> list[Channel]:
    """The channels of a figure: of the first files, those that judge before the others, the longest piece of each."""
    longest: dict[tuple[str, str], Channel] = {}
    for each in sorted(channels, key=lambda c: (c.role != "validate", c.file)):
        before = longest.get(place := (each.file, each.name))
        if before is None or len(each.time_s) > len(before.time_s):
            longest[place] = each
    a_file = max(1, len({name for _, name in longest}))
    files = list(dict.fromkeys(file for file, _ in longest))[: max(1, most // a_file)]
    return [each for each in longest.values() if each.file in files]
