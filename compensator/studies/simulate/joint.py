"""Simulation of a joint under motor angles from a file."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.scenario.driven.joint import JointScenario, sample_joint
from tendonff.compensator.scenario.sampled.joint_motion import motion_by_file
from tendonff.compensator.studies.simulate.motors import behind, check_step, finer, read_motors
from tendonff.compensator.studies.simulate.result import SimulatedFile
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import DriveKind
from tendonff.models.turns import in_turn
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.joint.simulate import JointOutcome, JointSimulation, simulate_joint
from tendonff.ocp.joint.start import joint_problem


@in_turn
def simulate_joint_file(
    scenario: JointScenario,
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
    """Simulate a joint under motor angles of a file, and write a table; see `door.simulate_file`.

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
    mechanism, step = scenario.mechanism, scenario.run.step_s
    loop = mechanism.drive.kind is DriveKind.LOOP
    names = [""] if loop else [tendon.name for tendon in mechanism.tendons]
    drums = behind([mechanism.drive] * len(names), read_motors(motors, names, step, column), step)
    time = np.arange(float(len(drums))) * step
    whole = replace(scenario.mechanism, drive=replace(mechanism.drive, homing_rad=0.0))  # the file says what is turned
    sampled = sample_joint(replace(scenario, mechanism=whole))
    motion = sampled.motion
    if joints is not None:
        motion = motion_by_file(motion, tuple(scenario.joints), joints, time[-1], scenario.source.name)
    try:
        problem = joint_problem(mechanism, level, motion)
    except ParameterError as error:
        raise InputError(f"{scenario.source.name}: {error}") from None
    contact = np.interp(time, sampled.time_s, sampled.contact_N_m)
    led = None if scenario.motion is None else np.interp(time, sampled.time_s, sampled.angle_rad)

    def respond(drums: FloatArray, parts: int, method: Method = Method.BDF2) -> JointSimulation:
        return simulate_joint(
            problem,
            drums,
            step / parts,
            contact_N_m=finer(contact, parts) if led is None else float(contact[0]),
            led_rad=None if led is None else finer(led, parts),
            method=method,
        ).require()

    def output(run: JointSimulation) -> FloatArray:
        return run.angle_rad if led is None else run.torque_N_m

    run, found = respond(drums, 1, method), None
    if check:
        quantity = ("joint angle", "rad") if led is None else ("joint torque", "N m")
        found = check_step(lambda d, parts: output(respond(d, parts)), drums, output(run), step, *quantity)
    columns: dict[str, FloatArray] = {"time_s": run.time_s}
    columns |= {name: run.motor_rad[:, k] for k, name in enumerate(_motor_columns(scenario))}
    columns |= {name: run.motor_torque_N_m[:, k] for k, name in enumerate(_torque_columns(scenario))}
    columns |= {"angle_rad": run.angle_rad, "torque_N_m": run.torque_N_m}
    for k, tendon in enumerate(mechanism.tendons):
        columns[f"tension_{tendon.name}_N"] = run.tension_N[:, k]
    for k, tendon in enumerate(mechanism.tendons):
        columns[f"tension_{tendon.name}_at_drum_N"] = run.drum_N[:, k]
    write_csv(out, columns)
    slack = (run.message,) if run.outcome is JointOutcome.SLACK else ()
    return SimulatedFile(rows=len(time), warnings=slack, check=found)


def _motor_columns(scenario: JointScenario) -> tuple[str, ...]:
    if scenario.mechanism.drive.kind is DriveKind.LOOP:
        return ("motor_rad",)
    return tuple(f"motor_{tendon.name}_rad" for tendon in scenario.mechanism.tendons)


def _torque_columns(scenario: JointScenario) -> tuple[str, ...]:
    if scenario.mechanism.drive.kind is DriveKind.LOOP:
        return ("motor_torque_N_m",)  # the name that identification reads
    return tuple(f"motor_torque_{tendon.name}_N_m" for tendon in scenario.mechanism.tendons)
