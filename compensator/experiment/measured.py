"""Measured tensions of the same test, laid over the simulated ones."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonff.compensator.experiment.result import SECTIONS, ExperimentRun, MeasuredTensions
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.tables import read_table

COLUMNS = tuple(f"tension_{k + 1}_N" for k in range(SECTIONS))


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Measured against simulated, over the time that both have."""

    sensor: int  # place along the path, 1 at motor 1 to 7 at motor 2
    # measured_rms_percent_of_range, measured_max_percent_of_range: of the range of the simulated run
    measured_rms_percent_of_range: float
    measured_max_percent_of_range: float


def read_measured(path: Path) -> MeasuredTensions:
    """Read a file with `time_s` and any of `tension_1_N` .. `tension_7_N`; its time counts from the start of the test.

    Raises
    ------
    InputError
        If the file has no time or none of the tensions, or starts after the test.
    """
    table = read_table(path, ("time_s", *COLUMNS))
    there = [k for k, name in enumerate(COLUMNS) if name in table.columns]
    if "time_s" not in table.columns or not there:
        raise InputError(
            f"{path.name}: --measured needs the column time_s and at least one of tension_1_N (motor 1) to "
            f"tension_{SECTIONS}_N (motor 2); it has {', '.join(table.columns)}"
        )
    time, _ = table.seconds("time_s")
    rows = np.column_stack([time, *(table.numbers(COLUMNS[k]) for k in there)])
    rows = rows[np.isfinite(rows).all(axis=1)]
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    if len(rows) < 2:
        raise InputError(f"{path.name}: {len(rows)} rows hold numbers in all columns; at least 2 are needed")
    return MeasuredTensions(
        name=path.name, time_s=rows[:, 0], tension_N={k: rows[:, j + 1] for j, k in enumerate(there)}
    )


def deviations(run: ExperimentRun, measured: MeasuredTensions) -> tuple[Deviation, ...]:
    """Difference of each measured tension from a run.

    Raises
    ------
    InputError
        If no measured row lies within the test.
    """
    inside = (measured.time_s >= run.time_s[0]) & (measured.time_s <= run.time_s[-1])
    if not inside.any():
        raise InputError(
            f"{measured.name}: time_s goes from {measured.time_s[0]:g} to {measured.time_s[-1]:g} s, the test from 0 "
            f"to {run.time_s[-1]:g} s; let the measured time start with the test"
        )
    found = []
    for k, tension in measured.tension_N.items():
        simulated = np.interp(measured.time_s[inside], run.time_s, run.tension_N[:, k])
        off = 100 * (tension[inside] - simulated) / run.range_N
        found.append(
            Deviation(
                sensor=k + 1,
                measured_rms_percent_of_range=float(np.sqrt(np.mean(off**2))),
                measured_max_percent_of_range=float(np.abs(off).max()),
            )
        )
    return tuple(found)
