"""What a comparison holds."""

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
    """One compensator, designed on one level, simulated on one plant."""

    compensator: str  # its name
    design_level: Level  # repeats for a compensator that does not depend on it
    plant_level: str  # a `Level`, or "capstan" for the static law
    # rmse_percent_of_range, peak_error_N: of a simulation with a quarter of the step
    rmse_percent_of_range: float
    peak_error_N: float
    lag_s: float  # delay of the output against the reference [s]; negative when it leads
    # largest RMS difference to simulations with half the step, the whole step, and a force that differs in the ninth
    # digit, which stands for a solver's tolerance [% of range]. Errors that differ by less are equal
    spread_percent_of_range: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonData:
    """All compensators on all levels."""

    scenario: Scenario
    reference: Reference
    compensators: tuple[Compensator, ...]  # in the order in which they are shown
    entries: tuple[Entry, ...]  # compensator by compensator, design level by design level, plant by plant
    # shape (n,); delivered tension by name of the compensator, design level and plant, at the rows of the reference [N]
    outputs_N: dict[tuple[str, Level, str], FloatArray]
    traits: dict[str, LevelTraits]  # what each level and the static law do differently
    costs: dict[str, LevelCost]
    # errors of each design over what may be the real transmission, on the most detailed level
    bands: dict[tuple[str, Level], ErrorBand]
    expectation: Expectation  # of the designs on the recommended level
    recommended_level: Level
    recommendation: str  # one sentence
    ignored: IgnoredMotion | None  # what it would cost to ignore that joints move; None where none does
    warnings: tuple[str, ...]

    @property
    def headline(self) -> str:
        """What to expect on a rig of the best design on the recommended level, and what to do next."""
        best = next(c for c in self.compensators if c.name == self.expectation.recommended)
        return self.expectation.headline(best.label, f"tendonff design {self.scenario.source.name} --out out")

    def entry(self, name: str, design_level: Level, plant_level: str) -> Entry:
        """One cell of the matrix."""
        wanted = (name, design_level, plant_level)
        return next(e for e in self.entries if (e.compensator, e.design_level, e.plant_level) == wanted)
