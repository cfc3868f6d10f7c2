"""The report of a compensation table."""

from pathlib import Path

from tendonff.compensator.reporting.page import FileNote, PictureFile, Provenance, Report, Section, Table, Text
from tendonff.compensator.tables.run import FORMULA, ScenarioTables
from tendonff.models.capstan import Branch


def table_report(tables: ScenarioTables, folder: Path, *, options: str = "") -> Report:
    """The page of a table.

    Parameters
    ----------
    tables : ScenarioTables
    folder : Path
        Where its figure `table.png` lies.
    options : str, optional
        Further options that the command was given.
    """
    own = tables.scores[tables.level]
    first = tables.runs[0].built
    covered = first.table.reference_N
    sizes = Table(
        caption="Tables in table.csv",
        columns=(
            "wrap angle [rad]",
            "rate of the reference [N/s]",
            "references",
            "places while pulling",
            "places while releasing",
            "interpolation error [N]",
            "bound [N]",
        ),
        rows=[
            (
                run.total_angle_rad,
                run.built.rate_N_per_s,
                len(run.built.table.reference_N),
                len(run.built.table.branch(Branch.PULL).share),
                len(run.built.table.branch(Branch.RELEASE).share),
                run.built.error_N,
                run.built.bound_N,
            )
            for run in tables.runs
        ],
    )
    scores = Table(
        caption="The scenario's own table as a compensator, within the actuator's limits",
        columns=("plant", "rms [% of range]", "rms [N]", "largest error [N]"),
        rows=[
            (level.value, score.rmse_percent_of_range, score.rmse_N, score.peak_error_N)
            for level, score in tables.scores.items()
        ],
    )
    return Report(
        title=f"Compensation table: {tables.scenario.name}",
        summary=(
            f"Looked up in a table of {first.table.nodes} values, the force leaves {own.rmse_percent_of_range:.2g} % "
            f"of range on the {tables.level} level. The table covers {covered[0]:.4g} to {covered[-1]:.4g} N."
        ),
        warnings=tables.reference.warnings,
        sections=(
            Section(
                title="The table",
                blocks=(
                    PictureFile(
                        path=folder / "table.png",
                        caption="Left: the force over the wanted tension, in slip and after reversals. Right: the way "
                        "from one branch to the other, over the tension since the reversal, with its nodes.",
                    ),
                    sizes,
                ),
            ),
            Section(
                title="How to read it",
                blocks=(
                    *(Text(f"{part}.") for part in FORMULA.split("; ")),
                    Text(
                        "The table is quasi-static: made for slow reversals out of full slip, without masses. The "
                        "exact inverse (tendonff export-c) knows more for a few more instructions."
                    ),
                ),
            ),
            Section(title="What it delivers", blocks=(scores,)),
        ),
        provenance=Provenance(
            scenario=tables.scenario,
            command=f"tendonff table {tables.scenario.source.name} --out DIR {options}".strip(),
        ),
        files=(
            FileNote(name="table.csv", content="one row for each node"),
            FileNote(name="table.json", content="formula, ranges, errors and nodes for other programs"),
            FileNote(name="table.h", content="the table for C"),
        ),
    )
