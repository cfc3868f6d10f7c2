"""The files of a finger's design: profile, summary, figures and report."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.compensators.expected import contributions_figure, expectation_summary, robustness_table
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.writing import atomic_directory, write_csv
from tendonff.compensator.finger.result import FingerDesign
from tendonff.compensator.reporting.colours import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, Style
from tendonff.compensator.reporting.interactive import Curves, zoomed
from tendonff.compensator.reporting.page import (
    FileNote,
    Interactive,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
    provenance_of,
    summary_head,
    write_pages,
)
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, thinned
from tendonff.compensator.reporting.terminal import print_scores

_CAPTIONS = {
    "joints": "Errors of the joint angles on the verifying mechanism; below, the angles that were wanted.",
    "tension": "Tensions at the far ends under the exact inverse.",
    "motor": "What the motors turn beyond the lengths of the tendons alone, exact inverse.",
    "contributions": "RMS error of the recommended profile with one parameter at the worse end of its interval.",
}


def write_files(
    result: FingerDesign, folder: str | os.PathLike[str], *, interactive: bool = False, pdf: bool = False
) -> None:
    """Write the files of `FingerDesign.write`."""
    figures = finger_figures(result)
    view = interactive_panels(result) if interactive else None
    with atomic_directory(folder) as partial:
        write_csv(partial / "profile.csv", profile_columns(result))
        write_pages(partial, summary(result), figures, _report(result, figures, view), pdf=pdf)


def finger_figures(result: FingerDesign) -> dict[str, Figure]:
    """All figures of a finger's design by file name."""
    with figure_style():
        return {
            "joints": _joints_figure(result),
            "tension": _tension_figure(result),
            "motor": _motor_figure(result),
            "contributions": contributions_figure(result.expectation, result.recommended.style),
        }


def profile_columns(result: FingerDesign) -> dict[str, FloatArray]:
    """Columns of `profile.csv`: references by joint, motor angles by motor and compensator, torques, tensions."""
    finger, sampled = result.scenario.mechanism, result.sampled
    columns = {"time_s": sampled.time_s}
    wanted = result.names
    columns |= {f"reference_{name}_rad": sampled.angle_rad[:, k] for k, name in enumerate(wanted)}
    for k, name in enumerate(finger.names[len(wanted) :], start=len(wanted)):
        columns[f"joint_{name}_rad"] = result.inversion.position[:, k]
    for k, motor in enumerate(finger.motors):
        for name in ("linear", "stretch", "inverse"):
            if name in result.profiles:
                columns[f"motor_{motor.name}_{name}_rad"] = result.profiles[name].motor_rad[:, k]
        columns[f"motor_{motor.name}_torque_inverse_N_m"] = motor_torque_N_m(result)[:, k]
    columns |= {f"tension_{t.name}_N": result.inversion.tension_N[:, k] for k, t in enumerate(finger.tendons)}
    return columns


def motor_torque_N_m(result: FingerDesign) -> FloatArray:
    """Torque of each motor under the exact inverse: tendons, inertia and dry friction, shape (rows, motors)."""
    found, step = result.inversion, result.scenario.run.step_s
    speed = np.gradient(found.motor, step, axis=0)
    acceleration = np.gradient(speed, step, axis=0)
    columns = [
        motor.drive.torque_N_m(found.effort[:, k], acceleration[:, k], np.sign(speed[:, k]))
        for k, motor in enumerate(result.scenario.mechanism.motors)
    ]
    return np.column_stack(columns)


def summary(result: FingerDesign) -> dict[str, object]:
    """The contents of `summary.json`."""
    names = result.names
    return {
        **summary_head(result.scenario),
        "quantity": "joint_angle",
        "compensators": {
            name: {
                result.scenario.run.level.value: {
                    "rmse_rad": dict(zip(names, profile.rms_rad.tolist(), strict=True))
                    | {"all": profile.rms_of_all_rad},
                    "peak_error_rad": profile.peak_rad,
                }
            }
            for name, profile in result.profiles.items()
        },
        "recommended": result.recommended.name,
        "expectation": expectation_summary(result.expectation, result.doubt_masses),
        "inverse": {
            "status": result.inversion.status.value,
            "evaluations_per_step": result.inversion.work / max(len(result.sampled.time_s) - 1, 1),
            "lowest_tension_N": float(result.inversion.lowest_N.min()),
            "fastest_tension_N_per_s": float(
                np.abs(np.diff(result.inversion.tension_N, axis=0)).max() / result.scenario.run.step_s
            ),
        },
        "tendons": {each.name: asdict(each) for each in result.tendons},
        "joints": {each.name: asdict(each) for each in result.joints},
        "warnings": list(result.warnings),
    }


