"""Doubts about the units of measured files: a fit does not start before the user has answered them."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np

from tendonff.compensator.files.typeset import typeset
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.cleaning import Record, joints_of
from tendonff.compensator.scenario.doubts import UnitDoubt, angle_doubt, settle, unaccepted
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenario.settings import Run
from tendonff.models.joint.parameters import JointDrive
from tendonff.models.path import FURTHEST_RAD

MOST_ABOVE, MOST_BELOW = 20.0, 400.0
"""A largest tension so many times above, or below, what the actuator can do is of another rig, or in another unit."""

LIKELY_MILLI, LIKELY_KILO = 150.0, 1000.0
"""From so many times on, mN or kN are likely: readings in mN are 1000 times the tension."""

_LONGEST_STROKE_M = 10.0
_OVER_TENSION = 10.0  # a motor that states no largest torque pulls so many times the tendon's tension at rest
_MOST_APART = 300.0  # largest tension of an end over that of the other: beyond what friction does, e^5
_UNITS_APART = 1e4  # more is a tendon that goes slack
_LEAST_PART = 0.05  # of a recording, that may be in another unit
_FIRST = 0.8  # of the largest change: later ones count what is left of the recording alone

_FORCES, _LENGTHS = ("kN", "mN", "lbf", "lb", "kg"), ("mm", "cm", "um")
_FORCE_LIKE, _LENGTH_LIKE = ("Nm", "mNm", "V", "mV", "mA"), ("rad", "deg", "counts")
OTHERS = {
    "time": ("s", ("ms", "us"), ()),
    "input": ("N", _FORCES, _FORCE_LIKE),
    "output": ("N", _FORCES, _FORCE_LIKE),
    "input_position": ("m", _LENGTHS, _LENGTH_LIKE),
    "output_position": ("m", _LENGTHS, _LENGTH_LIKE),
    "actuator_force": ("N", _FORCES, _FORCE_LIKE),
}
"""For each column the unit it is read in, and last words of names that tell another unit of the same quantity, or of
another one that may stand for it; `A`, `g` and `in` may as well name a place."""


def answered(found: Iterable[UnitDoubt], run: Run, confirm: Callable[[str], bool], *, file: str) -> tuple[str, ...]:
    """Doubts about measured files that the user accepts, as warnings; those in `accept` of [run] are left out.

    InputError, with the way out, if `confirm` declines the others.
    """
    doubts = unaccepted(found, run)
    accept = bool(doubts) and confirm("; ".join(map(str, doubts)))
    return settle(doubts, file=file, accept=accept)


def _told_units(how: Measurement, positions: Sequence[str], converted: str) -> Iterator[tuple[str, str, str]]:
    """Key, name and last word of columns, of positions those in `positions`, that are read without a factor.

    `converted` is what the reader said of the columns whose units it turned into SI.
    """
    for key in OTHERS:
        name, scale = getattr(how, f"{key}_column"), getattr(how, f"{key}_scale")
        if name is None or (scale or 1) != 1 or (key.endswith("position") and key not in positions):
            continue
        if f"{name} x " not in converted and f"{name} [" not in converted:
            yield key, name, re.split(r"[^A-Za-z]+", name.rstrip(" ])"))[-1]


def column_doubts(how: Measurement, positions: Sequence[str], converted: str = "") -> Iterator[UnitDoubt]:
    """Columns whose names tell another unit than the one of the same quantity they are read in; see `unit_warning`."""
    for key, name, word in _told_units(how, positions, converted):
        unit, others, _ = OTHERS[key]
        if word in others:
            text = f'column "{name}" is read as {unit}: {word}? Then --scale {key}=FACTOR'
            yield UnitDoubt(f"measurement.{key}_scale", text)


def unit_warning(how: Measurement, positions: Sequence[str], converted: str = "") -> str:
    """Columns of another quantity that stands for the one that is read, a torque for a tension; else empty.

    `positions` are the positions that were read, `converted` is what the reader said of columns that it converted.
    """
    found = [
        f"{name} as {OTHERS[key][0]} (--scale {key}=FACTOR)"
        for key, name, word in _told_units(how, positions, converted)
        if word in OTHERS[key][2]
    ]
    if not found:
        return ""
    return (
        f"read without a factor: {', '.join(found)}; estimates with N and m in their names are then in the file's own "
        "units. A torque over the drum's radius is a tension, an angle times it a position"
    )


def data_doubts(files: Sequence[Record], how: Measurement, force_max_N: float) -> Iterator[UnitDoubt]:
    """Measured tensions, positions and angles that look like another unit on a rig with such an actuator [N]."""
    named = {key: word in OTHERS[key][2] for key, _, word in _told_units(how, (), "")}
    ends = [end for end in ("input", "output") if not named.get(end)]
    largest = {
        end: max((float(np.abs(file.joined(f"{end}_N")).max()), file.name) for file in files)
        for end in ends
        if all(end == "input" or file.has_output for file in files)
    }
    small = 0 < max((most_N for most_N, _ in largest.values()), default=0.0) < force_max_N / LIKELY_KILO
    beyond = {end for end, (most_N, _) in largest.items() if small or most_N > LIKELY_MILLI * force_max_N}
    if len(largest) == 2 and not beyond:
        yield from _ends_apart(files, largest)
    for end, (most_N, name) in largest.items():
        if end in beyond:
            unit, factor = ("kN", 1e3) if small else ("mN", 1e-3)
            yield UnitDoubt(
                f"measurement.{end}_scale",
                typeset(
                    f"{name}: the {end} tension reaches {most_N:.3g} N, the scenario's actuator {force_max_N:.3g} N: "
                    f"{unit}? Then it is {factor * most_N:.3g} N: --scale {end}={factor:g}"
                ),
            )
    for file in files:
        for end in ("input", "output"):
            if getattr(file.pieces[0], f"{end}_m") is None:
                continue
            if (stroke_m := float(np.ptp(file.joined(f"{end}_m")))) > _LONGEST_STROKE_M:
                yield UnitDoubt(
                    f"measurement.{end}_position_scale",
                    f"{file.name}: the {end} position moves by {stroke_m:.3g} m: millimetres? Then it is "
                    f"{stroke_m / 1e3:.3g} m: --scale {end}_position=0.001",
                )
        for name, angle in joints_of([file]).items():
            yield from angle_doubt(f"joints.{name}", float(np.max(np.abs(angle))), f"{file.name}: {name}")


def _ends_apart(files: Sequence[Record], largest: Mapping[str, tuple[float, str]]) -> Iterator[UnitDoubt]:
    """Ends whose tensions differ by more than friction can, all the time or from one sample on."""
    (high, (most_N, name)), (low, (least_N, _)) = sorted(largest.items(), key=lambda each: -each[1][0])
    if 0 < least_N < most_N / _MOST_APART:
        text = f"{name}: the {low} tension reaches {least_N:.3g} N where the {high} reaches {most_N:.3g} N: kN?"
        yield UnitDoubt(f"measurement.{low}_scale", f"{text} Then --scale {low}=1000")
        return
    for file in files:
        size_N = {end: np.abs(file.joined(f"{end}_N")) for end in largest}
        changes = {end: _change(size) for end, size in size_N.items()}
        factors = {end: factor for end, (_, factor) in changes.items()}
        end = max(factors, key=lambda each: abs(np.log(factors[each])))
        at, by = changes[end]
        if _is_unit(factors["input"] / factors["output"]):
            which = f"the {end} tension alone is"
        elif _is_unit(by) and _are_alike(*(size[at:] if by < 1 else size[:at] for size in size_N.values())):
            which = "both tensions are"
        else:
            continue
        changed = f"from {file.joined('time_s')[at]:.4g} s on {which} {by:.2g} times as large as before"
        text = f"{file.name}: {changed}: another unit? Then split the file there"
        yield UnitDoubt(f"measurement.{end}_scale", text)


def _is_unit(factor: float) -> bool:
    """Whether a factor either way is beyond friction, and below that of a tendon that goes slack."""
    return _MOST_APART < max(factor, 1 / factor) < _UNITS_APART


def _are_alike(one: Array, other: Array) -> bool:
    """Whether small tensions move together: those of a slack tendon are noise."""
    return bool(np.std(one) > 0 and np.std(other) > 0 and np.corrcoef(one, other)[0, 1] > TUNED.alike)


def _change(size: Array) -> tuple[int, float]:
    """Sample from which on the largest size, shape (rows,), differs from that before, and the factor."""
    least = max(1, int(_LEAST_PART * len(size)))
    if len(size) <= 2 * least:
        return 0, 1.0
    floor = 1e-9 * float(size.max()) + np.finfo(float).tiny
    before = np.maximum.accumulate(size)[least - 1 : -least]
    after = np.maximum.accumulate(size[::-1])[::-1][least : len(size) - least + 1]
    change = np.log((after + floor) / (before + floor))
    at = int(np.argmax(np.abs(change) > _FIRST * np.abs(change).max()))
    return at + least, float(np.exp(change[at]))


def magnitude_warning(largest_N: float, force_max_N: float) -> str:
    """Message where the measured tensions are far from the range of the scenario's actuator; else empty."""
    if force_max_N / MOST_BELOW <= largest_N <= force_max_N * MOST_ABOVE:
        return ""
    return (
        f"the measured tensions reach {largest_N:.3g} N, the scenario's actuator {force_max_N:.3g} N: is this its rig, "
        "and the unit N (--scale)? Masses, load and limits are the scenario's; no excitation is suggested"
    )


