"""Strict reading of CSV and text, and the error that every bad input becomes."""

import csv
import warnings
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from tendonff.models.errors import TendonffError

FloatArray = NDArray[np.float64]


class InputError(TendonffError, ValueError):
    """A file or an argument given by the user cannot be used; the text names it and says what to do."""


def suggestion(name: str, valid: Sequence[str]) -> str:
    """`, did you mean "x"?` for the nearest valid name, else the list of all of them.

    Parameters
    ----------
    name : str
        What the user wrote.
    valid : sequence of str
        What could have been meant.
    """
    near = get_close_matches(name, valid, n=1, cutoff=0.6)
    if near:
        return f', did you mean "{near[0]}"?'
    return f"; known: {', '.join(valid)}"


# --- reading ---------------------------------------------------------------------------------------------------------


def read_csv(
    path: Path,
    required: Sequence[str],
    *,
    optional: Sequence[str] = (),
    increasing: str | None = "time_s",
    starts_at_zero: bool = False,
) -> dict[str, FloatArray]:
    """Read named columns of numbers and refuse anything doubtful.

    Parameters
    ----------
    path : Path
        File with one header line, commas, decimal points.
    required, optional : sequence of str
        Columns to read; other columns are ignored, whatever they hold.
    increasing : str or None
        Column that must increase strictly from row to row.
    starts_at_zero : bool
        The increasing column must start at 0.

    Returns
    -------
    dict of str to ndarray, shape (rows,)
        Finite numbers, by column name; an optional column that the file lacks is left out.

    Raises
    ------
    InputError
        One message with file, row (as an editor counts: the header is row 1), column, and what was found.
    """
    names = _read_header(path)
    for name in required:
        if name not in names:
            raise InputError(f'{path.name}: column "{name}" is missing{nearest_column(name, names)}')
    wanted = [name for name in dict.fromkeys((*required, *optional)) if name in names]
    for name in wanted:
        if names.count(name) > 1:
            raise InputError(f'{path.name}: column "{name}" appears {names.count(name)} times; keep one')
    columns = _parse(path, names, wanted)
    if columns[wanted[0]].size == 0:
        raise InputError(f"{path.name} has a header but no rows; add at least one")
    for name, values in columns.items():
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise InputError(f"{path.name} row {row + 2}: {name} must be a finite number, got {values[row]}")
    if increasing is not None and increasing in columns:
        _check_increasing(path, increasing, columns[increasing], starts_at_zero=starts_at_zero)
    return columns


def _check_increasing(path: Path, name: str, time: FloatArray, *, starts_at_zero: bool) -> None:
    """Refuse a clock that stands still, runs back, or starts elsewhere than at 0."""
    if starts_at_zero and time[0] != 0:
        raise InputError(f"{path.name} row 2: {name} must start at 0, got {time[0]:g}; subtract the first time")
    forward = np.diff(time) > 0
    if not forward.all():
        row = int(np.argmin(forward))
        raise InputError(f"{path.name} row {row + 3}: {name} must increase, got {time[row + 1]:g} after {time[row]:g}")


def nearest_column(name: str, names: Sequence[str]) -> str:
    """What the file has instead of a missing column.

    Parameters
    ----------
    name : str
        What was looked for.
    names : sequence of str
        The file's columns.
    """
    if len(names) == 1 and any(mark in names[0] for mark in ";\t|"):
        return f"; the header is one cell ({names[0]!r}), separate the columns by commas"
    return suggestion(name, [other or "(empty)" for other in names])


def open_text(path: Path) -> IO[str]:
    """Open a user's text file, turning what can go wrong into an InputError."""
    if path.is_dir():
        raise InputError(f"{path} is a folder, not a file")
    try:
        return path.open(encoding="utf-8-sig", newline="")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise InputError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None


