"""Figures of a comparison: the matrix, the errors over time, loops and holds, the small-signal response."""

from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from tendonff.compensator.compensators.base import CAPSTAN_PLANT
from tendonff.compensator.reporting.colours import BLUE, GREEN, INK, VERMILION
from tendonff.compensator.reporting.plots import (
    bode_figure,
    coinciding,
    draw_joints,
    figure_style,
    legend_below,
    new_figure,
    thinned,
)
from tendonff.compensator.studies.compare.matrix import Entry
from tendonff.compensator.studies.compare.result import Comparison
from tendonff.models.fidelity import Level
from tendonff.models.mechanism.linearise import Lineariser
from tendonff.models.path import JointMotion
from tendonff.models.tendon.chain import Chain

LEVEL_COLOURS = {"elastic": BLUE, "viscoelastic": VERMILION, "presliding": GREEN, CAPSTAN_PLANT: INK}
_LEAST, _COARSE = 0.01, 10.0  # errors not resolved, and from which on two decimals are enough [% of range]
LEVEL_STYLES = {"elastic": "-", "viscoelastic": "--", "presliding": "-.", CAPSTAN_PLANT: ":"}


def compare_figures(result: Comparison) -> dict[str, Figure]:
    """All figures of a comparison by file name."""
    with figure_style():
        return {
            "matrix": matrix_figure(result),
            "errors": errors_figure(result, None if result.ignored is None else result.ignored.motion),
            **({"levels": levels_figure(result), "bode": small_signal_figure(result)} if result.traits else {}),
        }


def matrix_figure(result: Comparison) -> Figure:
    """Error of every design on every plant, as numbers on colours."""
    rows = result.rows
    values = np.array([[entry.rmse_percent_of_range for entry in row] for _, row in rows])
    shown = np.clip(values, 0.01, 100.0)
    figure, axes = new_figure(height_in=0.36 * len(rows) + 0.9)
    panel = axes[0, 0]
    image = panel.imshow(shown, norm=LogNorm(0.01, 100.0), cmap="cividis_r", aspect="auto")
    panel.set_xticks(range(len(result.plants)), result.plants)
    panel.set_yticks(range(len(rows)), [label for label, _ in rows])
    panel.set(xlabel="plant", ylabel="design", title="RMS error, % of range (± spread over step and tolerance)")
    panel.grid(False)
    panel.tick_params(length=0)
    for i, row in enumerate(cell_texts(result)):
        for j, text in enumerate(row):
            dark = shown[i, j] > 1.5
            panel.text(j, i, text, ha="center", va="center", fontsize=8, color="white" if dark else INK)
    colour_bar = figure.colorbar(image, ax=panel, shrink=0.9)
    colour_bar.set_ticks([0.01, 0.1, 1, 10, 100], labels=["≤ 0.01", "0.1", "1", "10", "100"])
    return figure


def cell_texts(result: Comparison) -> list[list[str]]:
    """Error and, where it matters, spread of each cell, all with the same decimals [% of range]."""
    cells = [row for _, row in result.rows]
    decimals = 2 if max(entry.rmse_percent_of_range for row in cells for entry in row) >= _COARSE else 3

    def text(entry: Entry) -> str:
        value, spread = entry.rmse_percent_of_range, entry.spread_percent_of_range
        shown = f"{value:.{decimals}f}" if value >= _LEAST else f"< {_LEAST:g}"
        return f"{shown} ± {spread:.{decimals}f}" if spread >= max(_LEAST / 2, _LEAST * value) else shown

    return [[text(entry) for entry in row] for row in cells]


def errors_figure(result: Comparison, motion: JointMotion | None = None) -> Figure:
    """Reference, and error over time of a compensator designed on each level, on the most detailed plant.

    Joints that move have a panel of their own.
    """
    time, plant, shown = result.time_s, Level.PRESLIDING.value, result.unit
    rows = thinned(len(time))
    moved = motion is not None
    figure, axes = new_figure(4 if moved else 3, 1, share_x=True, height_in=7.0 if moved else 5.6)
    wanted, *under, whole, zoom = axes[:, 0]
    if motion is not None:
        draw_joints(under[0], motion, time)
    wanted.plot(time[rows], shown.factor * result.wanted[rows], color=INK, label="reference")
    errors = {level: shown.factor * (result.outputs[result.exact, level, plant] - result.wanted) for level in Level}
    statics = [
        (shown.factor * (result.outputs[c.name, next(iter(Level)), plant] - result.wanted), c.label)
        for c in result.compensators
        if c.name == result.static
    ]
    hidden = coinciding({level.value: error for level, error in errors.items()}, float(np.ptp(errors[Level.ELASTIC])))
    for panel in (whole, zoom):
        for level, error in errors.items():
            style: dict[str, Any] = {"color": LEVEL_COLOURS[level], "linestyle": LEVEL_STYLES[level]}
            if level in hidden.values():
                style.update(linewidth=3.4, linestyle="-", alpha=0.55)
            label = f"designed on {level}"
            label += f" (= {hidden[level]})" if level in hidden else ""
            panel.plot(time[rows], error[rows], label=label, **style)
        for static, label in statics:
            panel.plot(time[rows], static[rows], color="0.55", linewidth=0.9, label=label)
    limit = 1.15 * max(float(np.max(np.abs(error))) for error in errors.values())
    if limit > 0:
        zoom.set_ylim(-limit, limit)
    wanted.set(ylabel=f"reference [{shown.shown}]")
    whole.set(ylabel=f"error [{shown.shown}]", title=f"Error on the {plant} plant")
    zoom.set(ylabel=f"error [{shown.shown}]", xlabel="time [s]", title="Enlarged")
    legend_below(figure, whole, columns=2)
    return figure


def levels_figure(result: Comparison) -> Figure:
    """Differences between the levels: the loop, and the tension in a hold."""
    figure, axes = new_figure(1, 2, height_in=3.2)
    loop, hold = axes[0]
    for name, traits in result.traits.items():
        style: dict[str, Any] = {"color": LEVEL_COLOURS[name], "linestyle": LEVEL_STYLES[name]}
        rows = thinned(len(traits.force_N))
        loop.plot(traits.force_N[rows], traits.output_N[rows], label=name, **style)
        rows = thinned(len(traits.hold_time_s))
        hold.plot(traits.hold_time_s[rows], 100 * traits.hold_input_N[rows] / traits.hold_input_N[0], **style)
    loop.set(xlabel="actuator force [N]", ylabel="output tension [N]", title="Hysteresis loop")
    loop.set_aspect("equal", adjustable="datalim")
    hold.set(xlabel="time held [s]", ylabel="tension at the actuator [%]", title="Relaxation in a hold")
    legend_below(figure, loop, columns=4)
    return figure


def small_signal_figure(result: Comparison) -> Figure:
    """Small changes of the force around rest, where the tendon sticks: Bode plot from force to output tension."""
    transmission: Any = result.scenario.system
    start = result.initial_tension_N
    frequencies, gains = np.geomspace(0.1, 1000, 400), {}
    for level in Level:
        chain = Chain.of(transmission, level)
        linear = Lineariser(chain).at(chain.rest_state(start))
        gains[level.value] = linear.response(2j * np.pi * frequencies)[:, chain.count]
    figure = bode_figure(gains, frequencies, ylabel="output tension / force [-]")
    figure.axes[0].set_title("Small changes around rest: the tendon sticks")
    return figure
