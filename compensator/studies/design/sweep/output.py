"""The files of a sweep: samples, summary, figures and report."""

import math
import os

from tendonff.compensator.files.writing import atomic_directory, csv_text, write_parquet, write_text
from tendonff.compensator.reporting.page import summary_head, write_pages
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.studies.design.sweep.figures import sweep_figures
from tendonff.compensator.studies.design.sweep.report import sweep_report
from tendonff.compensator.studies.design.sweep.result import QUANTILES, YIELD_PERCENT, Sweep


def write_files(result: Sweep, folder: str | os.PathLike[str], *, parquet: bool = False, pdf: bool = False) -> None:
    """Write the files of `Sweep.write`."""
    figures = sweep_figures(result)
    with atomic_directory(folder) as partial:
        samples = sample_table(result)
        write_text(
            partial / "samples.csv", csv_text(samples, zip(*samples.values(), strict=True))
        )  # failed: empty cell
        if parquet:
            write_parquet(partial / "samples.parquet", samples)
        write_pages(partial, summary(result), figures, sweep_report(result, figures), pdf=pdf)


def sample_table(result: Sweep) -> dict[str, list[float]]:
    """The columns of `samples.csv`."""
    rows = [(r.index, *r.values, *r.percent, *r.peak) for r in result.rows]
    return {name: list(column) for name, column in zip(sample_columns(result), zip(*rows, strict=True), strict=True)}


def sample_columns(result: Sweep) -> list[str]:
    """Names of the columns: the sample, the keys, errors and peaks of each compensator."""
    peak = f"peak_error_{result.scenario.goal.unit.key}"
    scores = [f"{name}_{what}" for what in ("rmse_percent_of_range", peak) for name in result.compensators]
    return ["sample", *result.keys, *scores]


def summary(result: Sweep) -> dict[str, object]:
    """The contents of `summary.json`."""

    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        **summary_head(result.scenario),
        "samples": len(result.rows),
        "keys": list(result.keys),
        "compensators": {
            name: {
                "failed": sum(not math.isfinite(x) for x in result.percent(name).tolist()),
                "yield": {f"below_{bound:g}_percent": result.yield_of(name, bound) for bound in YIELD_PERCENT},
                "quantiles_percent_of_range": {
                    f"{q:g}": finite(x) for q, x in zip(QUANTILES, result.quantiles(name), strict=True)
                },
            }
            for name in result.compensators
        },
        "budget": [
            {
                "key": key,
                "from": low,
                "to": high,
                "rmse_percent_of_range": {
                    name: [finite(a), finite(b)]
                    for name, a, b in zip(result.compensators, at_low, at_high, strict=True)
                },
            }
            for key, low, high, at_low, at_high in result.budget
        ],
    }


VIEWS = Views(write=write_files, columns=sample_table, figures=sweep_figures)
