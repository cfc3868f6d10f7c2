"""`tendonff simulate`: what a force does to the tensions along the tendon."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    LevelOption,
    MethodOption,
    ScenarioArgument,
    YesOption,
    looked_at,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import require_suffix
from tendonff.ocp.integrate.method import Method

_COLUMN = "Column of the force or, with NAME for the motor, of motor angles; default: force_N, motor_NAME_rad."
_JOINTS = "Motion of joints that no tendon drives: time_s,NAME_rad; default: the scenario's."


def simulate(
    scenario: ScenarioArgument,
    force: Annotated[
        Path, option("--force", "F.csv", "Force file: time_s,force_N, from 0 (position drive: command_m).")
    ],
    out: Annotated[Path, option("--out", "O.csv", "Result: tensions and end positions.")],
    column: Annotated[str | None, option("--force-column", "NAME", _COLUMN)] = None,
    joints: Annotated[Path | None, option("--joints", "J.csv", _JOINTS)] = None,
    level: LevelOption = None,
    check: Annotated[
        bool, typer.Option("--check", help="Simulate with smaller steps as well and state the discretisation error.")
    ] = False,
    method: MethodOption = Method.BDF2,
    yes: YesOption = False,
) -> None:
    """Simulate a force file, or a joint under a file of motor angles.

    The run starts at rest at the scenario's initial tension; of a joint, where its reference starts.
    """
    require_suffix(out, ".csv")
    loaded = looked_at(scenario, follows_reference=False, yes=yes)
    from tendonff.compensator import door

    with progress("simulating") as advance:
        simulated = door.simulate_file(
            loaded,
            force,
            out,
            column=column,
            joints=joints,
            level=level,
            check=check,
            method=method,
            accept=yes,
            progress=advance,
        )
    say(*simulated.notes)
    warn(*simulated.warnings)
    if simulated.check is not None:
        say(f"check: {simulated.check}")
