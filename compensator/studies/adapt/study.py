"""Study of a compensator that tunes itself: plants that differ from the scenario are tried one after the other.

What is tuned differs by physics. `tension` estimates friction, and stiffness beside it, along the chain of one tendon,
from what the far end or the actuator does; `loop` one factor of the lost motion between a motor and its joint, from an
encoder there, in which friction, pre-tension and stiffness are not separate. Plants and schemes differ with it.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.compensators.every import AnyScenario
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.results import Result
from tendonff.models.turns import in_turn


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class AdaptationStudy(Result):
    """Self-tuning on every plant of a study.

    Attributes
    ----------
    scenario : Scenario or JointScenario
        The scenario it was made for.
    cases : tuple
        Every plant, `variation` naming what differs.
    headline : str
        One sentence.
    warnings : tuple of str
        What the user should know.
    """

    scenario: Any
    cases: tuple[Any, ...]
    headline: str
    warnings: tuple[str, ...]

    @property
    def lines(self) -> tuple[str, ...]:
        """The finding in words."""
        return (self.headline,)

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `estimate.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder."""
        self._views.write(self, folder, pdf=pdf)


class Trials(ABC):
    """Plants of a study, and what is tried on each.

    Attributes
    ----------
    variations : sequence
        Plants that differ from the scenario.
    """

    variations: Sequence[Any]

    @classmethod
    @abstractmethod
    def of(cls, scenario: Any) -> Self:
        """The trials of a scenario; InputError where it has nothing to tune."""

    @abstractmethod
    def case(self, one: Any) -> Any:
        """A plant with every scheme."""

    @abstractmethod
    def study(self, cases: Sequence[Any]) -> AdaptationStudy:
        """The study of all plants."""

    @classmethod
    @in_turn
    def run(cls, scenario: AnyScenario, *, progress: Progress = silent) -> AdaptationStudy:
        """Try the self-tuning compensator on plants that differ; arguments and errors as of `tendonff.adapt`."""
        trials = cls.of(scenario)
        cases: list[Any] = []
        for one in trials.variations:  # one after the other: CasADi's symbols are not safe in threads
            cases.append(trials.case(one))
            progress(len(cases), len(trials.variations))
        return trials.study(cases)


def there_and_back(once: int, rows: int) -> NDArray[np.int_]:
    """Rows of a reference of so many that goes forwards and backwards until it is long enough, shape (rows,)."""
    if once == 1:
        return np.zeros(rows, dtype=int)
    there = np.arange(rows) % (2 * once - 2)
    return np.minimum(there, 2 * once - 2 - there)
