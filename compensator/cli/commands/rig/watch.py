"""`tendonff watch`: drift of a joint over its use."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    joint_looked_at,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenario.measurement import Measurement


def watch(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("watch"),
    data: Annotated[
        list[Path] | None, option("--data", "DAY.csv", "Log of the motor, in the order of use; may be repeated.")
    ] = None,
    time_column: Annotated[str | None, option("--time-column", None, "Name of the column of time.")] = None,
    input_column: Annotated[
        str | None, option("--input-column", None, "Name of the column of the motor's torque or current.")
    ] = None,
    input_position_column: Annotated[
        str | None, option("--input-position-column", None, "Name of the column of the motor's angle.")
    ] = None,
    torque_constant: Annotated[
        float | None, option("--torque-constant", "N_M_PER_A", "Torque over current of the motor, in N m/A.")
    ] = None,
    pdf: PdfOption = False,
    yes: YesOption = False,
) -> None:
    """Watch friction and pre-tension of a joint drift.

    Reads logs of the motor of an identified loop in the order of use; an alarm names what has changed.
    """
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.joint.scenario.detect import is_joint_file

    if not is_joint_file(scenario) and scenario.exists():
        raise InputError(
            f"{scenario.name}: watch is for a joint between tendons; tendonff identify with several --data reports how "
            "the values of one tendon drift"
        )
    if not data:
        raise InputError("no log given; name at least one with --data, in the order of use")
    loaded = joint_looked_at(scenario, follows_reference=False, yes=yes)
    given = {
        "time_column": time_column,
        "input_column": input_column,
        "input_position_column": input_position_column,
        "torque_constant_N_m_per_A": torque_constant,
    }
    how = replace(Measurement(), **{key: value for key, value in given.items() if value is not None})  # type: ignore[arg-type]
    from tendonff.compensator.studies.watch.run import watch as watch_files

    with atomic_directory(out) as folder:
        with progress("watching") as advance:
            found = watch_files(loaded, data, how=how, progress=advance)
        with progress("writing"):
            found.write(folder, pdf=pdf)
    warn(*found.warnings)
    say(found.headline, f"report: {out / 'report.html'}")
