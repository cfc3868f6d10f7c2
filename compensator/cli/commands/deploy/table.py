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
    named_numbers,
    opened,
    option,
)
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.ocp.errors import SolveError

_MANY_NODES = 5000
_BOUND = "Largest interpolation error [N, of a joint rad]; default: 0.5 % of the reference's range, 0.1 %."
_ANGLES = "Wrap angles [rad]: a further axis; of a joint: its nodes."
_RATES = "Rates of the reference [N/s, of a joint rad/s]: a further axis."


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
    angles: Annotated[str | None, option("--angles", "A,A,...", _ANGLES)] = None,
    rates: Annotated[str | None, option("--rates", "R,R,...", _RATES)] = None,
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
    angles_of_joints = dict(named_numbers("--pose", pose or [], "NAME=ANGLE", "wrist=0.5", is_named=True))
    angle_axis, rate_axis = _numbers(angles, "--angles"), _numbers(rates, "--rates")
    with opened(scenario, out, yes=yes) as (loaded, folder):
        from tendonff.compensator import door
        from tendonff.compensator.export.modules import check_prefix

        check_prefix(prefix)
        with progress("tabulating"):
            result = door.make_table(
                loaded,
                level=level,
                bound=bound,
                angles_rad=angle_axis,
                rates=rate_axis,
                pose_rad=angles_of_joints,
            )
            if result.harm and not force:
                warn(*(warning for warning in result.warnings if warning not in result.harm))
                raise SolveError(f"{result.harm[0]}; nothing was written, --force writes it all the same")
            result.write(folder, prefix=prefix, pdf=pdf)
    warn(*result.warnings)
    if result.nodes > _MANY_NODES:
        warn(
            f"{result.nodes} nodes in one table are {8 * result.nodes} bytes on the controller: raise --bound, or use "
            "the inverse"
        )
    say(*result.lines)
