"""Output that appears whole or not at all.

Every result goes to a temporary sibling first and takes its name only when it is complete, so an error, Ctrl-C or a
full disk leaves what was there before.
"""

import ctypes
import functools
import json
import math
import os
import shutil
import signal
import stat
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tendonff.compensator.files.interrupts import raise_if_stopped
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.codegen.leftovers import remove_leftovers, temporary_name

BYTES_PER_NUMBER = 26
BYTES_MORE = 64

Writer = Callable[[NDArray[np.float64], NDArray[np.uint8]], int]


@functools.cache
def compiled_writer() -> Writer | None:
    """Function that writes rows of numbers as CSV lines into a buffer and returns the bytes used.

    The buffer must hold `BYTES_PER_NUMBER` a number and `BYTES_MORE`. Every number reads back as the same double. None
    where no C compiler works, or it has no integers of 128 bits.
    """
    if resolve_engine(Engine.AUTO) is not Engine.COMPILED:
        return None
    try:
        library = load_library(
            resources.files("tendonff.compensator.files").joinpath("number_text.c").read_text("utf-8")
        )
    except (RuntimeError, OSError):
        return None
    library.tff_csv_text.restype = ctypes.c_long

    def write(block: NDArray[np.float64], out: NDArray[np.uint8]) -> int:
        rows, columns = block.shape
        if out.size < BYTES_PER_NUMBER * block.size + BYTES_MORE:
            raise ValueError(f"the buffer holds {out.size} bytes, too few for {block.size} numbers")
        return int(
            library.tff_csv_text(
                ctypes.c_void_p(block.ctypes.data),
                ctypes.c_long(rows),
                ctypes.c_long(columns),
                ctypes.c_void_p(out.ctypes.data),
            )
        )

    return write


_GENERATOR, _HEAD_BYTES = b'name="generator" content="tendonff"', 4096  # what every report begins with
_MANY_VALUES = 100_000  # numbers in a block from which it pays to load the compiled writer
_BLOCK_VALUES = 20_000  # numbers per written block: what stays in the processor's cache writes twice as fast


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Hold back Ctrl-C for the moment in which finished files take their names."""
    raise_if_stopped()
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous if previous is not None else signal.default_int_handler)


def _refused(path: Path, what: str, error: OSError) -> InputError:
    return InputError(f"{path} cannot be {what}: {error.strerror or error}; name a place that you may write to")


def _make_parents(folder: Path) -> list[Path]:
    """Create `folder` and what is missing above it; returns what was created, deepest first."""
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _refused(folder, "created", error) from None
    return missing


def _remove_empty(folders: Sequence[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return  # somebody else put something there


@contextmanager
def _appearing(
    target: Path, make: Callable[[Path], None], place: Callable[[Path], None], remove: Callable[[Path], None]
) -> Iterator[Path]:
    """A sibling of `target`, made, then placed when the block ends without an error, else removed."""
    made = _make_parents(target.parent)
    remove_leftovers(target.parent, target.name)
    partial = target.with_name(temporary_name(target.name))
    try:
        try:
            make(partial)
        except OSError as error:
            raise _refused(target, "written", error) from None
        yield partial
        with _uninterrupted():
            place(partial)
    except BaseException:
        remove(partial)
        _remove_empty(made)
        raise


@contextmanager
def atomic_file(target: Path) -> Iterator[Path]:
    """Path to write to; it becomes `target` when the block ends without an error, else it vanishes.

    A file that exists is replaced on success only; missing folders are made; a device or pipe (`/dev/null`) is written
    to directly. InputError at entry, before any work, when `target` is a folder or cannot be written.
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

    def place(partial: Path) -> None:
        if mode is not None:
            partial.chmod(stat.S_IMODE(mode))
        partial.replace(resolved)

    with _appearing(resolved, Path.touch, place, lambda partial: partial.unlink(missing_ok=True)) as partial:
        yield partial


