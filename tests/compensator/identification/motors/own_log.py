"""Logs of the mechanism's own simulation: cheap, for what does not need an independent plant."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.motors.loop_routine import suggest_routine
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.models.joint.parameters import Mechanism
from tendonff.ocp.fits.mechanism import Loop, MotorRun, respond
from tests.hidden_loop import COUNT_RAD, hidden, scenario


def other(**drive: float) -> Mechanism:
    """A loop that is not the scenario's."""
    true = hidden(6).mechanism
    return replace(true, drive=replace(true.drive, **drive))  # type: ignore[arg-type]


def write(
    folder: Path,
    true: Mechanism,
    asked: JointScenario | None = None,
    *,
    encoder: bool = False,
    dip_rad: float = 0.0,
    moves_in_counts: bool | None = None,
) -> Path:
    """Log of the suggested routine, with the noise of a current; a dip goes below its start at the end.

    A motor that moves in counts goes straight from one to the next; one that does not is read in counts.
    """
    routine = suggest_routine(asked or scenario())
    dip = -dip_rad * np.sin(np.pi * np.arange(1, 201) / 200) ** 2 if dip_rad else np.empty(0)
    motor = np.concatenate([routine.motor_rad, routine.motor_rad[-1] + dip])
    counts = np.round(motor / COUNT_RAD) * COUNT_RAD
    run = MotorRun.of_one(motor, 0.01, 0.0, counts)
    answer = respond(
        Loop(mechanism=true), run, segments=16, refinement=10 if moves_in_counts else 4, as_read=bool(moves_in_counts)
    )
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(motor))
    columns = {
        "time_s": 0.01 * np.arange(len(motor)),
        "motor_rad": motor if moves_in_counts is None else counts,
        "motor_torque_N_m": answer.torque_N_m[:, 0] + noise,
        "joint_rad": answer.angle_rad[:, 0],
    }
    write_csv(folder / "log.csv", columns if encoder else {k: v for k, v in columns.items() if k != "joint_rad"})
    return folder / "log.csv"
