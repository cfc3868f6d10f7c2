"""Figures of an identification: model against measurement over time, as loops, what is left, and relaxation."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.identification.answer.result import Identification, PieceComparison
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.suggest import Excitation
from tendonff.compensator.reporting.colours import BLUE, GREY, INK, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure, save_figure, thinned
from tendonff.compensator.scenario.measurement import Explain

MOST_PANELS = 4


def identification_figures(found: Identification) -> dict[str, Figure]:
    """Every figure that the data has material for, by file name."""
    shown = _chosen(found.comparisons)
    with figure_style():
        figures = {"time": _over_time(found, shown), "loop": _loops(found, shown), "residuals": _residuals(shown)}
        if any(c.elongation_m is not None for c in shown):
            figures["relaxation"] = _relaxation(shown)
    return figures


def draw(found: Identification, folder: Path, *, pdf: bool = False) -> dict[str, Path]:
    """Write every figure; the files that a report shows, by name."""
    figures = identification_figures(found)
    return {name: save_figure(figure, folder / name, pdf=pdf)[0] for name, figure in figures.items()}


def _chosen(comparisons: Sequence[PieceComparison]) -> list[PieceComparison]:
    """The longest pieces, validation first: one per file, as many as fit on a page."""
    longest: dict[str, PieceComparison] = {}
    for piece in comparisons:
        if piece.name not in longest or len(piece.time_s) > len(longest[piece.name].time_s):
            longest[piece.name] = piece
    ordered = sorted(longest.values(), key=lambda c: (c.role != "validate", c.name))
    return ordered[:MOST_PANELS]


def _thin(*columns: Array) -> list[Array]:
    rows = thinned(len(columns[0]))
    return [c[rows] for c in columns]


CHANNELS = {
    Explain.OUTPUT: ("output tension", "input tension", 1.0, "N"),
    Explain.INPUT: ("input tension", "output tension", 1.0, "N"),
    Explain.POSITION: ("actuator position", "input tension", 1e3, "mm"),
}
"""Predicted channel, its input, and the factor and unit of its axis."""


def _title(piece: PieceComparison) -> str:
    return f"{piece.name} ({'validation' if piece.role == 'validate' else 'fitted'})"


def _over_time(found: Identification, comparisons: Sequence[PieceComparison]) -> Figure:
    figure, axes = new_figure(len(comparisons), 1)
    name, other, scale, unit = CHANNELS[found.explain]
    for ax, piece in zip(axes[:, 0], comparisons, strict=True):
        t, x, y, m = _thin(piece.time_s, piece.given, scale * piece.measured, scale * piece.model)
        if found.explain is not Explain.POSITION:
            ax.plot(t, x, color=GREY, lw=0.8, label=f"{other}, measured")
        ax.plot(t, y, color=INK, lw=1.4, label=f"{name}, measured")
        ax.plot(t, m, color=VERMILION, lw=1.0, ls="--", label=f"{name}, model")
        ax.set_title(_title(piece))
        ax.set_ylabel(f"{'position' if found.explain is Explain.POSITION else 'tension'} [{unit}]")
        ax.margins(x=0.01)
    axes[-1, 0].set_xlabel("time [s]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def _loops(found: Identification, comparisons: Sequence[PieceComparison]) -> Figure:
    columns = min(2, len(comparisons))
    rows = -(-len(comparisons) // columns)
    figure, axes = new_figure(rows, columns, height_in=2.8 * rows + 0.5)
    name, other, scale, unit = CHANNELS[found.explain]
    for ax, piece in zip(axes.ravel(), comparisons, strict=False):
        x, y, m = _thin(piece.given, scale * piece.measured, scale * piece.model)
        ends = [f"{other} [N]", f"{name} [{unit}]"]
        for label, values, look in (("measured", y, {"color": INK}), ("model", m, {"color": VERMILION, "ls": "--"})):
            ax.plot(*((values, x) if found.explain is Explain.INPUT else (x, values)), lw=0.9, label=label, **look)
        ax.set_title(_title(piece))
        ax.set_xlabel(ends[found.explain is Explain.INPUT])
        ax.set_ylabel(ends[found.explain is not Explain.INPUT])
    for ax in axes.ravel()[len(comparisons) :]:
        ax.set_axis_off()
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def _residuals(comparisons: Sequence[PieceComparison]) -> Figure:
    figure, axes = new_figure(len(comparisons), 1, height_in=1.7 * len(comparisons) + 0.5)
    for ax, piece in zip(axes[:, 0], comparisons, strict=True):
        span = max(float(np.ptp(piece.measured)), 1e-300)
        t, left = _thin(piece.time_s, 100 * (piece.model - piece.measured) / span)
        ax.axhline(0, color=INK, lw=0.6)
        ax.plot(t, left, color=BLUE, lw=0.8)
        rms = float(np.sqrt(np.mean(left**2)))
        ax.set_title(f"{_title(piece)}: RMS error {rms:.2g} % of range")
        ax.set_ylabel("model less\nmeasured [%]")
        ax.margins(x=0.01)
    axes[-1, 0].set_xlabel("time [s]")
    return figure


def _relaxation(comparisons: Sequence[PieceComparison]) -> Figure:
    shown = [c for c in comparisons if c.elongation_m is not None][:2]
    figure, axes = new_figure(len(shown), 2, height_in=2.6 * len(shown) + 0.5)
    for (over, loop), piece in zip(axes, shown, strict=True):
        if piece.elongation_m is None or piece.model_elongation_m is None:
            continue
        t, x, m, f = _thin(piece.time_s, 1e3 * piece.elongation_m, 1e3 * piece.model_elongation_m, piece.input_N)
        over.plot(t, x, color=INK, lw=1.2, label="measured")
        over.plot(t, m, color=VERMILION, lw=0.9, ls="--", label="model")
        over.set_title(_title(piece))
        over.set_xlabel("time [s]")
        over.set_ylabel("elongation [mm]")
        loop.plot(x, f, color=INK, lw=0.8)
        loop.plot(m, f, color=VERMILION, lw=0.8, ls="--")
        loop.set_xlabel("elongation [mm]")
        loop.set_ylabel("input tension [N]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def draw_suggestion(excitation: Excitation, folder: Path, *, pdf: bool = False) -> Path:
    """Figure of a suggested excitation, its parts marked; the file that a report shows."""
    with figure_style():
        figure, axes = new_figure(1, 1, height_in=2.8)
        ax = axes[0, 0]
        ax.plot(*_thin(excitation.time_s, excitation.force_N), color=BLUE)
        for number, part in enumerate(excitation.parts):
            start = float(part.split(" s:", maxsplit=1)[0])
            ax.axvline(start, color=ORANGE, lw=0.8, ls=":")
            ax.annotate(
                str(number + 1),
                (start, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(3, -9),
                textcoords="offset points",
            )
        names = [part.split(": ", maxsplit=1)[1].split(":", maxsplit=1)[0] for part in excitation.parts]
        ax.set_title("; ".join(f"{k + 1} {name}" for k, name in enumerate(names)), fontsize=7)
        ax.set_xlabel("time [s]")
        ax.set_ylabel("actuator force [N]")
    return save_figure(figure, folder / "suggested_force", pdf=pdf)[0]
