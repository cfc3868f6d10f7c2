"""Task of a feedback: a scenario's goals, mechanisms and feedforward, whatever is driven."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.scenario.settings import Feedback
from tendonff.compensator.scenario.unit import Unit
from tendonff.ocp.feedback.closed_loop import Course
from tendonff.ocp.feedback.system import FeedbackSystem


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackTask(ABC):
    """A feedback to design.

    Attributes
    ----------
    settings : Feedback
    file : str
        Name of the scenario, for messages.
    names : tuple of str
        Of the goals.
    unit : Unit
        Of the goals.
    seen_unit, command_unit : str
        Of what the loops compare, and of the corrections.
    doubt : Doubt
        Mechanisms that may be the real one.
    masses : int
        Of each tendon of the mechanisms that the loops are judged on.
    feedforward, alone : Course
        With the exact inverse, and with the commands of a controller without a friction model.
    scored : slice
        Rows whose errors count.
    """

    settings: Feedback
    file: str
    names: tuple[str, ...]
    unit: Unit
    seen_unit: str
    command_unit: str
    doubt: Doubt[Any]
    masses: int
    feedforward: Course
    alone: Course
    scored: slice

    @abstractmethod
    def system(self, mechanism: Any, masses: int | None = None) -> FeedbackSystem:
        """The loops about a mechanism, with so many masses on each tendon; default: the paths' own."""

    @abstractmethod
    def followed(self, mechanism: Any) -> Course:
        """The motion of a mechanism that follows the reference, as feedback makes it: under its own exact inverse."""

    @property
    def limit(self) -> float | None:
        """Largest correction [unit of the engine's commands]; None where none is stated."""
        return self.settings.limit

    @property
    def sample_s(self) -> float:
        """Time between two calls of the controller [s]."""
        return self.settings.sample_s or self.feedforward.step_s