def motor_doubts(
    file: str, motor_rad: Array, torque_N_m: Array, drive: JointDrive, arm_m: float, *, of: str = ""
) -> Iterator[UnitDoubt]:
    """Angle and torque of a motor, shape (rows,), that look like another unit.

    A radian of every joint takes its tendons as far as `arm_m`; `of` names the motor where there are several, whose
    columns no option scales.
    """
    who = f'motor "{of}"' if of else "the motor"
    turned, drum_m = float(np.ptp(motor_rad)), min(map(abs, drive.drum_radius_m))
    most = 2 * FURTHEST_RAD * arm_m / drum_m * drive.gear_ratio
    if turned > most > 0:
        way = "convert the column" if of else "name the column in deg, or --scale input_position=0.01745"
        yield UnitDoubt(
            "measurement.input_position_scale",
            f"{file}: {who} turns by {turned:.4g} rad, a whole turn of the joint either way takes {most:.3g}: degrees? "
            f"Then it is {np.radians(turned):.4g} rad: {way}",
        )
    held_N = drive.pretension_N or drive.least_tension_N or 0.0
    usual = drive.torque_max_N_m or _OVER_TENSION * held_N * drum_m / drive.gear_ratio
    largest = float(np.abs(torque_N_m).max())
    if usual > 0 and largest > MOST_ABOVE * usual:
        what = "torque_max_N_m" if drive.torque_max_N_m else f"{_OVER_TENSION:g} times that of the tension at rest"
        way = "convert the column" if of else "name the column in mNm, or --scale input=0.001"
        yield UnitDoubt(
            "measurement.input_scale",
            f"{file}: the torque of {who} reaches {largest:.3g} N m, {what} is {usual:.3g} N m: mN m, or a current in "
            f"mA? Then it is {largest / 1e3:.3g} N m: {way}",
        )


def encoder_doubts(file: str, joint: str, angle_rad: Array | None) -> Iterator[UnitDoubt]:
    """Angle of a joint's encoder, shape (rows,), that looks like degrees; none without an encoder."""
    if angle_rad is not None and np.isfinite(angle_rad).all():
        yield from angle_doubt(f"joints.{joint}", float(np.abs(angle_rad).max()), f"{file}: {joint}")
