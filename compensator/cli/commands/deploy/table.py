"""`tendonff table`: compensation tables."""

from pathlib import Path
from typing import Annotated

import typer

from tendonff.compensator.cli.options import (
    LevelOption,
    OutFolderOption,
    PdfOption,
    PrefixOption,
    ScenarioArgument,
    YesOption,
    joint_looked_at,
    named_numbers,
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.files.text import InputError
from tendonff.ocp.errors import SolveError

_MANY_NODES = 5000
_BOUND = "Largest interpolation error [N]; default: 0.5 % of the reference's range."


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
    out: OutFolderOption = Path("table"),
    level: LevelOption = None,
    bound: Annotated[float | None, option("--bound", "N", _BOUND)] = None,
    angles: Annotated[str | None, option("--angles", "A,A,...", "Wrap angles [rad]: a further axis.")] = None,
    rates: Annotated[str | None, option("--rates", "R,R,...", "Rates of the reference [N/s]: a further axis.")] = None,
    pose: Annotated[
        list[str] | None,
        option("--pose", "NAME=ANGLE", "Angle of a joint during the table [rad]; repeatable."),
    ] = None,
    prefix: PrefixOption = "tff",
    *,
    force: Annotated[bool, typer.Option("--force", help="Write a table all the same that does harm.")] = False,
    pdf: PdfOption = False,
    yes: YesOption = False,
) -> None:
    """Tabulate the feedforward force.

    The axes are the reference, the branch and the tension since the last reversal. A table whose error is above that of
    no compensation is not written, unless forced.
    """
    from tendonff.compensator.joint.scenario.detect import is_joint_file

    if is_joint_file(scenario):
        for name, given in (("--level", level), ("--bound", bound), ("--angles", angles), ("--rates", rates)):
            if given is not None or pose:
                raise InputError(f"{scenario.name}: {name if given is not None else '--pose'} is for a tension")
        _table_joint(scenario, out, force=force, pdf=pdf, yes=yes)
        return
    angles_of_joints = dict(named_numbers("--pose", pose or [], "NAME=ANGLE", "wrist=0.5", is_named=True))
    angle_axis, rate_axis = _numbers(angles, "--angles"), _numbers(rates, "--rates")
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator.export.modules import check_prefix
        from tendonff.compensator.studies.tables.run import make_tables

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
            if result.harm and not force:
                warn(*(warning for warning in result.warnings if warning not in result.harm))
                raise SolveError(f"{result.harm[0]}; nothing was written, --force writes it all the same")
            result.write(folder, prefix=prefix, pdf=pdf)
    warn(*result.warnings)
    if (nodes := max(made.built.table.nodes for made in result.tables)) > _MANY_NODES:
        warn(f"{nodes} nodes in one table are {8 * nodes} bytes on the controller: raise --bound, or use the inverse")
    say(result.headline)
    built, own = result.tables[0].built, result.scores[result.level]
    say(
        f"{sum(made.built.table.nodes for made in result.tables)} nodes, interpolation error {built.error_N:.3g} N "
        f"(bound {built.bound_N:.3g} N); RMS error with exactly the scenario's parameters on level {result.level}: "
        f"{own.rmse_percent_of_range:.2g} % of range"
    )


def _table_joint(scenario: Path, out: Path, *, force: bool, pdf: bool, yes: bool) -> None:
    loaded = joint_looked_at(scenario, yes=yes)
    from tendonff.compensator.files.writing import atomic_directory
    from tendonff.compensator.studies.tables.joint import tabulate_joint

    with atomic_directory(out) as folder, progress("tabulating"):
        result = tabulate_joint(loaded)
        worst = result.expectation.worst_percent
        if worst["table"] > worst["linear"] and not force:
            raise SolveError(
                f"{result.headline}: worse than the ratio; nothing was written, --force writes it all the same"
            )
        result.write(folder, pdf=pdf)
    say(result.headline)
