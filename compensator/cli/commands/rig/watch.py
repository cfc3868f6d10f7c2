"""`tendonff watch`: drift of a joint over its use."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    YesOption,
    looked_at,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import InputError


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

    if not data:
        raise InputError("no log given; name at least one with --data, in the order of use")
    loaded = looked_at(scenario, follows_reference=False, yes=yes)
    from tendonff.compensator import works

    watched = works.function_of("watch", loaded)
    given = {
        "time_column": time_column,
        "input_column": input_column,
        "input_position_column": input_position_column,
        "torque_constant_N_m_per_A": torque_constant,
    }
    how = replace(loaded.measurement, **{key: value for key, value in given.items() if value is not None})  # type: ignore[arg-type]
    with atomic_directory(out) as folder:
        with progress("watching") as advance:
            found = watched(loaded, data, how=how, confirm=lambda _: yes, progress=advance)
        with progress("writing"):
            found.write(folder, pdf=pdf)
    warn(*found.warnings)
    say(found.headline, f"report: {out / 'report.html'}")
