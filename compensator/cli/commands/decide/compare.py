"""`tendonff compare`: which model fidelity the task needs."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    joint_looked_at,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import InputError


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
    from tendonff.compensator.joint.scenario.detect import is_joint_file

    if is_joint_file(scenario):
        _compare_joint(scenario, out, optimal=optimal, pdf=pdf, yes=yes)
        return
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator.compensators.registry import COMPENSATORS
        from tendonff.compensator.studies.compare.run import FEEDFORWARDS
        from tendonff.compensator.studies.compare.run import compare as compare_levels

        with progress("comparing") as advance:
            result = compare_levels(loaded, compensators=COMPENSATORS if optimal else FEEDFORWARDS, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    say(result.recommendation, result.headline)


def _compare_joint(scenario: Path, out: Path, *, optimal: bool, pdf: bool, yes: bool) -> None:
    if optimal:
        raise InputError(f"{scenario.name}: --optimal is for the force of one tendon; a joint has the exact inverse")
    loaded = joint_looked_at(scenario, yes=yes)
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.studies.compare.joint import compare_joint

    with atomic_directory(out) as folder:
        with progress("comparing") as advance:
            result = compare_joint(loaded, progress=advance)
        result.write(folder, pdf=pdf)
    warn(*result.warnings)
    say(result.recommendation, result.headline)
