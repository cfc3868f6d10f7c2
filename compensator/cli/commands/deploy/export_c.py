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
    joint_looked_at,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import InputError
from tendonff.ocp.codegen.precision import Precision


def export_c(
    scenarios: Annotated[
        list[Path],
        typer.Argument(
            metavar="SCENARIO...", help="Scenario file (TOML); of driven joints one or more.", show_default=False
        ),
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

    Inverse, capstan law, table, optimal profile, and the chain itself for tests; of driven joints the inverse, one copy
    of the code for all of them.
    """
    from tendonff.compensator.joint.scenario.detect import is_joint_file

    scenario = scenarios[0]
    if is_joint_file(scenario):
        if level is not None:
            raise InputError(f"{scenario.name}: --level is for the tension of one tendon; set [run] level in the file")
        return _export_joints(scenarios, out, precision, prefix, force_export=force_export, yes=yes)
    if len(scenarios) > 1:
        raise InputError(
            f"{scenario.name}: one project has one tension, or several driven joints; give one scenario at a time"
        )
    with opened(scenario, out, yes=yes) as (loaded, folder):
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
    return None


def _export_joints(
    scenarios: list[Path], out: Path, precision: Precision, prefix: str, *, force_export: bool, yes: bool
) -> None:
    loaded = [joint_looked_at(path, yes=yes) for path in scenarios]
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.joint.export.project import export_joints

    with progress("exporting"), atomic_directory(out) as folder:
        exported = export_joints(loaded, precision=precision, prefix=prefix, force_export=force_export)
        exported.write(folder)
    warn(*exported.warnings)
    for each in exported.judged:
        say(f"{each.name}: RMS error {each.text(each.rms)}, by the ratio alone {each.text(each.plain_rms)}")
    if exported.loss_rad is not None:
        say(f"compiled here, the code departs from the model by {exported.loss_rad:.2g} rad at most")
    say(f"{len(exported.files)} files in {out}; `make test` there compares them with the Python model")