@contextmanager
def atomic_directory(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Empty folder to fill; its contents become `target` when the block ends without an error, else it vanishes.

    Files of an earlier run with the same names are replaced, on success only; files that this run does not write stay,
    for they may be the user's. A page of another program is not replaced: InputError, and the folder stays as it was.
    InputError at entry, before any work, when `target` is a file or cannot be written.
    """
    target = Path(os.path.abspath(target))  # noqa: PTH100 - `resolve` would replace a linked folder by its target
    if target.exists() and not target.is_dir():
        raise InputError(f"{target} is a file; name a folder to write")

    def place(partial: Path) -> None:
        if target.exists():
            _merge(partial, target)
        else:
            partial.rename(target)

    with _appearing(target, Path.mkdir, place, lambda partial: shutil.rmtree(partial, ignore_errors=True)) as partial:
        yield partial


def write_folder(files: Mapping[str, str], folder: str | os.PathLike[str]) -> None:
    """Write texts by their name in a folder, all or nothing; makes the folder and those in it."""
    with atomic_directory(folder) as partial:
        for name, text in files.items():
            (partial / name).parent.mkdir(parents=True, exist_ok=True)
            write_text(partial / name, text)


def _merge(source: Path, target: Path) -> None:
    """Move every file of `source` over its namesake in `target`; checks for clashes before it moves anything."""
    files = [path.relative_to(source) for path in sorted(source.rglob("*")) if not path.is_dir()]
    folders = [path.relative_to(source) for path in sorted(source.rglob("*")) if path.is_dir()]
    for file in files:
        if (target / file).is_dir():
            raise InputError(f"{target / file} is a folder, and the result is a file of that name; move it away")
        if file.suffix == ".html" and (target / file).exists() and _GENERATOR not in _head(target / file):
            raise InputError(
                f"{target / file} is no page of tendonff and is kept; name another folder, or move it away"
            )
    for folder in folders:
        if (target / folder).exists() and not (target / folder).is_dir():
            raise InputError(f"{target / folder} is a file, and the result is a folder of that name; move it away")
    for folder in folders:
        (target / folder).mkdir(exist_ok=True)
    for file in files:
        (source / file).replace(target / file)
    shutil.rmtree(source)


def _head(path: Path) -> bytes:
    """First bytes of a file; none of one that may not be read."""
    try:
        with path.open("rb") as file:
            return file.read(_HEAD_BYTES)
    except OSError:
        return b""


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file, whole or not at all."""
    with atomic_file(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")


def write_json(path: Path, value: Mapping[str, Any]) -> None:
    """Write `value` as indented JSON, whole or not at all; numpy scalars and arrays become numbers and lists.

    ValueError when a number is not finite: JSON has no NaN, and a result should say what is missing instead.
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
    """CSV file that grows block by block; made by `open_csv`."""

    __slots__ = ("_columns", "_stream")

    def __init__(self, stream: IO[bytes], names: Sequence[str]) -> None:
        self._stream = stream
        self._columns = len(names)
        stream.write(",".join(names).encode() + b"\n")

    def write(self, block: FloatArray) -> None:
        """Append rows, shape (rows, columns); every number reads back as the same double."""
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
    """Write a CSV file block by block, whole or not at all."""
    with atomic_file(path) as partial, partial.open("wb") as stream:
        yield CsvStream(stream, names)


def write_csv(path: Path, columns: Mapping[str, ArrayLike]) -> None:
    """Write columns of numbers, shape (rows,), under their names, whole or not at all."""
    table = np.column_stack([np.asarray(values, dtype=np.float64) for values in columns.values()])
    with open_csv(path, list(columns)) as out:
        out.write(table)


def csv_text(names: Iterable[str], rows: Iterable[Iterable[str | float]]) -> str:
    """CSV of texts and numbers, which read back as the same double; NaN is an empty cell."""

    def cell(value: str | float) -> str:
        return value if isinstance(value, str) else "" if math.isnan(value) else repr(value)

    return "".join(f"{','.join(line)}\n" for line in (names, *(map(cell, row) for row in rows)))


def require_parquet() -> None:
    """Raise `InputError` where no package writes Parquet files."""
    if find_spec("pyarrow") is None:
        raise InputError('--parquet needs pyarrow: pip install "tendonff[parquet]"; or leave it out for CSV alone')


def write_parquet(path: Path, columns: Mapping[str, ArrayLike]) -> None:
    """Write columns as a Parquet file."""
    import pandas as pd

    pd.DataFrame({name: np.asarray(column) for name, column in columns.items()}).to_parquet(path, index=False)
