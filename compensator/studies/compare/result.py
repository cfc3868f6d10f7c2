"""Result of a comparison of levels."""

import math
import os
from dataclasses import dataclass, field
from typing import ClassVar

from tendonff.compensator.compensators.expectation import ErrorBand, Expectation
from tendonff.compensator.compensators.ignored import IgnoredMotion
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.reporting.results import Result
from tendonff.compensator.scenario.document import Document
from tendonff.compensator.scenario.unit import Unit
from tendonff.compensator.studies.compare.levels import LevelTraits
from tendonff.compensator.studies.compare.matrix import Designed, Entry
from tendonff.models.fidelity import Level


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Comparison(Result):
    """All compensators on all levels.

    Attributes
    ----------
    scenario : Scenario, JointScenario or FingerScenario
        The scenario it was made for.
    time_s, wanted : numpy.ndarray, shape (n,)
        Reference.
    unit : Unit
        Of the reference and its errors.
    plants : tuple of str
        Names of the plants.
    static : str
        Name of the compensator by the capstan law.
    compensators : tuple of Designed
        In the order in which they are shown.
    entries : tuple of Entry
        Compensator by compensator, design level by design level, plant by plant.
    outputs : dict of tuple[str, Level, str] to numpy.ndarray
        Shape (n,); what is delivered by name of the compensator, design level and plant, at the rows of the reference.
    bands : dict of tuple[str, Level] to ErrorBand
        Errors of each design over what may be the real system, on the most detailed level.
    expectation : Expectation
        Of the designs on the recommended level.
    recommended_level : Level
        Simplest level that is good enough on the most detailed plant.
    recommendation : str
        One sentence.
    warnings : tuple of str
        What the user should know before relying on it, one sentence each.
    traits : dict of str to LevelTraits
        Differences between the levels and the capstan law; empty where there is more than one tendon.
    initial_tension_N : float
        Tension before the start, around which small changes are shown [N].
    ignored : IgnoredMotion or None
        Error if the motion of joints on the path is ignored; None where none does.
    """

    shown_by: ClassVar[str] = "studies.compare.output"

    scenario: Document
    time_s: FloatArray
    wanted: FloatArray
    unit: Unit
    plants: tuple[str, ...]
    static: str
    compensators: tuple[Designed, ...]
    entries: tuple[Entry, ...]
    outputs: dict[tuple[str, Level, str], FloatArray]
    bands: dict[tuple[str, Level], ErrorBand]
    expectation: Expectation
    recommended_level: Level
    recommendation: str
    warnings: tuple[str, ...]
    traits: dict[str, LevelTraits] = field(default_factory=dict)
    initial_tension_N: float = math.nan
    ignored: IgnoredMotion | None = None

    @property
    def headline(self) -> str:
        """Expected error on a rig of the best design on the recommended level, and the next command."""
        best = next(c for c in self.compensators if c.name == self.expectation.recommended)
        file = as_argument(self.scenario.source)
        then = next_step(self.expectation, file, f"tendonff design {file} --out out")
        return self.expectation.headline(best.label, then)

    def entry(self, name: str, design_level: Level, plant_level: str) -> Entry:
        """Cell of the matrix."""
        wanted = (name, design_level, plant_level)
        return next(e for e in self.entries if (e.compensator, e.design_level, e.plant_level) == wanted)

    @property
    def rows(self) -> list[tuple[str, list[Entry]]]:
        """Rows by label, without the repetitions of what does not depend on the design level."""
        first = next(iter(Level))
        found = []
        for each in self.compensators:
            for level in tuple(Level) if each.knows_the_level else (first,):
                label = f"{each.name}, {level}" if each.knows_the_level else each.name
                found.append((label, [self.entry(each.name, level, plant) for plant in self.plants]))
        return found

    @property
    def exact(self) -> str:
        """Compensator whose designs on each level are drawn over time: the exact inverse, or the first with a model."""
        names = [c.name for c in self.compensators if c.knows_the_level]
        return "inverse" if "inverse" in names else names[-1]

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `matrix.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder."""
        self._views.write(self, folder, pdf=pdf)
