"""`tendonff table`: compensation tables."""

from typing import Annotated

import typer

from tendonff.compensator.cli.commands.export_c import PrefixOption
from tendonff.compensator.cli.options import LevelOption, OutFolderOption, ScenarioArgument
from tendonff.compensator.cli.progress import progress, say, warn

_MANY_NODES = 5000


def _numbers(text: str | None, option: str) -> tuple[float, ...]:
    """Comma-separated numbers of an option."""
    if text is None:
        return ()
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f'must be numbers separated by commas, got "{text}"', param_hint=option) from None


def _angles(pose: list[str] | None) -> dict[str, float]:
    """Angles of joints by name."""
    found = {}
    for text in pose or []:
        name, _, angle = text.partition("=")
        numbers = _numbers(angle or None, "--pose")
        if len(numbers) != 1 or not name:
            raise typer.BadParameter(f'must be NAME=ANGLE, got "{text}"', param_hint="--pose")
        found[name.strip()] = numbers[0]
    return found


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
    pose: Annotated[
        list[str] | None,
        typer.Option("--pose", metavar="NAME=ANGLE", help="Joint that stands still for the table [rad]; repeatable."),
    ] = None,
    prefix: PrefixOption = "tff",
) -> None:
    """Tabulate the feedforward force.

    The axes are the reference, the branch and the tension since the last reversal.
    """
    from tendonff.compensator.cli.opening import opened

    angles_of_joints = _angles(pose)
    angle_axis, rate_axis = _numbers(angles, "--angles"), _numbers(rates, "--rates")
    with opened(scenario, out) as (loaded, folder):
        from tendonff.compensator.export.modules import check_prefix
        from tendonff.compensator.tables.run import make_tables

        check_prefix(prefix)

        with progress("tabulating"):
            result = make_tables(
                loaded,
                level=level,
                bound_N=bound,
                angles_rad=angle_axis,
                rates_N_per_s=rate_axis,
                pose_rad=angles_of_joints,
            )
            result.write(folder, prefix=prefix)
    for warning in result.reference.warnings:
        warn(warning)
    if (nodes := max(made.built.table.nodes for made in result.tables)) > _MANY_NODES:
        warn(f"{nodes} nodes in one table are {8 * nodes} bytes on the controller: raise --bound, or use the inverse")
    say(result.headline)
    built, own = result.tables[0].built, result.scores[result.level]
    say(
        f"{sum(made.built.table.nodes for made in result.tables)} nodes, interpolation error {built.error_N:.3g} N "
        f"(bound {built.bound_N:.3g} N); RMS error with exactly the scenario's parameters on level {result.level}: "
        f"{own.rmse_percent_of_range:.2g} % of range"
    )
