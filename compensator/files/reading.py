"""Reading of tables: numbers or one message that shows the way, in any of the usual ways of writing."""

import csv
import warnings
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.dialect import Dialect, is_comment
from tendonff.compensator.files.tables import is_packed, read_table, table_dialect
from tendonff.compensator.files.text import (
    InputError,
    encoding_of,
    open_bytes,
    open_text,
    read_text,
    suggestion,
    user_text,
)

__all__ = ["FloatArray", "InputError", "nearest_column", "open_text", "read_csv", "read_text", "suggestion"]

FloatArray = NDArray[np.float64]

_SMALL = 500_000
"""Bytes of a file that is read without pandas, which takes longer to load."""


def read_csv(
    path: Path,
    required: Sequence[str],
    *,
    optional: Sequence[str] = (),
    increasing: str | None = "time_s",
    starts_at_zero: bool = False,
    dialect: Dialect | None = None,
) -> dict[str, FloatArray]:
    """Read named columns of numbers, shape (rows,), and refuse anything doubtful.

    The file has one header line; separator, decimal mark, remarks and a line of units are found out, where no dialect
    is given. Other columns are ignored, whatever they hold, and an optional one that the file lacks is left out. One
    column must increase strictly from row to row, and may have to start at 0.

    InputError is one message with file, row (as an editor counts: the header is row 1), column, and what was found.
    """
    if dialect is None:
        dialect = table_dialect(path, (*required, *optional))
    names = dialect.names
    for name in required:
        if name not in names:
            missing = f'{path.name}: column "{name}" is missing'
            raise InputError(f"{missing}{nearest_column(name, names)}", discreet=missing)
    wanted = [name for name in dict.fromkeys((*required, *optional)) if name in names]
    for name in wanted:
        if names.count(name) > 1:
            raise InputError(f'{path.name}: column "{name}" appears {names.count(name)} times; keep one')
    if is_packed(path):
        table = read_table(path, wanted)
        columns = {name: table.numbers(name) for name in wanted}
    elif path.suffix.lower() != ".gz" and path.stat().st_size <= _SMALL:
        columns = _parse_slowly(path, dialect, wanted)
    else:
        columns = _parse(path, dialect, wanted)
    if columns[wanted[0]].size == 0:
        raise InputError(f"{path.name} has a header but no rows; add at least one")
    for name, values in columns.items():
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            place = row + dialect.skipped + 1
            raise InputError(f"{path.name} row {place}: {name} must be a finite number, got {values[row]}")
    if increasing is not None and increasing in columns:
        others = {name: values for name, values in columns.items() if name != increasing}
        check_increasing(
            path, increasing, columns[increasing], dialect.skipped + 1, starts_at_zero=starts_at_zero, others=others
        )
    return columns


def check_increasing(
    path: Path,
    name: str,
    time: FloatArray,
    first: int,
    *,
    starts_at_zero: bool,
    others: Mapping[str, FloatArray] = MappingProxyType({}),
) -> None:
    """Refuse a clock that stops, runs back, or starts elsewhere than at 0; its first row is row `first`.

    Where another column could be the clock, the message asks whether the two are reversed.
    """
    clocks = [other for other, values in others.items() if values[0] == 0 and (np.diff(values) > 0).all()]
    reversed_ = f"; {clocks[0]} starts at 0 and increases: are the two columns reversed?" if clocks else ""
    if starts_at_zero and time[0] != 0:
        raise InputError(
            f"{path.name} row {first}: {name} must start at 0, got {time[0]:g}"
            f"{reversed_ or '; subtract the first time'}"
        )
    forward = np.diff(time) > 0
    if not forward.all():
        row = int(np.argmin(forward))
        place = row + first + 1
        raise InputError(
            f"{path.name} row {place}: {name} must increase, got {time[row + 1]:g} after {time[row]:g}{reversed_}"
        )


def nearest_column(name: str, names: Sequence[str]) -> str:
    """Columns of the file that may replace a missing one."""
    return suggestion(name, [other or "(empty)" for other in names])


