"""Panels of measurement and model that the figures of every identification are made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tendonff.compensator.identification.measured import Array
from tendonff.compensator.reporting.colours import BLUE, GREY, INK, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import legend_below, new_figure, thinned

MOST_PANELS = 4
"""Files that are shown."""


class File(Protocol):
    """A measured file, as far as it is shown."""

    @property
    def name(self) -> str:
        """Of the file."""

    @property
    def role(self) -> str:
        """Fit or validate."""

    @property
    def time_s(self) -> Array:
        """Clock, shape (n,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """A channel of a file, measured and by the model.

    Parameters
    ----------
    file : File
    label : str
        Channel and unit.
    measured, model : ndarray, shape (n,)
    over : ndarray, shape (n,), optional
        Abscissa of a loop, or what drives the law.
    over_label : str
        Its name and unit.
    band : tuple of ndarray, shape (n,), optional
        Ends of the model's 95 % band.
    percent : float, optional
        RMS error in % of the channel's range where not all rows count.
    turned : bool
        A loop has the channel on its abscissa.
    """

    file: File
    label: str
    measured: Array
    model: Array
    over: Array | None = None
    over_label: str = ""
    band: tuple[Array, Array] | None = None
    percent: float | None = None
    turned: bool = False

    @property
    def title(self) -> str:
        """File and role."""
        return f"{self.file.name} ({'validation' if self.file.role == 'validate' else 'fitted'})"


def over_time(
    panels: Sequence[Panel], measured: str = "measured", model: str = "model", *, given: bool = False
) -> Figure:
    """Channels over time, one below the other; with `given` beside what drives the law."""
    figure, axes = new_figure(len(panels), 1)
    for ax, panel in zip(axes[:, 0], panels, strict=True):
        rows = thinned(len(panel.file.time_s))
        time = panel.file.time_s[rows]
        if panel.band is not None:
            ax.fill_between(time, *(end[rows] for end in panel.band), color=VERMILION, alpha=0.2, linewidth=0)
        if given and panel.over is not None:
            ax.plot(time, panel.over[rows], color=GREY, lw=0.8, label=f"{panel.over_label}, measured")
        ax.plot(time, panel.measured[rows], color=INK, label=measured)
        ax.plot(time, panel.model[rows], color=VERMILION, lw=1.0, ls="--", label=model)
        ax.set(title=panel.title, ylabel=panel.label)
        ax.margins(x=0.01)
    axes[-1, 0].set_xlabel("time [s]")
    legend_below(figure, axes[0, 0])
    return figure


def loops(panels: Sequence[Panel]) -> Figure:
    """Channels over their abscissae, two beside each other."""
    columns = min(2, len(panels))
    lines = -(-len(panels) // columns)
    figure, axes = new_figure(lines, columns, height_in=2.8 * lines + 0.5)
    for ax, panel in zip(axes.ravel(), panels, strict=False):
        rows, ends = thinned(len(panel.file.time_s)), [panel.over_label, panel.label]
        over = panel.file.time_s if panel.over is None else panel.over
        for label, values, look in (
            ("measured", panel.measured, {"color": INK}),
            ("model", panel.model, {"color": VERMILION, "ls": "--"}),
        ):
            x, y = (values, over) if panel.turned else (over, values)
            ax.plot(x[rows], y[rows], lw=0.9, label=label, **look)
        ax.set(title=panel.title, xlabel=ends[panel.turned], ylabel=ends[not panel.turned])
    for ax in axes.ravel()[len(panels) :]:
        ax.set_axis_off()
    legend_below(figure, axes[0, 0])
    return figure


def residuals(panels: Sequence[Panel]) -> Figure:
    """Model less measurement in % of the channel's range, one below the other."""
    figure, axes = new_figure(len(panels), 1, height_in=1.8 * len(panels) + 0.5)
    for ax, panel in zip(axes[:, 0], panels, strict=True):
        left = 100 * (panel.model - panel.measured) / max(float(np.ptp(panel.measured)), 1e-300)
        rms = float(np.sqrt(np.mean(left**2))) if panel.percent is None else panel.percent
        rows = thinned(len(left))
        ax.axhline(0, color=INK, lw=0.6)
        ax.plot(panel.file.time_s[rows], left[rows], color=BLUE, lw=0.8)
        ax.set(title=f"{panel.title}: RMS error {rms:.2g} % of range", ylabel=f"{panel.label}\nmodel less measured [%]")
        ax.margins(x=0.01)
    axes[-1, 0].set_xlabel("time [s]")
    return figure


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
