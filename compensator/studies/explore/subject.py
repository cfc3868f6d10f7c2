"""Subject of the interactive page: knobs, curves and panels of a scenario, and the design for the knobs' values."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import Score
from tendonff.compensator.reporting.colours import Style


@dataclass(frozen=True, slots=True, kw_only=True)
class Knob:
    """Slider of the page.

    Attributes
    ----------
    key, title : str
    value : float
        Where it starts.
    start, end, step : float
        Its range; of a logarithmic one `start` and `end` are in decades about the value.
    shown : str
        Format of its number.
    is_logarithmic : bool
    """

    key: str
    title: str
    value: float
    start: float
    end: float
    step: float = 0.01
    shown: str = "0.000"
    is_logarithmic: bool = False

    @classmethod
    def decades(cls, key: str, title: str, value: float, decades: float) -> "Knob":
        """A logarithmic one, so many decades either way."""
        return cls(key=key, title=title, value=value, start=-decades, end=decades, is_logarithmic=True)


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


class Subject(ABC):
    """A scenario to be explored.

    Attributes
    ----------
    name, file : str
        Of the scenario.
    knobs : tuple of Knob
    panels : mapping of str to Panel
        "loop" has the legend, "output" the reference.
    fast, slow : tuple of Curve
        Those that follow a slider, and those that come when they are asked for.
    """

    name: str
    file: str
    knobs: tuple[Knob, ...]
    panels: Mapping[str, Panel]
    fast: tuple[Curve, ...]
    slow: tuple[Curve, ...]

    @abstractmethod
    def explore(self, values: Mapping[str, float], *, design_knows: bool, curves: Sequence[Curve]) -> Exploration:
        """Design and simulate with the knobs at these values; TendonffError where that is infeasible."""

    @abstractmethod
    def worst_case(self, values: Mapping[str, float], *, design_knows: bool) -> str:
        """Expected error of the fast curves over the scenario's uncertainty."""

    @abstractmethod
    def toml(self, values: Mapping[str, float]) -> str:
        """Scenario file with these values; empty where there is none."""
