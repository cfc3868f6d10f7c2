"""Output that appears whole or not at all.

Every result goes to a temporary sibling first and takes its name only when it is complete, so an error, Ctrl-C or a
full disk leaves what was there before.
"""

import json
import os
import shutil
import signal
import stat
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike

from tendonff.compensator.files.interrupts import raise_if_stopped
from tendonff.compensator.files.number_text import BYTES_MORE, BYTES_PER_NUMBER, compiled_writer
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.ocp.codegen.leftovers import remove_leftovers, temporary_name

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
        raise InputError(
            f"{folder} cannot be created: {error.strerror or error}; name a place that you may write to"
        ) from None
    return missing


def _remove_empty(folders: Sequence[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return  # somebody else put something there


def _sibling(target: Path) -> Path:
    remove_leftovers(target.parent, target.name)
    return target.with_name(temporary_name(target.name))


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
            raise InputError(
                f"{target} cannot be written: {error.strerror or error}; name a place that you may write to"
            ) from None
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
def atomic_directory(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Empty folder to fill; its contents become `target` when the block ends without an error, else it vanishes.

    Parameters
    ----------
    target : str or path
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
            raise InputError(
                f"{target} cannot be written: {error.strerror or error}; name a place that you may write to"
            ) from None
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
    """Write a CSV file block by block, whole or not at all."""
    with atomic_file(path) as partial, partial.open("wb") as stream:
        yield CsvStream(stream, names)


def write_csv(path: Path, columns: Mapping[str, ArrayLike]) -> None:
    """Write equally long columns of numbers under their names, whole or not at all.

    Parameters
    ----------
    columns : mapping of str to array_like, shape (rows,)
    """
    table = np.column_stack([np.asarray(values, dtype=np.float64) for values in columns.values()])
    with open_csv(path, list(columns)) as out:
        out.write(table)


def require_parquet() -> None:
    """Raise `InputError` where no package writes Parquet files."""
    if find_spec("pyarrow") is None:
        raise InputError('--parquet needs pyarrow: pip install "tendonff[parquet]"; or leave it out for CSV alone')


def write_parquet(path: Path, columns: Mapping[str, ArrayLike]) -> None:
    """Write columns as a Parquet file."""
    import pandas as pd

    pd.DataFrame({name: np.asarray(column) for name, column in columns.items()}).to_parquet(path, index=False)
