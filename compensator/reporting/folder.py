"""What every command writes into its folder: summary, figures and report."""

from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from tendonff._version import __version__
from tendonff.compensator.files.writing import write_json
from tendonff.compensator.reporting.page import Report, write_report
from tendonff.compensator.reporting.plots import save_figure
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash


def summary_head(scenario: Scenario) -> dict[str, object]:
    """How every `summary.json` begins."""
    return {
        "schema": 1,
        "scenario": scenario.name,
        "scenario_hash": scenario_hash(scenario),
        "tool": f"tendonff {__version__}",
    }


def write_pages(folder: Path, summary: Mapping[str, object], figures: Mapping[str, Figure], report: Report) -> None:
    """Write `summary.json`, every figure and `report.html` into an existing folder.

    Parameters
    ----------
    figures : mapping of str to Figure
        By file name, without a suffix.
    """
    write_json(folder / "summary.json", summary)
    for name, figure in figures.items():
        save_figure(figure, folder / name)
    write_report(folder / "report.html", report)
