"""Result of `table`."""

import os
from dataclasses import dataclass
from typing import ClassVar

from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.score import Score
from tendonff.compensator.compensators.table import BuiltTable
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.reporting.results import Result
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


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Tables(Result):
    """Tables of a scenario: the first for its own wrap angle and rate, or for the requested axes.

    Attributes
    ----------
    scenario : Scenario
        The scenario it was made for.
    level : Level
        Fidelity level of the sweeps.
    reference : Reference
        What was to be delivered, sampled.
    tables : tuple of AngleTable
        One for each wrap angle and rate.
    axes : tuple of str
        Further columns of the file.
    scores : dict of Level to Score
        What the scenario's own table delivers on each level, within the actuator's limits.
    expectation : Expectation
        Of "table" beside "none" and "frictionless", over what may be the real transmission.
    options : str
        Options of the command that would make the same, for the report.
    warnings : tuple of str
        What the user should know.
    harm : tuple of str
        Why the table must not be used as it is: its error is above that of no compensation.
    """

    shown_by: ClassVar[str] = "studies.tables.output"

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
        file = as_argument(self.scenario.source)
        then = next_step(self.expectation, file, f"tendonff export-c {file} --out c")
        return self.expectation.headline("compensation table", then)

    @property
    def nodes(self) -> int:
        """Of the largest table."""
        return max(made.built.table.nodes for made in self.tables)

    @property
    def lines(self) -> tuple[str, ...]:
        """The finding in words, and the size of the table."""
        built, own = self.tables[0].built, self.scores[self.level]
        size = (
            f"{sum(made.built.table.nodes for made in self.tables)} nodes, interpolation error {built.error_N:.3g} N "
            f"(bound {built.bound_N:.3g} N); RMS error with exactly the scenario's parameters on level {self.level}: "
            f"{own.rmse_percent_of_range:.2g} % of range"
        )
        return self.headline, size

    def write(self, folder: str | os.PathLike[str], *, prefix: str = "tff", pdf: bool = False) -> None:
        """Write `table.csv`, `table.json`, `table.h`, a figure and `report.html`, all or nothing; makes the folder.

        The names in `table.h` begin with `prefix`.
        """
        self._views.write(self, folder, prefix=prefix, pdf=pdf)
