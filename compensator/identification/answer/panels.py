"""Panels of measurement and model that the figures of every identification are made of."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tendonff.compensator.identification.answer.records import Channel
from tendonff.compensator.reporting.colours import BLUE, GREY, INK, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import legend_below, new_figure, thinned


def over_time(channels: Sequence[Channel]) -> Figure:
    """Channels over time, one below the other, beside what drives the law where that has the same unit."""
    figure, axes = new_figure(len(channels), 1)
    for ax, channel in zip(axes[:, 0], channels, strict=True):
        _over_time(ax, channel)
    axes[-1, 0].set_xlabel("time [s]")
    legend_below(figure, axes[0, 0])
    return figure


def loops(channels: Sequence[Channel]) -> Figure:
    """Channels over their abscissae, two beside each other."""
    columns = min(2, len(channels))
    lines = -(-len(channels) // columns)
    figure, axes = new_figure(lines, columns, height_in=2.8 * lines + 0.5)
    for ax, channel in zip(axes.ravel(), channels, strict=False):
        _loop(ax, channel)
        ax.set(title=channel.title)
    for ax in axes.ravel()[len(channels) :]:
        ax.set_axis_off()
    legend_below(figure, axes[0, 0])
    return figure


def over_time_and_loops(channels: Sequence[Channel]) -> Figure:
    """Each channel over time, and beside it over its abscissa."""
    figure, axes = new_figure(len(channels), 2, height_in=2.6 * len(channels) + 0.5)
    for (left, right), channel in zip(axes, channels, strict=True):
        _over_time(left, channel)
        _loop(right, channel)
        left.set(xlabel="time [s]")
    legend_below(figure, axes[0, 0])
    return figure


def _over_time(ax: Axes, channel: Channel) -> None:
    rows = thinned(len(channel.time_s))
    time = channel.time_s[rows]
    if channel.band is not None:
        low, high = channel.band
        ax.fill_between(time, low[rows], high[rows], color=VERMILION, alpha=0.2, linewidth=0)
    if channel.over is not None and channel.over_unit == channel.unit:
        ax.plot(time, channel.over[rows], color=GREY, lw=0.8, label=f"{channel.over_label}, measured")
    ax.plot(time, channel.measured[rows], color=INK, label="measured")
    ax.plot(time, channel.model[rows], color=VERMILION, lw=1.0, ls="--", label="model")
    ax.set(title=channel.title, ylabel=_in_lines(channel.label))
    ax.margins(x=0.01)


def _loop(ax: Axes, channel: Channel) -> None:
    over = channel.time_s if channel.over is None else channel.over
    rows, ends = thinned(len(over)), [channel.over_label, channel.label]
    for label, values, colour, style in (
        ("measured", channel.measured, INK, "-"),
        ("model", channel.model, VERMILION, "--"),
    ):
        x, y = (values, over) if channel.turned else (over, values)
        ax.plot(x[rows], y[rows], lw=0.9, label=label, color=colour, ls=style)
    ax.set(xlabel=ends[channel.turned], ylabel=_in_lines(ends[not channel.turned]))


def residuals(channels: Sequence[Channel]) -> Figure:
    """Model less measurement in % of the channel's range, one below the other."""
    figure, axes = new_figure(len(channels), 1, height_in=1.8 * len(channels) + 0.5)
    for ax, channel in zip(axes[:, 0], channels, strict=True):
        left = 100 * (channel.model - channel.measured) / max(float(np.ptp(channel.measured)), 1e-300)
        rms = float(np.sqrt(np.mean(left**2))) if channel.percent is None else channel.percent
        rows = thinned(len(left))
        ax.axhline(0, color=INK, lw=0.6)
        ax.plot(channel.time_s[rows], left[rows], color=BLUE, lw=0.8)
        title = f"{channel.title}: RMS error {rms:.2g} % of range"
        ax.set(title=title, ylabel=f"{_in_lines(channel.label)}\nmodel less measured [%]")
        ax.margins(x=0.01)
    axes[-1, 0].set_xlabel("time [s]")
    return figure


def _in_lines(label: str) -> str:
    """A label with the name of a motor on a line of its own."""
    return label.replace(" of ", " of\n")


def mark_parts(axes: Sequence[Axes], parts: Sequence[str]) -> None:
    """Number the parts of a suggested routine, lines like "12 s: small reversals: ...", at their starts."""
    names = []
    for number, part in enumerate(parts):
        start, _, text = part.partition(" s: ")
        names.append(f"{number + 1} {text.partition(':')[0].partition(',')[0]}")
        for ax in axes:
            ax.axvline(float(start), color=ORANGE, lw=0.8, ls=":")
        axes[0].annotate(
            str(number + 1),
            (float(start), 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(3, -9),
            textcoords="offset points",
        )
    axes[0].set_title("; ".join(names), fontsize=7)
