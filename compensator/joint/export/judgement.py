"""Errors of the exported commands of a joint, against those of the ratio alone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.joint.compensators import linear_motor_rad
from tendonff.compensator.joint.drive import commanded, known_by_ratio
from tendonff.compensator.joint.plant import REFINEMENT, JointPlant, verifying_masses
from tendonff.compensator.joint.scenario.reference import JointQuantity
from tendonff.compensator.joint.scenario.scenario import JointScenario, SampledJoint
from tendonff.compensator.joint.task import MotorTask


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
    judged: Sequence[JudgedJoint], plain: str, loss_rad: float | None = None, headlines: Sequence[str] = ()
) -> tuple[str, ...]:
    """Errors in words, beside those of what is `plain`, the departure of compiled code, and what to expect of each."""
    compiled = (
        () if loss_rad is None else (f"compiled here, the code departs from the model by {loss_rad:.2g} rad at most",)
    )
    rows = [
        f"{j.name}: RMS error {j.text(j.rms)} with exactly these parameters, by the {plain} alone {j.text(j.plain_rms)}"
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


def judge_joint(scenario: JointScenario, sampled: SampledJoint, command_rad: FloatArray) -> JudgedJoint:
    """Simulate commands, and those of the ratio alone, on the mechanism that a design is verified on."""
    mechanism, step = scenario.mechanism, scenario.run.step_s
    plant = JointPlant(
        mechanism=mechanism,
        scenario=scenario,
        sampled=sampled,
        masses=verifying_masses(mechanism),
        refinement=REFINEMENT,
    )
    plain = commanded(known_by_ratio(mechanism.drive), linear_motor_rad(scenario, sampled), step)
    errors = []
    for command in (command_rad, plain):
        error = (plant.reached(plant.respond(command)) - sampled.wanted)[sampled.lead :]
        errors.append(float(np.sqrt(np.mean(error**2))))
    judged = JudgedJoint(
        name=mechanism.joint.name,
        rms=errors[0],
        plain_rms=errors[1],
        range=sampled.range,
        is_angle=scenario.reference.quantity is JointQuantity.ANGLE,
        fault="",
    )
    if errors[0] < errors[1]:
        return judged
    fault = f"RMS error {judged.text(errors[0])}, not better than the ratio alone ({judged.text(errors[1])})"
    return replace(judged, fault=fault)
