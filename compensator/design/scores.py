"""The scores of a design on the terminal."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.design.figures import percent
from tendonff.compensator.design.run import FINE_REFINEMENT, FINE_SEGMENTS, Design
from tendonff.models.fidelity import Level


def print_scores(result: Design, folder: Path) -> None:
    """Print what each compensator leaves on each level, and where the files are.

    Parameters
    ----------
    result : Design
    folder : Path
        Where the design was written.
    """
    console = Console()
    table = Table(title=f"{result.scenario.name}: error, % of range rms", title_justify="left")
    table.add_column("compensator")
    for level in Level:
        table.add_column(f"{level}*" if level is result.level else level.value, justify="right")
    table.add_column(f"{FINE_SEGMENTS} masses, step/{FINE_REFINEMENT}", justify="right")
    for compensator in Compensator:
        scores = [result.on_level(compensator, level).score for level in Level]
        scores += [p.score for p in result.proof if p.compensator == compensator]
        table.add_row(compensator.value, *[percent(s) for s in scores])
    console.print(table)
    console.print(f"* design level, also of the last column; range {result.reference.range_N:.4g} N")
    console.print(f"optimal control: {result.tracking.message}", soft_wrap=True)
    console.print(f"written to {folder}", soft_wrap=True)
