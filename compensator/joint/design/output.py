"""The files of a joint's design: profile, summary, figures and report."""

import os
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.compensators.expected import expectation_summary
from tendonff.compensator.feedback.result import feedback_summary
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.writing import atomic_directory, write_csv
from tendonff.compensator.joint.design.figures import joint_figures, motor_names
from tendonff.compensator.joint.design.report import interactive_panels, joint_report
from tendonff.compensator.joint.design.result import JointDesign
from tendonff.compensator.reporting.page import summary_head, write_pages
from tendonff.compensator.reporting.terminal import print_scores


def write_files(
    result: JointDesign, folder: str | os.PathLike[str], *, interactive: bool = False, pdf: bool = False
) -> None:
    """Write the files of `JointDesign.write`."""
    figures = joint_figures(result)
    view = interactive_panels(result) if interactive else None
    with atomic_directory(folder) as partial:
        write_csv(partial / "profile.csv", profile_columns(result))
        if result.sampled.lead:
            write_csv(partial / "homing.csv", homing_columns(result))
        write_pages(partial, summary(result), figures, joint_report(result, figures, view), pdf=pdf)


def profile_columns(result: JointDesign) -> dict[str, FloatArray]:
    """Columns of `profile.csv`: a loop's motor by compensator, a pair's by tendon and with the exact inverse."""
    sampled = result.sampled
    wanted = sampled.wanted[sampled.lead :]
    columns = {"time_s": sampled.run_time_s, f"reference_{result.scenario.reference.unit}": wanted}
    inverse, names = result.profiles["inverse"], motor_names(result.scenario)
    if result.is_loop:
        columns |= {f"motor_{name}_rad": p.motor_rad[:, 0] for name, p in result.profiles.items()}
        columns["motor_torque_inverse_N_m"] = result.inversion.motor_torque_N_m[:, 0]
    else:
        columns |= {f"motor_{name}_rad": inverse.motor_rad[:, k] for k, name in enumerate(names)}
        columns |= {f"motor_torque_{name}_N_m": result.inversion.motor_torque_N_m[:, k] for k, name in enumerate(names)}
    for k, tendon in enumerate(result.scenario.mechanism.tendons):
        columns[f"tension_{tendon.name}_N"] = result.inversion.tension_N[:, k]
    if not result.is_angle:
        columns["angle_rad"] = result.sampled.angle_rad
    return columns


def homing_columns(result: JointDesign) -> dict[str, FloatArray]:
    """Columns of `homing.csv`: time, joint angle, and the motors' commands; the profile goes on from there."""
    sampled = result.sampled
    rows = slice(0, sampled.lead)
    names = ("motor_rad",) if result.is_loop else tuple(f"motor_{name}_rad" for name in motor_names(result.scenario))
    columns = {"time_s": sampled.time_s[rows], "reference_rad": sampled.wanted[rows]}
    return columns | {name: result.homing_rad[:, k] for k, name in enumerate(names)}


def summary(result: JointDesign) -> dict[str, object]:
    """The contents of `summary.json`."""
    unit, level = result.scenario.reference.unit, result.scenario.run.level.value
    found: dict[str, object] = {
        **summary_head(result.scenario),
        "quantity": result.scenario.reference.quantity.value,
        f"reference_range_{unit}": result.sampled.range,
        "compensators": {
            name: {
                level: {
                    f"rmse_{unit}": profile.rms,
                    "rmse_percent_of_range": result.percent(profile.rms),
                    f"peak_error_{unit}": profile.peak,
                }
            }
            for name, profile in result.profiles.items()
        },
        "recommended": result.recommended.name,
        "expectation": expectation_summary(result.expectation, result.masses),
        "inverse": {
            "status": result.inversion.status.value,
            "evaluations_per_step": result.inversion.evaluations / max(len(result.sampled.time_s) - 1, 1),
            "lowest_tension_N": float(np.min(result.inversion.lowest_N)),
        },
        "warnings": list(result.warnings),
    }
    if result.feedback is not None:
        found["feedback"] = feedback_summary(result.feedback)
    if result.sheet is not None:
        found["loop"] = asdict(result.sheet)
    return found


def show(result: JointDesign, folder: Path) -> None:
    """Print the error of each compensator, what to expect on a rig, and where the files are."""
    worst = result.expectation.worst_percent
    print_scores(
        f"{result.scenario.name}: RMS error, % of range of the {'joint angle' if result.is_angle else 'torque'}",
        ("compensator", "worst case", f"{result.masses} masses, step/{result.refinement}"),
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
