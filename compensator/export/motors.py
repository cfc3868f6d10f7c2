"""Contents of an export of driven joints, and the errors of its commands against those of the ratio alone."""

import math
import os
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.live import expect_live
from tendonff.compensator.compensators.motors.task import MotorTask
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.files.writing import write_folder
from tendonff.ocp.errors import SolveError


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

    @property
    def line(self) -> str:
        """The errors in words."""
        plain = self.text(self.plain_rms)
        return f"{self.name}: RMS error {self.text(self.rms)} with exactly these parameters, by the ratio alone {plain}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedMotors:
    """Content of an export of driven joints, before it is written.

    Attributes
    ----------
    files : dict of str to str
        Text by file name.
    judged : tuple of JudgedJoint
        Of each joint or, over all its joints, of each finger.
    loss_rad : float or None
        Largest departure of the compiled code from the model; None without a compiler.
    headlines : tuple of str
        Expected error of each over what is uncertain, with the next step.
    warnings : tuple of str
        What the user should know, one sentence each.
    """

    files: dict[str, str] = field(repr=False)
    judged: tuple[JudgedJoint, ...]
    loss_rad: float | None
    headlines: tuple[str, ...]
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self.files)} files; {' '.join(self.headlines)}>"

    @property
    def notes(self) -> tuple[str, ...]:
        """None so far."""
        return ()

    @property
    def lines(self) -> tuple[str, ...]:
        """Errors in words, beside those of the ratio alone, the departure of compiled code, and what to expect."""
        lines = [each.line for each in self.judged]
        if self.loss_rad is not None:
            lines.append(f"compiled here, the code departs from the model by {self.loss_rad:.2g} rad at most")
        return (*lines, *(f"{j.name}: {each}" for j, each in zip(self.judged, self.headlines, strict=True)))

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write every file, all or nothing; makes the folder."""
        write_folder(self.files, folder)


def live_headline(task: MotorTask, source: Path) -> str:
    """Expected error on a rig where the reference arrives live, and the next step."""
    found = expect_live(task)
    return found.headline(
        "exact inverse", next_step(found, as_argument(source), "call it once per sample, and watch its status")
    )


def rms_of(task: MotorTask, command_rad: FloatArray) -> float:
    """RMS error of commands on the mechanism that a design is verified on [rad or N m]."""
    run = task.respond(task.system, command_rad, masses=task.masses, refinement=task.refinement)
    return float(np.sqrt(np.mean((run.output[task.lead :] - task.target) ** 2)))


def judge(task: MotorTask, name: str, command_rad: FloatArray) -> JudgedJoint:
    """Simulate commands, and those of the ratio alone, on the mechanism that a design is verified on."""
    errors = [rms_of(task, command) for command in (command_rad, task.commanded(task.lengths_rad, by_ratio=True))]
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


def stated(judged: JudgedJoint, *, force_export: bool) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Error of the unit in words, and warnings; SolveError where it is of no use, and not made all the same."""
    if judged.fault and not force_export:
        raise SolveError(
            f"no unit is made: {judged.fault}. Let the reference move more slowly, or make it all the same with "
            "--force-export"
        )
    return (judged.line,), (f"{judged.fault}; made because of --force-export",) if judged.fault else ()
