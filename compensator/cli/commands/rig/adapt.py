"""`tendonff adapt`: feedforward that tunes itself, on rigs that differ from the scenario."""

from pathlib import Path

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn


def adapt(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("adapt"),
    pdf: PdfOption = False,
    yes: YesOption = False,
) -> None:
    """Try self-tuning on rigs that differ from the scenario.

    Feedforward and feedback alone stand beside it; of a driven joint the plain inverse.
    """
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator import door

        with progress("self-tuning") as advance:
            result = door.adapt(loaded, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    say(*result.lines)
