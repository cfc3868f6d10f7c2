"""Figures of a design: what to expect, tension, force, loop and error."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.compensators.expectation import FRICTIONLESS
from tendonff.compensator.compensators.expected import BOUND, contributions_figure
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.feedback.figures import feedback_figures
from tendonff.compensator.reporting.colours import GREY, INK
from tendonff.compensator.reporting.plots import (
    coinciding,
    draw_joints,
    figure_style,
    legend_below,
    new_figure,
    thinned,
)
from tendonff.compensator.studies.design.drive_use import drive_use
from tendonff.compensator.studies.design.online import online_figure
from tendonff.compensator.studies.design.result import Design
from tendonff.models.fidelity import Level

_ROUNDING = 1e-3  # of range: an enlarged panel shows no less
_BARE = ("none", FRICTIONLESS)  # friction is not compensated: what is enlarged leaves them out
_LOOPS = ("none", "inverse")  # whose loop of output over force is drawn
_WIDE = 3.4  # line under another that coincides with it


def design_figures(result: Design) -> dict[str, Figure]:
    """All figures of a design by file name."""
    with figure_style():
        return {
            "expectation": expectation_figure(result),
            "contributions": contributions_figure(result.expectation, result.recommended.style),
            "tension": tension_figure(result),
            "force": force_figure(result),
            "drive": drive_figure(result),
            "loop": loop_figure(result),
            "error": error_figure(result),
            **({} if result.feedback is None else feedback_figures(result.feedback)),
            **({} if result.online is None else {"online": online_figure(result.online)}),
        }


def expectation_figure(result: Design) -> Figure:
    """Output of the recommended profile over all that the uncertainty admits."""
    figure, axes = new_figure(2, 1, share_x=True, height_in=4.4, height_ratios=(3, 2))
    tension, error = axes[:, 0]
    time, rows, unit = result.reference.time_s, thinned(len(result.reference.time_s)), result.reference.unit
    best, found = result.recommended, result.expectation
    wanted, least, most = (
        unit.factor * values for values in (result.reference.wanted, found.best.low, found.best.high)
    )
    none = result.on_level("none", result.level) if "none" in result.profiles else None
    for panel, base in ((tension, 0 * wanted), (error, wanted)):
        low, high = least - base, most - base
        panel.fill_between(
            time[rows],
            low[rows],
            high[rows],
            color=best.style.color,
            alpha=0.35,
            linewidth=0.6,
            label=f"{best.label}, all sampled parameters",
        )
        if none is not None:
            label = f"reference applied directly: {none.score.percent} % of range"
            panel.plot(time[rows], (unit.factor * none.delivered - base)[rows], color=GREY, linestyle=":", label=label)
        panel.plot(time[rows], (wanted - base)[rows], color=INK, linewidth=0.8, label="reference")
    tension.set(ylabel=f"{result.reference.output} [{unit.shown}]", ylim=_around(np.append(least, most), wanted))
    band = np.append(least - wanted, most - wanted)
    error.set(xlabel="time [s]", ylabel=f"error [{unit.shown}]", ylim=_around(band, 0.01 * (wanted - wanted.mean())))
    legend_below(figure, tension, columns=3)
    return figure


def _around(*shown: FloatArray) -> tuple[float, float]:
    """Limits of an axis that show these and a margin; what else there is may leave the panel."""
    values = np.concatenate(shown)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.08 * max(high - low, 1e-9)
    return low - margin, high + margin


def tension_figure(result: Design) -> Figure:
    """Reference and output of each compensator on the design level, and the compensated errors enlarged."""
    moved = result.ignored is not None
    height, ratios = (6.2, (3, 2, 1)) if moved else (5.0, (3, 2))
    figure, axes = new_figure(len(ratios), 1, share_x=True, height_in=height, height_ratios=ratios)
    reference, rows, unit = result.reference, thinned(len(result.reference.time_s)), result.reference.unit
    outputs, wanted = _delivered(result, result.level), unit.factor * reference.wanted

    def label(compensator: Compensator) -> str:
        return f"{compensator.label}: {result.on_level(compensator.name, result.level).score.percent} %"

    _draw(axes[0, 0], result, outputs, label)
    axes[0, 0].plot(reference.time_s[rows], wanted[rows], color=INK, linewidth=0.8, label="reference")
    title = f"RMS error in % of range, same parameters, {result.level} level"
    axes[0, 0].set(ylabel=f"{reference.output} [{unit.shown}]", title=title)
    errors = {name: output - wanted for name, output in outputs.items() if name not in _BARE}
    _draw(axes[1, 0], result, errors)
    _zoom(axes[1, 0], errors, _ROUNDING * float(np.ptp(wanted)))
    axes[1, 0].set(ylabel=f"error [{unit.shown}]", title="Compensated, enlarged")
    if result.ignored is not None:
        draw_joints(axes[2, 0], result.ignored.motion, reference.time_s)
    axes[-1, 0].set(xlabel="time [s]")
    legend_below(figure, axes[0, 0], columns=2)
    return figure


def force_figure(result: Design) -> Figure:
    """Force, rate of force and travel of each compensator, with the actuator's limits."""
    figure, axes = new_figure(3, 1, share_x=True, height_in=6.2, height_ratios=(3, 2, 2))
    force, rate, travel = axes[:, 0]
    actuator, step = result.scenario.transmission.actuator, result.reference.step_s
    _draw(force, result, result.forces_N, lambda c: c.label)
    _mark(force, "N", actuator.force_min_N, actuator.force_max_N)
    rates = {name: np.gradient(profile, step) for name, profile in result.forces_N.items()}
    _draw(rate, result, rates)
    _zoom(rate, {name: values for name, values in rates.items() if name not in _BARE})
    _mark(rate, "N/s", -actuator.force_rate_max_N_per_s, actuator.force_rate_max_N_per_s)
    travels = {c.name: 1e3 * result.on_level(c.name, result.level).travel_m for c in result.compensators}
    _draw(travel, result, travels)
    force.set(ylabel="actuator force [N]")
    rate.set(ylabel="force rate [N/s]")
    travel.set(xlabel="time [s]", ylabel="travel [mm]")
    legend_below(figure, force, columns=3)
    return figure


