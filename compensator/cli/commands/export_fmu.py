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
) -> None:
    """Write FMUs for Simulink, dSPACE or Modelica.

    Co-simulation units of the exported C, with their sources.
    """
    with opened(scenario, out) as (loaded, folder):
        from tendonff.compensator.export.fmu import build_fmu
        from tendonff.compensator.export.judgement import score_lines

        with progress("exporting"):
            units = [
                build_fmu(
                    loaded, kind, each, prefix=prefix, level=level, everywhere=everywhere, force_export=force_export
                )
                for each in (FmiVersion if fmi is None else (fmi,))
            ]
            for unit in units:
                unit.write(folder)
    warn(*units[0].warnings)
    if units[0].judged:
        say(*score_lines(units[0].judged))
    if not all(unit.has_binary for unit in units):
        warn("no binary was made here (a C compiler on Linux makes one); the unit holds its sources")
    if everywhere:
        say("binaries for Windows and macOS were built, not run: try them on such a machine first")
    say(f"{', '.join(unit.name for unit in units)} in {out}")
