"""`tendonff export-fmu`: co-simulation units."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    ForceOption,
    LevelOption,
    OutFolderOption,
    PrefixOption,
    ScenarioArgument,
    YesOption,
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.export.kinds import FmiVersion, Kind


def export_fmu(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("fmu"),
    kind: Annotated[Kind, typer.Option("--kind", help="What the unit computes.")] = Kind.INVERSE,
    fmi: Annotated[FmiVersion | None, option("--fmi", None, "Version of FMI; default: both.")] = None,
    prefix: PrefixOption = "tff",
    level: LevelOption = None,
    everywhere: Annotated[
        bool, typer.Option("--everywhere", help="Binaries for Windows and macOS too (needs ziglang); not run here.")
    ] = False,
    force_export: ForceOption = False,
    yes: YesOption = False,
) -> None:
    """Write FMUs for Simulink, dSPACE or Modelica.

    Co-simulation units of the exported C, with their sources. A driven joint has the kinds inverse and adaptive, with
    one motor plant and observer too; a finger has its inverse.
    """
    versions = tuple(FmiVersion) if fmi is None else (fmi,)
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator import door

        with progress("exporting"):
            units = [
                door.export_fmu(
                    loaded, kind, each, prefix=prefix, level=level, everywhere=everywhere, force_export=force_export
                )
                for each in versions
            ]
            for unit in units:
                unit.write(folder)
    warn(*units[0].warnings)
    say(*units[0].lines)
    if not all(unit.has_binary for unit in units):
        warn("no binary was made here (a C compiler on Linux makes one); the unit holds its sources")
    if everywhere:
        say("binaries for Windows and macOS were built, not run: try them on such a machine first")
    say(f"{', '.join(unit.name for unit in units)} in {out}")
