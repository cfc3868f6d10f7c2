"""Figures of an identification: law against measurement over time, as loops, what is left; what to log next."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from tendonff.compensator.identification.answer.panels import (
    loops,
    mark_parts,
    over_time,
    over_time_and_loops,
    residuals,
)
from tendonff.compensator.identification.answer.records import ELONGATION, shown
from tendonff.compensator.identification.answer.result import AnyIdentification
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.reporting.plots import figure_style, new_figure, thinned

MOST_PANELS = 4
"""Of a figure, beside each other or one below the other."""


def identification_figures(found: AnyIdentification) -> dict[str, Figure]:
    """Every figure that the data has material for, by file name: the first also as loops and as residuals."""
    figures = dict[str, Figure]()
    with figure_style():
        for name in dict.fromkeys(channel.figure for channel in found.channels):
            own = [channel for channel in found.channels if channel.figure == name]
            if name == ELONGATION:
                figures[name] = over_time_and_loops(shown(own, MOST_PANELS // 2))
                continue
            panels = shown(own, MOST_PANELS)
            also = {} if figures else {"loop": loops(panels), "residuals": residuals(panels)}
            figures |= {name: over_time(panels)} | also
    return figures


def routine_figure(time_s: Array, axes: Mapping[str, Mapping[str, Array]], parts: Sequence[str]) -> Figure:
    """Figure of a suggested routine, its parts marked: by the label of each axis its lines by name."""
    with figure_style():
        figure, panels = new_figure(len(axes), 1, share_x=True, height_in=1.0 + 1.8 * len(axes))
        rows = thinned(len(time_s))
        for ax, (label, lines) in zip(panels[:, 0], axes.items(), strict=True):
            for name, line in lines.items():
                ax.plot(time_s[rows], line[rows], label=name)
            if len(lines) > 1:
                ax.legend(loc="upper right", fontsize=7)
            ax.set(ylabel=label)
        mark_parts(panels[:, 0].tolist(), parts)
        panels[-1, 0].set(xlabel="time [s]")
    return figure
