"""The files of a comparison: the matrix as CSV, the summary, figures and the report."""

import math
import os
from pathlib import Path

import numpy as np

from tendonff.compensator.files.writing import atomic_directory, csv_text, write_text
from tendonff.compensator.reporting.page import summary_head, write_pages
from tendonff.compensator.studies.compare.figures import compare_figures
from tendonff.compensator.studies.compare.matrix import ENOUGH_PERCENT, MatrixData
from tendonff.compensator.studies.compare.report import compare_report
from tendonff.compensator.studies.compare.result import Comparison


def write_files(result: Comparison, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
    """Write the files of `Comparison.write`."""
    figures = compare_figures(result)
    with atomic_directory(folder) as partial:
        write_matrix(partial, result)
        write_pages(partial, summary(result), figures, compare_report(result, figures), pdf=pdf)


def matrix_columns(result: MatrixData) -> dict[str, list[str | float]]:
    """The columns of `matrix.csv`."""
    rows = [entry.named(result.unit) for entry in result.entries]
    return {name: [row[name] for row in rows] for name in rows[0]}


def write_matrix(folder: Path, result: MatrixData) -> None:
    """Write `matrix.csv` into a folder."""
    columns = matrix_columns(result)
    write_text(folder / "matrix.csv", csv_text(columns, zip(*columns.values(), strict=True)))


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


def summary(result: Comparison) -> dict[str, object]:
    """The contents of `summary.json`."""
    return {
        **matrix_summary(result),
        **({} if result.ignored is None else {"ignored_motion": result.ignored.named(result.unit)}),
        "levels": {
            name: {
                "relaxation_percent": traits.relaxation_percent,
                "loop_area_percent": traits.loop_area_percent,
                "deadband_N": traits.deadband_N,
                "reversal_width_N": traits.reversal_width_N,
                "time_per_simulated_second_s": result.costs[name].time_per_simulated_second_s,
                "states": result.costs[name].states,
                "parameters_to_identify": list(result.costs[name].parameters),
            }
            for name, traits in result.traits.items()
        },
        "warnings": list(result.warnings),
    }
