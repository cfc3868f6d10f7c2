"""Result of `table`."""

from dataclasses import dataclass

from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.score import Score
from tendonff.compensator.compensators.table import BuiltTable
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level

FORMULA = (
    "(force_N + adhesion_N)/(reference_N + adhesion_N) = bilinear(reference_N, share); "
    "share = tension_since_reversal_N/(reference_N + adhesion_N); "
    "tension_since_reversal_N = abs(reference_N - turn_N); "
    "branch = pull while the reference rises, release while it falls; "
    "at a reversal turn_N is set so that the force goes on without a jump (out of full slip: the reference there); "
    "beyond the last share the force of the last share holds"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleTable:
    """A table for one wrap angle and rate.

    Attributes
    ----------
    built : BuiltTable
        The table and how good it is.
    total_angle_rad : float
        Wrap angle [rad].
    """

    built: BuiltTable
    total_angle_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TablesData:
    """Tables of a scenario: the first for its own wrap angle and rate, or for the requested axes.

    `Tables` documents its fields.
    """

    scenario: Scenario
    level: Level
    reference: Reference
    tables: tuple[AngleTable, ...]
    axes: tuple[str, ...]
    scores: dict[Level, Score]
    expectation: Expectation
    options: str
    warnings: tuple[str, ...]
    harm: tuple[str, ...] = ()

    @property
    def headline(self) -> str:
        """Expected error on a rig, in one sentence."""
        return self.expectation.headline(
            "compensation table", f"tendonff export-c {as_argument(self.scenario.source)} --out c"
        )
