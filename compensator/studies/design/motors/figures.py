"""Figures of a design of motor angles."""

from dataclasses import asdict

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.expected import contributions_figure
from tendonff.compensator.feedback.figures import feedback_figures
from tendonff.compensator.reporting.colours import GREY, INK
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, thinned
from tendonff.compensator.studies.design.motors.result import MotorDesign

_DASHES = ("-", "--", ":", "-.")  # of joints and motors in one panel


def design_figures(result: MotorDesign) -> dict[str, Figure]:
    """All figures of a design by file name."""
    with figure_style():
        figures = {"joint": joint_figure(result), "tension": tension_figure(result), "motor": motor_figure(result)}
        figures["contributions"] = contributions_figure(result.expectation, result.recommended.style)
        if result.feedback is not None:
            figures |= feedback_figures(result.feedback)
        if result.sheets:
            figures["pretension"] = pretension_figure(result)
        return figures


def joint_figure(result: MotorDesign) -> Figure:
    """Reference, of one joint also its response, and the errors of all compensators."""
    goal, task = result.goal, result.task
    figure, axes = new_figure(1 + len(goal.names), 1, share_x=True, height_in=2.3 + 1.5 * len(goal.names))
    rows, scale = thinned(len(task.target)), goal.unit.factor
    time, (top, *panels) = task.target_time_s[rows], axes[:, 0]
    for each in result.compensators:
        profile, style = result.profiles[each.name], asdict(each.style)
        if not goal.is_named:
            top.plot(time, scale * profile.reached[rows, 0], **style)
        for k, panel in enumerate(panels):
            panel.plot(time, scale * profile.error[rows, k], label=None if k else each.label, **style)
    for k, name in enumerate(goal.names):
        dash = _DASHES[k % 4] if goal.is_named else "--"
        top.plot(time, scale * task.target[rows, k], dash, color=INK, label=name if goal.is_named else "reference")
    top.set(ylabel=f"{goal.quantity} [{goal.unit.shown}]")
    top.legend(loc="upper right", ncols=len(goal.names))
    for name, panel in zip(goal.names, panels, strict=True):
        panel.set(ylabel=f"{name + ' ' if goal.is_named else ''}error [{goal.unit.shown}]")
    panels[-1].set(xlabel="time [s]")
    legend_below(figure, panels[0], columns=4)
    return figure


def tension_figure(result: MotorDesign) -> Figure:
    """Tensions at the far ends under the exact inverse."""
    figure, axes = new_figure(1, 1, height_in=2.9)
    time, tension, tendons = result.task.target_time_s, result.profiles["inverse"].tension_N, result.task.system.tendons
    rows, panel = thinned(len(time)), axes[0, 0]
    colours = (INK, GREY) if len(tendons) <= 2 else (None,)  # those of the style, in turn
    for k, tendon in enumerate(tendons):
        panel.plot(time[rows], tension[rows, k], color=colours[k % len(colours)], label=tendon.name)
    panel.set(xlabel="time [s]", ylabel="tension at the joint [N]", ylim=(0, None))
    legend_below(figure, panel, columns=4)
    return figure


def motor_figure(result: MotorDesign) -> Figure:
    """Motor angles beyond those of the ratio alone, and the motors' torques."""
    figure, axes = new_figure(2, 1, share_x=True, height_in=4.6)
    time, names = result.task.target_time_s, result.task.motors
    rows = thinned(len(time))
    top, bottom = axes[:, 0]
    base = result.profiles["linear"].motor_rad
    for each in (c for c in result.compensators if c.name in ("static", "inverse")):
        more = (result.profiles[each.name].motor_rad - base)[rows]
        for k, motor in enumerate(names):
            label = each.label + (f", {motor}" if len(names) > 1 else "")
            top.plot(time[rows], more[:, k], _DASHES[k % 4], color=each.style.color, label=label)
    for k, motor in enumerate(names):
        bottom.plot(time[rows], result.profiles["inverse"].torque_N_m[rows, k], _DASHES[k % 4], color=INK, label=motor)
    top.set(ylabel="motor angle less ratio [rad]")
    bottom.set(xlabel="time [s]", ylabel="motor torque [N m]")
    legend_below(figure, top, columns=4)
    return figure


def pretension_figure(result: MotorDesign) -> Figure:
    """Cost of a pre-tension in lost motion and in friction of the drive, and the torque that it holds."""
    figure, axes = new_figure(1, 2, height_in=2.8)
    tension = np.array([at for at, _ in result.sheets])
    lost = np.rad2deg([sheet.lost_motion_rad for _, sheet in result.sheets])
    friction = [sheet.drive_torque_N_m for _, sheet in result.sheets]
    slack = [sheet.slack_torque_N_m for _, sheet in result.sheets]
    left, right = axes[0]
    left.plot(friction, lost, color=INK)
    left.set(xlabel="friction at the drum, ± [N m]", ylabel="lost motion, ± [deg]")
    right.plot(tension, slack, color=INK)
    right.set(xlabel="pre-tension [N]", ylabel="torque that makes slack [N m]")
    sheet = result.sheet
    if sheet is not None:
        right.axhline(sheet.largest_torque_N_m, color=GREY, linestyle=":")
        left.plot(sheet.drive_torque_N_m, np.rad2deg(sheet.lost_motion_rad), "o", color=INK)
        right.plot(result.task.drives[0].pretension_N, sheet.slack_torque_N_m, "o", color=INK)
    return figure
