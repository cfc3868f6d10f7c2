"""`tendonff identify`: parameters of a rig from what was measured on it."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonff.compensator.cli.options import OutFolderOption, ScenarioArgument
from tendonff.compensator.cli.progress import progress, say, warn
from tendonff.compensator.scenario.measurement import Explain

if TYPE_CHECKING:
    from tendonff.compensator.scenario.measurement import Measurement

SCALED = ("time", "input", "output", "input_position", "output_position")


def identify(
    scenario: ScenarioArgument,
    out: OutFolderOption,
    data: Annotated[
        list[Path] | None,
        typer.Option("--data", metavar="D.csv", help="Measured file to fit; may be repeated.", show_default=False),
    ] = None,
    validate: Annotated[
        list[Path] | None,
        typer.Option(
            "--validate",
            metavar="V.csv",
            help="Measured file that judges the laws; may be repeated.",
            show_default=False,
        ),
    ] = None,
    suggest: Annotated[
        bool, typer.Option("--suggest", help="Only write an excitation for this rig, as a force file.")
    ] = False,
    time_column: Annotated[
        str | None, typer.Option("--time-column", help="Name of the column of time.", show_default=False)
    ] = None,
    input_column: Annotated[
        str | None, typer.Option("--input-column", help="Name of the column of the input tension.", show_default=False)
    ] = None,
    output_column: Annotated[
        str | None,
        typer.Option("--output-column", help="Name of the column of the output tension.", show_default=False),
    ] = None,
    input_position_column: Annotated[
        str | None,
        typer.Option(
            "--input-position-column", help="Name of the column of the input end's position.", show_default=False
        ),
    ] = None,
    output_position_column: Annotated[
        str | None,
        typer.Option(
            "--output-position-column", help="Name of the column of the output end's position.", show_default=False
        ),
    ] = None,
    scale: Annotated[
        list[str] | None,
        typer.Option(
            "--scale",
            metavar="[COLUMN=]FACTOR",
            help="Factor to SI units: of both tensions, or of the column time, input, output, input_position or "
            "output_position; may be repeated.",
            show_default=False,
        ),
    ] = None,
    skip: Annotated[
        float | None,
        typer.Option(
            "--skip",
            metavar="SECONDS",
            help="Leave out the start of every file; default: until the start-up transient has decayed.",
            show_default=False,
        ),
    ] = None,
    explain: Annotated[
        Explain | None,
        typer.Option(
            "--explain",
            help="Tension to predict from the other; default: chosen from the data.",
            show_default=False,
        ),
    ] = None,
    static_only: Annotated[bool, typer.Option("--static", help="Stop after the static stage.")] = False,
) -> None:
    """Fit the parameters to measured data.

    The data are tensions, and optionally positions, at both ends of the tendon.
    """
    from tendonff.compensator.cli.opening import opened
    from tendonff.compensator.files.reading import InputError
    from tendonff.models.errors import ParameterError

    if suggest:
        with opened(scenario, out, follows_reference=False) as (loaded, folder):
            from tendonff.compensator.identification.output import write_suggestion

            excitation = write_suggestion(loaded, folder)
        say(f"{out / 'suggested_force.csv'}: {excitation.time_s[-1]:.4g} s, up to {excitation.force_N.max():.4g} N")
        for part in excitation.parts:
            say(f"  {part}")
        return
    if not data:
        raise InputError(
            "no measured file given; name at least one with --data, or ask for an excitation with --suggest"
        )
    names = {
        "time_column": time_column,
        "input_column": input_column,
        "output_column": output_column,
        "input_position_column": input_position_column,
        "output_position_column": output_position_column,
        "skip_s": skip,
        "explain": explain,
    }
    with opened(scenario, out, follows_reference=False) as (loaded, folder):
        try:
            how = _scaled(replace(loaded.measurement, **{k: v for k, v in names.items() if v is not None}), scale or [])  # type: ignore[arg-type]
        except ParameterError as error:
            raise InputError(str(error)) from None
        from tendonff.compensator.identification.result import summary_lines
        from tendonff.compensator.identification.run import identify as identify_files

        with progress("identifying"):
            found = identify_files(replace(loaded, measurement=how), data, validate or [], static_only=static_only)
        with progress("writing"):
            found.write(folder)
    for warning in found.warnings:
        warn(warning)
    for line in summary_lines(found):
        say(line)


def _scaled(how: "Measurement", wishes: list[str]) -> "Measurement":
    """Put `--scale` into the table [measurement]."""
    from tendonff.compensator.files.reading import InputError, suggestion

    for wish in wishes:
        column, _, factor = wish.rpartition("=")
        try:
            value = float(factor)
        except ValueError:
            raise InputError(
                f'--scale must be a number or COLUMN=number, got "{wish}"; --scale input=9.81 turns kg into N'
            ) from None
        if column and column not in SCALED:
            raise InputError(f'--scale: unknown column "{column}"{suggestion(column, SCALED)}')
        for name in [column] if column else ["input", "output"]:
            how = replace(how, **{f"{name}_scale": value})  # type: ignore[arg-type]
    return how
