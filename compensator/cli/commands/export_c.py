"""`tendonff export-c`: C99 for the controller."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    ForceOption,
    LevelOption,
    OutFolderOption,
    PrefixOption,
    ScenarioArgument,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.ocp.codegen.precision import Precision


def export_c(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("c"),
    precision: Annotated[
        Precision, typer.Option("--precision", help="Real type of all arithmetic.")
    ] = Precision.DOUBLE,
    prefix: PrefixOption = "tff",
    level: LevelOption = None,
    force_export: ForceOption = False,
) -> None:
    """Write C99 for the controller.

    Inverse, capstan law, table, optimal profile, and the chain itself for tests.
    """
    with opened(scenario, out) as (loaded, folder):
        from tendonff.compensator.export.c_project import export_project
        from tendonff.compensator.export.judgement import score_lines

        with progress("exporting"):
            exported = export_project(
                loaded, precision=precision, prefix=prefix, level=level, force_export=force_export
            )
            exported.write(folder)
    say(*exported.notes)
    warn(*exported.warnings)
    say(*score_lines(exported.judged))
    say(f"{len(exported.files)} files in {out}; `make test` there compares them with the Python model")