def _joints_figure(result: FingerDesign) -> Figure:
    names, time = result.names, result.sampled.time_s
    rows = thinned(len(time))
    figure, axes = new_figure(len(names) + 1, 1, share_x=True, height_in=1.5 * (len(names) + 1))
    for k, name in enumerate(names):
        panel = axes[k, 0]
        for each in result.compensators:
            if each.name in result.profiles:
                error = np.degrees(result.profiles[each.name].error_rad[rows, k])
                panel.plot(time[rows], error, label=each.label if k == 0 else None, **asdict(each.style))
        panel.set(ylabel=f"{name} error [deg]")
    for k, name in enumerate(names):
        shade = ("-", "--", ":", "-.")[k % 4]
        axes[-1, 0].plot(time[rows], np.degrees(result.sampled.angle_rad[rows, k]), shade, color=INK, label=name)
    axes[-1, 0].set(xlabel="time [s]", ylabel="reference [deg]")
    axes[-1, 0].legend(loc="upper right", ncols=len(names))
    legend_below(figure, axes[0, 0], columns=4)
    return figure


def _tension_figure(result: FingerDesign) -> Figure:
    figure, axes = new_figure(1, 1, height_in=2.9)
    rows, panel = thinned(len(result.sampled.time_s)), axes[0, 0]
    for k, tendon in enumerate(result.scenario.mechanism.tendons):
        panel.plot(result.sampled.time_s[rows], result.inversion.tension_N[rows, k], label=tendon.name)
    panel.set(xlabel="time [s]", ylabel="tension at the far end [N]", ylim=(0, None))
    legend_below(figure, panel, columns=4)
    return figure


def _motor_figure(result: FingerDesign) -> Figure:
    figure, axes = new_figure(1, 1, height_in=2.9)
    rows, panel = thinned(len(result.sampled.time_s)), axes[0, 0]
    more = result.profiles["inverse"].motor_rad - result.profiles["linear"].motor_rad
    for k, motor in enumerate(result.scenario.mechanism.motors):
        panel.plot(result.sampled.time_s[rows], more[rows, k], label=motor.name)
    panel.set(xlabel="time [s]", ylabel="motor angle less lengths [rad]")
    legend_below(figure, panel, columns=4)
    return figure


