"""The report of a compensation table."""

from pathlib import Path

from tendonff.compensator.reporting.page import FileNote, PictureFile, Report, Section, Table, Text, provenance_of
from tendonff.compensator.studies.tables.result import FORMULA, Tables
from tendonff.models.capstan import Branch


def table_report(result: Tables, picture: Path) -> Report:
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
                    PictureFile(
                        path=picture,
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
