"""Before any work is done: the question, units that do not fit, and how much a fit will have to do."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.compensator.identification.measured.reading import RawMeasurement
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.compensator.scenario.scenario import Scenario

FIT_S, FIT_S_PER_S = 1.0, 0.12
"""CPU time of a fit, and per second of log, on a desktop processor: 8.2 s for 60 s at 1 kHz."""

LONG_FIT_S = 140.0
"""A fit that takes longer is asked about."""

SLOWEST_S = 0.5
"""A clock with longer intervals may count milliseconds."""

_REVERSED = 1.1  # an output tension that swings so many times the input is at the driven end

_MOSTLY = 0.9  # share of the rows of a tension whose cell is mounted the other way round

_DRIVEN = -0.3
"""Share of the work of friction below which a position has the wrong sign: measured tendons have +0.85 to +1."""


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
    guess = f"a sample every {longest:.3g} s: is the time in milliseconds? --scale time=0.001"
    slow, is_long = longest > SLOWEST_S, fit_s > LONG_FIT_S
    if not static_only:
        say(f"the fit takes about {fit_s:.2g} s")
    if is_long and not static_only:
        _ask(
            confirm,
            f"the fit takes about {fit_s / 60:.0f} min{f'; {guess}' if slow else ''}",
            "give --yes to fit all of it, --static for the capstan law alone, or shorter files",
        )
    elif slow:
        _ask(confirm, guess, 'give --yes if it is not, or for good accept = ["measurement.time_scale"] in [run]')
    return fit_s


def _ask(confirm: Callable[[str], bool], question: str, ways: str) -> None:
    """Raise InputError with the ways out if `confirm` declines."""
    if not confirm(question):
        raise InputError(f"{question}. Not started: {ways}")


def check_signs(records: Sequence[Record], confirm: Callable[[str], bool]) -> None:
    """Ask where friction would drive the tendon by the sign of a position; InputError if `confirm` declines.

    Whatever loads it, friction takes power from a tendon that slides: (T_in - T_out) v > 0, both cells' offsets aside.
    Where one tension alone is below zero its sign comes first, since positions are judged by the tensions.
    """
    for record in records:
        below = {end: _share_below_zero(record, f"{end}_N") for end in ("input", "output")}
        end, other = sorted(below, key=lambda name: -below[name])
        both = below[other] > _MOSTLY
        if record.has_output and below[end] > _MOSTLY and (both or below[other] < 1 - _MOSTLY):
            what = "both tensions are" if both else f"{end} is"
            aside = "" if both else f", {other} is not"
            question = f"{record.name}: {what} below zero in {100 * below[end]:.0f} % of the rows{aside}"
            way = " ".join(f"--scale {each}=-1" for each in (("input", "output") if both else (end,)))
            _ask(confirm, question, f"{way}, or give --yes to fit it as it is")
        ends = (("input", "input_m", record.has_input_position), ("output", "output_m", record.has_positions))
        wrong = [end for end, name, is_there in ends if is_there and _dissipated_share(record, name) < _DRIVEN]
        if not wrong or not record.has_output:
            continue
        question = (
            f"{record.name}: friction would drive the tendon: a rising {' and '.join(wrong)} position is motion "
            "towards the actuator, with which the tension falls along the path; here it rises"
        )
        way = f"turn the sign by {' '.join(f'--scale {end}_position=-1' for end in wrong)}"
        if _swings_more(record):
            way = (
                "the output tension swings more than the input: if the two are reversed, exchange --input-column and "
                f"--output-column; else {way}"
            )
        _ask(confirm, question, f"{way}, or give --yes to fit it as it is")


def _share_below_zero(record: Record, name: str) -> float:
    """Share of the rows of all pieces in which a tension is below zero."""
    return float(np.mean(record.joined(name) < 0))


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


def reversal_doubts(records: Sequence[Record], explain: Explain) -> tuple[str, ...]:
    """Questions about tensions that look like reversed columns."""
    found = []
    for file in records:
        if explain in (Explain.AUTO, Explain.OUTPUT) and _swings_more(file):
            swings = _swings_N(file)
            found.append(
                f"{file.name}: the output tension swings by {swings[1]:.3g} N, the input by {swings[0]:.3g} N: are the "
                'two columns reversed? If the far end is driven, say so with explain = "input"'
            )
    return tuple(found)


def _swings_N(file: Record) -> tuple[float, float]:
    """Range of the tension at the input, and at the output [N]."""
    return float(np.ptp(file.joined("input_N"))), float(np.ptp(file.joined("output_N")))


def _swings_more(file: Record) -> bool:
    """Whether the output swings more than the input: friction takes its share of every swing on the way to a load."""
    near_N, far_N = _swings_N(file) if file.has_output else (1.0, 0.0)
    return far_N > _REVERSED * near_N