def interactive_panels(result: FingerDesign) -> Interactive:
    """Angles, motors and errors of the exact inverse, to be zoomed."""
    inverse, shades = result.profiles["inverse"], ("-", "--", ":", "-.")
    colours = (INK, BLUE, ORANGE, GREEN, PURPLE, GREY)

    def curves(names: Sequence[str], columns: FloatArray) -> Curves:
        return {
            name: (column, Style(color=colours[k % len(colours)], linestyle=shades[k // len(colours) % 4]))
            for k, (name, column) in enumerate(zip(names, columns.T, strict=True))
        }

    motors = [motor.name for motor in result.scenario.mechanism.motors]
    panels = {
        "joint angle [deg]": curves(result.names, np.degrees(inverse.angle_rad)),
        "motor [rad]": curves(motors, inverse.motor_rad),
        "error [deg]": curves(result.names, np.degrees(inverse.error_rad)),
    }
    return zoomed(result.sampled.time_s, panels, f"Exact inverse, {result.masses} masses a tendon.")


def _report(result: FingerDesign, figures: Mapping[str, Figure], view: Interactive | None = None) -> Report:
    names = result.names
    shown = [c for c in result.compensators if c.name in result.profiles]
    plant = f"{result.masses} masses a tendon and step/{result.refinement}"
    errors = Table(
        caption=f"RMS error [deg] on the verifying mechanism, {plant}",
        columns=("compensator", *names, "all joints", "peak"),
        rows=[
            (c.label, *np.degrees(p.rms_rad).tolist(), math.degrees(p.rms_of_all_rad), math.degrees(p.peak_rad))
            for c in shown
            for p in (result.profiles[c.name],)
        ],
    )
    pictures = pictures_of(figures, _CAPTIONS)
    labels = {c.name: c.label for c in result.compensators}
    doubt = Text(f"For {result.expectation.doubt}.")
    robustness = (robustness_table(result.expectation, labels, result.doubt_masses), doubt, pictures["contributions"])
    return Report(
        title=f"Design: {result.scenario.name}",
        summary=result.headline,
        fine_print=result.fine_print,
        warnings=result.warnings,
        sections=(
            Section(title="Joint angles", blocks=(pictures["joints"], errors)),
            *([] if view is None else [Section(title="Interactive view", blocks=(view,))]),
            Section(title="Robustness to parameter uncertainty", blocks=robustness),
            Section(title="Tensions", blocks=(pictures["tension"],)),
            Section(title="Data sheet", blocks=tuple(_sheets(result))),
            Section(title="Motors", blocks=(pictures["motor"],)),
        ),
        provenance=provenance_of(result.scenario, "design"),
        files=(
            FileNote(name="profile.csv", content="references, motor angles and torques, tensions of every sample"),
            FileNote(name="summary.json", content="errors by joint for other programs"),
        ),
    )


def _sheets(result: FingerDesign) -> list[Table]:
    """Data sheet: numbers of each tendon over the motion, and of each joint at its start."""
    found, tendons, joints = result.inversion, result.tendons, result.joints
    columns = ["tendon", "largest wrap angle [deg]", "tension ratio of full sliding [-]"]
    columns += ["least tension [N]", "largest tension [N]", "largest at the drum [N]"]
    columns += ["drive friction [N]", "lost motion of the motor [deg]"]
    rows: list[list[str | float | None]] = [
        [
            each.name,
            math.degrees(each.wrap_angle_rad),
            each.tension_ratio,
            float(found.tension_N[:, k].min()),
            float(found.tension_N[:, k].max()),
            float(found.drum_N[:, k].max()),
            each.drive_friction_N,
            math.degrees(each.lost_motion_rad),
        ]
        for k, each in enumerate(tendons)
    ]
    if any(each.least_pretension_N is not None for each in tendons):
        columns.append("least pre-tension [N]")
        for row, each in zip(rows, tendons, strict=True):
            row.append(each.least_pretension_N)
    tables = [Table(caption="Tendons over the motion", columns=tuple(columns), rows=[tuple(row) for row in rows])]
    if all(each.lost_motion_rad is None for each in joints):
        return tables
    reach = all(each.torque_N_m is not None for each in joints)
    head: tuple[str, ...] = ("joint", "lost motion by tendon lengths alone [deg]")
    head += ("least torque [N m]", "largest torque [N m]") if reach else ()
    cells = [
        (
            each.name,
            None if each.lost_motion_rad is None else math.degrees(each.lost_motion_rad),
            *((each.torque_N_m or ()) if reach else ()),
        )
        for each in joints
    ]
    said = "" if reach else "; reachable torques appear here once every motor states torque_max_N_m"
    return [*tables, Table(caption=f"Joints at the start, the others at rest{said}", columns=head, rows=cells)]


def show(result: FingerDesign, folder: Path) -> None:
    """Print the error of each compensator, what to expect on a rig, and where the files are."""
    worst = result.expectation.worst_percent
    print_scores(
        f"{result.scenario.name}: RMS error over all joints",
        ("compensator", "worst case [% of range]", f"{result.masses} masses, step/{result.refinement} [deg]"),
        [
            (c.name, two_digits(worst[c.name]), f"{math.degrees(result.profiles[c.name].rms_of_all_rad):.2g}")
            for c in result.compensators
        ],
        (result.headline, result.fine_print, f"written to {folder}"),
    )
