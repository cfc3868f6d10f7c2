"""Result of a comparison."""

from dataclasses import dataclass
from typing import Literal

from tendonff.compensator.compare.levels import LevelCost, LevelTraits
from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.compensators.expectation import ErrorBand, Expectation
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import IgnoredMotion
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level

CAPSTAN_PLANT: Literal["capstan"] = "capstan"  # name of the static law as a plant
PLANTS = (*(level.value for level in Level), CAPSTAN_PLANT)  # names of the plants: the levels, then the static law

ENOUGH_PERCENT = 0.5
"""A simpler level is enough if its design costs no more than this on the most detailed plant [% of range]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """Compensator, designed on a level and simulated on a plant.

    Attributes
    ----------
    compensator : str
        Its name.
    design_level : Level
        Repeats for a compensator that does not depend on it.
    plant_level : str
        A `Level`, or "capstan" for the static law.
    rmse_percent_of_range, peak_error_N : float
        Of a simulation with a quarter of the step.
    lag_s : float
        Delay of the output against the reference [s]; negative when it leads.
    spread_percent_of_range : float
        Largest RMS difference to simulations with half the step, the whole step, and a force that differs in the ninth
        digit, which represents a solver's tolerance [% of range]. Errors that differ by less are equal.
    """

    compensator: str
    design_level: Level
    plant_level: str
    rmse_percent_of_range: float
    peak_error_N: float
    lag_s: float
    spread_percent_of_range: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonData:
    """All compensators on all levels.

    Attributes
    ----------
    scenario : Scenario
        The scenario it was made for.
    reference : Reference
        What was to be delivered, sampled.
    compensators : tuple of Compensator
        In the order in which they are shown.
    entries : tuple of Entry
        Compensator by compensator, design level by design level, plant by plant.
    outputs_N : dict of tuple[str, Level, str] to numpy.ndarray
        Shape (n,); delivered tension by name of the compensator, design level and plant, at the rows of the reference
        [N].
    traits : dict of str to LevelTraits
        What each level and the static law do differently.
    costs : dict of str to LevelCost
        What each level and the static law cost, by name.
    bands : dict of tuple[str, Level] to ErrorBand
        Errors of each design over what may be the real transmission, on the most detailed level.
    expectation : Expectation
        Of the designs on the recommended level.
    recommended_level : Level
        Simplest level that is good enough on the most detailed plant.
    recommendation : str
        One sentence.
    ignored : IgnoredMotion or None
        What it would cost to ignore that joints move; None where none does.
    warnings : tuple of str
        What the user should know before relying on it, one sentence each.
    """

    scenario: Scenario
    reference: Reference
    compensators: tuple[Compensator, ...]
    entries: tuple[Entry, ...]
    outputs_N: dict[tuple[str, Level, str], FloatArray]
    traits: dict[str, LevelTraits]
    costs: dict[str, LevelCost]
    bands: dict[tuple[str, Level], ErrorBand]
    expectation: Expectation
    recommended_level: Level
    recommendation: str
    ignored: IgnoredMotion | None
    warnings: tuple[str, ...]

    @property
    def headline(self) -> str:
        """Expected error on a rig of the best design on the recommended level, and the next command."""
        best = next(c for c in self.compensators if c.name == self.expectation.recommended)
        return self.expectation.headline(best.label, f"tendonff design {self.scenario.source.name} --out out")

    def entry(self, name: str, design_level: Level, plant_level: str) -> Entry:
        """Cell of the matrix."""
        wanted = (name, design_level, plant_level)
        return next(e for e in self.entries if (e.compensator, e.design_level, e.plant_level) == wanted)
