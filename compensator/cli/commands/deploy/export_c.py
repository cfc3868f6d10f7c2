"""`tendonff export-c`: C99 for the controller."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    ForceOption,
    LevelOption,
    OutFolderOption,
    PrefixOption,
    YesOption,
    looked_at,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.ocp.codegen.precision import Precision


def export_c(
    scenarios: Annotated[
        list[Path],
        typer.Argument(metavar="SCENARIO...", help="Scenario files (TOML) of one kind.", show_default=False),
    ],
    out: OutFolderOption = Path("c"),
    precision: Annotated[
        Precision, typer.Option("--precision", help="Real type of all arithmetic.")
    ] = Precision.DOUBLE,
    prefix: PrefixOption = "tff",
    level: LevelOption = None,
    force_export: ForceOption = False,
    yes: YesOption = False,
) -> None:
    """Write C99 for the controller.

    Inverse, capstan law, table, optimal profile, and the chain itself for tests, a folder for each of several tensions;
    of driven joints and fingers the inverse, one copy of the code for all of them.
    """
    with opened(scenarios[0], out, yes=yes) as (loaded, folder):
        from tendonff.compensator import door

        further = [looked_at(each, yes=yes) for each in scenarios[1:]]
        with progress("exporting"):
            exported = door.export_c(
                loaded, further=further, precision=precision, prefix=prefix, level=level, force_export=force_export
            )
            exported.write(folder)
    say(*exported.notes)
    warn(*exported.warnings)
    say(*exported.lines)
    say(f"{len(exported.files)} files in {out}; `make test` there compares them with the Python model")
