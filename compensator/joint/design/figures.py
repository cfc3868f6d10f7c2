"""Figures of a joint's design."""

from dataclasses import asdict

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.expected import contributions_figure
from tendonff.compensator.feedback.figures import feedback_figures
from tendonff.compensator.joint.design.result import JointDesign
from tendonff.compensator.joint.scenario.scenario import JointScenario
from tendonff.compensator.reporting.colours import BLUE, GREY, INK
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, thinned
from tendonff.models.joint.parameters import DriveKind


def joint_figures(result: JointDesign) -> dict[str, Figure]:
    """All figures of a design by file name."""
    with figure_style():
        figures = {"joint": joint_figure(result), "tension": tension_figure(result), "motor": motor_figure(result)}
        figures["contributions"] = contributions_figure(result.expectation, result.recommended.style)
        if result.feedback is not None:
            figures |= feedback_figures(result.feedback)
        if result.sheets:
            figures["pretension"] = pretension_figure(result)
        return figures


def joint_figure(result: JointDesign) -> Figure:
    """Wanted and reached, and the errors of all compensators."""
    figure, axes = new_figure(2, 1, share_x=True, height_in=4.6)
    sampled = result.sampled
    time, wanted = sampled.run_time_s, sampled.wanted[sampled.lead :]
    rows = thinned(len(time))
    scale, unit = (180 / np.pi, "deg") if result.is_angle else (1.0, "N m")
    top, bottom = axes[:, 0]
    for each in result.compensators:
        profile, style = result.profiles[each.name], asdict(each.style)
        top.plot(time[rows], scale * profile.reached[rows], label=each.label, **style)
        bottom.plot(time[rows], scale * profile.error[rows], **style)
    top.plot(time[rows], scale * wanted[rows], color=INK, linewidth=0.8, linestyle="--", label="reference")
    top.set(ylabel=f"{'joint angle' if result.is_angle else 'torque of the joint'} [{unit}]")
    bottom.set(xlabel="time [s]", ylabel=f"error [{unit}]")
    legend_below(figure, top, columns=4)
    return figure


def tension_figure(result: JointDesign) -> Figure:
    """Tensions at the joint under the exact inverse, and their sum over the arms."""
    figure, axes = new_figure(1, 1, height_in=2.9)
    time = result.sampled.run_time_s
    rows, panel = thinned(len(time)), axes[0, 0]
    tension = result.profiles["inverse"].tension_N
    for k, tendon in enumerate(result.scenario.mechanism.tendons):
        panel.plot(time[rows], tension[rows, k], color=(INK, GREY)[k % 2], label=tendon.name)
    panel.set(xlabel="time [s]", ylabel="tension at the joint [N]", ylim=(0, None))
    legend_below(figure, panel)
    return figure


def motor_figure(result: JointDesign) -> Figure:
    """Motor angle beyond that of the ratio alone, and the motors' torque."""
    figure, axes = new_figure(2, 1, share_x=True, height_in=4.6)
    time = result.sampled.run_time_s
    rows, names = thinned(len(time)), motor_names(result.scenario)
    top, bottom = axes[:, 0]
    base = result.profiles["linear"].motor_rad
    for each in (c for c in result.compensators if c.name in ("static", "inverse")):
        profile = result.profiles[each.name]
        for k, motor in enumerate(names):
            label = each.label + (f", {motor}" if len(names) > 1 else "")
            style = ("-", "--")[k % 2]
            top.plot(time[rows], (profile.motor_rad - base)[rows, k], style, color=each.style.color, label=label)
    for k, motor in enumerate(names):
        torque = result.profiles["inverse"].torque_N_m[rows, k]
        bottom.plot(time[rows], torque, ("-", "--")[k % 2], color=BLUE, label=motor)
    top.set(ylabel="motor angle less ratio [rad]")
    bottom.set(xlabel="time [s]", ylabel="motor torque [N m]")
    legend_below(figure, top, columns=4)
    return figure


def pretension_figure(result: JointDesign) -> Figure:
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
        right.plot(result.scenario.mechanism.drive.pretension_N, sheet.slack_torque_N_m, "o", color=INK)
    return figure


def motor_names(scenario: JointScenario) -> tuple[str, ...]:
    """Names of the motors: one of a loop, else by tendon."""
    mechanism = scenario.mechanism
    return ("motor",) if mechanism.drive.kind is DriveKind.LOOP else tuple(t.name for t in mechanism.tendons)
