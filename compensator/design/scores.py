"""The scores of a design on the terminal."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from tendonff.compensator.design.report import headline
from tendonff.compensator.design.result import FINE_REFINEMENT, FINE_SEGMENTS, DesignData
from tendonff.models.fidelity import Level


def print_scores(result: DesignData, folder: Path) -> None:
    """Print the error of each compensator on each level, what to expect on a rig, and where the files are."""
    console = Console()
    table = Table(title=f"{result.scenario.name}: RMS error, % of reference range", title_justify="left")
    table.add_column("compensator")
    table.add_column(f"worst, {result.expectation.doubt.widths}", justify="right")
    for level in Level:
        table.add_column(f"{level}*" if level is result.level else level.value, justify="right")
    table.add_column(f"{FINE_SEGMENTS} masses, step/{FINE_REFINEMENT}", justify="right")
    for compensator in result.compensators:
        name = compensator.name
        scores = [*(result.on_level(name, level).score for level in Level), result.on_proof(name).score]
        worst = result.expectation.worst_percent.get(name)
        table.add_row(name, "–" if worst is None else f"{worst:.3g}", *[score.percent for score in scores])
    console.print(table)
    console.print(f"* design level, used in the last column too; range {result.reference.range_N:.4g} N")
    console.print(headline(result), soft_wrap=True, markup=False, highlight=False)
    if result.tracking is not None:
        console.print(f"optimal control: {result.tracking.message}", soft_wrap=True)
    console.print(f"written to {folder}", soft_wrap=True)
