"""`tendonff identify`: parameters of a rig from what was measured on it."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonff.compensator.cli.options import (
    OutFolderOption,
    PdfOption,
    ScenarioArgument,
    looked_at,
    named_numbers,
    option,
)
from tendonff.compensator.cli.progress import interruptible, progress, say, warn
from tendonff.compensator.files.progress import DOUBT
from tendonff.compensator.files.text import InputError, suggestion
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.models.errors import ParameterError

if TYPE_CHECKING:
    from tendonff.compensator.door import AnyScenario

_YES = "Fit very long files without asking, and go on where a value looks like another unit."
SCALED = ("time", "input", "output", "input_position", "output_position", "actuator_force")
_SCALE = (
    "Factor to SI units: of both tensions, or of the column time, input, output, input_position, output_position or "
    "actuator_force"
)
_OFFSET = (
    "What the cells read without tension, in N: of both, or of the column input or output; subtracted. "
    "Default: found from slack samples."
)
_CELLS = "Column of a tension between the ends, and the wrap angle from the actuator to it"
_CHANNEL = "Column of a channel by its usual name: motor_flexor_rad=motorPosition[2]"
_CONDITION = "Angle of a joint at rest in a file, such as the bend of a sheath; without FILE: in all files"
_TARE = "Seconds of every file in which the tendon is slack, or no motor loaded: cells and torques are zero there."
_SKIP = "Leave out the start of every file; default: until the start-up transient has decayed."
_COLUMNS = "Names of the columns, for a text file without a header"
_TORQUE_CONSTANT = "Torque over current of the motor, in N m/A: a column of the input tension may be in A or mA."
_DRUM_RADIUS = "Radius of the drum, in m: columns may be torques in N m or mN m, angles in rad or deg, speeds in rpm."
_GEAR_RATIO = "Revolutions of the motor for one of the drum: torque, current and angle of the input are the motor's."
_CUTOFF = "Cut-off of the low-pass over all channels, in Hz; default: found from the noise."


def _column(name: str, what: str) -> Any:
    """The option that names a column."""
    return option(f"--{name}-column", None, f"Name of the column of {what}.")


def _several(name: str, metavar: str, text: str) -> Any:
    """An option that may be repeated."""
    return option(name, metavar, f"{text}; may be repeated.")


def identify(
    scenario: ScenarioArgument,
    out: OutFolderOption = Path("fit"),
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
    input_position_column: Annotated[str | None, _column("input-position", "the near end's position")] = None,
    output_position_column: Annotated[str | None, _column("output-position", "the far end's position")] = None,
    actuator_force_column: Annotated[str | None, _column("actuator-force", "the actuator's force")] = None,
    tension_column: Annotated[list[str] | None, _several("--tension-column", "NAME=ANGLE_RAD", _CELLS)] = None,
    channel: Annotated[list[str] | None, _several("--channel", "CHANNEL=COLUMN", _CHANNEL)] = None,
    condition: Annotated[list[str] | None, _several("--condition", "[FILE:]JOINT=RAD", _CONDITION)] = None,
    columns: Annotated[str | None, option("--columns", "A,B,C", _COLUMNS)] = None,
    torque_constant: Annotated[float | None, option("--torque-constant", "N_M_PER_A", _TORQUE_CONSTANT)] = None,
    drum_radius: Annotated[float | None, option("--drum-radius", "M", _DRUM_RADIUS)] = None,
    gear_ratio: Annotated[float | None, option("--gear-ratio", "RATIO", _GEAR_RATIO)] = None,
    scale: Annotated[list[str] | None, _several("--scale", "[COLUMN=]FACTOR", _SCALE)] = None,
    offset: Annotated[list[str] | None, option("--offset", "[COLUMN=]N", _OFFSET)] = None,
    tare: Annotated[str | None, option("--tare", "FROM:TO", _TARE)] = None,
    skip: Annotated[float | None, option("--skip", "SECONDS", _SKIP)] = None,
    cutoff: Annotated[float | None, option("--cutoff", "HZ", _CUTOFF)] = None,
    explain: Annotated[
        Explain | None, option("--explain", None, "Tension to predict from the other; default: chosen from the data.")
    ] = None,
    static_only: Annotated[bool, typer.Option("--static", help="Fit the quasi-static laws only.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help=_YES)] = False,
    strict: Annotated[bool, typer.Option("--strict", help="Exit with 1 where no law explains the files.")] = False,
    pdf: PdfOption = False,
) -> int:
    """Fit the parameters to measured data.

    The data are tensions, and optionally positions, at both ends of the tendon. For a joint between tendons: angle
    (motor_rad) and torque or current of its motor, and the joint's angle where there is an encoder; --input-column
    names the motor's torque, --output-column the joint's where it was measured, --input-position-column the motor's
    angle, --output-position-column the joint's.
    """
    loaded = looked_at(scenario, follows_reference=False, yes=yes)
    from tendonff.compensator import door, works
    from tendonff.compensator.files.writing import atomic_directory

    if suggest:
        with atomic_directory(out) as folder:
            routine = works.function_of("write_suggestion", loaded)(loaded, folder, pdf=pdf)
        say(*routine.lines(out))
        return 0
    if not data:
        raise InputError(
            "no measured file given; name at least one with --data, or ask for an excitation with --suggest"
        )
    header = None if columns is None else tuple(name.strip() for name in columns.split(","))
    names = {
        "time_column": time_column,
        "input_column": input_column,
        "output_column": output_column,
        "input_position_column": input_position_column,
        "output_position_column": output_position_column,
        "actuator_force_column": actuator_force_column,
        "skip_s": skip,
        "cutoff_Hz": cutoff,
        "columns": header,
        "torque_constant_N_m_per_A": torque_constant,
        "drum_radius_m": drum_radius,
        "gear_ratio": gear_ratio,
        "explain": explain,
        "channels": None if channel is None else tuple(channel),
        "conditions": None if condition is None else tuple(condition),
    }
    works.require_options("identify", loaded, {**names, "tension_columns": tension_column, "tare_s": tare})

    def confirm(question: str) -> bool:
        return yes or (sys.stdin.isatty() and typer.confirm(f"{question}. Go on?", err=True))

    with atomic_directory(out) as folder:
        if _identify_servo(loaded, out, folder, data, header=header or loaded.measurement.columns or ()):
            return 0
        try:
            how = replace(loaded.measurement, **{k: v for k, v in names.items() if v is not None})  # type: ignore[arg-type]
            how = _of_columns(how, "--scale", scale or [], SCALED, "input=9.81 turns kg into N")
            how = _of_columns(how, "--offset", offset or [], ("input", "output"), "output=0.4 takes 0.4 N off")
            how = _between(_tared(how, tare), tension_column or [])
        except ParameterError as error:
            raise InputError(str(error)) from None
        with progress("identifying"):
            found = interruptible(
                lambda: door.identify(
                    loaded,
                    data,
                    validate or [],
                    how=how,
                    static_only=static_only,
                    say=_say_files,
                    confirm=confirm,
                )
            )
        with progress("writing"):
            found.write(folder, pdf=pdf)
    warn(*found.warnings)
    say(*found.lines(str(out)))
    return int(strict and found.status.is_unexplained)


def _identify_servo(loaded: "AnyScenario", out: Path, folder: Path, data: list[Path], *, header: Sequence[str]) -> bool:
    """Identify lag and delay of the drive, where the files are logs of its command and its answer."""
    from tendonff.compensator.identification.servo import identify_servo, is_servo_log

    if not all(is_servo_log(path, header) for path in data):
        return False
    found = identify_servo(data, loaded.drive_table)
    found.write(folder)
    say(*found.lines, f"written to {out / 'drive.toml'}: copy its keys into the scenario")
    return True


def _say_files(line: str) -> None:
    """Print what was read, how long it takes, and questions; names of stages are not printed."""
    if " samples over " in line or line.startswith("the fit takes"):
        say(line)
    elif line.startswith(DOUBT):
        warn(line.removeprefix(DOUBT))


def _of_columns(how: Measurement, name: str, texts: list[str], known: tuple[str, ...], example: str) -> Measurement:
    """Put `--scale` or `--offset` into the table [measurement]: of a column, or of both tensions."""
    suffix = "scale" if name == "--scale" else "offset_N"
    for column, value in named_numbers(name, texts, "a number or COLUMN=number", example):
        if column and column not in known:
            raise InputError(f'{name}: unknown column "{column}"{suggestion(column, known)}')
        for each in [column] if column else ["input", "output"]:
            how = replace(how, **{f"{each}_{suffix}": value})  # type: ignore[arg-type]
    return how


def _between(how: Measurement, texts: list[str]) -> Measurement:
    """Put `--tension-column` into the table [measurement]."""
    if not texts:
        return how
    cells = named_numbers("--tension-column", texts, "NAME=ANGLE_RAD", "cell_2_N=1.05", is_named=True)
    names, angles = zip(*cells, strict=True)
    return replace(how, tension_columns=names, tension_angles_rad=angles)


def _tared(how: Measurement, tare: str | None) -> Measurement:
    """Put `--tare` into the table [measurement]."""
    if tare is None:
        return how
    try:
        start, stop = (float(text) for text in tare.split(":"))
    except ValueError:
        raise InputError(f'--tare must be FROM:TO in seconds, got "{tare}"; --tare 0:2 for the first two') from None
    return replace(how, tare_s=(start, stop))
