"""Simulation of a joint under motor angles from a file."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.motors.drive import driven
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.reading import FloatArray, InputError, read_csv
from tendonff.compensator.files.tables import table_dialect
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.joint.scenario.scenario import JointScenario, sample_joint
from tendonff.compensator.studies.simulate.result import SimulatedFile
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import DriveKind
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.joint.simulate import JointOutcome, simulate_joint
from tendonff.ocp.joint.start import joint_problem

_LOOP_COLUMNS = ("motor_rad", "motor_inverse_rad")


def simulate_joint_file(
    scenario: JointScenario,
    level: Level,
    motors: Path,
    out: Path,
    *,
    column: str | None = None,
    method: Method = Method.BDF2,
    accept: bool = False,  # noqa: ARG001  a file of angles raises no doubt
    progress: Progress = silent,  # noqa: ARG001  one call computes all
) -> SimulatedFile:
    """Simulate a joint under motor angles of a file, and write a table.

    Parameters
    ----------
    scenario : JointScenario
    level : Level
    motors : Path
        Columns time_s and motor_rad of a loop (of a profile.csv motor_inverse_rad), motor_NAME_rad of each tendon of a
        pair; straight between rows, from 0.
    out : Path
        CSV file: time_s, angles and torques of the motors, angle_rad, torque_N_m of the tendons on the joint, tensions
        at the joint and at the drums.
    column : str, optional
        Column of a loop's motor, if it has another name.
    method : Method, optional

    Raises
    ------
    InputError
        If a file has no meaning.
    SolveError
        If the simulation fails.
    """
    mechanism, step = scenario.mechanism, scenario.run.step_s
    names = _columns(scenario, motors, column)
    table = read_csv(motors, ("time_s", *names), increasing="time_s", starts_at_zero=True)
    rows = int(table["time_s"][-1] / step * (1 + 1e-9) + 1e-9) + 1
    if rows < 2:
        raise InputError(f"{motors.name}: ends at {table['time_s'][-1]:g} s, before the first step of {step:g} s")
    time = np.arange(rows) * step
    motor = np.column_stack([np.interp(time, table["time_s"], table[name]) for name in names])
    whole = replace(scenario.mechanism, drive=replace(mechanism.drive, homing_rad=0.0))  # the file says what is turned
    sampled = sample_joint(replace(scenario, mechanism=whole))
    try:
        problem = joint_problem(mechanism, level, sampled.motion)
    except ParameterError as error:
        raise InputError(f"{scenario.source.name}: {error}") from None
    contact = np.interp(time, sampled.time_s, sampled.contact_N_m)
    led = None if scenario.motion is None else np.interp(time, sampled.time_s, sampled.angle_rad)
    run = simulate_joint(
        problem,
        driven(mechanism.drive, motor, step),
        step,
        contact_N_m=contact if led is None else float(contact[0]),
        led_rad=led,
        method=method,
    ).require()
    columns: dict[str, FloatArray] = {"time_s": run.time_s}
    columns |= {name: run.motor_rad[:, k] for k, name in enumerate(_motor_columns(scenario))}
    columns |= {name: run.motor_torque_N_m[:, k] for k, name in enumerate(_torque_columns(scenario))}
    columns |= {"angle_rad": run.angle_rad, "torque_N_m": run.torque_N_m}
    for k, tendon in enumerate(mechanism.tendons):
        columns[f"tension_{tendon.name}_N"] = run.tension_N[:, k]
    for k, tendon in enumerate(mechanism.tendons):
        columns[f"tension_{tendon.name}_at_drum_N"] = run.drum_N[:, k]
    write_csv(out, columns)
    said = [run.message] if run.outcome is JointOutcome.SLACK else []
    if run.method is not method:
        said.append(
            f"simulated by {run.method}, without a C compiler: slower, to the same numbers within its tolerance"
        )
    return SimulatedFile(rows=len(time), warnings=tuple(said))


def _motor_columns(scenario: JointScenario) -> tuple[str, ...]:
    if scenario.mechanism.drive.kind is DriveKind.LOOP:
        return ("motor_rad",)
    return tuple(f"motor_{tendon.name}_rad" for tendon in scenario.mechanism.tendons)


def _torque_columns(scenario: JointScenario) -> tuple[str, ...]:
    if scenario.mechanism.drive.kind is DriveKind.LOOP:
        return ("motor_torque_N_m",)  # the name that identification reads
    return tuple(f"motor_torque_{tendon.name}_N_m" for tendon in scenario.mechanism.tendons)


def _columns(scenario: JointScenario, motors: Path, column: str | None) -> tuple[str, ...]:
    """Columns to read of a file of motor angles."""
    if scenario.mechanism.drive.kind is DriveKind.PAIR:
        if column is not None:
            raise InputError(f"{motors.name}: a pair has a column for each motor; leave --force-column out")
        return _motor_columns(scenario)
    if column is not None:
        return (column,)
    known = table_dialect(motors, ("time_s", *_LOOP_COLUMNS)).names
    return (next((name for name in _LOOP_COLUMNS if name in known), _LOOP_COLUMNS[0]),)
