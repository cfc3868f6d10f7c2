"""Design of a joint's motor angle: its compensators, each verified on a finer mechanism behind the drive."""

import math
from dataclasses import replace

import numpy as np

from tendonff.compensator.feedback.run import design_feedback
from tendonff.compensator.files.notices import Danger, by_urgency
from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.joint.compensators import JointTask, compensators_of
from tendonff.compensator.joint.design.figures import joint_figures
from tendonff.compensator.joint.design.output import profile_columns, write_files
from tendonff.compensator.joint.design.result import JointDesign, JointProfile
from tendonff.compensator.joint.feedback import JointFeedbackTask
from tendonff.compensator.joint.plant import REFINEMENT, UNSETTLED, joint_load, verifying_masses
from tendonff.compensator.joint.scenario.doubts import joint_doubts
from tendonff.compensator.joint.scenario.scenario import JointScenario, SampledJoint
from tendonff.compensator.reporting.results import Views, register_views
from tendonff.models.joint.closed_form import DataSheet, GrossSliding, data_sheet, sweep_pretension
from tendonff.models.joint.parameters import DriveKind, JointDrive, Mechanism
from tendonff.models.turns import in_turn
from tendonff.ocp.joint.invert import JointInversion, JointStatus

LEAST_DAMPING_RATIO, LEAST_COMMANDS = 0.02, 20.0
"""A joint that damps its resonance less is shaken by commands that come less often than so many times a period [-]."""

register_views(JointDesign, Views(write=write_files, columns=profile_columns, figures=joint_figures))


@in_turn
def design_joint(scenario: JointScenario, *, strict: bool = False, progress: Progress = silent) -> JointDesign:
    """Design and verify the motor angles of a joint.

    Parameters
    ----------
    scenario : JointScenario
    strict : bool, optional
        Refuse a reference beyond a stop, or one for which a tendon of a pair would have to push.
    progress : callable, optional

    Raises
    ------
    InputError
        If the reference has no meaning, or cannot be followed.
    SolveError
        If the inverse or a simulation fails.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/hand_joint.toml")
    >>> result = tf.design(scenario)  # doctest: +SKIP
    >>> print(result.headline)  # doctest: +SKIP
    """
    task = JointTask.of(scenario)
    if task.sampled.warnings and strict:
        raise InputError("; ".join(task.sampled.warnings))
    sampled, mechanism, drive = task.sampled, task.mechanism, task.mechanism.drive
    inversion = task.inversion
    if inversion.status is JointStatus.WOULD_PUSH and strict and drive.kind is DriveKind.PAIR:
        raise InputError(f"{scenario.source.name}: {inversion.message}")
    compensators = compensators_of(task)
    parts = Parts(progress, 2 * len(compensators) + 1)
    plant = task.plant(mechanism, task.level, REFINEMENT, verifying_masses(mechanism))
    kept = slice(sampled.lead, None)
    tried, profiles = task.tried(plant.respond, parts), {}
    for name, run in tried.responses.items():
        reached = plant.reached(run)
        profiles[name] = JointProfile(
            name=name,
            motor_rad=tried.commands[name][kept],
            reached=reached[kept],
            tension_N=run.tension_N[kept],
            torque_N_m=run.motor_torque_N_m[kept],
            error=(reached - sampled.wanted)[kept],
        )
    expectation = task.expect(tried.commands)
    settings = scenario.feedback
    feedback = None if settings is None else design_feedback(JointFeedbackTask.of(task, settings))
    sheet, sheets, warned = _data_sheet(scenario, sampled, inversion)
    warnings = [
        *map(str, joint_doubts(scenario)),
        *sampled.warnings,
        *task.notes,
        *tried.warnings,
        *(f"{name}: {run.message}" for name, run in tried.responses.items() if run.message.startswith(UNSETTLED)),
        *warned,
        *_drive_warnings(drive, inversion, scenario.run.step_s),
    ]
    warnings += _ringing(mechanism, sampled)
    warnings += () if feedback is None else feedback.warnings
    if inversion.status is not JointStatus.EXACT:
        warnings.append(Danger(inversion.message))
    parts.done(len(compensators) + 1)
    return JointDesign(
        scenario=scenario,
        sampled=sampled,
        compensators=tuple(c for c in compensators if c.name in profiles),
        profiles=profiles,
        failed=tried.failed,
        inversion=_after(inversion, sampled.lead),
        homing_rad=tried.commands["inverse"][: sampled.lead],
        sheet=sheet,
        sheets=sheets,
        expectation=expectation,
        feedback=feedback,
        middle=task.middle,
        masses=plant.masses or 0,
        refinement=REFINEMENT,
        warnings=by_urgency(warnings),
    )


