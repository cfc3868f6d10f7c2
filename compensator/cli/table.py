"""`tendonff table`: compensation tables."""

from typing import Annotated

import typer

from tendonff.compensator.cli.options import LevelOption, OutFolderOption, ScenarioArgument
from tendonff.compensator.cli.progress import progress, say, warn


def _numbers(text: str | None, option: str) -> tuple[float, ...]:
    """Comma-separated numbers of an option."""
    if text is None:
        return ()
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f'must be numbers separated by commas, got "{text}"', param_hint=option) from None


def table(
    scenario: ScenarioArgument,
    out: OutFolderOption,
    level: LevelOption = None,
    bound: Annotated[
        float | None,
        typer.Option(
            "--bound", metavar="N", help="Largest interpolation error [N]; default: 0.5 % of the reference's range."
        ),
    ] = None,
    angles: Annotated[
        str | None, typer.Option("--angles", metavar="A,A,...", help="Wrap angles [rad]: a further axis.")
    ] = None,
    rates: Annotated[
        str | None, typer.Option("--rates", metavar="R,R,...", help="Rates of the reference [N/s]: a further axis.")
    ] = None,
) -> None:
    """Tabulate the feedforward force over reference, branch and tension since the last reversal."""
    from tendonff.compensator.cli.opening import opened

    angle_axis, rate_axis = _numbers(angles, "--angles"), _numbers(rates, "--rates")
    options = {"--level": level, "--bound": bound, "--angles": angles, "--rates": rates}
    given = [f"{name} {value}" for name, value in options.items() if value is not None]
    with opened(scenario, out) as (loaded, folder):
        from tendonff.compensator.reporting.page import write_report
        from tendonff.compensator.tables.report import table_report
        from tendonff.compensator.tables.run import make_tables, write_tables

        with progress("tabulating"):
            tables = make_tables(loaded, level=level, bound_N=bound, angles_rad=angle_axis, rates_N_per_s=rate_axis)
            write_tables(tables, folder)
            write_report(folder / "report.html", table_report(tables, folder, options=" ".join(given)))
    for warning in tables.reference.warnings:
        warn(warning)
    built = tables.runs[0].built
    own = tables.scores[tables.level]
    say(
        f"{sum(run.built.table.nodes for run in tables.runs)} nodes, interpolation error {built.error_N:.3g} N "
        f"(bound {built.bound_N:.3g} N); as a compensator on level {tables.level}: {own.rmse_N:.3g} N rms, "
        f"{own.rmse_percent_of_range:.2g} % of range"
    )
