"""Pictures of the two-motor test, after the paper's Figs. 4, 8, 9 and 10."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, withStroke

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.reporting.colours import BLUE, GREY, INK, VERMILION
from tendonff.compensator.reporting.plots import LINE_STYLES, figure_style, legend_below, new_figure, thinned
from tendonff.compensator.scenario.experiment import MotorMode
from tendonff.compensator.studies.experiment.machine import StatePass
from tendonff.compensator.studies.experiment.numbers import driven_motor, holds, reversals
from tendonff.compensator.studies.experiment.result import SECTIONS, ExperimentResult, ExperimentRun
from tendonff.models.fidelity import Level

_LEVEL_LOOK: dict[Level, dict[str, Any]] = {
    Level.ELASTIC: {"color": INK, "linestyle": LINE_STYLES[0], "linewidth": 1.0},
    Level.VISCOELASTIC: {"color": VERMILION, "linestyle": LINE_STYLES[1], "linewidth": 1.4},
    Level.PRESLIDING: {"color": BLUE, "linestyle": LINE_STYLES[0], "linewidth": 1.6},
}
_MAP = "viridis"  # even in lightness, so that it survives a black-and-white print
_HEAT = "cividis_r"  # dark is high
_HEAT_ROWS = 600


def _section_colours() -> FloatArray:
    """A colour for each section, from dark (motor 1) to light (motor 2), without the palest end."""
    import matplotlib as mpl

    return np.asarray(mpl.colormaps[_MAP](np.linspace(0.0, 0.88, SECTIONS)))


def _shade_states(axes: Axes, run: ExperimentRun, *, named: bool, shaded: bool = True) -> None:
    """Every other state on grey, or between lines, with its name above the panel."""
    total = run.time_s[-1]
    end_of_last_name = -np.inf
    for index, done in enumerate(run.passes):
        start, end = run.time_s[done.first_row], run.time_s[done.last_row]
        if index % 2:
            if shaded:
                axes.axvspan(start, end, color="#EBEBEB", linewidth=0, zorder=0)
            else:
                for edge in (start, end):
                    axes.axvline(edge, color="white", linewidth=0.6)
        if named:
            middle = (start + end) / 2
            lift = 1.02 if middle - end_of_last_name > 0.03 * total else 1.09  # narrow neighbours on two lines
            end_of_last_name = middle if lift < 1.05 else end_of_last_name
            axes.text(
                middle,
                lift,
                done.state.name,
                transform=axes.get_xaxis_transform(),
                ha="center",
                va="bottom",
                fontsize=8,
            )


@figure_style()
def tensions_figure(result: ExperimentResult) -> Figure:
    """Seven tensions over time on the three levels, states shaded and named."""
    figure, axes = new_figure(len(result.runs), 1, height_in=7.0, share_x=True)
    for row, (level, run) in enumerate(result.runs.items()):
        panel: Axes = axes[row, 0]
        rows = thinned(len(run.time_s))
        tension = run.tension_N
        for k, colour in enumerate(_section_colours()):
            label = f"$f_{k + 1}$" + (" (motor 1)" if k == 0 else " (motor 2)" if k == SECTIONS - 1 else "")
            panel.plot(run.time_s[rows], tension[rows, k], color=colour, label=label, linewidth=1.2)
            if result.measured is not None and k in result.measured.tension_N:
                few = thinned(len(result.measured.time_s))
                course = result.measured.time_s[few], result.measured.tension_N[k][few]
                panel.plot(*course, color=colour, linestyle=LINE_STYLES[1], linewidth=0.9)
        _shade_states(panel, run, named=row == 0)
        panel.grid(visible=False, axis="x")
        panel.set_ylabel(f"tension [N]\n{level}")
        panel.set_ylim(bottom=0)
        panel.margins(x=0)
    axes[-1, 0].set_xlabel("time [s]")
    legend_below(figure, axes[0, 0], columns=SECTIONS)
    return figure


@figure_style()
def distribution_figure(result: ExperimentResult) -> Figure:
    """Tension over time and angle, on the level of the machine."""
    run = result.runs[result.lead]
    rows = thinned(len(run.time_s), _HEAT_ROWS)
    time, tension = run.time_s[rows], run.tension_N[rows]
    angle = np.degrees(np.linspace(0, run.transmission.path.total_angle_rad, SECTIONS))
    figure, axes = new_figure(height_in=3.4)
    panel: Axes = axes[0, 0]
    image = panel.pcolormesh(time, angle, tension.T, cmap=_HEAT, shading="gouraud", rasterized=True)
    lines = panel.contour(time, angle, tension.T, levels=8, colors=INK, linewidths=0.5)
    halo: list[AbstractPathEffect] = [withStroke(linewidth=2, foreground="white")]
    for label in panel.clabel(lines, fontsize=7, fmt="%.0f N"):
        label.set_path_effects(halo)
    _shade_states(panel, run, named=True, shaded=False)
    panel.grid(visible=False)
    panel.set(xlabel="time [s]", ylabel="wrap angle from motor 1 [deg]", yticks=angle[::2], xlim=(0, run.time_s[-1]))
    figure.colorbar(image, ax=panel, label="tension [N]")
    return figure


def _end(run: ExperimentRun, motor: int) -> tuple[FloatArray, str]:
    """Tension at a motor's end, and its symbol."""
    return run.link_tension_N[:, 0 if motor == 0 else -1], f"$f_{1 if motor == 0 else SECTIONS}$"


