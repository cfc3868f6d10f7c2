"""Columns with a meaning: found by their own name, by the user's, or by a name that states quantity and unit."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.dialect import Dialect
from tendonff.compensator.files.reading import FloatArray, check_increasing, nearest_column, read_csv
from tendonff.compensator.files.tables import read_table, table_dialect
from tendonff.compensator.files.text import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A quantity that a file must hold."""

    name: str  # name of its column in the plain form, which ends in the SI unit: "time_s"
    words: tuple[str, ...]  # what its column may be called instead, small letters, when a unit is given as well
    units: Mapping[str, float]  # known units and what one of each is in SI
    option: str  # how a user names a column of his own: `time_column = "{}" in [reference]`
    column: str | None = None  # the column that the user named

    @property
    def si(self) -> str:
        """SI unit."""
        return self.name.rpartition("_")[2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantities:
    """Data read from a file."""

    values: dict[str, FloatArray]  # shape (rows,); in SI units, by `Quantity.name`
    notes: tuple[str, ...]  # what was taken for granted; empty for a file in the plain form


TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0, "sec": 1.0}
GRAVITY_M_PER_S2 = 9.80665
FORCE_UNITS = {
    "N": 1.0,
    "kN": 1e3,
    "mN": 1e-3,
    "lbf": 4.4482216152605,
    "kgf": GRAVITY_M_PER_S2,
    "gf": 1e-3 * GRAVITY_M_PER_S2,
}
TORQUE_UNITS = {"Nm": 1.0, "N m": 1.0, "N·m": 1.0, "mNm": 1e-3, "mN m": 1e-3, "Ncm": 1e-2, "N cm": 1e-2}
CURRENT_UNITS = {"A": 1.0, "mA": 1e-3}
SPEED_UNITS = {"rpm": 2 * math.pi / 60, "1/min": 2 * math.pi / 60, "rad/s": 1.0, "deg/s": math.pi / 180}
ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180}
LENGTH_UNITS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "µm": 1e-6}
TIME_WORDS = ("time", "t", "timestamp", "zeit")


def time_quantity(option: str, column: str | None = None) -> Quantity:
    """The column of time [s]; `option` is how a user names it, or `column` what he named it."""
    return Quantity(name="time_s", words=TIME_WORDS, units=TIME_UNITS, option=option, column=column)


def read_quantities(
    path: Path,
    wanted: Sequence[Quantity],
    *,
    optional: Sequence[Quantity] = (),
    rises: bool = True,
    starts_at_zero: bool = False,
) -> Quantities:
    """Read quantities from a table, the first of which must increase from row to row unless `rises` is false, or start
    at 0 too; an optional one of which the table has no column is left out.

    InputError if a column or its unit is ambiguous, with the option that states it; or what `read_csv` refuses.
    """
    named = [q.column for q in wanted if q.column is not None]
    dialect = table_dialect(path, (*named, *(q.name for q in (*wanted, *optional))))
    wanted = (*wanted, *(q for q in optional if q.name in dialect.names or _meant(dialect, q)))
    found = [_resolve(path, dialect, quantity) for quantity in wanted]
    for k, (column, _, _) in enumerate(found):
        if column in [other for other, _, _ in found[:k]]:
            raise InputError(f'{path.name}: column "{column}" stands for two quantities; name a column for each')
    columns = [column for column, _, _ in found]
    notes = [*dialect.notes, *(note for _, _, note in found if note)]
    dated = _dated(path, dialect, columns[0]) if wanted[0].si == "s" else None
    if dated is None:
        table = read_csv(
            path, columns, increasing=columns[0] if rises else None, starts_at_zero=starts_at_zero, dialect=dialect
        )
    else:
        check_increasing(path, columns[0], dated, dialect.skipped + 1, starts_at_zero=starts_at_zero)
        table = read_csv(path, columns[1:], increasing=None, dialect=dialect) | {columns[0]: dated}
        notes.append(f'column "{columns[0]}" read as dates, in seconds since the first')
        found[0] = (columns[0], 1.0, "")
    return Quantities(
        values={q.name: table[column] * scale for q, (column, scale, _) in zip(wanted, found, strict=True)},
        notes=(f"{path.name}: {', '.join(notes)}",) if notes else (),
    )


def _dated(path: Path, dialect: Dialect, column: str) -> FloatArray | None:
    """Seconds since the first of a column of dates or times of day; None where it is none."""
    if not dialect.is_dated(column):
        return None
    seconds, began = read_table(path, (column,)).seconds(column)
    return None if began is None or not np.isfinite(seconds).all() else seconds


