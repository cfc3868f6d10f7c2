"""Errors of the exported commands of a finger, against those of the lengths of its tendons alone."""

from dataclasses import replace

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.finger.compensators import REFINEMENT, FingerTask
from tendonff.compensator.joint.export.judgement import JudgedJoint
from tendonff.compensator.joint.plant import verifying_masses


def judge_finger(task: FingerTask, name: str, command_rad: FloatArray) -> JudgedJoint:
    """Simulate commands, and those by lengths alone, on the mechanism that a design is verified on."""
    masses, errors = verifying_masses(task.finger), []
    plain = next(each for each in task.compensators if each.name == "linear").command_rad(task)
    for command in (command_rad, plain):
        run = task.respond(task.finger, command, masses, REFINEMENT)
        errors.append(float(np.sqrt(np.mean((run.position[:, : task.scenario.wanted] - task.wanted_rad) ** 2))))
    span = float(np.ptp(task.wanted_rad, axis=0).max())
    judged = JudgedJoint(name=name, rms=errors[0], plain_rms=errors[1], range=span, is_angle=True, fault="")
    if errors[0] < errors[1]:
        return judged
    fault = f"RMS error {judged.text(errors[0])}, not better than the lengths alone ({judged.text(errors[1])})"
    return replace(judged, fault=fault)
