"""Figures of a feedback: the loop's gain with its uncertainty and margins, and the errors."""

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.feedback.result import FeedbackResult
from tendonff.compensator.reporting.colours import BLUE, GREY, INK, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import legend_below, new_figure, thinned
from tendonff.models.turns import in_turn

_GRID = 400
_SEEN = 2.5  # times the largest error with the feedforward, that a panel shows
_STYLES = {
    "feedforward": ("feedforward alone", {"color": GREY, "linestyle": "--"}),
    "feedback": ("feedback alone", {"color": ORANGE, "linestyle": ":"}),
    "both": ("both", {"color": BLUE, "linestyle": "-"}),
}


@in_turn
def feedback_figures(result: FeedbackResult) -> dict[str, Figure]:
    """All figures by file name."""
    return {"feedback_loop": loop_figure(result), "feedback_error": error_figure(result)}


def loop_figure(result: FeedbackResult) -> Figure:
    """Gain and phase of the open loop of each goal over its branches, with the margins of the worst."""
    design = result.design
    goals = len(result.names)
    figure, axes = new_figure(2, goals, share_x=True, height_in=4.6)
    law = design.laws[0]
    grid = np.geomspace(0.5, np.pi / law.sample_s * 0.999, _GRID)
    for goal, name in enumerate(result.names):
        top, bottom = axes[:, goal]
        loops = [(p.rad_per_s, p.opened(design.laws, goal)) for p in design.plants]
        size = np.array([np.interp(grid, w, np.abs(o)) for w, o in loops])
        phase = np.array([np.interp(grid, w, np.unwrap(np.angle(o))) for w, o in loops])
        phase -= 2 * np.pi * np.round(phase[:, :1] / (2 * np.pi))
        hertz = grid / (2 * np.pi)
        for panel, rows in ((top, size), (bottom, np.rad2deg(phase))):
            panel.fill_between(hertz, rows.min(axis=0), rows.max(axis=0), color=BLUE, alpha=0.25, linewidth=0)
            panel.plot(hertz, np.median(rows, axis=0), color=BLUE, label="middle of all linearisations")
        top.axhline(1.0, color=INK, linewidth=0.7)
        bottom.axhline(-180.0, color=INK, linewidth=0.7)
        margins = design.margins[goal]
        if np.isfinite(margins.gain):
            at = margins.oscillation_Hz
            top.plot([at, at], [1 / margins.gain, 1.0], color=VERMILION, marker="o", markersize=3, label="gain margin")
        bottom.axhline(-180.0 + min(margins.phase_deg, 180.0), color=VERMILION, linestyle="--", label="phase margin")
        low = max(float(size.min()), 1e-3)
        top.set(xscale="log", yscale="log", ylim=(low, None), ylabel=f"gain of the loop{_of(result, name)} [-]")
        bottom.set(ylim=(-540, 90), xlabel="frequency [Hz]", ylabel="phase [deg]")
    legend_below(figure, axes[0, 0], columns=3)
    return figure


def error_figure(result: FeedbackResult) -> Figure:
    """Errors of the three cases, each on the mechanism where it is worst."""
    figure, axes = new_figure(len(result.names), 1, share_x=True)
    rows, factor = thinned(len(result.time_s)), result.unit.factor
    for goal, name in enumerate(result.names):
        panel = axes[goal, 0]
        for case, (label, style) in _STYLES.items():
            panel.plot(result.time_s[rows], factor * result.cases[case].worst[rows, goal], label=label, **style)
        seen = max(result.cases["feedforward"].worst_peak, result.cases["both"].worst_peak)
        if np.isfinite(seen) and seen > 0:  # feedback alone may be far outside
            panel.set_ylim(-_SEEN * factor * seen, _SEEN * factor * seen)
        panel.set(ylabel=f"error{_of(result, name)} [{result.unit.shown}]")
    axes[-1, 0].set(xlabel="time [s]")
    legend_below(figure, axes[0, 0], columns=3)
    return figure


def _of(result: FeedbackResult, name: str) -> str:
    return f", {name}" if len(result.names) > 1 else ""
