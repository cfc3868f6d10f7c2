"""Before any work is done: the question, units that do not fit, and how much a fit will have to do."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured.cleaning import Record, joints_of
from tendonff.compensator.identification.measured.reading import RawMeasurement
from tendonff.compensator.scenario.doubts import angle_doubt
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.compensator.scenario.scenario import Scenario

FIT_S, FIT_S_PER_S = 1.0, 0.12
"""CPU time of a fit, and per second of log, on a desktop processor: 8.2 s for 60 s at 1 kHz."""

LONG_FIT_S = 140.0
"""A fit that takes longer is asked about."""

SLOW_S = 0.05
"""A clock with longer intervals may count milliseconds."""

_REVERSED = 1.1  # an output tension that swings so many times the input is at the driven end
_LONGEST_STROKE_M = 10.0

_DRIVEN = -0.3
"""Share of the work of friction below which a position has the wrong sign: measured tendons have +0.85 to +1."""

_FORCES = ("Nm", "mNm", "kN", "mN", "lbf", "lb", "kg", "V", "mV", "mA")
_LENGTHS = ("rad", "deg", "mm", "cm", "um", "counts")
OTHERS = {
    "time": ("s", ("ms", "us")),
    "input": ("N", _FORCES),
    "output": ("N", _FORCES),
    "input_position": ("m", _LENGTHS),
    "output_position": ("m", _LENGTHS),
    "actuator_force": ("N", _FORCES),
}
"""For each column the unit it is read in, and last words of names that tell another one; `A`, `g` and `in` may as well
name a place."""

MOST_ABOVE, MOST_BELOW = 20.0, 400.0
"""A largest tension so many times above, or below, what the actuator can do is in another unit or of another rig."""


def check_plan(
    files: Sequence[RawMeasurement],
    how: Measurement,
    *,
    static_only: bool,
    say: Callable[[str], None],
    confirm: Callable[[str], bool],
) -> float:
    """Say what was read, in which units, and how long a fit of it takes; ask where that is very long.

    The capstan law simulates nothing, but a clock that may count milliseconds is asked about there too. InputError if
    `confirm` declines. Returns the time that was said [s].
    """
    fit_s, longest = FIT_S, 0.0
    for file in files:
        interval = float(np.median(np.diff(file.time_s)))
        length = float(np.ptp(file.time_s))
        fit_s += FIT_S_PER_S * length
        longest = max(longest, interval)
        scales = {"time": how.time_scale, "input": how.input_scale, "output": how.output_scale}
        factors = "".join(f", {key} x {scale:g}" for key, scale in scales.items() if scale != 1)
        say(
            f"{file.name}: {len(file.time_s)} samples over {length:.4g} s ({1 / interval:.4g} Hz), input "
            f"{file.input_N.min():.4g} to {file.input_N.max():.4g} N{factors}"
        )
    if not static_only:
        say(f"the fit takes about {fit_s:.2g} s")
    slow = longest > SLOW_S
    if fit_s <= LONG_FIT_S or (static_only and not slow):
        return fit_s
    guess = "is the time in milliseconds? --scale time=0.001"
    question = f"the fit takes about {fit_s / 60:.2g} min{f'; {guess}' if slow else ''}"
    ways = "give --yes to fit all of it, --static for the capstan law alone, or shorter files"
    if static_only:
        question, ways = f"a sample every {longest:.3g} s: {guess}", "give --yes if it is not"
    if not confirm(question):
        raise InputError(f"{question}. Not started: {ways}")
    return fit_s


def check_signs(records: Sequence[Record], confirm: Callable[[str], bool]) -> None:
    """Ask where friction would drive the tendon by the sign of a position; InputError if `confirm` declines.

    Whatever loads it, friction takes power from a tendon that slides: (T_in - T_out) v > 0, both cells' offsets aside.
    """
    for record in records:
        ends = (("input", "input_m", record.has_input_position), ("output", "output_m", record.has_positions))
        wrong = [end for end, name, is_there in ends if is_there and _dissipated_share(record, name) < _DRIVEN]
        if not wrong or not record.has_output:
            continue
        question = (
            f"{record.name}: friction would drive the tendon: a rising {' and '.join(wrong)} position is motion "
            "towards the actuator, with which the tension falls along the path; here it rises"
        )
        scales = " ".join(f"--scale {end}_position=-1" for end in wrong)
        if not confirm(question):
            raise InputError(f"{question}. Not started: turn the sign by {scales}, or give --yes to fit it as it is")


def _dissipated_share(record: Record, name: str) -> float:
    """Work that the path takes at the speed of one end, over what it would be if all of it were taken [-]."""
    work = most = 0.0
    for piece in record.pieces:
        lost_N = piece.input_N - piece.output_N
        lost_N = (lost_N - lost_N.mean())[1:]
        moved_m = np.diff(getattr(piece, name))
        work += float(lost_N @ moved_m)
        most += float(np.abs(lost_N) @ np.abs(moved_m))
    return work / most if most > 0 else 0.0


def check_question(scenario: Scenario, fit_files: Sequence[Path], judging: Sequence[Path]) -> None:
    """Refuse by InputError: no file, a straight path, two relaxation times, cells beyond the path, a file that
    judges itself.
    """
    if not fit_files:
        raise InputError("no measured file given; name at least one with --data")
    theta = scenario.transmission.path.total_angle_rad
    if theta == 0:
        raise InputError(
            "total_angle_rad is 0: without a wrap angle friction has no coefficient; give the path's angle"
        )
    if scenario.transmission.tendon.second_relaxation_time_s is not None:
        raise InputError(
            "second_relaxation_time_s is given, but one relaxation time is fitted; "
            "leave it and second_relaxing_stiffness_N_per_m out"
        )
    if twice := sorted({p.name for p in fit_files if p.resolve() in {v.resolve() for v in judging}}):
        raise InputError(f"{', '.join(twice)}: given with --data and with --validate; a file cannot judge its own fit")
    for angle in scenario.measurement.tension_angles_rad or ():
        if angle >= theta:
            raise InputError(
                f"tension_angles_rad: a cell at {angle:g} rad; its angle from the actuator must be less than that of "
                f"the whole path, {theta:g} rad"
            )


def unit_warning(how: Measurement, positions: Sequence[str], converted: str = "") -> str:
    """Columns, of positions those in `positions`, whose names tell another unit than they are read in; else empty.

    `converted` is what the reader said of the columns whose units it turned into SI.
    """
    found = []
    for key, (unit, others) in OTHERS.items():
        name, scale = getattr(how, f"{key}_column"), getattr(how, f"{key}_scale")
        if name is None or (scale or 1) != 1 or (key.endswith("position") and key not in positions):
            continue
        if f"{name} x " in converted or f"{name} [" in converted:
            continue
        word = re.split(r"[^A-Za-z]+", name.rstrip(" ])"))[-1]
        if word in others:
            found.append(f"{name} as {unit} (--scale {key}=FACTOR)")
    if not found:
        return ""
    return (
        f"read without a factor: {', '.join(found)}; estimates with N and m in their names are then in the file's own "
        "units. A torque over the drum's radius is a tension, an angle times it a position"
    )


def data_doubts(records: Sequence[Record], explain: Explain) -> tuple[str, ...]:
    """Questions about measured values that look like another unit, or like reversed columns."""
    found = []
    for file in records:
        swings = float(np.ptp(file.joined("input_N"))), float(np.ptp(file.joined("output_N")))
        # Friction takes its share of every swing on the way to a load that moves with the tendon alone.
        if file.has_output and explain in (Explain.AUTO, Explain.OUTPUT) and swings[1] > _REVERSED * swings[0]:
            found.append(
                f"{file.name}: the output tension swings by {swings[1]:.3g} N, the input by {swings[0]:.3g} N: are the "
                'two columns reversed? If the far end is driven, say so with explain = "input"'
            )
        for end in ("input", "output"):
            if getattr(file.pieces[0], f"{end}_m") is None:
                continue
            if (stroke_m := float(np.ptp(file.joined(f"{end}_m")))) > _LONGEST_STROKE_M:
                found.append(
                    f"{file.name}: the {end} position moves by {stroke_m:.3g} m: millimetres? "
                    f"--scale {end}_position=0.001"
                )
        for name, angle in joints_of([file]).items():
            asked = angle_doubt(f"joints.{name}", float(np.max(np.abs(angle))), f"{file.name}: {name}")
            found += map(str, asked)
    return tuple(found)


def magnitude_warning(largest_N: float, force_max_N: float) -> str:
    """Message where the measured tensions are far from the range of the scenario's actuator; else empty."""
    if force_max_N / MOST_BELOW <= largest_N <= force_max_N * MOST_ABOVE:
        return ""
    return (
        f"the measured tensions reach {largest_N:.3g} N, the scenario's actuator {force_max_N:.3g} N: is this its rig, "
        "and the unit N (--scale)? Masses, load and limits are the scenario's; no excitation is suggested"
    )
