"""Simulation of driven joints under motor angles from a file."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.sampled.joint_motion import motion_by_file
from tendonff.compensator.studies.simulate.motors import behind, check_step, finer, read_motors
from tendonff.compensator.studies.simulate.result import SimulatedFile
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.mechanism.response import MechanismRun, MechanismStatus, simulate_mechanism


@in_turn
def simulate_finger_file(
    scenario: FingerScenario,
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
    """Simulate several joints under motor angles of a file, and write a table; see `door.simulate_file`.

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
    finger, step = scenario.mechanism, scenario.run.step_s
    commands = read_motors(motors, [motor.name for motor in finger.motors], step, column)
    drums = behind([motor.drive for motor in finger.motors], commands, step)
    time = np.arange(float(len(drums))) * step
    task = FingerTask.of(scenario, level)
    if joints is not None:
        motion = motion_by_file(task.sampled.motion, tuple(scenario.joints), joints, time[-1], scenario.source.name)
        task = replace(task, sampled=replace(task.sampled, motion=motion))
    problem = task.problem(finger)
    known, effort = task.sampled.motion.at(time), np.zeros((len(time), problem.known))
    for k, given in enumerate(task.sampled.effort_N_m.T):
        effort[:, k] = np.interp(time, task.sampled.time_s, given)

    def respond(drums: FloatArray, parts: int, method: Method = Method.BDF2) -> MechanismRun:
        given = finer(known, parts), finer(effort, parts)
        run = simulate_mechanism(problem, drums, step / parts, known=given[0], effort=given[1], method=method)
        if run.status is MechanismStatus.FAILED:
            raise SolveError(run.message)
        return run

    def angles(drums: FloatArray, parts: int) -> FloatArray:
        return respond(drums, parts).position[:, : len(finger.joints)]

    run = respond(drums, 1, method)
    columns: dict[str, FloatArray] = {"time_s": run.time_s}
    columns |= {f"motor_{m.name}_rad": run.motor[:, k] for k, m in enumerate(finger.motors)}
    columns |= {f"motor_torque_{m.name}_N_m": run.effort[:, k] for k, m in enumerate(finger.motors)}
    columns |= {f"joint_{name}_rad": run.position[:, k] for k, name in enumerate(finger.names)}
    columns |= {f"tension_{t.name}_N": run.tension_N[:, k] for k, t in enumerate(finger.tendons)}
    columns |= {f"tension_{t.name}_at_drum_N": run.drum_N[:, k] for k, t in enumerate(finger.tendons)}
    outputs = run.position[:, : len(finger.joints)]
    found = check_step(angles, drums, outputs, step, "joint angles", "rad") if check else None
    write_csv(out, columns)
    slack = (run.message,) if run.status is MechanismStatus.SLACK else ()
    return SimulatedFile(rows=len(run.time_s), warnings=slack, check=found)
