"""`tendonff compare`: which model fidelity the task needs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import InputError

if TYPE_CHECKING:
    from tendonff.compensator.studies.compare.joint import JointComparison
    from tendonff.compensator.studies.compare.result import Comparison


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
        from tendonff.compensator.scenario.scenario import Scenario

        result: Comparison | JointComparison
        if isinstance(loaded, Scenario):
            from tendonff.compensator.compensators.registry import COMPENSATORS
            from tendonff.compensator.studies.compare.run import FEEDFORWARDS
            from tendonff.compensator.studies.compare.run import compare as compare_levels

            with progress("comparing") as advance:
                result = compare_levels(
                    loaded, compensators=COMPENSATORS if optimal else FEEDFORWARDS, progress=advance
                )
        else:
            from tendonff.compensator.studies.compare.joint import compare_joint

            if optimal:
                raise InputError(
                    f"{scenario.name}: --optimal is for the force of one tendon; joints have the exact inverse"
                )
            with progress("comparing") as advance:
                result = compare_joint(loaded, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    say(result.recommendation, result.headline)
