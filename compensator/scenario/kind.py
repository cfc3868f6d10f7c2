"""Kinds of scenario."""

from enum import StrEnum
from typing import Any


class Kind(StrEnum):
    """Kind of a scenario file; the reader knows it by the tables of the file."""

    TENSION = "tension of one tendon"
    JOINT = "driven joint"
    FINGER = "several driven joints"


def in_short(scenario: Any) -> str:
    """`repr` of a scenario: its name, its file and how it is computed."""
    run = scenario.run
    kind = type(scenario).__name__
    return f"<{kind} {scenario.name!r} of {scenario.source.name}: {run.level} level, {run.step_s:g} s a step>"
