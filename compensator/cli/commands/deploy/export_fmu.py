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
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.files.text import InputError

if TYPE_CHECKING:
    from tendonff.compensator.export.unit import Fmu
    from tendonff.compensator.finger.scenario import FingerScenario
    from tendonff.compensator.joint.scenario.scenario import JointScenario


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

    Co-simulation units of the exported C, with their sources; of a driven joint or a finger its inverse.
    """
    versions = tuple(FmiVersion) if fmi is None else (fmi,)
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator.scenario.scenario import Scenario

        if not isinstance(loaded, Scenario):
            if level is not None:
                raise InputError(
                    f"{scenario.name}: --level is for the tension of one tendon; set [run] level in the file"
                )
            if kind is not Kind.INVERSE:
                raise InputError(
                    f"{scenario.name}: a driven joint has the kind inverse only, got {kind}; leave --kind out"
                )
            return _joint(loaded, folder, out, versions, prefix, everywhere=everywhere, force_export=force_export)
        from tendonff.compensator.export.fmu import build_fmu
        from tendonff.compensator.export.judgement import score_lines

        with progress("exporting"):
            units = [
                build_fmu(
                    loaded, kind, each, prefix=prefix, level=level, everywhere=everywhere, force_export=force_export
                )
                for each in versions
            ]
            for unit in units:
                unit.write(folder)
    warn(*units[0].warnings)
    if units[0].judged:
        say(*score_lines(units[0].judged))
    _close(units, out, everywhere=everywhere)
    return None


def _joint(
    loaded: "JointScenario | FingerScenario",
    folder: Path,
    out: Path,
    versions: tuple[FmiVersion, ...],
    prefix: str,
    *,
    everywhere: bool,
    force_export: bool,
) -> None:
    from tendonff.compensator.finger.export.fmu import build_finger_fmu
    from tendonff.compensator.finger.scenario import FingerScenario
    from tendonff.compensator.joint.export.fmu import build_joint_fmu

    options = {"prefix": prefix, "everywhere": everywhere, "force_export": force_export}
    with progress("exporting"):
        made = [
            build_finger_fmu(loaded, each, **options)  # type: ignore[arg-type]
            if isinstance(loaded, FingerScenario)
            else build_joint_fmu(loaded, each, **options)  # type: ignore[arg-type]
            for each in versions
        ]
        for unit, _ in made:
            unit.write(folder)
    units, (judged, *_) = zip(*made, strict=True)
    warn(*units[0].warnings)
    plain = "lengths" if isinstance(loaded, FingerScenario) else "ratio"
    say(f"{judged.name}: RMS error {judged.text(judged.rms)}, by the {plain} alone {judged.text(judged.plain_rms)}")
    _close(units, out, everywhere=everywhere)


def _close(units: Sequence["Fmu"], out: Path, *, everywhere: bool) -> None:
    if not all(unit.has_binary for unit in units):
        warn("no binary was made here (a C compiler on Linux makes one); the unit holds its sources")
    if everywhere:
        say("binaries for Windows and macOS were built, not run: try them on such a machine first")
    say(f"{', '.join(unit.name for unit in units)} in {out}")
