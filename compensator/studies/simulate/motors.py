"""Simulation of a mechanism under motor angles from a file.

A force file of one tendon is read and simulated by `run`: a log of hours passes row by row, in bounded memory, which a
mechanism that is judged as a whole does not; and what drives a tendon is a force or a position, in units of the file.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.every import AnyScenario, problem_of
from tendonff.compensator.compensators.motors.drive import driven
from tendonff.compensator.compensators.motors.response import finer
from tendonff.compensator.compensators.motors.task import MotorTask
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.reading import FloatArray, InputError, read_csv
from tendonff.compensator.files.tables import table_dialect
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.scenario.sampled.joint_motion import motion_by_file
from tendonff.compensator.studies.simulate.result import SimulatedFile
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import JointDrive
from tendonff.models.turns import in_turn
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.tendon.crosscheck import NUDGE, StepTally


@in_turn
def simulate_motor_file(
    scenario: AnyScenario,
    level: Level,
    motors: Path,
    out: Path,
    *,
    column: str | None = None,
    joints: Path | None = None,
    check: bool = False,
    method: Method = Method.BDF2,
    accept: bool = False,  # noqa: ARG001  a file of angles raises no doubt
    progress: Progress = silent,  # noqa: ARG001  one call computes all
) -> SimulatedFile:
    """Simulate a mechanism under motor angles of a file, and write a table; see `door.simulate_file`.

    Parameters
    ----------
    scenario : JointScenario or FingerScenario
    level : Level
    motors : Path
        Columns time_s and motor_NAME_rad of each motor (of a profile.csv motor_NAME_inverse_rad), of a loop's only
        motor motor_rad; straight between rows, from 0.
    out : Path
        CSV file: time_s, angles and torques of the motors, what the joints do, tensions at the far ends and at the
        drums.
    column : str, optional
        Name of the motors' columns, where NAME stands for the motor's.
    joints : Path, optional
        Motion of the joints that no tendon drives.
    check : bool, optional
    method : Method, optional

    Raises
    ------
    InputError
        If a file has no meaning.
    SolveError
        If the simulation fails.
    """
    task: MotorTask = problem_of(scenario, level).without_homing
    step, file = task.step_s, scenario.source.name
    drums = behind(task.drives, read_motors(motors, task.columns, step, column), step)
    time = np.arange(float(len(drums))) * step
    if joints is not None:
        task = task.with_motion(motion_by_file(task.sampled.motion, tuple(scenario.joints), joints, time[-1], file))
    found = task.turned(drums, method=method)
    response, tendons = found.response, [tendon.name for tendon in task.system.tendons]
    names = [f"_{name}" * bool(name) for name in task.columns]
    columns: dict[str, FloatArray] = {"time_s": time}
    columns |= {f"motor{name}_rad": response.motor_rad[:, k] for k, name in enumerate(names)}
    columns |= {f"motor_torque{name}_N_m": response.torque_N_m[:, k] for k, name in enumerate(names)}
    columns |= found.columns
    columns |= {f"tension_{name}_N": response.tension_N[:, k] for k, name in enumerate(tendons)}
    columns |= {f"tension_{name}_at_drum_N": response.drum_N[:, k] for k, name in enumerate(tendons)}
    tally = check_step(task, drums, found.outputs) if check else None
    write_csv(out, columns)
    return SimulatedFile(rows=len(time), warnings=(response.slack,) * bool(response.slack), check=tally)


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


def check_step(task: MotorTask, drums_rad: FloatArray, outputs: FloatArray) -> str:
    """Discretisation error of a simulation, in words; `outputs`, shape (rows, n), are those of the run itself."""
    tally = StepTally(task.goal.title.lower(), task.unit.key.replace("_", " "), task.step_s)
    by_parts = {parts: task.turned(finer(drums_rad, parts), parts=parts).outputs[::parts] for parts in (2, 4)}
    tally.add({1: outputs} | by_parts, task.turned(drums_rad * (1 + NUDGE)).outputs)
    return tally.result().text