def guess(dialect: Dialect, quantity: Quantity) -> tuple[str, float, str] | None:
    """Column whose name states quantity and unit, its unit in SI, and a message; None for none."""
    meant = [(name, unit) for name, unit in _meant(dialect, quantity) if unit in quantity.units]
    if quantity.si == "s":
        meant += [(name, "s") for name, unit in _meant(dialect, quantity) if not unit and dialect.is_dated(name)]
    if len(meant) == 1:
        name, unit = meant[0]
        return name, quantity.units[unit], f'column "{name}" read as {quantity.words[0]} in {unit}'
    alike = [name for name in dialect.names if name.lower() == quantity.name.lower()]
    return (alike[0], 1.0, f'column "{alike[0]}" read as {quantity.name}') if len(alike) == 1 else None


def _meant(dialect: Dialect, quantity: Quantity) -> list[tuple[str, str]]:
    """Columns that are called as the quantity may be, with their units."""
    named = [(name, *unit_of(dialect, name)) for name in dialect.names]
    return [(name, unit) for name, stem, unit, _ in named if stem in quantity.words]


def _resolve(path: Path, dialect: Dialect, quantity: Quantity) -> tuple[str, float, str]:
    """Column of a quantity, what its unit is in SI, and what to say about it."""
    names = dialect.names
    if quantity.column is not None and quantity.column not in names:
        quantity = replace(quantity, column=with_unit(names, quantity.column))
    if quantity.column is not None and quantity.column not in names:
        missing = f'{path.name}: column "{quantity.column}" is missing'
        raise InputError(f"{missing}{nearest_column(quantity.column, names)}", discreet=missing)
    if quantity.column is not None or quantity.name in names:
        return _named(path, dialect, quantity)
    if (found := guess(dialect, quantity)) is not None:
        return found
    meant = _meant(dialect, quantity)
    head = f'{path.name}: column "{quantity.name}" is missing'
    if len(meant) > 1:
        listed = ", ".join(f'"{name}"' for name, _ in meant)
        raise InputError(
            f"{head}; {listed} could be meant: choose with {quantity.option.format(meant[0][0])}",
            discreet=f"{head}; {len(meant)} could be meant: choose with {quantity.option.format('...')}",
        )
    if meant:
        name, unit = meant[0]
        if unit:
            raise _unknown_unit(path, quantity, name, unit)
        raise InputError(
            f'{head}; is it "{name}"? If it is in {quantity.si}, say so with {quantity.option.format(name)}, '
            f'else put the unit into its name: "{name} [{next(u for u in quantity.units if u != quantity.si)}]"'
        )
    way = f"(say which by {quantity.option.format('...')})"
    raise InputError(f"{head}{nearest_column(quantity.name, names)} {way}", discreet=f"{head} {way}")


def _named(path: Path, dialect: Dialect, quantity: Quantity) -> tuple[str, float, str]:
    """The column that the user named, or that has the plain form's name."""
    column = quantity.column or quantity.name
    _, unit, is_stated = unit_of(dialect, column)
    if quantity.column is None:
        if is_stated and unit != quantity.si:
            refused = f'{path.name}: column "{column}" has'
            raise InputError(
                f"{refused} the unit {unit} below its name; rename it, or correct the unit",
                discreet=f"{refused} another unit below its name; rename it, or correct the unit",
            )
        return column, 1.0, ""
    if unit in quantity.units:
        return column, quantity.units[unit], "" if unit == quantity.si else f'column "{column}" read in {unit}'
    if is_stated:
        raise _unknown_unit(path, quantity, column, unit)
    return column, 1.0, f'column "{column}" read in {quantity.si}'


def _unknown_unit(path: Path, quantity: Quantity, column: str, unit: str) -> InputError:
    known = f"which is none of {', '.join(quantity.units)}; convert it, or correct the unit"
    return InputError(
        f'{path.name}: column "{column}" has the unit {unit}, {known}',
        discreet=f"{path.name}: the column of {quantity.words[0]} has a unit {known}",
    )


_BRACKET = re.compile(r"(.*?)\s*(?:\[[^\]]*\]|\([^)]*\))")


def with_unit(names: Iterable[str], column: str) -> str:
    """Column that is called `column` but for a unit in brackets, where there is one such; else `column` itself."""
    meant = [name for name in names if (match := _BRACKET.fullmatch(name.strip())) and match[1] == column]
    return meant[0] if len(meant) == 1 else column


_NAME = re.compile(r"\s*(.+?)\s*(?:\[(.*?)\]|\((.*?)\)|/\s*(\S+)|[_ ]([^\s_]+))\s*")


def unit_of(dialect: Dialect, name: str) -> tuple[str, str, bool]:
    """Word and unit of a column: from the line of units, else from its name; "" where there is none.

    And whether the unit stands in that line or in brackets, so that it can be nothing else.
    """
    below = dialect.units[dialect.names.index(name)]
    word, unit, is_bracketed = name, "", False
    if (match := _NAME.fullmatch(name)) is not None:
        unit = next((group for group in match.groups()[1:] if group is not None), "")
        is_bracketed = bool(match[2] or match[3])
        if not below or match[5] is None or unit == below:
            word = match[1]
    return word.lower().replace(" ", "_"), below or unit, bool(below) or is_bracketed
