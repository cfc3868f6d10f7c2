"""`tendonff export-fmu`: co-simulation units."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonff.compensator.cli.options import (
    ForceOption,
    LevelOption,
    OutFolderOption,
    PrefixOption,
    ScenarioArgument,
    YesOption,
    joint_looked_at,
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.files.text import InputError

if TYPE_CHECKING:
    from tendonff.compensator.export.unit import Fmu


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

    Co-simulation units of the exported C, with their sources; of a driven joint its inverse.
    """
    from tendonff.compensator.joint.scenario.detect import is_joint_file

    if is_joint_file(scenario):
        if level is not None:
            raise InputError(f"{scenario.name}: --level is for the tension of one tendon; set [run] level in the file")
        if kind is not Kind.INVERSE:
            raise InputError(f"{scenario.name}: a driven joint has the kind inverse only, got {kind}; leave --kind out")
        versions = FmiVersion if fmi is None else (fmi,)
        return _joint(scenario, out, tuple(versions), prefix, everywhere=everywhere, force_export=force_export, yes=yes)
    with opened(scenario, out, yes=yes) as (loaded, folder):
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
    _close(units, out, everywhere=everywhere)
    return None


def _joint(
    scenario: Path,
    out: Path,
    versions: tuple[FmiVersion, ...],
    prefix: str,
    *,
    everywhere: bool,
    force_export: bool,
    yes: bool,
) -> None:
    loaded = joint_looked_at(scenario, yes=yes)
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.joint.export.fmu import build_joint_fmu

    with progress("exporting"), atomic_directory(out) as folder:
        made = [
            build_joint_fmu(loaded, each, prefix=prefix, everywhere=everywhere, force_export=force_export)
            for each in versions
        ]
        for unit, _ in made:
            unit.write(folder)
    units, (judged, *_) = zip(*made, strict=True)
    warn(*units[0].warnings)
    say(f"{judged.name}: RMS error {judged.text(judged.rms)}, by the ratio alone {judged.text(judged.plain_rms)}")
    _close(units, out, everywhere=everywhere)


def _close(units: Sequence["Fmu"], out: Path, *, everywhere: bool) -> None:
    if not all(unit.has_binary for unit in units):
        warn("no binary was made here (a C compiler on Linux makes one); the unit holds its sources")
    if everywhere:
        say("binaries for Windows and macOS were built, not run: try them on such a machine first")
    say(f"{', '.join(unit.name for unit in units)} in {out}")
