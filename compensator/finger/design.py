"""Design of a finger: motor angles by each compensator, verified on a finer mechanism behind the drives."""

from dataclasses import replace

import numpy as np

from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.results import Views, register_views
from tendonff.compensator.finger.compensators import REFINEMENT, FingerTask
from tendonff.compensator.finger.doubts import finger_doubts
from tendonff.compensator.finger.output import finger_figures, motor_torque_N_m, profile_columns, write_files
from tendonff.compensator.finger.result import FingerDesign, FingerProfile
from tendonff.compensator.finger.scenario import FingerScenario
from tendonff.compensator.finger.sheet import joint_sheets, tendon_sheets
from tendonff.compensator.joint.design.result import JointDesign
from tendonff.compensator.joint.design.run import design_joint
from tendonff.compensator.joint.plant import verifying_masses
from tendonff.compensator.joint.scenario.scenario import JointScenario
from tendonff.models.errors import TendonffError
from tendonff.models.turns import in_turn

register_views(FingerDesign, Views(write=write_files, columns=profile_columns, figures=finger_figures))


@in_turn
def design_finger(scenario: FingerScenario, *, strict: bool = False, progress: Progress = silent) -> FingerDesign:
    """Design and verify the motor angles of several joints.

    Parameters
    ----------
    scenario : FingerScenario
    strict : bool, optional
        Refuse a motion in which a tendon goes slack.
    progress : callable, optional

    Raises
    ------
    InputError
        If the reference has no meaning, or no tensions give a torque that it needs.
    SolveError
        If the inverse or its simulation fails.
    """
    task = FingerTask.of(scenario)
    task.check_reach()
    inversion, finger = task.inversion, task.finger
    if strict and task.notes:
        raise InputError(f"{scenario.source.name}: {task.notes[0]}")
    masses, compensators = verifying_masses(finger), task.compensators
    parts = Parts(progress, 2 * len(compensators))
    profiles, commands, failed = {}, {}, []
    for each in compensators:
        try:
            command = each.command_rad(task)
            run = task.respond(finger, command, masses, REFINEMENT)
        except TendonffError as error:  # one that has no answer must not take the others along
            if each.name == "inverse":
                raise
            failed.append(f"{each.label}: {error}")
            continue
        commands[each.name] = command
        reached = run.position[:, : scenario.wanted]
        profiles[each.name] = FingerProfile(
            name=each.name,
            motor_rad=command,
            angle_rad=reached,
            tension_N=run.tension_N,
            error_rad=reached - task.wanted_rad,
        )
        parts.done()
    expectation = task.expect(commands)
    parts.done(len(compensators))
    result = FingerDesign(
        scenario=scenario,
        sampled=task.sampled,
        compensators=compensators,
        profiles=profiles,
        inversion=inversion,
        expectation=expectation,
        tendons=tendon_sheets(task),
        joints=joint_sheets(task),
        masses=masses,
        refinement=REFINEMENT,
        doubt_masses=task.doubt_masses(finger),
        warnings=(*task.notes, *map(str, finger_doubts(scenario)), *failed),
    )
    return _with_limits(result)


def design_motors(
    scenario: JointScenario | FingerScenario, *, strict: bool = False, progress: Progress = silent
) -> JointDesign | FingerDesign:
    """Design and verify the motor angles of driven joints, one or several; see `design_joint`, `design_finger`."""
    if isinstance(scenario, JointScenario):
        return design_joint(scenario, strict=strict, progress=progress)
    return design_finger(scenario, strict=strict, progress=progress)


def _with_limits(result: FingerDesign) -> FingerDesign:
    """The result with warnings where a motor would have to turn or pull more than it can."""
    found = []
    speed = np.abs(np.diff(result.inversion.motor, axis=0)) / result.scenario.run.step_s
    torque = np.abs(motor_torque_N_m(result))
    for k, motor in enumerate(result.scenario.mechanism.motors):
        most, strongest = motor.drive.speed_max_rad_per_s, motor.drive.torque_max_N_m
        if most is not None and speed[:, k].max() > most:
            found.append(
                f"motor {motor.name} would have to turn at {speed[:, k].max():.3g} rad/s, speed_max_rad_per_s is "
                f"{most:g}; the commands keep to it"
            )
        if strongest is not None and torque[:, k].max() > strongest:
            found.append(
                f"motor {motor.name} would have to give {torque[:, k].max():.3g} N m, torque_max_N_m is {strongest:g}; "
                "a slower reference, less tension or a larger gear_ratio help"
            )
    return replace(result, warnings=(*result.warnings, *found))