def read_text(path: Path) -> str:
    """Whole text of a user's UTF-8 file."""
    with open_text(path) as stream:
        try:
            return stream.read()
        except UnicodeDecodeError:
            raise InputError(f"{path.name} is not UTF-8 text; save it as UTF-8") from None
        except OSError as error:
            raise InputError(f"{path.name} cannot be read: {error.strerror or error}") from None


def _read_header(path: Path) -> list[str]:
    with open_text(path) as stream:
        try:
            header = next(csv.reader([stream.readline(100_000)]), [])
        except UnicodeDecodeError:
            raise InputError(f"{path.name} is not UTF-8 text; save it as UTF-8 with commas") from None
        except (csv.Error, OSError) as error:
            raise InputError(f"{path.name} row 1: the header cannot be read ({error})") from None
    names = [name.strip() for name in header]
    if not any(names):
        raise InputError(f"{path.name} is empty; the first line must name the columns")
    if all(_is_number(name) for name in names):
        raise InputError(f"{path.name} row 1: the first line must name the columns, got numbers ({header[0]}, ...)")
    return names


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _parse(path: Path, names: Sequence[str], wanted: Sequence[str]) -> dict[str, FloatArray]:
    """Numbers of the wanted columns: by pandas' C parser, and row by row when that refuses."""
    import pandas as pd

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # a row with too many cells
            frame = pd.read_csv(
                path,
                names=list(range(len(names))),
                header=None,
                skiprows=1,
                # every column, for with a choice of columns a row with too many cells passes unseen
                dtype={k: np.float64 if name in wanted else object for k, name in enumerate(names)},
                index_col=False,
                skip_blank_lines=False,
                keep_default_na=False,
                na_values=[],
                encoding="utf-8-sig",
                engine="c",
            )
    except (ValueError, OverflowError, pd.errors.ParserWarning, pd.errors.EmptyDataError):
        return _parse_slowly(path, names, wanted)
    columns = {name: frame[names.index(name)].to_numpy(np.float64) for name in wanted}
    if not all(np.isfinite(values).all() for values in columns.values()):
        return _parse_slowly(path, names, wanted)  # finds the cell and says what stands there
    return columns


def _parse_slowly(path: Path, names: Sequence[str], wanted: Sequence[str]) -> dict[str, FloatArray]:
    """Row by row with Python's own reader: reaches the first bad cell and names it."""
    indices = [(name, names.index(name)) for name in wanted]
    values: list[list[float]] = []
    blank_row = 0
    with open_text(path) as stream:
        reader = csv.reader(stream)
        try:
            next(reader, None)
            for cells in reader:
                row = reader.line_num
                if not any(cell.strip() for cell in cells) and len(cells) <= 1:
                    blank_row = blank_row or row
                    continue
                if blank_row:
                    raise InputError(f"{path.name} row {blank_row} is empty; remove it")
                if len(cells) != len(names):
                    raise InputError(f"{path.name} row {row}: expected {len(names)} cells, got {len(cells)}")
                values.append([_cell(path, row, name, cells[index]) for name, index in indices])
        except UnicodeDecodeError:
            raise InputError(f"{path.name} is not UTF-8 text; save it as UTF-8 with commas") from None
        except (csv.Error, OSError) as error:
            raise InputError(f"{path.name} row {reader.line_num}: cannot be read ({error})") from None
    table = np.array(values, dtype=np.float64).reshape(-1, len(wanted))
    return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(wanted)}


def _cell(path: Path, row: int, name: str, text: str) -> float:
    """One finite number, or a message that quotes the cell."""
    if not text.strip():
        raise InputError(f"{path.name} row {row}: {name} is empty; every row needs a number")
    try:
        value = float(text)
    except ValueError:
        shown = text if len(text) <= 40 else f"{text[:37]}..."
        raise InputError(f'{path.name} row {row}: {name} must be a number, got "{shown}"') from None
    if not np.isfinite(value):
        raise InputError(f"{path.name} row {row}: {name} must be a finite number, got {text.strip()}")
    return value
