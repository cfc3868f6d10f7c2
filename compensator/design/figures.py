"""Figures of a design: tension, force, loop and error."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.design.drive_use import drive_use
from tendonff.compensator.design.result import DesignData
from tendonff.compensator.reporting.plots import INK, PAGE_WIDTH_IN, figure_style, legend_below, new_figure, thinned
from tendonff.models.fidelity import Level

_LOOPS = ("none", "inverse")  # whose loop of output over force is drawn


def design_figures(result: DesignData) -> dict[str, Figure]:
    """All figures of a design by file name.

    Parameters
    ----------
    result : DesignData
    """
    with figure_style():
        return {
            "tension": tension_figure(result),
            "force": force_figure(result),
            "drive": drive_figure(result),
            "loop": loop_figure(result),
            "error": error_figure(result),
        }


def tension_figure(result: DesignData) -> Figure:
    """Wanted tension against what each compensator delivers on the design level.

    Parameters
    ----------
    result : DesignData
    """
    figure, axes = new_figure()
    panel, rows = axes[0, 0], thinned(len(result.reference.time_s))
    time = result.reference.time_s[rows]
    for compensator in result.compensators:
        found = result.on_level(compensator.name, result.level)
        label = f"{compensator.label}: {found.score.percent} % of range rms"
        panel.plot(time, found.output_N[rows], **asdict(compensator.style), label=label)
    panel.plot(time, result.reference.tension_N[rows], color=INK, linewidth=0.8, label="wanted")
    panel.set(xlabel="time [s]", ylabel="output tension [N]", title=f"Output tension on the {result.level} level")
    legend_below(figure, panel, columns=2)
    figure.set_size_inches(PAGE_WIDTH_IN, 3.4)
    return figure


def force_figure(result: DesignData) -> Figure:
    """Force profile of each compensator, with the actuator's range where it is near.

    Parameters
    ----------
    result : DesignData
    """
    figure, axes = new_figure()
    panel, rows = axes[0, 0], thinned(len(result.reference.time_s))
    for compensator in result.compensators:
        force = result.profiles[compensator.name].force_N
        panel.plot(result.reference.time_s[rows], force[rows], **_look(compensator))
    _mark_limits(panel, result)
    panel.set(xlabel="time [s]", ylabel="actuator force [N]", title="Force profiles")
    legend_below(figure, panel)
    figure.set_size_inches(PAGE_WIDTH_IN, 3.2)
    return figure


def drive_figure(result: DesignData) -> Figure:
    """Travel, speed and power of the drive, and its torque over its speed, with the limits.

    Parameters
    ----------
    result : DesignData
    """
    figure, axes = new_figure(2, 2, height_in=4.6)
    (travel, speed), (power, plane) = axes
    actuator, rows = result.scenario.transmission.actuator, thinned(len(result.reference.time_s))
    motor, time = actuator.motor, result.reference.time_s[rows]
    styles = {c.name: _look(c) for c in result.compensators}
    for use in drive_use(result):
        look = styles[use.name]
        travel.plot(time, 1e3 * use.travel_m[rows], **look)
        speed.plot(time, 1e3 * use.speed_m_per_s[rows], **look)
        power.plot(time, use.power_W[rows], **look)
        if motor is None:
            plane.plot(1e3 * use.speed_m_per_s[rows], use.force_N[rows], **look)
        else:
            plane.plot(use.speed_m_per_s[rows] / motor.travel_per_rad_m, use.torque_N_m(motor)[rows], **look)
    if actuator.speed_max_m_per_s is not None:
        _limit_lines(speed, (-1e3 * actuator.speed_max_m_per_s, 1e3 * actuator.speed_max_m_per_s))
    _limit_lines(travel, [1e3 * x for x in (actuator.travel_min_m, actuator.travel_max_m) if x is not None])
    travel.set(xlabel="time [s]", ylabel="travel [mm]", title="Actuator travel from the start")
    speed.set(xlabel="time [s]", ylabel="speed [mm/s]", title="Actuator speed")
    power.set(xlabel="time [s]", ylabel="power [W]", title="Mechanical power")
    if motor is None:
        plane.set(xlabel="speed [mm/s]", ylabel="force [N]", title="Force over speed")
    else:
        line = np.linspace(0, motor.speed_max_rad_per_s, 50)
        plane.plot(line, [motor.torque_limit_N_m(w) for w in line.tolist()], color=INK, linewidth=0.8)
        plane.set(xlabel="motor speed [rad/s]", ylabel="motor torque [N m]", title="Torque over speed, and its limit")
    legend_below(figure, travel)
    return figure


def _limit_lines(panel: Axes, values: Iterable[float]) -> None:
    """Limits that lie within a third of the drawn range."""
    low, high = panel.get_ylim()
    for value in values:
        if low - (high - low) / 3 < value < high + (high - low) / 3:
            panel.axhline(value, color=INK, linewidth=0.8, linestyle=(0, (6, 3)))


def loop_figure(result: DesignData) -> Figure:
    """Hysteresis: output tension over the force, and over the tension that was asked for.

    Parameters
    ----------
    result : DesignData
    """
    figure, axes = new_figure(1, 2, height_in=3.6)
    by_force, by_wanted = axes[0]
    rows = thinned(len(result.reference.time_s))
    wanted = result.reference.tension_N[rows]
    for compensator in result.compensators:
        output = result.on_level(compensator.name, result.level).output_N[rows]
        if compensator.name in _LOOPS:
            by_force.plot(result.profiles[compensator.name].force_N[rows], output, **_look(compensator))
        by_wanted.plot(wanted, output, **_look(compensator))
    ends = [float(np.min(wanted)), float(np.max(wanted))]
    by_wanted.plot(ends, ends, color=INK, linewidth=0.8, label="as wanted")
    by_force.set(xlabel="actuator force [N]", ylabel="output tension [N]", title="What the tendon does")
    by_wanted.set(xlabel="wanted tension [N]", ylabel="output tension [N]", title="What the user gets")
    legend_below(figure, by_wanted)
    return figure


def error_figure(result: DesignData) -> Figure:
    """Error over time on each level: how much the answer depends on the model.

    Parameters
    ----------
    result : DesignData
    """
    figure, axes = new_figure(len(Level), 1, share_x=True, height_in=5.4)
    rows = thinned(len(result.reference.time_s))
    time = result.reference.time_s[rows]
    for panel, level in zip(axes[:, 0], Level, strict=True):
        largest = 0.0
        for compensator in result.compensators:
            error = result.on_level(compensator.name, level).output_N[rows] - result.reference.tension_N[rows]
            panel.plot(time, error, **_look(compensator))
            largest = max(largest, float(np.max(np.abs(error))))
        here = " (design level)" if level is result.level else ""
        panel.set(ylabel="error [N]", title=f"{level}{here}")
        if largest > 0:  # nothing to scale by where every compensator is exact
            panel.set_ylim(-1.1 * largest, 1.1 * largest)
    axes[-1, 0].set_xlabel("time [s]")
    legend_below(figure, axes[0, 0])
    return figure


def _look(compensator: Compensator) -> dict[str, Any]:
    """What matplotlib is told to draw a compensator."""
    return {**asdict(compensator.style), "label": compensator.label}


def _mark_limits(panel: Axes, result: DesignData) -> None:
    """Draw a limit of the actuator where it lies within a third of the drawn range."""
    actuator = result.scenario.transmission.actuator
    low, high = panel.get_ylim()
    for name, limit in (("force_min_N", actuator.force_min_N), ("force_max_N", actuator.force_max_N)):
        if low - (high - low) / 3 < limit < high + (high - low) / 3:
            panel.axhline(limit, color=INK, linewidth=0.8, linestyle=(0, (6, 3)), label=name)
