"""Design of motor angles for driven joints: each compensator verified on a finer mechanism behind the drives."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tendonff.compensator.compensators.every import answering, chosen, problem_of
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.compensators.motors.joint import JointTask, joint_load
from tendonff.compensator.compensators.motors.registry import require_needed, tried
from tendonff.compensator.compensators.motors.response import MotorResponse
from tendonff.compensator.compensators.motors.sheet import joint_sheets, tendon_sheets
from tendonff.compensator.compensators.motors.task import UNSETTLED, MotorCompensator, MotorTask
from tendonff.compensator.files.notices import Danger, by_urgency
from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.finger_doubts import finger_doubts
from tendonff.compensator.scenario.driven.joint import JointScenario, SampledJoint
from tendonff.compensator.scenario.driven.joint_doubts import joint_doubts
from tendonff.compensator.studies.design.motors.result import MotorDesign, MotorProfile
from tendonff.models.joint.closed_form import (
    RECOMMENDED_MARGIN,
    DataSheet,
    GrossSliding,
    data_sheet,
    sweep_pretension,
)
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.models.turns import in_turn

LEAST_DAMPING_RATIO, LEAST_COMMANDS = 0.02, 20.0
"""A joint that damps its resonance less is shaken by commands that come less often than so many times a period [-]."""


@in_turn
def design_motors(
    scenario: JointScenario | FingerScenario,
    *,
    compensators: Sequence[MotorCompensator | str] | None = None,
    strict: bool = False,
    progress: Progress = silent,
) -> MotorDesign:
    """Design and verify the motor angles of driven joints; arguments and errors as of `tendonff.design`."""
    task: MotorTask = problem_of(scenario)
    if task.warnings and strict:
        raise InputError("; ".join(task.warnings))
    task.check_reach()
    inversion, lead = task.inversion, task.lead
    if strict and (refused := task.refusal):
        raise InputError(f"{scenario.source.name}: {refused}")
    tried_ones = answering(task) if compensators is None else chosen(task, compensators)
    require_needed(task, tried_ones)
    parts = Parts(progress, 2 * len(tried_ones) + 1)
    found = tried(task, tried_ones, parts)
    kept, profiles = slice(lead, None), {}
    for name, run in found.responses.items():
        after = run.rows(kept)
        profiles[name] = MotorProfile(
            name=name,
            motor_rad=found.commands[name][kept],
            reached=after.output,
            tension_N=after.tension_N,
            torque_N_m=after.torque_N_m,
            error=after.output - task.target,
        )
    expectation = task.expect(found.commands)
    own, told = _OWN[type(task)](task)
    warnings = [
        *task.warnings,
        *task.notes,
        *found.warnings,
        *(f"{name}: {run.message}" for name, run in found.responses.items() if run.message.startswith(UNSETTLED)),
        *_drive_warnings(task),
        *told,
    ]
    if not inversion.is_taut:
        warnings.append(Danger(inversion.message))
    parts.done(len(tried_ones) + 1)
    return MotorDesign(
        scenario=scenario,
        task=task,
        compensators=tuple(c for c in tried_ones if c.name in profiles),
        profiles=profiles,
        failed=found.failed,
        inversion=inversion.rows(kept),
        homing_rad=found.commands["inverse"][:lead],
        expectation=expectation,
        warnings=by_urgency(warnings),
        **own,
    )


def _one(task: JointTask) -> tuple[dict[str, Any], list[str]]:
    """Data sheet and feedback of one joint, and what they warn of."""
    sheet, sheets, warned = _data_sheet(task, task.inversion)
    settings = task.scenario.feedback
    feedback = None
    if settings is not None:
        from tendonff.compensator.feedback.joint import feedback_of  # slow to import, for few scenarios

        feedback = feedback_of(task, settings)
    told = [*map(str, joint_doubts(task.scenario)), *warned, *_ringing(task.mechanism, task.sampled)]
    told += () if feedback is None else feedback.warnings
    return {"sheet": sheet, "sheets": sheets, "tendons": (), "joints": (), "feedback": feedback}, told


def _several(task: FingerTask) -> tuple[dict[str, Any], list[str]]:
    """Data sheet of several joints, and what the numbers of the file warn of."""
    own = {"sheet": None, "sheets": (), "tendons": tendon_sheets(task), "joints": joint_sheets(task), "feedback": None}
    return own, [str(doubt) for doubt in finger_doubts(task.scenario)]


_SURPLUS = 3.0  # pre-tension over the recommended one that is worth a word

_OWN: Mapping[type[MotorTask], Callable[[Any], tuple[dict[str, Any], list[str]]]] = {
    JointTask: _one,
    FingerTask: _several,
}


def _data_sheet(
    task: JointTask, inversion: MotorResponse
) -> tuple[DataSheet | None, tuple[tuple[float, DataSheet], ...], list[str]]:
    """Closed forms of a loop, the same over pre-tensions, and what they warn of."""
    mechanism, sampled = task.mechanism, task.sampled
    if mechanism.drive.kind is not DriveKind.LOOP:
        return None, (), []
    others = {name: float(q[0]) for name, q in sampled.others(mechanism.joint.name).items()}
    law = GrossSliding.of(mechanism, float(sampled.angle_rad[0]), others)
    load = joint_load(mechanism, sampled, task.step_s) + sampled.contact_N_m
    largest = float(np.abs(load).max())
    sheet = data_sheet(law, largest)
    tension = mechanism.drive.pretension_N or 0.0
    most = max(2 * tension, 2 * sheet.recommended_pretension_N, 1e-3)
    grid = np.linspace(0.1, 1.0, 10) * most
    warned = []
    home = mechanism.drive.homing_rad
    if 0 < home < 4 * sheet.lost_motion_rad:
        warned.append(
            f"homing_rad = {home:g} hardly slides the tendons through; {5 * sheet.lost_motion_rad:.2g} rad leaves a "
            "margin"
        )
    if tension < sheet.least_pretension_N and inversion.is_taut:
        warned.append(
            f"pretension_N = {tension:g} is below {sheet.least_pretension_N:.3g} N, at which the largest torque makes "
            f"a tendon slack in steady sliding; {sheet.recommended_pretension_N:.3g} N leaves a margin"
        )
    low, high = mechanism.joint.range_rad or (0.0, 0.0)
    standing = mechanism.joint.static_torque_N_m(np.linspace(low, high, 101) if high > low else sampled.angle_rad)
    anywhere = max(largest, float(np.abs(standing).max()))  # a live reference may ask for the whole range
    enough = RECOMMENDED_MARGIN * law.least_pretension_N(anywhere)
    if 0 < _SURPLUS * enough < tension:
        warned.append(
            f"pretension_N = {tension:g} is more than {anywhere:.3g} N m ask for, the most in the reference and at "
            f"rest in range_rad; {enough:.3g} N would make lost motion and friction of the drive that much smaller, "
            "where nothing else loads the joint"
        )
    return sheet, tuple(zip(grid.tolist(), sweep_pretension(law, largest, grid), strict=True)), warned


def _ringing(mechanism: Mechanism, sampled: SampledJoint) -> list[str]:
    """Effect of stepped commands on a joint that hardly damps its own resonance between the tendons."""
    interval, joint = mechanism.drive.command_interval_s, mechanism.joint
    if interval is None:
        return []
    arms = mechanism.arms_at(float(sampled.angle_rad[0]))
    parts = [(t.tendon.stiffness_N_per_m, t.tendon.damping_N_s_per_m) for t in mechanism.tendons]
    stiffness = joint.stiffness_N_m_per_rad + math.fsum(k * arm**2 for (k, _), arm in zip(parts, arms, strict=True))
    damping = joint.damping_N_m_s_per_rad + math.fsum(c * arm**2 for (_, c), arm in zip(parts, arms, strict=True))
    ratio = damping / (2 * math.sqrt(stiffness * joint.inertia_kg_m2))
    frequency = math.sqrt(stiffness / joint.inertia_kg_m2) / (2 * math.pi)
    if ratio > LEAST_DAMPING_RATIO or 1 / interval > LEAST_COMMANDS * frequency:
        return []
    text = (
        f"the joint rings at {frequency:.3g} Hz with {100 * ratio:.2g} % of critical damping: commands every "
        f"{interval:g} s shake it, and what friction stores leaks away while it stands; more commands a second or more "
        "damping help"
    )
    return [text]


def _drive_warnings(task: MotorTask) -> list[str]:
    """Where a motor would have to turn or pull more than it can."""
    found = []
    speed = np.abs(np.diff(task.inversion.motor_rad, axis=0)) / task.step_s
    torque = np.abs(task.inversion.torque_N_m)
    for k, (name, drive) in enumerate(zip(task.motors, task.drives, strict=True)):
        who = "the motor" if len(task.motors) == 1 else f"motor {name}"
        fastest, strongest = float(speed[:, k].max()), float(torque[:, k].max())
        if drive.speed_max_rad_per_s is not None and fastest > drive.speed_max_rad_per_s:
            share = 100 * float((speed[:, k] > drive.speed_max_rad_per_s).mean())
            found.append(
                f"{who} would have to turn at {fastest:.3g} rad/s at t = {speed[:, k].argmax() * task.step_s:g} s, "
                f"speed_max_rad_per_s is {drive.speed_max_rad_per_s:g}; the commands keep to it in {share:.2g} % of "
                "the samples"
            )
        if drive.torque_max_N_m is not None and strongest > drive.torque_max_N_m:
            found.append(
                f"{who} would have to give {strongest:.3g} N m at t = {torque[:, k].argmax() * task.step_s:g} s, "
                f"torque_max_N_m is {drive.torque_max_N_m:g}; less tension, a slower reference or a larger gear_ratio "
                "help"
            )
    return [Danger(text) for text in found]
