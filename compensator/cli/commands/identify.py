"""`tendonff identify`: parameters of a rig from what was measured on it."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonff.compensator.cli.options import OutFolderOption, ScenarioArgument
from tendonff.compensator.cli.progress import interruptible, progress, say, warn
from tendonff.compensator.scenario.measurement import Explain

if TYPE_CHECKING:
    from tendonff.compensator.identification.output import Identification
    from tendonff.compensator.scenario.measurement import Measurement

SCALED = ("time", "input", "output", "input_position", "output_position", "actuator_force")


def _option(name: str, text: str, metavar: str | None = None) -> Any:
    """An option whose default is told in its text, if at all."""
    return typer.Option(name, metavar=metavar, help=text, show_default=False)


def _column(name: str, what: str) -> Any:
    """The option that names a column."""
    return _option(f"--{name}-column", f"Name of the column of {what}.")


def _several(name: str, metavar: str, text: str) -> Any:
    """An option that may be repeated."""
    return _option(name, f"{text}; may be repeated.", metavar)


def identify(
    scenario: ScenarioArgument,
    out: OutFolderOption,
    data: Annotated[list[Path] | None, _several("--data", "D.csv", "Measured file to fit")] = None,
    validate: Annotated[
        list[Path] | None, _several("--validate", "V.csv", "Measured file that judges the laws")
    ] = None,
    suggest: Annotated[
        bool, typer.Option("--suggest", help="Only write an excitation for this rig, as a force file.")
    ] = False,
    time_column: Annotated[str | None, _column("time", "time")] = None,
    input_column: Annotated[str | None, _column("input", "the input tension")] = None,
    output_column: Annotated[str | None, _column("output", "the output tension")] = None,
    input_position_column: Annotated[str | None, _column("input-position", "the input end's position")] = None,
    output_position_column: Annotated[str | None, _column("output-position", "the output end's position")] = None,
    actuator_force_column: Annotated[str | None, _column("actuator-force", "the actuator's force")] = None,
    tension_column: Annotated[
        list[str] | None,
        _several(
            "--tension-column",
            "NAME=ANGLE_RAD",
            "Column of a tension between the ends, and the wrap angle from the actuator to it",
        ),
    ] = None,
    scale: Annotated[
        list[str] | None,
        _several(
            "--scale",
            "[COLUMN=]FACTOR",
            "Factor to SI units: of both tensions, or of the column time, input, output, input_position, "
            "output_position or actuator_force",
        ),
    ] = None,
    offset: Annotated[
        list[str] | None,
        _option(
            "--offset",
            "What the cells read without tension, in N: of both, or of the column input or output; subtracted. "
            "Default: found from slack samples.",
            "[COLUMN=]N",
        ),
    ] = None,
    tare: Annotated[
        str | None,
        _option(
            "--tare", "Seconds of every file in which the tendon is slack; both cells are set to zero there.", "FROM:TO"
        ),
    ] = None,
    skip: Annotated[
        float | None,
        _option(
            "--skip", "Leave out the start of every file; default: until the start-up transient has decayed.", "SECONDS"
        ),
    ] = None,
    explain: Annotated[
        Explain | None, _option("--explain", "Tension to predict from the other; default: chosen from the data.")
    ] = None,
    static_only: Annotated[bool, typer.Option("--static", help="Stop after the static stage.")] = False,
    condition: Annotated[
        list[str] | None,
        _several(
            "--condition", "FILE=LABEL", "Label of a measured file, such as wet or worn: estimates are told by label"
        ),
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Fit very long files without asking.")] = False,
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
        if excitation.gain:
            say(excitation.gain)
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
        "actuator_force_column": actuator_force_column,
        "skip_s": skip,
        "explain": explain,
    }
    labels = _labels(condition or [], [path.name for path in data])

    def confirm(question: str) -> bool:
        return yes or (sys.stdin.isatty() and typer.confirm(f"{question}. Go on?", err=True))

    with opened(scenario, out, follows_reference=False) as (loaded, folder):
        try:
            how = replace(loaded.measurement, **{k: v for k, v in names.items() if v is not None})  # type: ignore[arg-type]
            how = _between(_zeroed(_scaled(how, scale or []), offset or [], tare), tension_column or [])
        except ParameterError as error:
            raise InputError(str(error)) from None
        from tendonff.compensator.identification.result import summary_lines
        from tendonff.compensator.identification.run import identify as identify_files

        def work() -> "Identification":
            return identify_files(
                replace(loaded, measurement=how),
                data,
                validate or [],
                static_only=static_only,
                conditions=labels,
                say=_say_files,
                confirm=confirm,
            )

        with progress("identifying"):
            found = interruptible(work)
        with progress("writing"):
            found.write(folder)
    for warning in found.warnings:
        warn(warning)
    for line in summary_lines(found):
        say(line)


def _say_files(line: str) -> None:
    """What was read; the names of stages stay silent."""
    if " samples over " in line:
        say(line)


def _labels(options: list[str], names: list[str]) -> dict[str, str]:
    """Labels by file name from `--condition`."""
    from tendonff.compensator.files.reading import InputError, suggestion

    found = {}
    for option in options:
        name, equals, label = option.rpartition("=")
        if not equals or not label:
            raise InputError(f'--condition must be FILE=LABEL, got "{option}"; --condition run3.csv=wet')
        if Path(name).name not in names:
            raise InputError(f'--condition: "{name}" is not given with --data{suggestion(Path(name).name, names)}')
        found[Path(name).name] = label
    return found


def _between(how: "Measurement", options: list[str]) -> "Measurement":
    """Put `--tension-column` into the table [measurement]."""
    from tendonff.compensator.files.reading import InputError

    if not options:
        return how
    cells = []
    for option in options:
        name, _, text = option.rpartition("=")
        try:
            cells.append((name, float(text)))
        except ValueError:
            name = ""
        if not name:
            raise InputError(f'--tension-column must be NAME=ANGLE_RAD, got "{option}"; --tension-column cell_2_N=1.05')
    names, angles = zip(*cells, strict=True)
    return replace(how, tension_columns=names, tension_angles_rad=angles)


def _zeroed(how: "Measurement", offsets: list[str], tare: str | None) -> "Measurement":
    """Put `--offset` and `--tare` into the table [measurement]."""
    from tendonff.compensator.files.reading import InputError, suggestion

    for option in offsets:
        column, _, text = option.rpartition("=")
        try:
            value = float(text)
        except ValueError:
            raise InputError(
                f'--offset must be a number or COLUMN=number, got "{option}"; --offset output=0.4 takes 0.4 N off'
            ) from None
        if column not in ("", "input", "output"):
            raise InputError(f'--offset: unknown column "{column}"{suggestion(column, ("input", "output"))}')
        for name in [column] if column else ["input", "output"]:
            how = replace(how, **{f"{name}_offset_N": value})  # type: ignore[arg-type]
    if tare is not None:
        try:
            start, stop = (float(text) for text in tare.split(":"))
        except ValueError:
            raise InputError(f'--tare must be FROM:TO in seconds, got "{tare}"; --tare 0:2 for the first two') from None
        how = replace(how, tare_s=(start, stop))
    return how


def _scaled(how: "Measurement", options: list[str]) -> "Measurement":
    """Put `--scale` into the table [measurement]."""
    from tendonff.compensator.files.reading import InputError, suggestion

    for option in options:
        column, _, factor = option.rpartition("=")
        try:
            value = float(factor)
        except ValueError:
            raise InputError(
                f'--scale must be a number or COLUMN=number, got "{option}"; --scale input=9.81 turns kg into N'
            ) from None
        if column and column not in SCALED:
            raise InputError(f'--scale: unknown column "{column}"{suggestion(column, SCALED)}')
        for name in [column] if column else ["input", "output"]:
            how = replace(how, **{f"{name}_scale": value})  # type: ignore[arg-type]
    return how
