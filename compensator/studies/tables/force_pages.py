"""Files, figure and report of the compensation tables of a tension."""

from dataclasses import asdict

import numpy as np
from matplotlib.figure import Figure

from tendonff._version import __version__
from tendonff.compensator.export.text.c_text import table_header
from tendonff.compensator.reporting.colours import BLUE, VERMILION
from tendonff.compensator.reporting.page import FileNote, Picture, Report, Section, Table, Text, provenance_of
from tendonff.compensator.reporting.plots import figure_style, new_figure
from tendonff.compensator.scenario.scenario import scenario_hash
from tendonff.compensator.studies.tables.force import FORMULA, AngleTable, ForceTables
from tendonff.compensator.studies.tables.output import Pages
from tendonff.models.capstan import Branch


def table_columns(result: ForceTables) -> dict[str, list[str | float]]:
    """The columns of `table.csv`: one row per node."""
    lines: list[tuple[str | float, ...]] = []
    for made in result.tables:
        further = {"total_angle_rad": made.total_angle_rad, "rate_N_per_s": made.built.rate_N_per_s}
        table, at = made.built.table, [further[axis] for axis in result.axes]
        for branch in Branch:
            nodes = table.branch(branch)
            for reference, forces in zip(table.reference_N.tolist(), nodes.force_N.tolist(), strict=True):
                travelled = (nodes.share * (reference + table.adhesion_N)).tolist()
                rows = zip(travelled, forces, nodes.share.tolist(), strict=True)
                lines += [(reference, branch.value, *row, *at) for row in rows]
    names = ("reference_N", "branch", "tension_since_reversal_N", "force_N", "share", *result.axes)
    return {name: list(column) for name, column in zip(names, zip(*lines, strict=True), strict=True)}


def summary(result: ForceTables) -> dict[str, object]:
    """The contents of `table.json`: formula, model, parameters, ranges, errors, and the nodes."""
    scenario = result.scenario

    def one(item: AngleTable) -> dict[str, object]:
        built, table = item.built, item.built.table
        return {
            "total_angle_rad": item.total_angle_rad,
            "rate_N_per_s": built.rate_N_per_s,
            "bound_N": built.bound_N,
            "interpolation_error_N": built.error_N,
            "resolution_N": built.resolution_N,
            "checked_points": built.checked,
            "nodes": table.nodes,
            "reference_N": table.reference_N,
            "share": {b: table.branch(b).share for b in Branch},
            "force_N": {b: table.branch(b).force_N for b in Branch},
        }

    first = result.tables[0].built.table
    return {
        "schema": 1,
        "formula": FORMULA,
        "model": "tendon chain, quasi-static reversals out of full slip through the exact inverse, without masses",
        "level": result.level,
        "segments": scenario.transmission.path.segments,
        "scenario": scenario.name,
        "scenario_hash": scenario_hash(scenario),
        "tendonff": __version__,
        "parameters": asdict(scenario.transmission),
        "valid_reference_N": [float(first.reference_N[0]), float(first.reference_N[-1])],
        "adhesion_N": first.adhesion_N,
        "expected_error": {level: score.named(result.reference.unit) for level, score in result.scores.items()},
        "tables": [one(item) for item in result.tables],
    }


@figure_style()
def table_figures(result: ForceTables) -> dict[str, Figure]:
    """The figure by file name."""
    return {"table": table_figure(result)}


def table_figure(result: ForceTables) -> Figure:
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


def table_report(result: ForceTables, figures: dict[str, Figure]) -> Report:
    """The page of a table, whose figure is written already."""
    own = result.scores[result.level]
    first = result.tables[0].built
    covered, unit = first.table.reference_N, result.reference.unit
    sizes = Table(
        caption="Tables in table.csv",
        columns=(
            "wrap angle [rad]",
            "rate of the reference [N/s]",
            "references",
            "nodes, pulling",
            "nodes, releasing",
            "interpolation error [N]",
            "bound [N]",
        ),
        rows=[
            (
                made.total_angle_rad,
                made.built.rate_N_per_s,
                len(made.built.table.reference_N),
                len(made.built.table.branch(Branch.PULL).share),
                len(made.built.table.branch(Branch.RELEASE).share),
                made.built.error_N,
                made.built.bound_N,
            )
            for made in result.tables
        ],
    )
    scores = Table(
        caption="The scenario's own table as a compensator, within the actuator's limits",
        columns=("plant", "RMS error [% of range]", f"RMS error [{unit.shown}]", f"largest error [{unit.shown}]"),
        rows=[
            (level.value, score.rmse_percent_of_range, unit.factor * score.rmse, unit.factor * score.peak_error)
            for level, score in result.scores.items()
        ],
    )
    return Report(
        title=f"Compensation table: {result.scenario.name}",
        summary=f"{first.table.nodes} values for {covered[0]:.4g} to {covered[-1]:.4g} N. {result.headline}",
        fine_print=(
            f"With exactly the scenario's parameters the RMS error is {own.rmse_percent_of_range:.2g} % on the "
            f"{result.level} level. That is the accuracy of the table, not of a rig, where the uncertainty of the "
            "parameters decides."
        ),
        warnings=result.warnings,
        sections=(
            Section(
                title="The table",
                blocks=(
                    Picture(
                        figure=figures["table"],
                        caption="Left: force over reference, in slip and after reversals. Right: the transition "
                        "from one branch to the other, over the tension since the reversal, with its nodes.",
                    ),
                    sizes,
                ),
            ),
            Section(
                title="How to read it",
                blocks=(
                    *map(Text, FORMULA.split("; ")),
                    Text(
                        "The table is quasi-static: made for slow reversals out of full slip, without masses. The "
                        "exact inverse (tendonff export-c) is more accurate for slightly more computation."
                    ),
                ),
            ),
            Section(title="Accuracy", blocks=(scores,)),
        ),
        provenance=provenance_of(result.scenario, "table", result.options),
        files=(
            FileNote(name="table.csv", content="one row for each node"),
            FileNote(name="table.json", content="formula, ranges, errors and nodes for other programs"),
            FileNote(name="table.h", content="the table for C"),
        ),
    )


VIEWS = Pages(
    columns=table_columns,
    header=lambda result, prefix: table_header(result.scenario, result.tables[0].built, result.level, prefix),
    numbers=summary,
    file="table.json",
    figures=table_figures,
    report=table_report,
).views