def _after(found: JointInversion, lead: int) -> JointInversion:
    """An inversion without the rows of the homing stroke."""
    rows = slice(lead, None)
    return replace(
        found,
        time_s=found.time_s[rows] - found.time_s[lead],
        motor_rad=found.motor_rad[rows],
        motor_torque_N_m=found.motor_torque_N_m[rows],
        tension_N=found.tension_N[rows],
        drum_N=found.drum_N[rows],
        slack_m=found.slack_m[rows],
        lowest_N=found.lowest_N[rows],
    )


def _data_sheet(
    scenario: JointScenario, sampled: SampledJoint, inversion: JointInversion
) -> tuple[DataSheet | None, tuple[tuple[float, DataSheet], ...], list[str]]:
    """Closed forms of a loop, the same over pre-tensions, and what they warn of."""
    mechanism = scenario.mechanism
    if mechanism.drive.kind is not DriveKind.LOOP:
        return None, (), []
    others = {name: float(q[0]) for name, q in sampled.others(mechanism.joint.name).items()}
    law = GrossSliding.of(mechanism, float(sampled.angle_rad[0]), others)
    load = joint_load(mechanism, sampled, scenario.run.step_s) + sampled.contact_N_m
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
    if tension < sheet.least_pretension_N and inversion.status is JointStatus.EXACT:
        warned.append(
            f"pretension_N = {tension:g} is below {sheet.least_pretension_N:.3g} N, at which the largest torque makes "
            f"a tendon slack in steady sliding; {sheet.recommended_pretension_N:.3g} N leaves a margin"
        )
    elif sheet.recommended_pretension_N > 0 and tension > 3 * sheet.recommended_pretension_N:
        warned.append(
            f"pretension_N = {tension:g} is more than the torque asks for; {sheet.recommended_pretension_N:.3g} N "
            "would make lost motion and friction of the drive that much smaller"
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


def _drive_warnings(drive: JointDrive, inversion: JointInversion, step_s: float) -> list[str]:
    found = []
    speed = np.abs(np.diff(inversion.motor_rad, axis=0)) / step_s
    if drive.speed_max_rad_per_s is not None and speed.max() > drive.speed_max_rad_per_s:
        row = int(speed.max(axis=1).argmax())
        share = 100 * float((speed > drive.speed_max_rad_per_s).any(axis=1).mean())
        found.append(
            f"the motor would have to turn at {speed.max():.3g} rad/s at t = {row * step_s:g} s, speed_max_rad_per_s "
            f"is {drive.speed_max_rad_per_s:g}; the commands keep to it in {share:.2g} % of the samples"
        )
    torque = np.abs(inversion.motor_torque_N_m)
    if drive.torque_max_N_m is not None and torque.max() > drive.torque_max_N_m:
        row = int(torque.max(axis=1).argmax())
        found.append(
            f"the motor would have to give {torque.max():.3g} N m at t = {row * step_s:g} s, torque_max_N_m is "
            f"{drive.torque_max_N_m:g}; lower pretension_N, a slower reference or a larger gear_ratio help"
        )
    return [Danger(text) for text in found]
