"""Figures of an identification: model against measurement over time, as loops, what is left, and relaxation."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from tendonff.compensator.identification.answer.panels import (
    MOST_PANELS,
    Panel,
    loops,
    mark_parts,
    over_time,
    residuals,
)
from tendonff.compensator.identification.answer.result import Identification, PieceComparison
from tendonff.compensator.identification.suggest import Excitation
from tendonff.compensator.reporting.colours import BLUE, INK, VERMILION
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, save_figure, thinned
from tendonff.compensator.scenario.measurement import Explain


def identification_figures(found: Identification) -> dict[str, Figure]:
    """Every figure that the data has material for, by file name."""
    shown = _chosen(found.comparisons)
    name, other, scale, unit = CHANNELS[found.explain]
    panels = [
        Panel(
            file=piece,
            label=f"{name} [{unit}]",
            measured=scale * piece.measured,
            model=scale * piece.model,
            over=piece.given,
            over_label=f"{other} [N]",
            turned=found.explain is Explain.INPUT,
        )
        for piece in shown
    ]
    with figure_style():
        figures = {
            "time": over_time(panels, given=found.explain is not Explain.POSITION),
            "loop": loops(panels),
            "residuals": residuals(panels),
        }
        if any(c.elongation_m is not None for c in shown):
            figures["relaxation"] = _relaxation(panels, shown)
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


CHANNELS = {
    Explain.OUTPUT: ("output tension", "input tension", 1.0, "N"),
    Explain.INPUT: ("input tension", "output tension", 1.0, "N"),
    Explain.POSITION: ("actuator position", "input tension", 1e3, "mm"),
}
"""Predicted channel, its input, and the factor and unit of its axis."""


def _relaxation(panels: Sequence[Panel], comparisons: Sequence[PieceComparison]) -> Figure:
    shown = [both for both in zip(panels, comparisons, strict=True) if both[1].elongation_m is not None][:2]
    figure, axes = new_figure(len(shown), 2, height_in=2.6 * len(shown) + 0.5)
    for (over, loop), (panel, piece) in zip(axes, shown, strict=True):
        if piece.elongation_m is None or piece.model_elongation_m is None:
            continue
        rows = thinned(len(piece.time_s))
        for label, elongation_m, look in (
            ("measured", piece.elongation_m, {"color": INK}),
            ("model", piece.model_elongation_m, {"color": VERMILION, "ls": "--"}),
        ):
            over.plot(piece.time_s[rows], 1e3 * elongation_m[rows], lw=1.0, label=label, **look)
            loop.plot(1e3 * elongation_m[rows], piece.input_N[rows], lw=0.8, **look)
        over.set(title=panel.title, xlabel="time [s]", ylabel="elongation [mm]")
        loop.set(xlabel="elongation [mm]", ylabel="input tension [N]")
    legend_below(figure, axes[0, 0])
    return figure


def draw_suggestion(excitation: Excitation, folder: Path, *, pdf: bool = False) -> Path:
    """Figure of a suggested excitation, its parts marked; the file that a report shows."""
    with figure_style():
        figure, axes = new_figure(1, 1, height_in=2.8)
        rows = thinned(len(excitation.time_s))
        axes[0, 0].plot(excitation.time_s[rows], excitation.force_N[rows], color=BLUE)
        axes[0, 0].set(xlabel="time [s]", ylabel="actuator force [N]")
        mark_parts(axes[:, 0].tolist(), excitation.parts)
    return save_figure(figure, folder / "suggested_force", pdf=pdf)[0]
