"""Files in and out: strict reading of CSV, and output that appears whole or not at all.

Every result goes to a temporary sibling first and takes its name only when it is complete, so an error, Ctrl-C or a
full disk leaves what was there before.
"""

import csv
import json
import os
import shutil
import signal
import stat
import threading
import uuid
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tendonff.compensator.csv_text import BYTES_MORE, BYTES_PER_NUMBER, compiled_writer
from tendonff.models.errors import TendonffError

FloatArray = NDArray[np.float64]

_MANY_VALUES = 100_000  # numbers in a block from which it pays to load the compiled writer
_BLOCK_VALUES = 20_000  # numbers per written block: what stays in the processor's cache writes twice as fast


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
            raise InputError(f'{path.name}: column "{name}" is missing{_nearest_column(name, names)}')
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


def _nearest_column(name: str, names: Sequence[str]) -> str:
    """What the file has instead of the missing column."""
    if len(names) == 1 and any(mark in names[0] for mark in ";\t|"):
        return f"; the header is one cell ({names[0]!r}), separate the columns by commas"
    return suggestion(name, [other or "(empty)" for other in names])


def open_text(path: Path) -> IO[str]:
    """Open a user's text file, turning what can go wrong into an InputError."""
    try:
        if path.is_dir():
            raise InputError(f"{path} is a folder, not a file")
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


# --- writing ---------------------------------------------------------------------------------------------------------


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Hold back Ctrl-C for the moment in which finished files take their names."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous if previous is not None else signal.default_int_handler)


def _make_parents(folder: Path) -> list[Path]:
    """Create `folder` and what is missing above it; returns what was created, deepest first."""
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be created: {error.strerror or error}") from None
    return missing


