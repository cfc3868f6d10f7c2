"""Result of a comparison of levels for a tension."""

import os
from dataclasses import dataclass
from typing import Literal

from tendonff.compensator.compensators.score import IgnoredMotion
from tendonff.compensator.reporting.results import views_of
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.studies.compare.levels import LevelCost, LevelTraits
from tendonff.compensator.studies.compare.matrix import MatrixData
from tendonff.models.fidelity import Level

CAPSTAN_PLANT: Literal["capstan"] = "capstan"  # name of the capstan law as a plant
PLANTS = (*(level.value for level in Level), CAPSTAN_PLANT)  # names of the plants: the levels, then the capstan law


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Comparison(MatrixData):
    """All compensators on all levels.

    Attributes
    ----------
    scenario : Scenario
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
    reference : Reference
        Desired tension, sampled.
    traits : dict of str to LevelTraits
        Differences between the levels and the capstan law.
    costs : dict of str to LevelCost
        Cost of each level and the capstan law, by name.
    ignored : IgnoredMotion or None
        Error if the motion of joints is ignored; None where none does.
    """

    scenario: Scenario
    reference: Reference
    traits: dict[str, LevelTraits]
    costs: dict[str, LevelCost]
    ignored: IgnoredMotion | None

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `matrix.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder."""
        views_of(Comparison).write(self, folder, pdf=pdf)
