"""`tendonff export-fmu`: co-simulation units."""

from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    LevelOption,
    OutFolderOption,
    PrefixOption,
    ScenarioArgument,
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.export.kinds import FmiVersion, Kind


def export_fmu(
    scenario: ScenarioArgument,
    out: OutFolderOption,
    kind: Annotated[Kind, typer.Option("--kind", help="What the unit computes.")] = Kind.INVERSE,
    fmi: Annotated[FmiVersion | None, option("--fmi", None, "Version of FMI; default: both.")] = None,
    prefix: PrefixOption = "tff",
    level: LevelOption = None,
    everywhere: Annotated[
        bool, typer.Option("--everywhere", help="Binaries for Windows and macOS too (needs ziglang); not run here.")
    ] = False,
) -> None:
    """Write FMUs for Simulink, dSPACE or Modelica.

    Co-simulation units of the exported C, with their sources.
    """
    complete = True
    names = []
    with opened(scenario, out) as (loaded, folder):
        from tendonff.compensator.export.fmu import build_fmu

        with progress("exporting"):
            for each in FmiVersion if fmi is None else (fmi,):
                unit = build_fmu(loaded, kind, each, prefix=prefix, level=level, everywhere=everywhere)
                unit.write(folder)
                names.append(unit.name)
                complete = complete and unit.has_binary
    if not complete:
        warn("no binary was made here (a C compiler on Linux makes one); the unit holds its sources")
    if everywhere:
        say("binaries for Windows and macOS were built, not run: try them on such a machine first")
    say(f"{', '.join(names)} in {out}")
