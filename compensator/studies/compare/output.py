"""The files of a comparison: the matrix as CSV, the summary, figures and the report."""

import math
import os

import numpy as np

from tendonff.compensator.files.writing import atomic_directory, csv_text, write_text
from tendonff.compensator.reporting.page import summary_head, write_pages
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.studies.compare.figures import compare_figures
from tendonff.compensator.studies.compare.matrix import ENOUGH_PERCENT
from tendonff.compensator.studies.compare.report import compare_report
from tendonff.compensator.studies.compare.result import Comparison


def write_files(result: Comparison, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
    """Write the files of `Comparison.write`."""
    figures = compare_figures(result)
    with atomic_directory(folder) as partial:
        columns = matrix_columns(result)
        write_text(partial / "matrix.csv", csv_text(columns, zip(*columns.values(), strict=True)))
        write_pages(partial, summary(result), figures, compare_report(result, figures), pdf=pdf)


def matrix_columns(result: Comparison) -> dict[str, list[str | float]]:
    """The columns of `matrix.csv`."""
    rows = [entry.named(result.unit) for entry in result.entries]
    return {name: [row[name] for row in rows] for name in rows[0]}


def summary(result: Comparison) -> dict[str, object]:
    """The contents of `summary.json`."""
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
        **({} if result.ignored is None else {"ignored_motion": result.ignored.named(result.unit)}),
        **({"levels": _levels(result)} if result.traits else {}),
        "warnings": list(result.warnings),
    }


def _levels(result: Comparison) -> dict[str, object]:
    """Traits of the levels, by name."""
    return {
        name: {
            "relaxation_percent": traits.relaxation_percent,
            "loop_area_percent": traits.loop_area_percent,
            "deadband_N": traits.deadband_N,
            "reversal_width_N": traits.reversal_width_N,
        }
        for name, traits in result.traits.items()
    }


VIEWS = Views(write=write_files, columns=matrix_columns, figures=compare_figures)
