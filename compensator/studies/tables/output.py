"""The files of compensation tables: for spreadsheets, programs and controllers, and the report."""

import os
from dataclasses import asdict

from tendonff._version import __version__
from tendonff.compensator.export.text.c_text import table_header
from tendonff.compensator.files.writing import atomic_directory, csv_text, write_json, write_text
from tendonff.compensator.reporting.page import write_report
from tendonff.compensator.reporting.plots import save_figure
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.scenario.scenario import scenario_hash
from tendonff.compensator.studies.tables.figures import table_figure, table_figures
from tendonff.compensator.studies.tables.report import table_report
from tendonff.compensator.studies.tables.result import FORMULA, AngleTable, Tables
from tendonff.models.capstan import Branch


def write_files(result: Tables, folder: str | os.PathLike[str], *, prefix: str = "tff", pdf: bool = False) -> None:
    """Write the files of `Tables.write`."""
    with atomic_directory(folder) as partial:
        columns = table_columns(result)
        write_text(partial / "table.csv", csv_text(columns, zip(*columns.values(), strict=True)))
        write_json(partial / "table.json", summary(result))
        write_text(partial / "table.h", table_header(result.scenario, result.tables[0].built, result.level, prefix))
        picture, *_ = save_figure(table_figure(result), partial / "table", pdf=pdf)
        write_report(partial / "report.html", table_report(result, picture))


def table_columns(result: Tables) -> dict[str, list[str | float]]:
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


def summary(result: Tables) -> dict[str, object]:
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


VIEWS = Views(write=write_files, columns=table_columns, figures=table_figures)