def _draw_detail(panel: Axes, result: ExperimentResult, done: StatePass, motor: int, what: str) -> None:
    symbol, creeps = "", done.state.modes[motor] is MotorMode.HOLD_FORCE
    for level, run in result.runs.items():
        course, symbol = _end(run, motor)
        if creeps:
            course, symbol = 1e3 * (1 - 2 * motor) * run.position_m[:, motor], ""
        rows = slice(done.first_row, done.last_row + 1)
        time = run.time_s[rows] - run.time_s[done.first_row]
        panel.plot(time, course[rows] - course[done.first_row], label=str(level), **_LEVEL_LOOK[level])
    panel.axhline(0, color=GREY, linewidth=0.6, zorder=1)
    panel.set_title(
        f"{done.state.name}: held force, motor {motor + 1}" if creeps else f"{done.state.name}: {what} {symbol}"
    )
    panel.set_xlabel(f"time in {done.state.name} [s]")
    panel.set_ylabel("motor travel [mm]" if creeps else "tension change [N]")
    panel.margins(x=0)


@figure_style()
def details_figure(result: ExperimentResult) -> Figure | None:
    """Holds and reversals, the three levels in one panel each; None for a test that has neither."""
    lead = result.runs[result.lead]
    held, turned = list(holds(lead))[:2], reversals(lead)[:2]
    columns = max(len(held), len(turned))
    if columns == 0:
        return None
    figure, axes = new_figure(2, columns, height_in=5.0)
    for panel in axes.ravel():
        panel.set_visible(False)
    for panel, (done, motor) in zip(axes[0], held, strict=False):
        panel.set_visible(True)
        _draw_detail(panel, result, done, motor, "held end,")
    for panel, done in zip(axes[1], turned, strict=False):
        panel.set_visible(True)
        _draw_detail(panel, result, done, 1 - driven_motor(done), "reversal, output")
    shown = next(panel for panel in axes.ravel() if panel.get_visible())
    figure.legend(*shown.get_legend_handles_labels(), loc="outside upper center", ncols=len(result.runs))
    return figure


@figure_style()
def hysteresis_figure(result: ExperimentResult) -> Figure:
    """Tension at both ends over the elongation of the tendon, three levels."""
    figure, axes = new_figure(1, 2, height_in=3.4, share_y=True)
    for motor in (0, 1):
        panel: Axes = axes[0, motor]
        for level, run in result.runs.items():
            rows = thinned(len(run.time_s))
            tension, symbol = _end(run, motor)
            panel.plot(1e3 * run.elongation_m[rows], tension[rows], label=str(level), **_LEVEL_LOOK[level])
            panel.plot(0, tension[0], "o", color=INK, markersize=4)
        panel.set_title(f"end of motor {motor + 1}, {symbol}")
        panel.set_xlabel("elongation since the start [mm]")
    axes[0, 0].set_ylabel("tension [N]")
    axes[0, 0].set_ylim(bottom=0)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=len(result.runs))
    return figure


def experiment_figures(result: ExperimentResult) -> dict[str, Figure]:
    """All figures by file name; without the details where the states have no hold and no reversal."""
    figures = {
        "experiment_distribution": distribution_figure(result),
        "experiment_tensions": tensions_figure(result),
        "experiment_details": details_figure(result),
        "experiment_hysteresis": hysteresis_figure(result),
    }
    return {name: figure for name, figure in figures.items() if figure is not None}
