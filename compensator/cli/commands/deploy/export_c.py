"""`tendonff export-c`: C99 for the controller."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonff.compensator.cli.options import (
    ForceOption,
    LevelOption,
    OutFolderOption,
    PrefixOption,
    YesOption,
    looked_at,
    of_fingers,
    of_one_joint,
    opened,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import InputError
from tendonff.ocp.codegen.precision import Precision

if TYPE_CHECKING:
    from tendonff.compensator.finger.scenario import FingerScenario
    from tendonff.compensator.joint.export.judgement import JudgedJoint
    from tendonff.compensator.joint.scenario.scenario import JointScenario

_APART = "a project holds single joints or fingers, each kind in a folder of its own; give one kind at a time"


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

    Inverse, capstan law, table, optimal profile, and the chain itself for tests; of driven joints and
    fingers the inverse, one copy of the code for all of them.
    """
    scenario = scenarios[0]
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator.finger.scenario import FingerScenario
        from tendonff.compensator.scenario.scenario import Scenario

        if not isinstance(loaded, Scenario):
            if level is not None:
                raise InputError(
                    f"{scenario.name}: --level is for the tension of one tendon; set [run] level in the file"
                )
            every = [loaded, *(looked_at(p, yes=yes) for p in scenarios[1:])]
            if isinstance(loaded, FingerScenario):
                fingers = [of_fingers(each, _APART) for each in every]
                return _export_fingers(fingers, folder, out, precision, prefix, force_export=force_export)
            joints = [of_one_joint(each, _APART) for each in every]
            return _export_joints(joints, folder, out, precision, prefix, force_export=force_export)
        if len(scenarios) > 1:
            raise InputError(
                f"{scenario.name}: one project has one tension, or several driven joints; give one scenario at a time"
            )
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
    loaded: list["JointScenario"], folder: Path, out: Path, precision: Precision, prefix: str, *, force_export: bool
) -> None:
    from tendonff.compensator.joint.export.project import export_joints

    with progress("exporting"):
        exported = export_joints(loaded, precision=precision, prefix=prefix, force_export=force_export)
        exported.write(folder)
    _say_joints(exported.judged, "ratio", exported.loss_rad)
    warn(*exported.warnings)
    say(f"{len(exported.files)} files in {out}; `make test` there compares them with the Python model")


def _export_fingers(
    loaded: list["FingerScenario"], folder: Path, out: Path, precision: Precision, prefix: str, *, force_export: bool
) -> None:
    from tendonff.compensator.finger.export.project import export_fingers

    with progress("exporting"):
        exported = export_fingers(loaded, precision=precision, prefix=prefix, force_export=force_export)
        exported.write(folder)
    _say_joints(exported.judged, "lengths", exported.loss_rad)
    warn(*exported.warnings)
    say(f"{len(exported.files)} files in {out}; `make test` there compares them with the Python model")


def _say_joints(judged: tuple["JudgedJoint", ...], plain: str, loss_rad: float | None) -> None:
    for each in judged:
        say(f"{each.name}: RMS error {each.text(each.rms)}, by the {plain} alone {each.text(each.plain_rms)}")
    if loss_rad is not None:
        say(f"compiled here, the code departs from the model by {loss_rad:.2g} rad at most")
