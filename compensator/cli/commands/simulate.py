"""`tendonff simulate`: what a force does to the tensions along the tendon."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import LevelOption, ScenarioArgument
from tendonff.compensator.cli.progress import progress, say, warn


def simulate(
    scenario: ScenarioArgument,
    force: Annotated[
        Path,
        typer.Option(
            "--force",
            metavar="F.csv",
            help="Force file: time_s,force_N, from 0 (position drive: command_m).",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="O.csv", help="Result: tensions and end positions.", show_default=False)
    ],
    column: Annotated[
        str | None,
        typer.Option(
            "--force-column",
            metavar="NAME",
            help="Column of the force; default: force_N, in a profile.csv force_optimal_N.",
            show_default=False,
        ),
    ] = None,
    joints: Annotated[
        Path | None,
        typer.Option(
            "--joints",
            metavar="J.csv",
            help="Motion of the joints: time_s,NAME_rad; default: that of the scenario.",
            show_default=False,
        ),
    ] = None,
    level: LevelOption = None,
    check: Annotated[
        bool, typer.Option("--check", help="Simulate with smaller steps as well and state the discretisation error.")
    ] = False,
) -> None:
    """Simulate the chain under a force file.

    The run starts at rest at the scenario's initial tension.
    """
    from tendonff.compensator.files.reading import InputError
    from tendonff.compensator.scenario.scenario import load_scenario

    loaded = load_scenario(scenario)  # before the imports below, which take a second: a refusal is quick
    from tendonff.compensator.scenario.sampled.joint_motion import moved_by_file
    from tendonff.compensator.simulate.run import read_force, simulate_force

    loaded = loaded if joints is None else moved_by_file(loaded, joints)
    profile = read_force(force, column, loaded.transmission.actuator.drive)
    for note in profile.notes:
        say(note)
    if out.exists() and any(out.samefile(source) for source in (scenario, force, joints) if source):
        raise InputError(f"{out} is an input of this run; name another file for the result")
    with progress("simulating") as advance:
        simulated = simulate_force(loaded, level or loaded.run.level, profile, out, check=check, progress=advance)
    for warning in simulated.warnings:
        warn(warning)
    if simulated.check is not None:
        say(f"check: {simulated.check}")
