"""The files of a comparison: the matrix as CSV, the summary, figures and the report."""

import math
import os
from dataclasses import asdict, astuple, dataclass, fields

from tendonff.compensator.compare.figures import compare_figures
from tendonff.compensator.compare.report import compare_report
from tendonff.compensator.compare.result import ENOUGH_PERCENT, ComparisonData, Entry
from tendonff.compensator.files.writing import atomic_directory, csv_text, write_text
from tendonff.compensator.reporting.page import summary_head, write_pages


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison(ComparisonData):
    """A comparison that can be written."""

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `matrix.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder."""
        figures = compare_figures(self)
        with atomic_directory(folder) as partial:
            names, rows = [field.name for field in fields(Entry)], map(astuple, self.entries)
            write_text(partial / "matrix.csv", csv_text(names, rows))
            write_pages(partial, summary(self), figures, compare_report(self, figures), pdf=pdf)


def summary(result: ComparisonData) -> dict[str, object]:
    """The contents of `summary.json`."""
    return {
        **summary_head(result.scenario),
        "reference_range_N": result.reference.range_N,
        "recommendation": result.recommendation,
        "uncertainty": result.expectation.doubt.widths,
        "uncertainty_is_assumed": result.expectation.doubt.is_assumed,
        "worst_percent_of_range": [
            {"compensator": name, "design_level": level.value, "worst": worst if math.isfinite(worst) else None}
            for (name, level), band in result.bands.items()
            for worst in (band.worst.rmse_percent_of_range,)
        ],
        "enough_percent_of_range": ENOUGH_PERCENT,
        "matrix": [asdict(entry) for entry in result.entries],
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
