"""Compensation tables of a tension: force over reference, branch and tension since the last reversal."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import ClassVar, Self

from tendonff.compensator.compensators.base import Problem, limit_warnings
from tendonff.compensator.compensators.expectation import FRICTIONLESS
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.compensators.score import Score, harm_warnings, verify
from tendonff.compensator.compensators.table import BuiltTable, CompensationTable, table_of, table_range
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.studies.tables.result import Tables
from tendonff.models.fidelity import Level
from tendonff.ocp.tracking.diagnosis import law_of, reasons

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ForceTables(Tables):
    """Compensation tables of a tension; see `Tables`.

    Attributes
    ----------
    reference : Reference
        What was to be delivered, sampled.
    tables : tuple of AngleTable
        One for each wrap angle and rate.
    axes : tuple of str
        Further columns of the file.
    scores : dict of Level to Score
        What the scenario's own table delivers on each level, within the actuator's limits.
    """

    shown_by: ClassVar[str] = "studies.tables.force_pages"
    beside: ClassVar[tuple[str, ...]] = ("none", FRICTIONLESS, "table")
    recommended: ClassVar[str | None] = "table"

    reference: Reference
    tables: tuple[AngleTable, ...]
    axes: tuple[str, ...]
    scores: dict[Level, Score] = field(default_factory=dict)

    @classmethod
    def tabulated(
        cls, problem: Problem, bound: float | None, angles_rad: Sequence[float], rates: Sequence[float]
    ) -> tuple["partial[Self]", CompensationTable]:
        """Sweeps through the exact inverse at each wrap angle and rate; see `Tables.tabulated`."""
        for angle in angles_rad:
            if not 0 < angle < float("inf"):
                raise InputError(f"--angles: every value must be a finite number > 0, got {angle}")
        transmission = problem.transmission
        if refused := CompensationTable().refusal(problem):
            raise InputError(refused)
        own_angle, covered = transmission.path.total_angle_rad, table_range(problem)
        own = table_of(problem, bound_N=bound)
        tables = [AngleTable(built=own, total_angle_rad=own_angle)]
        if angles_rad or rates:
            tables = []
            for angle in sorted(angles_rad or [own_angle]):
                bent = replace(transmission, path=replace(transmission.path, total_angle_rad=angle))
                there = replace(problem, transmission=bent)
                tables += [
                    AngleTable(
                        built=table_of(there, bound_N=bound, rate_N_per_s=rate, range_N=covered), total_angle_rad=angle
                    )
                    for rate in sorted(rates or [own.rate_N_per_s])
                ]
        axes = (("total_angle_rad",) if angles_rad else ()) + (("rate_N_per_s",) if rates else ())
        build = partial(cls, reference=problem.reference, tables=tuple(tables), axes=axes, warnings=())
        return build, CompensationTable(own.table)

    def judged(self, problem: Problem, table: CompensationTable, profiles: Mapping[str, Profile]) -> Self:
        """The same with scores on all levels, and the limits that it meets."""
        transmission, reference, profile = problem.transmission, problem.reference, profiles["table"]
        scores = {on: verify(Plant(transmission, on), "table", profile, reference).score for on in Level}
        nothing = verify(Plant(transmission, problem.level), "none", profiles["none"], reference).score
        harm = harm_warnings({"none": nothing, "table": scores[problem.level]}, reference.wanted, "table")
        met = limit_warnings("table", table.wanted_N(problem), profile.force_N)
        bounds = problem.options.minimum_tension_N, problem.options.maximum_tension_N
        needed = problem.inversion.force_N, reference.step_s, problem.limits
        law, drive = law_of(problem.chain), problem.chain.drive
        causes = reasons(law, reference.tension_N, *needed, *bounds, drive) if met else ()
        warnings = (*reference.warnings, *met, *causes, *harm)
        return replace(self, scores=scores, warnings=warnings, harm=tuple(harm))

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
