"""File of motor angles and check of the step, common to all mechanisms behind motors."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.motors.drive import driven
from tendonff.compensator.files.reading import FloatArray, InputError, read_csv
from tendonff.compensator.files.tables import table_dialect
from tendonff.models.joint.parameters import JointDrive
from tendonff.ocp.tendon.crosscheck import NUDGE, StepTally


def read_motors(path: Path, motors: Sequence[str], step_s: float, column: str | None = None) -> FloatArray:
    """Motor angles of a file at the steps of a run, straight between its rows from 0, shape (rows, motors) [rad].

    Parameters
    ----------
    path : Path
    motors : sequence of str
        Names; the only motor of a loop has none.
    step_s : float
    column : str, optional
        Name of the columns, where NAME stands for the motor's; default: `motor_NAME_rad`, in a profile.csv
        `motor_NAME_inverse_rad`.

    Raises
    ------
    InputError
        If the file has no meaning.
    """
    names = _columns(path, motors, column)
    table = read_csv(path, ("time_s", *names), increasing="time_s", starts_at_zero=True)
    rows = int(table["time_s"][-1] / step_s * (1 + 1e-9) + 1e-9) + 1
    if rows < 2:
        raise InputError(f"{path.name}: ends at {table['time_s'][-1]:g} s, before the first step of {step_s:g} s")
    time = np.arange(rows) * step_s
    return np.column_stack([np.interp(time, table["time_s"], table[name]) for name in names])


def _columns(path: Path, motors: Sequence[str], column: str | None) -> list[str]:
    if column is not None:
        if len(motors) > 1 and "NAME" not in column:
            raise InputError(
                f"{path.name}: {len(motors)} motors have a column each; write NAME for the motor's name, such as "
                f'--force-column motor_NAME_linear_rad, got "{column}"'
            )
        return [column.replace("NAME", name) for name in motors]
    plain, designed = ([f"motor{'_' * bool(m)}{m}{part}_rad" for m in motors] for part in ("", "_inverse"))
    known = table_dialect(path, ("time_s", *plain, *designed)).names
    return [a if a in known or b not in known else b for a, b in zip(plain, designed, strict=True)]


def behind(drives: Sequence[JointDrive], commands_rad: FloatArray, step_s: float) -> FloatArray:
    """Angles of the drums for commands, shape (rows, motors) [rad]; see `driven`."""
    columns = zip(drives, commands_rad.T, strict=True)
    return np.column_stack([driven(drive, column[:, None], step_s)[:, 0] for drive, column in columns])


def finer(rows: FloatArray, parts: int) -> FloatArray:
    """Straight lines between rows, shape (rows, ...), cut into parts each."""
    at = np.arange((len(rows) - 1) * parts + 1) / parts
    columns = np.asarray(rows, dtype=np.float64).reshape(len(rows), -1).T
    found = np.column_stack([np.interp(at, np.arange(len(rows)), column) for column in columns])
    return found.reshape(-1, *rows.shape[1:])


def check_step(
    respond: Callable[[FloatArray, int], FloatArray],
    drums_rad: FloatArray,
    outputs: FloatArray,
    step_s: float,
    quantity: str,
    unit: str,
) -> str:
    """Discretisation error of a simulation, in words.

    Parameters
    ----------
    respond : callable
        Outputs, shape (rows, ...), under drums whose rows are so many parts of a step apart; SolveError if it fails.
    drums_rad : ndarray, shape (rows, motors)
    outputs : ndarray, shape (rows, ...)
        Their response with the step of the run.
    step_s : float
    quantity, unit : str
        Of the outputs, in words.
    """
    by_parts = {parts: respond(finer(drums_rad, parts), parts)[::parts] for parts in (2, 4)}
    tally = StepTally(quantity, unit, step_s)
    tally.add({1: outputs} | by_parts, respond(drums_rad * (1 + NUDGE), 1))
    return tally.result().text