def drive_figure(result: Design) -> Figure:
    """Travel, speed and power of the drive, and its torque over its speed, with the limits."""
    figure, axes = new_figure(2, 2, height_in=4.6)
    (travel, speed), (power, plane) = axes
    actuator, rows = result.scenario.transmission.actuator, thinned(len(result.reference.time_s))
    motor, time = actuator.motor, result.reference.time_s[rows]
    uses = drive_use(result)
    looks = _looks(result, {use.name: use.force_N for use in uses})
    for use in uses:
        look = looks[use.name]
        travel.plot(time, 1e3 * use.travel_m[rows], **look)
        speed.plot(time, 1e3 * use.speed_m_per_s[rows], **look)
        power.plot(time, use.power_W[rows], **look)
        if motor is None:
            plane.plot(1e3 * use.speed_m_per_s[rows], use.force_N[rows], **look)
        else:
            plane.plot(use.speed_m_per_s[rows] / motor.travel_per_rad_m, use.torque_N_m(motor)[rows], **look)
    if actuator.speed_max_m_per_s is not None:
        _mark(speed, "mm/s", -1e3 * actuator.speed_max_m_per_s, 1e3 * actuator.speed_max_m_per_s)
    _mark(travel, "mm", *(1e3 * x for x in (actuator.travel_min_m, actuator.travel_max_m) if x is not None))
    travel.set(xlabel="time [s]", ylabel="travel [mm]", title="Travel from the start")
    speed.set(xlabel="time [s]", ylabel="speed [mm/s]", title="Speed")
    power.set(xlabel="time [s]", ylabel="power [W]", title="Mechanical power")
    if motor is None:
        plane.set(xlabel="speed [mm/s]", ylabel="force [N]", title="Force over speed")
    else:
        line = np.linspace(0, motor.speed_max_rad_per_s, 50)
        plane.plot(line, [motor.torque_limit_N_m(w) for w in line.tolist()], color=INK, linewidth=0.8)
        plane.set(xlabel="motor speed [rad/s]", ylabel="motor torque [N m]", title="Torque over speed, and its limit")
    legend_below(figure, travel)
    return figure


def loop_figure(result: Design) -> Figure:
    """Hysteresis: output tension over the force, and what is delivered over the reference."""
    figure, axes = new_figure(1, 2, height_in=3.8)
    by_force, by_reference = axes[0]
    rows, reference = thinned(len(result.reference.time_s)), result.reference
    wanted = reference.unit.factor * reference.wanted[rows]
    outputs = _delivered(result, result.level)
    looks = _looks(result, outputs)
    for compensator in result.compensators:
        if compensator.name in _LOOPS:
            tension = result.on_level(compensator.name, result.level).output_N
            force = result.profiles[compensator.name].force_N
            by_force.plot(force[rows], tension[rows], **asdict(compensator.style))
        by_reference.plot(wanted, outputs[compensator.name][rows], **looks[compensator.name])
    ends = [float(np.min(wanted)), float(np.max(wanted))]
    by_reference.plot(ends, ends, color=INK, linewidth=0.8, label="output = reference")
    by_force.set(xlabel="actuator force [N]", ylabel="output tension [N]", title="Tendon hysteresis")
    shown, what = reference.unit.shown, reference.output
    title = f"Delivered versus desired {what.rpartition(' ')[2]}"
    by_reference.set(xlabel=f"reference [{shown}]", ylabel=f"{what} [{shown}]", title=title)
    for panel in (by_force, by_reference):
        panel.set_aspect("equal", adjustable="datalim")
    legend_below(figure, by_reference, columns=3)
    return figure


