"""Figures of the identification of a joint: torque over time and over the motor's angle, residuals, joint, routine."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.identification.joint.result import JointComparison, JointIdentification
from tendonff.compensator.identification.joint.routine import MotorRoutine
from tendonff.compensator.identification.joint.sensor import SensorFit
from tendonff.compensator.identification.joint.torque import TorqueFit
from tendonff.compensator.reporting.colours import BLUE, GREY, INK, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, thinned

MOST_PANELS = 3


def identification_figures(found: JointIdentification, routine: MotorRoutine | None) -> dict[str, Figure]:
    """All figures by file name."""
    shown = sorted(found.comparisons, key=lambda c: c.role != "validate")[:MOST_PANELS]
    with figure_style():
        figures = {"torque": _over_time(shown), "loop": _loops(shown), "residuals": _residuals(shown)}
        if any(c.joint_rad is not None for c in shown):
            figures["joint"] = _joints(shown)
        if found.sensor is not None:
            figures["sensor"] = _sensor(found.sensor)
        if found.torque is not None:
            figures["torque_at_joint"] = _torque(found.torque)
        if routine is not None:
            figures["suggested_motor"] = routine_figure(routine)
    return figures


def _title(file: JointComparison) -> str:
    return f"{file.name} ({'validation' if file.role == 'validate' else 'fitted'})"


def _over_time(files: Sequence[JointComparison]) -> Figure:
    figure, axes = new_figure(len(files), 1, height_in=2.2 * len(files) + 0.5)
    for panel, file in zip(axes[:, 0], files, strict=True):
        rows = thinned(len(file.time_s))
        panel.plot(file.time_s[rows], file.torque_N_m[rows], color=INK, label="measured")
        panel.plot(file.time_s[rows], file.model_N_m[rows], color=VERMILION, linestyle="--", label="model")
        panel.set_title(_title(file))
        panel.set(ylabel="motor torque [N m]")
    axes[-1, 0].set_xlabel("time [s]")
    legend_below(figure, axes[-1, 0])
    return figure


def _loops(files: Sequence[JointComparison]) -> Figure:
    figure, axes = new_figure(1, min(2, len(files)), height_in=3.2)
    for panel, file in zip(axes[0], files, strict=False):
        rows = thinned(len(file.time_s))
        panel.plot(file.motor_rad[rows], file.torque_N_m[rows], color=INK, linewidth=0.9, label="measured")
        panel.plot(
            file.motor_rad[rows], file.model_N_m[rows], color=VERMILION, linewidth=0.9, linestyle="--", label="model"
        )
        panel.set_title(_title(file))
        panel.set(xlabel="motor angle [rad]", ylabel="motor torque [N m]")
    legend_below(figure, axes[0, 0])
    return figure


def _residuals(files: Sequence[JointComparison]) -> Figure:
    figure, axes = new_figure(len(files), 1, height_in=1.9 * len(files) + 0.5)
    for panel, file in zip(axes[:, 0], files, strict=True):
        rows = thinned(len(file.time_s))
        share = 100 * (file.model_N_m - file.torque_N_m) / max(float(np.ptp(file.torque_N_m)), 1e-300)
        panel.axhline(0, color=INK, linewidth=0.6)
        panel.plot(file.time_s[rows], share[rows], color=BLUE)
        panel.set_title(f"{_title(file)}: RMS error {file.torque_percent:.2g} % of range")
        panel.set(ylabel="model less\nmeasured [%]")
    axes[-1, 0].set_xlabel("time [s]")
    return figure


def _joints(files: Sequence[JointComparison]) -> Figure:
    some = [f for f in files if f.joint_rad is not None and f.model_rad is not None]
    figure, axes = new_figure(len(some), 1, height_in=2.2 * len(some) + 0.5)
    for panel, file in zip(axes[:, 0], some, strict=True):
        rows = thinned(len(file.time_s))
        if file.joint_rad is not None and file.model_rad is not None:
            panel.plot(file.time_s[rows], np.degrees(file.joint_rad[rows]), color=INK, label="encoder")
            panel.plot(
                file.time_s[rows], np.degrees(file.model_rad[rows]), color=VERMILION, linestyle="--", label="model"
            )
        panel.set_title(f"{_title(file)}: RMS error {file.joint_rms_deg:.2g} deg")
        panel.set(ylabel="joint angle [deg]")
    axes[-1, 0].set_xlabel("time [s]")
    legend_below(figure, axes[-1, 0])
    return figure


def _sensor(sensor: SensorFit) -> Figure:
    shown = sorted(sensor.files, key=lambda f: f.role != "validate")[:MOST_PANELS]
    figure, axes = new_figure(len(shown), 1, height_in=2.2 * len(shown) + 0.5)
    for panel, file in zip(axes[:, 0], shown, strict=True):
        rows, model = thinned(len(file.time_s)), np.degrees(file.model_rad)
        low, high = (np.degrees(end)[rows] for end in (file.low_rad, file.high_rad))
        panel.fill_between(file.time_s[rows], low, high, color=VERMILION, alpha=0.2, linewidth=0)
        panel.plot(file.time_s[rows], np.degrees(file.joint_rad)[rows], color=INK, label="encoder")
        panel.plot(file.time_s[rows], model[rows], color=VERMILION, linestyle="--", label="virtual sensor")
        panel.set_title(f"{file.name} ({'validation' if file.role == 'validate' else 'fitted'})")
        panel.set(ylabel="joint angle [deg]")
    axes[-1, 0].set_xlabel("time [s]")
    legend_below(figure, axes[-1, 0])
    return figure


def _torque(fit: TorqueFit) -> Figure:
    shown = sorted(fit.files, key=lambda f: f.role != "validate")[:MOST_PANELS]
    figure, axes = new_figure(len(shown), 1, height_in=2.2 * len(shown) + 0.5)
    for panel, file in zip(axes[:, 0], shown, strict=True):
        rows, model = thinned(len(file.time_s)), file.model_N_m
        if fit.band_N_m is not None:
            low, high = (model - fit.band_N_m)[rows], (model + fit.band_N_m)[rows]
            panel.fill_between(file.time_s[rows], low, high, color=VERMILION, alpha=0.2, linewidth=0)
        panel.plot(file.time_s[rows], file.joint_N_m[rows], color=INK, label="measured")
        panel.plot(file.time_s[rows], model[rows], color=VERMILION, linestyle="--", label="from the motor")
        panel.set_title(f"{file.name} ({'validation' if file.role == 'validate' else 'fitted'})")
        panel.set(ylabel="joint torque [N m]")
    axes[-1, 0].set_xlabel("time [s]")
    legend_below(figure, axes[-1, 0])
    return figure


def routine_figure(routine: MotorRoutine) -> Figure:
    """Motor angle of a suggested routine, its parts marked, and what the joint and the torque are expected to do."""
    with figure_style():
        figure, axes = new_figure(2, 1, share_x=True, height_in=4.6)
        top, bottom = axes[:, 0]
        rows = thinned(len(routine.time_s))
        top.plot(routine.time_s[rows], routine.motor_rad[rows], color=BLUE, label="motor")
        top.plot(
            routine.time_s[rows], routine.expected.angle_rad[rows], color=GREY, linestyle="--", label="joint, expected"
        )
        bottom.plot(routine.time_s[rows], routine.expected.torque_N_m[rows], color=INK)
        names = []
        for number, part in enumerate(routine.parts):
            start, _, text = part.partition(" s: ")
            names.append(f"{number + 1} {text.partition(':')[0].partition(',')[0]}")
            for panel in (top, bottom):
                panel.axvline(float(start), color=ORANGE, linewidth=0.8, linestyle=":")
            top.annotate(
                str(number + 1),
                (float(start), 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(3, -9),
                textcoords="offset points",
            )
        top.set_title("; ".join(names), fontsize=7)
        top.set(ylabel="angle [rad]")
        bottom.set(xlabel="time [s]", ylabel="expected torque [N m]")
        legend_below(figure, top)
    return figure
