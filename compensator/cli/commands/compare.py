"""`tendonff compare`: which model fidelity the task needs."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import OutFolderOption, PdfOption, ScenarioArgument, opened
from tendonff.compensator.cli.progress import progress, say, warn


def compare(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("compare"),
    optimal: Annotated[
        bool, typer.Option("--optimal", help="Also search the optimal profile on each level, which takes longest.")
    ] = False,
    pdf: PdfOption = False,
) -> None:
    """Compare model levels and compensators.

    Every compensator is designed on each level, and simulated on each and on the capstan law.
    """
    with opened(scenario, out) as (loaded, folder):
        from tendonff.compensator.compare.run import FEEDFORWARDS
        from tendonff.compensator.compare.run import compare as compare_levels
        from tendonff.compensator.compensators.registry import COMPENSATORS

        with progress("comparing") as advance:
            result = compare_levels(loaded, compensators=COMPENSATORS if optimal else FEEDFORWARDS, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    say(result.recommendation, result.headline)