def error_figure(result: Design) -> Figure:
    """Error over time on each level, on one scale; right: enlarged."""
    figure, axes = new_figure(len(Level), 2, share_x=True, height_in=5.8)
    unit = result.reference.unit
    wanted = unit.factor * result.reference.wanted
    by_level = {level: {name: output - wanted for name, output in _delivered(result, level).items()} for level in Level}
    largest = max(float(np.max(np.abs(e))) for errors in by_level.values() for e in errors.values())
    zoomed = max(_zoom_limit({k: e for k, e in errors.items() if k not in _BARE}) for errors in by_level.values())
    zoomed = max(zoomed, _ROUNDING * float(np.ptp(wanted)))
    for (whole, zoom), (level, errors) in zip(axes, by_level.items(), strict=True):
        here = " (design level)" if level is result.level else ""
        _draw(whole, result, errors, lambda c: c.label)
        _draw(zoom, result, {name: error for name, error in errors.items() if name not in _BARE})
        whole.set(ylabel=f"error [{unit.shown}]", title=f"{level}{here}")
        zoom.set(title="enlarged")
        for panel, limit in ((whole, 1.05 * largest), (zoom, zoomed)):
            if limit > 0:  # nothing to scale by where every compensator is exact
                panel.set_ylim(-limit, limit)
    for panel in axes[-1]:
        panel.set_xlabel("time [s]")
    legend_below(figure, axes[0, 0], columns=3)
    return figure


def _delivered(result: Design, level: Level) -> dict[str, FloatArray]:
    """Output of each compensator on a level, by name, in the unit that figures show."""
    factor = result.reference.unit.factor
    return {c.name: factor * result.on_level(c.name, level).delivered for c in result.compensators}


def _draw(
    panel: Axes, result: Design, curves: dict[str, FloatArray], label: Callable[[Compensator], str] | None = None
) -> None:
    """Draw a curve of each compensator; one that hides another differs by width and in the legend."""
    rows = thinned(len(result.reference.time_s))
    for name, look in _looks(result, curves, label).items():
        panel.plot(result.reference.time_s[rows], curves[name][rows], **look)


def _looks(
    result: Design, curves: dict[str, FloatArray], label: Callable[[Compensator], str] | None = None
) -> dict[str, dict[str, Any]]:
    """Line style of each compensator for matplotlib: a curve under another is wide, and the other's legend notes it."""
    hidden = coinciding(curves, max((float(np.ptp(curve)) for curve in curves.values()), default=0.0))
    names, looks = {c.name: c for c in result.compensators}, {}
    for name in curves:
        looks[name] = asdict(names[name].style)
        if name in hidden.values():
            looks[name].update(linewidth=_WIDE, linestyle="-", alpha=0.55)
        text = names[name].label if label is None else label(names[name])
        looks[name]["label"] = text + (f" (= {names[hidden[name]].label})" if name in hidden else "")
    return looks


def _zoom_limit(curves: dict[str, FloatArray]) -> float:
    """Half-height that shows all curves but one that would dwarf the others."""
    largest = sorted(float(np.max(np.abs(curve))) for curve in curves.values())
    if not largest:
        return 0.0
    return 1.15 * (largest[-2] if len(largest) > 1 and largest[-1] > 2 * largest[-2] > 0 else largest[-1])


def _zoom(panel: Axes, curves: dict[str, FloatArray], least: float = 0.0) -> None:
    """Show what is enlarged, but not rounding: at least this half-height."""
    limit = max(_zoom_limit(curves), least)
    if limit > 0:
        panel.set_ylim(-limit, limit)


def _mark(panel: Axes, unit: str, *limits: float) -> None:
    """Draw limits of the actuator that lie within a third of the drawn range, and write those that do not."""
    low, high = panel.get_ylim()
    beyond = []
    for limit in limits:
        if low - (high - low) / 3 < limit < high + (high - low) / 3:
            panel.axhline(limit, **BOUND)
        else:
            beyond.append(limit)
    if beyond:
        shown = (
            f"±{limits[1]:g}" if len(beyond) > 1 and limits[0] == -limits[1] else " and ".join(f"{x:g}" for x in beyond)
        )
        text = f"limit {shown} {unit} off scale".replace("-", "\N{MINUS SIGN}")
        panel.set_title(text, loc="right", fontsize=8, color=GREY)