def _remove_empty(folders: Sequence[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return  # somebody else put something there


def _sibling(target: Path) -> Path:
    return target.with_name(f".{target.name[:80]}.{uuid.uuid4().hex[:12]}.partial")


@contextmanager
def atomic_file(target: Path) -> Iterator[Path]:
    """Path to write to; it becomes `target` when the block ends without an error, else it vanishes.

    Parameters
    ----------
    target : Path
        File to write; one that exists is replaced on success only. Missing folders are made. A device or pipe
        (`/dev/null`) is written to directly.

    Raises
    ------
    InputError
        At entry, before any work, when `target` is a folder or cannot be written.
    """
    try:
        mode = target.stat().st_mode if target.exists() else None
        resolved = target.resolve()  # through a link, so that the link stays
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"{target} cannot be written: {error}") from None
    if mode is not None and stat.S_ISDIR(mode):
        raise InputError(f"{target} is a folder; name a file to write")
    if mode is not None and not stat.S_ISREG(mode):
        yield target
        return
    target = resolved
    made = _make_parents(target.parent)
    partial = _sibling(target)
    try:
        try:
            partial.touch()
        except OSError as error:
            raise InputError(f"{target} cannot be written: {error.strerror or error}") from None
        yield partial
        with _uninterrupted():
            if mode is not None:
                partial.chmod(stat.S_IMODE(mode))
            partial.replace(target)
    except BaseException:
        partial.unlink(missing_ok=True)
        _remove_empty(made)
        raise


@contextmanager
def atomic_directory(target: Path) -> Iterator[Path]:
    """Empty folder to fill; its contents become `target` when the block ends without an error, else it vanishes.

    Parameters
    ----------
    target : Path
        Folder to write. Files of an earlier run with the same names are replaced, on success only; files that this
        run does not write stay, for they may be the user's.

    Raises
    ------
    InputError
        At entry, before any work, when `target` is a file or cannot be written.
    """
    target = Path(os.path.abspath(target))  # noqa: PTH100 - `resolve` would replace a linked folder by its target
    if target.exists() and not target.is_dir():
        raise InputError(f"{target} is a file; name a folder to write")
    made = _make_parents(target.parent)
    partial = _sibling(target)
    try:
        try:
            partial.mkdir()
        except OSError as error:
            raise InputError(f"{target} cannot be written: {error.strerror or error}") from None
        yield partial
        with _uninterrupted():
            if target.exists():
                _merge(partial, target)
            else:
                partial.rename(target)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        _remove_empty(made)
        raise


def _merge(source: Path, target: Path) -> None:
    """Move every file of `source` over its namesake in `target`; checks for clashes before it moves anything."""
    files = [path.relative_to(source) for path in sorted(source.rglob("*")) if not path.is_dir()]
    folders = [path.relative_to(source) for path in sorted(source.rglob("*")) if path.is_dir()]
    for file in files:
        if (target / file).is_dir():
            raise InputError(f"{target / file} is a folder, and the result is a file of that name; move it away")
    for folder in folders:
        if (target / folder).exists() and not (target / folder).is_dir():
            raise InputError(f"{target / folder} is a file, and the result is a folder of that name; move it away")
    for folder in folders:
        (target / folder).mkdir(exist_ok=True)
    for file in files:
        (source / file).replace(target / file)
    shutil.rmtree(source)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file, whole or not at all."""
    with atomic_file(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")


def write_json(path: Path, value: Mapping[str, Any]) -> None:
    """Write `value` as indented JSON, whole or not at all; numpy scalars and arrays become numbers and lists.

    Raises
    ------
    ValueError
        When a number is not finite: JSON has no NaN, and a result should say what is missing instead.
    """
    write_text(path, json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False, default=_plain) + "\n")


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


class CsvStream:
    """CSV file that grows block by block; made by `open_csv`.

    Parameters
    ----------
    stream : binary file
    names : sequence of str
        Header.
    """

    __slots__ = ("_columns", "_stream")

    def __init__(self, stream: IO[bytes], names: Sequence[str]) -> None:
        self._stream = stream
        self._columns = len(names)
        stream.write(",".join(names).encode() + b"\n")

    def write(self, block: FloatArray) -> None:
        """Append rows; every number reads back as the same double.

        Parameters
        ----------
        block : ndarray, shape (rows, columns)
        """
        if block.ndim != 2 or block.shape[1] != self._columns:
            raise ValueError(f"block must have {self._columns} columns, got shape {block.shape}")
        rows = max(1, _BLOCK_VALUES // self._columns)
        compiled = compiled_writer() if block.size >= _MANY_VALUES else None
        if compiled is not None:
            whole = np.ascontiguousarray(block, dtype=np.float64)
            text = np.empty(BYTES_PER_NUMBER * rows * self._columns + BYTES_MORE, dtype=np.uint8)
            for start in range(0, len(whole), rows):
                size = compiled(whole[start : start + rows], text)
                self._stream.write(text[:size].data)
            return
        # pydantic's Rust serialiser prints the shortest text that reads back exactly, at a tenth of the cost of
        # `DataFrame.to_csv`: [[1.0,2.0],[3.0,4.0]] becomes two lines.
        from pydantic_core import to_json

        for start in range(0, len(block), rows):
            lines = to_json(block[start : start + rows].tolist(), inf_nan_mode="constants")
            self._stream.write(lines[2:-2].replace(b"],[", b"\n"))
            self._stream.write(b"\n")


@contextmanager
def open_csv(path: Path, names: Sequence[str]) -> Iterator[CsvStream]:
    """Write a CSV file block by block, whole or not at all.

    Parameters
    ----------
    path : Path
    names : sequence of str
        Header.
    """
    with atomic_file(path) as partial, partial.open("wb") as stream:
        yield CsvStream(stream, names)


def write_csv(path: Path, columns: Mapping[str, ArrayLike]) -> None:
    """Write equally long columns of numbers under their names, whole or not at all.

    Parameters
    ----------
    path : Path
    columns : mapping of str to array_like, shape (rows,)
    """
    table = np.column_stack([np.asarray(values, dtype=np.float64) for values in columns.values()])
    with open_csv(path, list(columns)) as out:
        out.write(table)
