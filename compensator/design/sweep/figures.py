"""Figures of a sweep."""

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.design.sweep.result import SweepData
from tendonff.compensator.reporting.plots import legend_below, new_figure


def sweep_figures(result: SweepData) -> dict[str, Figure]:
    """By file name: the share of units over the error, and the error over each varied key.

    Parameters
    ----------
    result : SweepData
    """
    share, axes = new_figure()
    panel = axes[0, 0]
    for name in result.compensators:
        each, error = compensator(name), np.sort(result.percent(name))
        error = error[np.isfinite(error)]
        up = 100 * np.arange(1, len(error) + 1) / len(result.rows)
        panel.plot(error, up, color=each.style.color, linestyle=each.style.linestyle, label=each.label)
    panel.set(xlabel="error [% of range rms]", ylabel="units below [%]", ylim=(0, 100))
    legend_below(share, panel)
    over, panels = new_figure(rows=len(result.keys))
    for k, (key, panel) in enumerate(zip(result.keys, panels[:, 0], strict=True)):
        at = [row.values[k] for row in result.rows]
        for name in result.compensators:
            each = compensator(name)
            panel.plot(at, result.percent(name), ".", markersize=3, color=each.style.color, label=each.label)
        panel.set(xlabel=key, ylabel="error [% of range]")
    legend_below(over, panels[-1, 0])
    return {"yield": share, "errors": over}
