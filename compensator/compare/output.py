"""The files of a comparison: the matrix as CSV, the summary, figures and the report."""

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonff.compensator.compare.figures import compare_figures
from tendonff.compensator.compare.matrix import ENOUGH_PERCENT, MatrixData
from tendonff.compensator.compare.report import compare_report
from tendonff.compensator.compare.result import ComparisonData
from tendonff.compensator.files.writing import atomic_directory, csv_text, write_text
from tendonff.compensator.reporting.page import summary_head, write_pages


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison(ComparisonData):
    """A comparison that can be written.

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
        Name of the compensator by the static law.
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
        Differences between the levels and the static law.
    costs : dict of str to LevelCost
        Cost of each level and the static law, by name.
    ignored : IgnoredMotion or None
        Error if the motion of joints is ignored; None where none does.
    """

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `matrix.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder."""
        figures = compare_figures(self)
        with atomic_directory(folder) as partial:
            write_matrix(partial, self)
            write_pages(partial, summary(self), figures, compare_report(self, figures), pdf=pdf)


def write_matrix(folder: Path, result: MatrixData) -> None:
    """Write `matrix.csv` into a folder."""
    rows = [entry.named(result.unit) for entry in result.entries]
    write_text(folder / "matrix.csv", csv_text(list(rows[0]), [tuple(row.values()) for row in rows]))


def matrix_summary(result: MatrixData) -> dict[str, object]:
    """The contents of `summary.json` that every comparison has, but for its warnings."""
    return {
        **summary_head(result.scenario),
        f"reference_range_{result.unit.key}": float(np.ptp(result.wanted)),
        "recommendation": result.recommendation,
        "uncertainty": result.expectation.doubt.widths,
        "uncertainty_is_assumed": result.expectation.doubt.is_assumed,
        "worst_percent_of_range": [
            {"compensator": name, "design_level": level.value, "worst": worst if math.isfinite(worst) else None}
            for (name, level), band in result.bands.items()
            for worst in (band.worst.rmse_percent_of_range,)
        ],
        "enough_percent_of_range": ENOUGH_PERCENT,
        "matrix": [entry.named(result.unit) for entry in result.entries],
    }


def summary(result: ComparisonData) -> dict[str, object]:
    """The contents of `summary.json`."""
    return {
        **matrix_summary(result),
        **({} if result.ignored is None else {"ignored_motion": result.ignored.ignored.named()}),
        "levels": {
            name: {
                "relaxation_percent": traits.relaxation_percent,
                "loop_area_percent": traits.loop_area_percent,
                "dead_zone_N": traits.dead_zone_N,
                "reversal_width_N": traits.reversal_width_N,
                "time_per_simulated_second_s": result.costs[name].time_per_simulated_second_s,
                "states": result.costs[name].states,
                "parameters_to_identify": list(result.costs[name].parameters),
            }
            for name, traits in result.traits.items()
        },
        "warnings": list(result.warnings),
    }
