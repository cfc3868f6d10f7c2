"""Content of the interactive page: panels, curves, and their courses."""

from collections.abc import Mapping
from dataclasses import dataclass

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import Score
from tendonff.compensator.reporting.colours import Style


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """Panel of the page: two columns of a curve, "time", "given", "output" or "error", against each other."""

    title: str
    x: str
    y: str
    x_label: str
    y_label: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Curve that the page can show."""

    name: str
    label: str
    style: Style


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """Curves of a compensator over time, thinned for the screen, in the units of the panels."""

    # time_s [s], given (to the actuator), output, error: shape (n,)
    time_s: FloatArray
    given: FloatArray
    output: FloatArray
    error: FloatArray
    score: Score  # of all rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Exploration:
    """Scenario with a few parameters changed."""

    time_s: FloatArray
    wanted: FloatArray  # reference at these times, in the unit of the panels
    courses: Mapping[str, Course]  # by name of the compensator
    notes: tuple[str, ...]  # what the reader should know, such as a slack tendon


MOST_POINTS = 1500
"""Rows of a curve on the screen."""
