"""Figures of a sweep."""

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure
from tendonff.compensator.studies.design.sweep.result import Sweep, key_label


@figure_style()
def sweep_figures(result: Sweep) -> dict[str, Figure]:
    """By file name: the share of units over the error, and the error over each key that takes several values."""
    share, axes = new_figure()
    panel = axes[0, 0]
    compensators = result.known
    for name, each in compensators.items():
        error = np.sort(result.percent(name))
        error = error[np.isfinite(error)]
        up = 100 * np.arange(1, len(error) + 1) / len(result.rows)
        panel.plot(
            error, up, color=each.style.color, linestyle=each.style.linestyle, label=each.label, drawstyle="steps-post"
        )
    panel.set(xlabel="RMS error [% of reference range]", ylabel="units below [%]", ylim=(0, 100))
    legend_below(share, panel, columns=3)
    several = [k for k in range(len(result.keys)) if len({row.values[k] for row in result.rows}) > 1] or [0]
    over, panels = new_figure(rows=len(several))
    for k, panel in zip(several, panels[:, 0], strict=True):
        at = [row.values[k] for row in result.rows]
        for name, each in compensators.items():
            panel.plot(at, result.percent(name), ".", markersize=6, color=each.style.color, label=each.label)
        panel.set(xlabel=key_label(result.keys[k]), ylabel="RMS error [% of range]")
    legend_below(over, panels[-1, 0], columns=3)
    return {"yield": share, "errors": over}
