"""`tendonff import`: tendons of a MuJoCo model as a scenario."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import option
from tendonff.compensator.cli.progress import say, warn


def import_(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL.xml", help="MuJoCo model (MJCF, or .mjb).", show_default=False)
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE.toml", help="Scenario file to write; one that exists is kept.")
    ] = Path("hand.toml"),
    tendon: Annotated[
        list[str] | None, option("--tendon", "NAME", "Tendon to import; default: those that an actuator pulls, or all.")
    ] = None,
    joint: Annotated[
        list[str] | None,
        option(
            "--joint", "NAME[=LOW:HIGH]", "Joint to drive, and its range in rad; default: hinges that tendons cross."
        ),
    ] = None,
    near: Annotated[
        list[str] | None,
        option("--near", "SITE", "Site where a tendon comes from its motor, if the model leaves it open."),
    ] = None,
) -> None:
    """Import the tendons of a MuJoCo model.

    A scenario with questions for what such a model does not know, tables of the paths, torques of inertia and gravity
    along the reference, and a survey of the tendons. Run again after a change of the reference: the scenario is kept,
    the rest is new.
    """
    from tendonff.compensator.mjcf.run import run_import

    result = run_import(model, tendons=tendon or (), joints=joint or (), near=near or (), out=out)
    typer.echo(result.survey.text())
    warn(*result.notes)
    files = ", ".join(f"{out.stem}_{each}" for each in ("TENDON.csv", "torques.csv", "survey.svg"))
    say(f"{'kept' if result.kept else 'scenario'}: {out}; beside it {files}")
    if not result.kept:
        say(f"Next: answer the lines with QUESTION in {out}, then tendonff design {out}")
