"""Simulation of driven joints under motor angles from a file."""

from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.motors.drive import driven
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.reading import FloatArray, InputError, read_csv
from tendonff.compensator.files.tables import table_dialect
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.finger.scenario import FingerScenario
from tendonff.compensator.studies.simulate.result import SimulatedFile
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.errors import SolveError
from tendonff.ocp.mechanism.response import MechanismStatus, simulate_mechanism


@in_turn
def simulate_finger_file(
    scenario: FingerScenario,
    level: Level,
    motors: Path,
    out: Path,
    *,
    accept: bool = False,  # noqa: ARG001  a file of angles raises no doubt
    progress: Progress = silent,  # noqa: ARG001  one call computes all
) -> SimulatedFile:
    """Simulate several joints under motor angles of a file, and write a table.

    Parameters
    ----------
    scenario : FingerScenario
    level : Level
    motors : Path
        Columns time_s and motor_NAME_rad of each motor (of a profile.csv motor_NAME_inverse_rad); straight between
        rows, from 0.
    out : Path
        CSV file: time_s, angles and torques of the motors, angles of the joints, tensions at the far ends and at the
        drums.

    Raises
    ------
    InputError
        If a file has no meaning.
    SolveError
        If the simulation fails.
    """
    finger, step = scenario.mechanism, scenario.run.step_s
    names = _columns(scenario, motors)
    table = read_csv(motors, ("time_s", *names), increasing="time_s", starts_at_zero=True)
    rows = int(table["time_s"][-1] / step * (1 + 1e-9) + 1e-9) + 1
    if rows < 2:
        raise InputError(f"{motors.name}: ends at {table['time_s'][-1]:g} s, before the first step of {step:g} s")
    time = np.arange(rows) * step
    drums = np.column_stack(
        [
            driven(motor.drive, np.interp(time, table["time_s"], table[name])[:, None], step)[:, 0]
            for motor, name in zip(finger.motors, names, strict=True)
        ]
    )
    task = FingerTask.of(scenario, level)
    at = task.sampled.time_s

    def stretched(given: FloatArray) -> FloatArray:
        return np.column_stack([np.interp(time, at, each) for each in given.T])

    run = simulate_mechanism(
        task.problem(finger),
        drums,
        step,
        known=stretched(task.sampled.motion.angle_rad),
        effort=stretched(task.efforts),
    )
    if run.status is MechanismStatus.FAILED:
        raise SolveError(run.message)
    columns: dict[str, FloatArray] = {"time_s": run.time_s}
    columns |= {f"motor_{m.name}_rad": run.motor[:, k] for k, m in enumerate(finger.motors)}
    columns |= {f"motor_torque_{m.name}_N_m": run.effort[:, k] for k, m in enumerate(finger.motors)}
    columns |= {f"joint_{name}_rad": run.position[:, k] for k, name in enumerate(finger.names)}
    columns |= {f"tension_{t.name}_N": run.tension_N[:, k] for k, t in enumerate(finger.tendons)}
    columns |= {f"tension_{t.name}_at_drum_N": run.drum_N[:, k] for k, t in enumerate(finger.tendons)}
    write_csv(out, columns)
    slack = (run.message,) if run.status is MechanismStatus.SLACK else ()
    return SimulatedFile(rows=len(run.time_s), warnings=slack)


def _columns(scenario: FingerScenario, motors: Path) -> tuple[str, ...]:
    """Columns to read of a file of motor angles."""
    names = [motor.name for motor in scenario.mechanism.motors]
    plain, designed = ([f"motor_{name}{part}_rad" for name in names] for part in ("", "_inverse"))
    known = table_dialect(motors, ("time_s", *plain, *designed)).names
    return tuple(a if a in known or b not in known else b for a, b in zip(plain, designed, strict=True))
