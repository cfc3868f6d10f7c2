"""Figures of the identification of joints: torques over time and over the motor, residuals, joints, routines."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.identification.answer.panels import (
    MOST_PANELS,
    Panel,
    loops,
    mark_parts,
    over_time,
    residuals,
)
from tendonff.compensator.identification.motors.loop_routine import MotorRoutine
from tendonff.compensator.identification.motors.result import MotorsComparison, MotorsIdentification
from tendonff.compensator.identification.motors.routine import MotorsRoutine
from tendonff.compensator.identification.motors.sensor import SensorFile, SensorFit
from tendonff.compensator.identification.motors.torque import TorqueFile, TorqueFit
from tendonff.compensator.reporting.colours import BLUE, GREY, INK
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, thinned

_File = TypeVar("_File", MotorsComparison, SensorFile, TorqueFile)


def identification_figures(found: MotorsIdentification, routine: MotorRoutine | None) -> dict[str, Figure]:
    """All figures by file name: of one motor of some files, of several motors of the first that judges."""
    shown = _first(found.comparisons)[: None if len(found.motors) == 1 else 1]
    torques = [
        Panel(
            file=file,
            label=f"torque of\n{name} [N m]",
            measured=file.torque_N_m[:, k],
            model=file.model_N_m[:, k],
            over=file.motor_rad[:, k],
            over_label="motor angle [rad]",
            percent=float(file.torque_percent[k]),
        )
        for file in shown
        for k, name in enumerate(found.motors)
    ]
    joints = [
        Panel(
            file=file,
            label=f"{found.joints[k]} [deg]",
            measured=np.degrees(file.joint_rad[:, k]),
            model=np.degrees(file.model_rad[:, k]),
        )
        for file in shown
        for k in file.encoders
    ]
    with figure_style():
        figures = {"torque": over_time(torques), "residuals": residuals(torques)}
        if len(found.motors) == 1:
            figures["loop"] = loops(torques)
        if joints:
            figures["joint"] = over_time(joints, "encoder")
        if found.sensor is not None:
            figures["sensor"] = _sensor(found.sensor)
        if found.torque is not None:
            figures["torque_at_joint"] = _torque(found.torque)
        if routine is not None:
            figures["suggested_motor"] = routine_figure(routine)
    return figures


def _first(files: Sequence[_File]) -> list[_File]:
    """Files that are shown, those that judge first."""
    return sorted(files, key=lambda file: file.role != "validate")[:MOST_PANELS]


def _sensor(sensor: SensorFit) -> Figure:
    panels = [
        Panel(
            file=file,
            label="joint angle [deg]",
            measured=np.degrees(file.joint_rad),
            model=np.degrees(file.model_rad),
            band=(np.degrees(file.low_rad), np.degrees(file.high_rad)),
        )
        for file in _first(sensor.files)
    ]
    return over_time(panels, "encoder", "virtual sensor")


def _torque(fit: TorqueFit) -> Figure:
    reach = fit.band_N_m
    panels = [
        Panel(
            file=file,
            label="joint torque [N m]",
            measured=file.joint_N_m,
            model=file.model_N_m,
            band=None if reach is None else (file.model_N_m - reach, file.model_N_m + reach),
        )
        for file in _first(fit.files)
    ]
    return over_time(panels, model="from the motor")


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
        mark_parts((top, bottom), routine.parts)
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
