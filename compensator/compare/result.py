"""Result of a comparison of levels for a tension."""

from dataclasses import dataclass
from typing import Literal

from tendonff.compensator.compare.levels import LevelCost, LevelTraits
from tendonff.compensator.compare.matrix import MatrixData
from tendonff.compensator.compensators.score import IgnoredMotion
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level

CAPSTAN_PLANT: Literal["capstan"] = "capstan"  # name of the static law as a plant
PLANTS = (*(level.value for level in Level), CAPSTAN_PLANT)  # names of the plants: the levels, then the static law


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonData(MatrixData):
    """All compensators on all levels.

    Attributes
    ----------
    scenario : Scenario
        The scenario it was made for.
    reference : Reference
        What was to be delivered, sampled.
    traits : dict of str to LevelTraits
        What each level and the static law do differently.
    costs : dict of str to LevelCost
        What each level and the static law cost, by name.
    ignored : IgnoredMotion or None
        What it would cost to ignore that joints move; None where none does.
    """

    scenario: Scenario
    reference: Reference
    traits: dict[str, LevelTraits]
    costs: dict[str, LevelCost]
    ignored: IgnoredMotion | None
