"""Design of a finger: motor angles by each compensator, verified on a finer mechanism behind the drives."""

from dataclasses import replace

import numpy as np

from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.finger.compensators import REFINEMENT, FingerTask
from tendonff.compensator.finger.doubts import finger_doubts
from tendonff.compensator.finger.output import finger_figures, motor_torque_N_m, profile_columns, write_files
from tendonff.compensator.finger.result import FingerDesign, FingerProfile
from tendonff.compensator.finger.scenario import FingerScenario
from tendonff.compensator.finger.sheet import joint_sheets, tendon_sheets
from tendonff.compensator.joint.plant import verifying_masses
from tendonff.compensator.reporting.results import Views, register_views
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
    tried = task.tried(lambda command: task.respond(finger, command, masses, REFINEMENT), parts)
    profiles = {}
    for name, run in tried.responses.items():
        reached = run.position[:, : scenario.wanted]
        profiles[name] = FingerProfile(
            name=name,
            motor_rad=tried.commands[name],
            angle_rad=reached,
            tension_N=run.tension_N,
            error_rad=reached - task.wanted_rad,
        )
    expectation = task.expect(tried.commands)
    parts.done(len(compensators))
    result = FingerDesign(
        scenario=scenario,
        sampled=task.sampled,
        compensators=tuple(c for c in compensators if c.name in profiles),
        profiles=profiles,
        failed=tried.failed,
        inversion=inversion,
        expectation=expectation,
        tendons=tendon_sheets(task),
        joints=joint_sheets(task),
        masses=masses,
        refinement=REFINEMENT,
        doubt_masses=task.doubt_masses(finger),
        warnings=(*task.notes, *map(str, finger_doubts(scenario)), *tried.warnings),
    )
    return _with_limits(result)


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
