"""The files of a design of motor angles: profile, summary, figures and report; and its scores on the terminal."""

import os
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.compensators.expected import expectation_summary
from tendonff.compensator.feedback.result import feedback_summary
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.writing import atomic_directory, write_csv
from tendonff.compensator.reporting.page import summary_head, write_pages
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.reporting.terminal import print_scores
from tendonff.compensator.studies.design.motors.figures import design_figures
from tendonff.compensator.studies.design.motors.report import design_report, interactive_panels
from tendonff.compensator.studies.design.motors.result import MotorDesign, MotorProfile


def write_files(
    result: MotorDesign, folder: str | os.PathLike[str], *, interactive: bool = False, pdf: bool = False
) -> None:
    """Write the files of `MotorDesign.write`."""
    figures = design_figures(result)
    view = interactive_panels(result) if interactive else None
    with atomic_directory(folder) as partial:
        write_csv(partial / "profile.csv", profile_columns(result))
        if result.task.lead:
            write_csv(partial / "homing.csv", homing_columns(result))
        write_pages(partial, summary(result), figures, design_report(result, figures, view), pdf=pdf)


def profile_columns(result: MotorDesign) -> dict[str, FloatArray]:
    """Columns of `profile.csv`: references, motors by compensator and torque, tensions, and angles that follow."""
    task, goal, found = result.task, result.goal, result.inversion
    columns = {"time_s": task.target_time_s, **dict(zip(goal.columns, task.target.T, strict=True))}
    driven = [joint.name for joint in task.system.joints]
    if goal.is_named:
        columns |= {f"joint_{n}_rad": found.position_rad[:, driven.index(n)] for n in driven if n not in goal.names}
    columns |= _channels(result)
    columns |= {f"tension_{t.name}_N": found.tension_N[:, k] for k, t in enumerate(task.system.tendons)}
    if goal.unit.key != "rad":
        columns["angle_rad"] = found.position_rad[:, 0]
    return columns


def _channels(result: MotorDesign) -> dict[str, FloatArray]:
    """Motors by compensator, and their torques with the exact inverse."""
    profiles, torque = result.profiles, result.inversion.torque_N_m
    named = {name: result.columns_of(name) for name in profiles}
    columns: dict[str, FloatArray] = {}
    for k, motor in enumerate(result.task.motors):
        columns |= {by[k]: profiles[name].motor_rad[:, k] for name, by in named.items()}
        if result.goal.is_named:
            columns[f"motor_{motor}_torque_inverse_N_m"] = torque[:, k]
    if result.sheet is not None:
        columns["motor_torque_inverse_N_m"] = torque[:, 0]
    elif not result.goal.is_named:
        columns |= {f"motor_torque_{motor}_N_m": torque[:, k] for k, motor in enumerate(result.task.motors)}
    return columns


def homing_columns(result: MotorDesign) -> dict[str, FloatArray]:
    """Columns of `homing.csv`: time, joint angle, and the motors' commands; the profile goes on from there."""
    task = result.task
    rows = slice(0, task.lead)
    names = ("motor_rad",) if result.sheet is not None else tuple(f"motor_{name}_rad" for name in task.motors)
    columns = {"time_s": task.sampled.time_s[rows], "reference_rad": task.sampled.wanted[rows]}
    return columns | {name: result.homing_rad[:, k] for k, name in enumerate(names)}


def _errors(result: MotorDesign, profile: MotorProfile) -> dict[str, object]:
    unit = result.goal.unit.key
    if not result.goal.is_named:
        errors: dict[str, object] = {
            f"rmse_{unit}": profile.rms,
            "rmse_percent_of_range": result.percent(profile.rms),
        }
    else:
        each = dict(zip(result.goal.names, profile.rms_each.tolist(), strict=True))
        errors = {f"rmse_{unit}": each | {"all": profile.rms}}
    return errors | {f"peak_error_{unit}": profile.peak}


def summary(result: MotorDesign) -> dict[str, object]:
    """The contents of `summary.json`."""
    task, found, level = result.task, result.inversion, result.scenario.run.level.value
    range_of = {} if result.goal.is_named else {f"reference_range_{result.goal.unit.key}": float(np.ptp(task.target))}
    rate = float(np.abs(np.diff(found.tension_N, axis=0)).max()) / task.step_s
    sheets: dict[str, object] = {} if result.sheet is None else {"loop": asdict(result.sheet)}
    if result.tendons:
        sheets |= {"tendons": {each.name: asdict(each) for each in result.tendons}}
        sheets |= {"joints": {each.name: asdict(each) for each in result.joints}}
    return {
        **summary_head(result.scenario),
        "quantity": "joint_angle" if result.goal.unit.key == "rad" else "joint_torque",
        **range_of,
        "compensators": {name: {level: _errors(result, profile)} for name, profile in result.profiles.items()},
        "recommended": result.recommended.name,
        "expectation": expectation_summary(result.expectation, result.doubt_masses),
        "inverse": {
            "status": found.status.value,
            "evaluations_per_step": found.work / max(len(task.sampled.time_s) - 1, 1),
            "lowest_tension_N": float(found.lowest_N.min()),
            **({"fastest_tension_N_per_s": rate} if result.goal.is_named else {}),
        },
        **sheets,
        **({} if result.feedback is None else {"feedback": feedback_summary(result.feedback)}),
        "warnings": list(result.warnings),
    }


def show(result: MotorDesign, folder: Path) -> None:
    """Print the error of each compensator, what to expect on a rig, and where the files are."""
    worst = result.expectation.worst_percent
    print_scores(
        f"{result.scenario.name}: RMS error of the {result.goal.quantity}, % of {result.goal.range}",
        ("compensator", "worst case", f"{result.task.masses} masses, step/{result.task.refinement}"),
        [
            (c.name, two_digits(worst[c.name]), two_digits(result.percent(result.profiles[c.name].rms)))
            for c in result.compensators
        ],
        (
            result.headline,
            result.fine_print,
            *(() if result.feedback is None else (result.feedback.sentence,)),
            f"written to {folder}",
        ),
    )


VIEWS = Views(write=write_files, columns=profile_columns, figures=design_figures, show=show)
