"""Figures of the identification of joints: torques over time and over the motor, residuals, joints, routines."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.loop_routine import MotorRoutine
from tendonff.compensator.identification.motors.result import MotorsComparison, MotorsIdentification
from tendonff.compensator.identification.motors.routine import MotorsRoutine
from tendonff.compensator.identification.motors.sensor import SensorFit
from tendonff.compensator.identification.motors.torque import TorqueFit
from tendonff.compensator.reporting.colours import BLUE, GREY, INK, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, thinned

MOST_PANELS = 3

_Panel = tuple[MotorsComparison, int, str]
"""A file, a channel of it, and a label."""


def identification_figures(found: MotorsIdentification, routine: MotorRoutine | None) -> dict[str, Figure]:
    """All figures by file name: of one motor of some files, of several motors of the first that judges."""
    files = sorted(found.comparisons, key=lambda c: c.role != "validate")
    shown = files[: MOST_PANELS if len(found.motors) == 1 else 1]
    torques = [(file, k, f"torque of\n{name} [N m]") for file in shown for k, name in enumerate(found.motors)]
    joints = [(file, k, f"{found.joints[k]} [deg]") for file in shown for k in file.encoders]
    with figure_style():
        figures = {
            "torque": _panels(torques, [(f.torque_N_m, f.model_N_m) for f, _, _ in torques], "measured"),
            "residuals": _residuals(torques),
        }
        if len(found.motors) == 1:
            figures["loop"] = _loops(shown)
        if joints:
            figures["joint"] = _panels(
                joints, [(np.degrees(f.joint_rad), np.degrees(f.model_rad)) for f, _, _ in joints], "encoder"
            )
        if found.sensor is not None:
            figures["sensor"] = _sensor(found.sensor)
        if found.torque is not None:
            figures["torque_at_joint"] = _torque(found.torque)
        if routine is not None:
            figures["suggested_motor"] = routine_figure(routine)
    return figures


def _title(file: MotorsComparison) -> str:
    return f"{file.name} ({'validation' if file.role == 'validate' else 'fitted'})"


def _panels(panels: Sequence[_Panel], pairs: Sequence[tuple[Array, Array]], what: str) -> Figure:
    """Channels measured and by the model over time, one below the other."""
    figure, axes = new_figure(len(panels), 1, height_in=2.0 * len(panels) + 0.5)
    for panel, (file, k, label), (measured, model) in zip(axes[:, 0], panels, pairs, strict=True):
        rows = thinned(len(file.time_s))
        panel.plot(file.time_s[rows], measured[rows, k], color=INK, label=what)
        panel.plot(file.time_s[rows], model[rows, k], color=VERMILION, linestyle="--", label="model")
        panel.set_title(_title(file))
        panel.set(ylabel=label)
    axes[-1, 0].set_xlabel("time [s]")
    legend_below(figure, axes[-1, 0])
    return figure


def _loops(files: Sequence[MotorsComparison]) -> Figure:
    figure, axes = new_figure(1, min(2, len(files)), height_in=3.2)
    for panel, file in zip(axes[0], files, strict=False):
        rows = thinned(len(file.time_s))
        motor = file.motor_rad[rows, 0]
        panel.plot(motor, file.torque_N_m[rows, 0], color=INK, linewidth=0.9, label="measured")
        panel.plot(motor, file.model_N_m[rows, 0], color=VERMILION, linewidth=0.9, linestyle="--", label="model")
        panel.set_title(_title(file))
        panel.set(xlabel="motor angle [rad]", ylabel="motor torque [N m]")
    legend_below(figure, axes[0, 0])
    return figure


def _residuals(panels: Sequence[_Panel]) -> Figure:
    figure, axes = new_figure(len(panels), 1, height_in=1.9 * len(panels) + 0.5)
    for panel, (file, k, label) in zip(axes[:, 0], panels, strict=True):
        rows, own = thinned(len(file.time_s)), file.torque_N_m[:, k]
        share = 100 * (file.model_N_m[:, k] - own) / max(float(np.ptp(own)), 1e-300)
        panel.axhline(0, color=INK, linewidth=0.6)
        panel.plot(file.time_s[rows], share[rows], color=BLUE)
        panel.set_title(f"{_title(file)}: RMS error {file.torque_percent[k]:.2g} % of range")
        panel.set(ylabel=label.replace("[N m]", "[%]"))
    axes[-1, 0].set_xlabel("time [s]")
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
            routine.time_s[rows],
            routine.expected.angle_rad[rows, 0],
            color=GREY,
            linestyle="--",
            label="joint, expected",
        )
        bottom.plot(routine.time_s[rows], routine.expected.torque_N_m[rows, 0], color=INK)
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


def routines_figure(routine: MotorsRoutine) -> Figure:
    """Motor angles of a suggested routine, and where they lead the joints."""
    with figure_style():
        figure, axes = new_figure(2, 1, share_x=True, height_in=4.6)
        for panel, names, angles in (
            (axes[0, 0], routine.names, routine.motor_rad),
            (axes[1, 0], routine.joints, routine.joint_rad),
        ):
            for name, angle in zip(names, angles.T, strict=True):
                panel.plot(routine.time_s, angle, label=name)
            panel.legend(loc="upper right", fontsize=7)
        axes[0, 0].set(ylabel="motor angle [rad]")
        axes[1, 0].set(xlabel="time [s]", ylabel="joint angle [rad]")
    return figure
