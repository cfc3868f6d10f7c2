"""Figures of a design: tension, force, loop and error."""

from collections.abc import Iterable

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.base import Compensator, FloatArray, Score
from tendonff.compensator.design.run import Design
from tendonff.compensator.reporting.plots import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PAGE_WIDTH_IN,
    VERMILION,
    figure_style,
    new_figure,
)
from tendonff.models.fidelity import Level

COLOURS = {
    Compensator.NONE: GREY,
    Compensator.CAPSTAN: ORANGE,
    Compensator.INVERSE: BLUE,
    Compensator.OPTIMAL: VERMILION,
}
STYLES = {
    Compensator.NONE: ":",
    Compensator.CAPSTAN: "-.",
    Compensator.INVERSE: "-",
    Compensator.OPTIMAL: "--",
}
LABELS = {
    Compensator.NONE: "no compensation",
    Compensator.CAPSTAN: "static capstan law",
    Compensator.INVERSE: "exact inverse",
    Compensator.OPTIMAL: "optimal profile",
}
_MOST_POINTS = 4000


def thinned(rows: int) -> slice:
    """Rows to draw: all of them, or an even selection where more would not be seen."""
    return slice(None, None, max(1, rows // _MOST_POINTS))


def percent(score: Score) -> str:
    """Error in % of range with three digits; what is below 0.001 % is rounding and said to be so."""
    value = score.rmse_percent_of_range
    return f"{value:.3g}" if value >= 1e-3 else "< 0.001"


def design_figures(result: Design) -> dict[str, Figure]:
    """All figures of a design by file name.

    Parameters
    ----------
    result : Design
    """
    with figure_style():
        return {
            "tension": tension_figure(result),
            "force": force_figure(result),
            "loop": loop_figure(result),
            "error": error_figure(result),
        }


def tension_figure(result: Design) -> Figure:
    """Wanted tension against what each compensator delivers on the design level.

    Parameters
    ----------
    result : Design
    """
    figure, axes = new_figure()
    panel, rows = axes[0, 0], thinned(len(result.reference.time_s))
    time = result.reference.time_s[rows]
    for compensator in Compensator:
        played = result.on_level(compensator, result.level)
        label = f"{LABELS[compensator]}: {percent(played.score)} % of range rms"
        panel.plot(time, played.output_N[rows], STYLES[compensator], color=COLOURS[compensator], label=label)
    panel.plot(time, result.reference.tension_N[rows], color=INK, linewidth=0.8, label="wanted")
    panel.set(xlabel="time [s]", ylabel="output tension [N]", title=f"Output tension on the {result.level} level")
    _legend_below(figure, panel, columns=2)
    figure.set_size_inches(PAGE_WIDTH_IN, 3.4)
    return figure


def force_figure(result: Design) -> Figure:
    """Force profile of each compensator, with the actuator's range where it is near.

    Parameters
    ----------
    result : Design
    """
    figure, axes = new_figure()
    panel, rows = axes[0, 0], thinned(len(result.reference.time_s))
    for compensator in Compensator:
        panel.plot(
            result.reference.time_s[rows],
            result.forces_N[compensator][rows],
            STYLES[compensator],
            color=COLOURS[compensator],
            label=LABELS[compensator],
        )
    _mark_limits(panel, result)
    panel.set(xlabel="time [s]", ylabel="actuator force [N]", title="Force profiles")
    _legend_below(figure, panel, columns=5)
    figure.set_size_inches(PAGE_WIDTH_IN, 3.2)
    return figure


def loop_figure(result: Design) -> Figure:
    """Hysteresis: output tension over the force, and over the tension that was asked for.

    Parameters
    ----------
    result : Design
    """
    figure, axes = new_figure(1, 2, height_in=3.6)
    by_force, by_wanted = axes[0]
    rows = thinned(len(result.reference.time_s))
    wanted = result.reference.tension_N[rows]
    for compensator in (Compensator.NONE, Compensator.INVERSE):
        output = result.on_level(compensator, result.level).output_N[rows]
        force = result.forces_N[compensator][rows]
        by_force.plot(force, output, STYLES[compensator], color=COLOURS[compensator], label=LABELS[compensator])
    for compensator in Compensator:
        output = result.on_level(compensator, result.level).output_N[rows]
        by_wanted.plot(wanted, output, STYLES[compensator], color=COLOURS[compensator], label=LABELS[compensator])
    _diagonal(by_wanted, [wanted])
    by_force.set(xlabel="actuator force [N]", ylabel="output tension [N]", title="What the tendon does")
    by_wanted.set(xlabel="wanted tension [N]", ylabel="output tension [N]", title="What the user gets")
    handles, labels = by_wanted.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5)
    return figure


def error_figure(result: Design) -> Figure:
    """Error over time on each level: how much the answer depends on the model.

    Parameters
    ----------
    result : Design
    """
    figure, axes = new_figure(len(Level), 1, share_x=True, height_in=5.4)
    rows = thinned(len(result.reference.time_s))
    time = result.reference.time_s[rows]
    for panel, level in zip(axes[:, 0], Level, strict=True):
        largest = 0.0
        for compensator in Compensator:
            played = result.on_level(compensator, level)
            error = played.output_N[rows] - result.reference.tension_N[rows]
            panel.plot(time, error, STYLES[compensator], color=COLOURS[compensator], label=LABELS[compensator])
            largest = max(largest, float(np.max(np.abs(error))))
        here = " (design level)" if level is result.level else ""
        panel.set(ylabel="error [N]", title=f"{level}{here}")
        if largest > 0:  # nothing to scale by where every compensator is exact
            panel.set_ylim(-1.1 * largest, 1.1 * largest)
    axes[-1, 0].set_xlabel("time [s]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5)
    return figure


def _legend_below(figure: Figure, panel: object, columns: int) -> None:
    handles, labels = panel.get_legend_handles_labels()  # type: ignore[attr-defined]
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def _mark_limits(panel: object, result: Design) -> None:
    """Draw a limit of the actuator where it lies within a third of the drawn range."""
    actuator = result.scenario.transmission.actuator
    low, high = panel.get_ylim()  # type: ignore[attr-defined]
    for name, limit in (("force_min_N", actuator.force_min_N), ("force_max_N", actuator.force_max_N)):
        if low - (high - low) / 3 < limit < high + (high - low) / 3:
            panel.axhline(limit, color=INK, linewidth=0.8, linestyle=(0, (6, 3)), label=name)  # type: ignore[attr-defined]


def _diagonal(panel: object, values: Iterable[FloatArray]) -> None:
    together = np.concatenate(list(values))
    ends = [float(np.min(together)), float(np.max(together))]
    panel.plot(ends, ends, color=INK, linewidth=0.8, label="as wanted")  # type: ignore[attr-defined]
