"""Errors of the exported commands of a joint, against those of the ratio alone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.motors.task import MotorTask
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.text import as_argument


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedJoint:
    """Errors of the exported commands of a joint.

    Attributes
    ----------
    name : str
        Of the joint.
    rms, plain_rms : float
        RMS error of the exported inverse and of the ratio alone, on the verifying mechanism [rad or N m].
    range : float
        Of the reference [rad or N m].
    is_angle : bool
    fault : str
        Why it should not run on the rig; empty where nothing speaks against it.
    """

    name: str
    rms: float
    plain_rms: float
    range: float
    is_angle: bool
    fault: str

    def text(self, value: float) -> str:
        """An error in degrees or N m."""
        return f"{math.degrees(value):.2g} deg" if self.is_angle else f"{value:.2g} N m"


def judgement_lines(
    judged: Sequence[JudgedJoint], loss_rad: float | None = None, headlines: Sequence[str] = ()
) -> tuple[str, ...]:
    """Errors in words, beside those of the ratio alone, the departure of compiled code, and what to expect of each."""
    compiled = (
        () if loss_rad is None else (f"compiled here, the code departs from the model by {loss_rad:.2g} rad at most",)
    )
    rows = [
        f"{j.name}: RMS error {j.text(j.rms)} with exactly these parameters, by the ratio alone {j.text(j.plain_rms)}"
        for j in judged
    ]
    expected = (f"{j.name}: {headline}" for j, headline in zip(judged, headlines, strict=False))
    return (*rows, *compiled, *expected)


def live_headline(task: MotorTask, source: Path) -> str:
    """Expected error on a rig where the reference arrives live, and the next step."""
    found = task.expect_live()
    return found.headline(
        "exact inverse", next_step(found, as_argument(source), "call it once per sample, and watch its status")
    )


def judge(task: MotorTask, name: str, command_rad: FloatArray) -> JudgedJoint:
    """Simulate commands, and those of the ratio alone, on the mechanism that a design is verified on."""
    errors = []
    for command in (command_rad, task.commanded(task.lengths_rad, by_ratio=True)):
        run = task.respond(task.system, command, masses=task.masses, refinement=task.refinement)
        errors.append(float(np.sqrt(np.mean((run.output[task.lead :] - task.target) ** 2))))
    judged = JudgedJoint(
        name=name,
        rms=errors[0],
        plain_rms=errors[1],
        range=scale_of(task.wanted),
        is_angle=task.unit.key == "rad",
        fault="",
    )
    if errors[0] < errors[1]:
        return judged
    fault = f"RMS error {judged.text(errors[0])}, not better than the ratio alone ({judged.text(errors[1])})"
    return replace(judged, fault=fault)
