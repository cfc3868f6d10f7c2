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
    """All compensators on all levels. `Comparison` documents its fields."""

    scenario: Scenario
    reference: Reference
    traits: dict[str, LevelTraits]
    costs: dict[str, LevelCost]
    ignored: IgnoredMotion | None
