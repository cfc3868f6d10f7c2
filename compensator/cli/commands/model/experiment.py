"""`tendonff experiment`: the paper's ten-state test on two motors."""

from pathlib import Path
from typing import Annotated

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn

_MEASURED = "Tensions of this test on a rig (time_s, any of tension_1_N to tension_7_N), laid over the models."


def experiment(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("experiment"),
    measured: Annotated[Path | None, option("--measured", "FILE", _MEASURED)] = None,
    pdf: PdfOption = False,
    yes: YesOption = False,
) -> None:
    """Run the ten-state test on two motors.

    All three model levels receive the same commands.
    """
    with opened(scenario, out, follows_reference=False, yes=yes) as (loaded, folder):
        from tendonff.compensator import works
        from tendonff.compensator.studies.experiment.numbers import warnings_of

        with progress("experimenting") as advance:
            result = works.function_of("experiment", loaded)(loaded, measured, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*warnings_of(result))
    states = len(result.plan.states)
    say(f"{states} states in {result.fine.time_s[-1]:.4g} s on {len(result.runs)} levels; see {out / 'report.html'}")