def _parse(path: Path, dialect: Dialect, wanted: Sequence[str]) -> dict[str, FloatArray]:
    """Numbers of the wanted columns: by pandas' C parser, and row by row when that refuses."""
    import pandas as pd

    names = dialect.names
    try:
        with warnings.catch_warnings(), open_bytes(path) as stream:
            warnings.simplefilter("error", pd.errors.ParserWarning)  # a row with too many cells
            frame = pd.read_csv(
                stream,
                sep=r"\s+" if dialect.separator == " " else dialect.separator,
                decimal=dialect.decimal,
                names=list(range(len(names))),
                header=None,
                skiprows=dialect.skipped,
                # every column, for with a choice of columns a row with too many cells passes unseen
                dtype={k: np.float64 if name in wanted else object for k, name in enumerate(names)},
                index_col=False,
                skip_blank_lines=False,
                keep_default_na=False,
                na_values=[],
                encoding=encoding_of(path),
                engine="c",
            )
    except InputError:
        raise
    except (ValueError, OverflowError, EOFError, zlib.error, pd.errors.ParserWarning, pd.errors.EmptyDataError):
        return _parse_slowly(path, dialect, wanted)
    columns = {name: frame[names.index(name)].to_numpy(np.float64) for name in wanted}
    if not all(np.isfinite(values).all() for values in columns.values()):
        return _parse_slowly(path, dialect, wanted)  # finds the cell and says what stands there
    return columns


def _parse_slowly(path: Path, dialect: Dialect, wanted: Sequence[str]) -> dict[str, FloatArray]:
    """Row by row with Python's own reader: passes over remarks, reaches the first bad cell and names it."""
    try:
        return _parse_rows(path, dialect, wanted)
    except InputError:
        # Whole numbers fill the first lines and the decimal mark shows only later.
        if dialect.separator == "," or dialect.decimal == ",":
            raise
        try:
            return _parse_rows(path, replace(dialect, decimal=","), wanted)
        except InputError:
            pass
        raise


def _parse_rows(path: Path, dialect: Dialect, wanted: Sequence[str]) -> dict[str, FloatArray]:
    indices = [(name, dialect.names.index(name)) for name in wanted]
    values: list[list[float]] = []
    blank_row = row = 0
    width = len(dialect.names)
    with user_text(path) as stream:
        try:
            for row, line in enumerate(stream, start=1):
                if row <= dialect.skipped or is_comment(line):
                    continue
                if not line.strip():
                    blank_row = blank_row or row
                    continue
                if blank_row:
                    raise InputError(f"{path.name} row {blank_row} is empty; remove it")
                cells = dialect.cells(line)
                while len(cells) > width and not cells[-1]:
                    cells.pop()
                if len(cells) != width:
                    doubled = dialect.separator == "," and len(cells) == 2 * width
                    hint = "; for decimal commas separate the columns by semicolons" if doubled else ""
                    raise InputError(f"{path.name} row {row}: expected {width} cells, got {len(cells)}{hint}")
                values.append([_cell(path, row, name, cells[index], dialect) for name, index in indices])
        except csv.Error as error:
            raise InputError(f"{path.name} row {row}: cannot be read ({error})") from None
    table = np.array(values, dtype=np.float64).reshape(-1, len(wanted))
    return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(wanted)}


def _cell(path: Path, row: int, name: str, text: str, dialect: Dialect) -> float:
    """Finite number, or a message that quotes the cell."""
    if not text.strip():
        raise InputError(f"{path.name} row {row}: {name} is empty; every row needs a number")
    try:
        value = dialect.number(text)
    except ValueError:
        shown = text if len(text) <= 40 else f"{text[:37]}..."
        hint = "; is it the header again? Remove the row" if text.strip() in dialect.names else ""
        refused = f"{path.name} row {row}: {name} must be a number"
        raise InputError(f'{refused}, got "{shown}"{hint}', discreet=f"{refused}{hint}") from None
    if not np.isfinite(value):
        raise InputError(f"{path.name} row {row}: {name} must be a finite number, got {text.strip()}")
    return value
