"""`tendonff compare`: which model fidelity the task needs."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn


def compare(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("compare"),
    optimal: Annotated[
        bool, typer.Option("--optimal", help="Also search the optimal profile on each level, which takes longest.")
    ] = False,
    pdf: PdfOption = False,
    yes: YesOption = False,
) -> None:
    """Compare model levels and compensators.

    Every compensator is designed on each level, and simulated on each and on the capstan law.
    """
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator import door
        from tendonff.compensator.compensators.registry import COMPENSATORS

        door.require_options("compare", loaded, {"options": optimal})
        with progress("comparing") as advance:
            names = [each.name for each in COMPENSATORS] if optimal else None
            result = door.compare(loaded, compensators=names, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    say(result.recommendation, result.headline)
