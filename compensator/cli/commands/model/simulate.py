"""`tendonff simulate`: what a force does to the tensions along the tendon."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
from tendonff.compensator.files.text import InputError
from tendonff.models.fidelity import Level
from tendonff.ocp.integrate.method import Method

if TYPE_CHECKING:
    from tendonff.compensator.finger.scenario import FingerScenario
    from tendonff.compensator.joint.scenario.scenario import JointScenario

_COLUMN = "Column of the force; default: force_N, in a profile.csv force_optimal_N."
_JOINTS = "Motion of the joints: time_s,NAME_rad; default: that of the scenario."


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
    loaded = looked_at(scenario, follows_reference=False, yes=yes)
    from tendonff.compensator.scenario.doubts import settle
    from tendonff.compensator.scenario.scenario import Scenario

    if not isinstance(loaded, Scenario):
        if joints is not None or check:
            raise InputError(f"{scenario.name}: --joints and --check are for the tension of one tendon; leave them out")
        _simulate_motors(loaded, force, out, column, level, method)
        return
    from tendonff.compensator.scenario.sampled.joint_motion import moved_by_file
    from tendonff.compensator.studies.simulate.run import doubts_of, notes_of, read_force, simulate_force

    loaded = loaded if joints is None else moved_by_file(loaded, joints)
    profile = read_force(force, column, loaded.transmission.actuator)
    say(*profile.notes)
    warn(*settle(doubts_of(loaded, profile), file=scenario.name, accept=yes), *notes_of(loaded, profile))
    if out.exists() and any(out.samefile(source) for source in (scenario, force, joints) if source):
        raise InputError(f"{out} is an input of this run; name another file for the result")
    with progress("simulating") as advance:
        simulated = simulate_force(
            loaded, level or loaded.run.level, profile, out, check=check, method=method, progress=advance
        )
    warn(*simulated.warnings)
    if simulated.check is not None:
        say(f"check: {simulated.check}")


def _simulate_motors(
    loaded: "JointScenario | FingerScenario",
    motors: Path,
    out: Path,
    column: str | None,
    level: Level | None,
    method: Method,
) -> None:
    from tendonff.compensator.finger.simulate import simulate_motor_file

    if out.exists() and any(out.samefile(source) for source in (loaded.source, motors)):
        raise InputError(f"{out} is an input of this run; name another file for the result")
    with progress("simulating"):
        notes = simulate_motor_file(loaded, level or loaded.run.level, motors, column, out, method)
    warn(*notes)
