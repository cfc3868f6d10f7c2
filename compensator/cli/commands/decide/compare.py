"""`tendonff compare`: which model fidelity the task needs."""

from pathlib import Path

from tendonff.compensator.cli.options import (
    CompensatorsOption,
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    names_of,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn


def compare(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("compare"),
    compensators: CompensatorsOption = None,
    pdf: PdfOption = False,
    yes: YesOption = False,
) -> None:
    """Compare model levels and compensators.

    Every compensator is designed on each level, and simulated on each and on the capstan law.
    """
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator import door

        with progress("comparing") as advance:
            result = door.compare(loaded, compensators=names_of(compensators), progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    say(result.recommendation, result.headline)
