"""The figure of a compensation table."""

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.reporting.colours import BLUE, VERMILION
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.compensator.studies.tables.result import Tables
from tendonff.models.capstan import Branch


@figure_style()
def table_figures(result: Tables) -> dict[str, Figure]:
    """The figure by file name."""
    return {"table": table_figure(result)}


def table_figure(result: Tables) -> Figure:
    """Force over reference on both branches with transitions, and the transition on its own."""
    table = result.tables[0].built.table
    p = table.adhesion_N
    figure, axes = new_figure(1, 2, height_in=3.0)
    left, right = axes[0]
    low, high = table.reference_N[0], table.reference_N[-1]
    colours = {Branch.PULL: BLUE, Branch.RELEASE: VERMILION}
    names = {Branch.PULL: "reference rises (pull)", Branch.RELEASE: "reference falls (release)"}
    for branch in Branch:
        nodes, sign = table.branch(branch), 1.0 if branch is Branch.PULL else -1.0
        left.plot(table.reference_N, nodes.force_N[:, -1], color=colours[branch], label=names[branch])
        for turn in np.linspace(low, high, 7)[1:-1]:
            end = high if branch is Branch.PULL else low
            way = turn + (end - turn) * np.linspace(0, 1, 400) ** 2
            share = sign * (way - turn) / (way + p)
            inside = share <= nodes.share[-1]
            force = table.force_N(way[inside], branch, share[inside])
            left.plot(way[inside], force, color=colours[branch], linewidth=0.7)
        middle = float(table.reference_N[0] + table.reference_N[-1]) / 2
        dense = np.linspace(0, nodes.share[-1], 400)
        travelled = dense * (middle + p)
        right.plot(travelled, table.force_N(np.full(400, middle), branch, dense), color=colours[branch])
        at_nodes = table.force_N(np.full(nodes.share.size, middle), branch, nodes.share)
        right.plot(nodes.share * (middle + p), at_nodes, ".", color=colours[branch], markersize=4)
    left.set(xlabel="reference tension [N]", ylabel="force [N]", title="slip (thick) and reversals (thin)")
    left.legend(loc="upper left")
    right.set(
        xlabel="tension since the reversal [N]", ylabel="force [N]", title=f"transition at {middle:.3g} N and its nodes"
    )
    return figure
