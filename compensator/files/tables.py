"""Tables as loggers write them: text with any usual separator, also packed; spreadsheets, Parquet, MATLAB files."""

import io
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.dialect import (
    MOST_COLUMNS,
    Dialect,
    find_dialect,
    is_comment,
    is_number,
    require_columns,
)
from tendonff.compensator.files.text import MOST_BYTES, READABLE, InputError, require_file, too_large, user_text

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

PACKED = {".xlsx": "openpyxl", ".xls": "xlrd", ".parquet": "pyarrow"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns of a file, before any judgement."""

    columns: "Mapping[str, pd.Series[Any]]"  # by name, in the file's order
    units: Mapping[str, str]  # by name, from a row of units below the header; empty where there is none
    long_rows: int = 0  # rows that had more cells than the header and were left out
    repeated: tuple[str, ...] = ()  # names that stand more than once in the header; `columns` has the last of each
    notes: tuple[str, ...] = ()  # what was taken for granted

    @property
    def dialect(self) -> Dialect:
        """The plain form, with its own names and units."""
        return Dialect(
            names=tuple(self.columns),
            units=tuple(self.units.get(name, "").strip(" []()") for name in self.columns),
            skipped=1,
            first=tuple(str(cells.iloc[0]) if len(cells) else "" for cells in self.columns.values()),
        )

    def numbers(self, name: str) -> Array:
        """A column as numbers, NaN where a cell is none, shape (rows,)."""
        import pandas as pd

        cells = self.columns[name]
        if cells.dtype == object or pd.api.types.is_string_dtype(cells):
            cells = (
                cells.astype(str).str.strip().str.replace(r"^([-+]?\d*),(\d+(?:[eE][-+]?\d+)?)$", r"\1.\2", regex=True)
            )
        return np.asarray(pd.to_numeric(cells, errors="coerce").to_numpy(dtype=np.float64))

    def seconds(self, name: str) -> tuple[Array, float | None]:
        """A column of time as numbers; dates and times of day (12:00:03.5) become seconds since the first.

        Also the first one: in seconds since 1970, or since midnight; None where the column holds numbers or nothing.
        """
        import pandas as pd

        found = self.numbers(name)
        if np.isfinite(found).any() and not pd.api.types.is_datetime64_any_dtype(self.columns[name]):
            return found, None
        dates = pd.to_datetime(self.columns[name], errors="coerce", format="ISO8601", utc=True)
        if not dates.notna().any():
            times = pd.to_timedelta(
                self.columns[name].astype(str).where(lambda x: x.str.contains(":")), errors="coerce"
            )
            if not times.notna().any():
                return found, None
            since = np.asarray(times.dt.total_seconds().to_numpy(dtype=np.float64))
            begin = float(since[np.isfinite(since)][0])
            return np.asarray(since - begin, dtype=np.float64), begin
        first = dates.dropna().iloc[0]
        return np.asarray((dates - first).dt.total_seconds().to_numpy(dtype=np.float64)), float(first.timestamp())


def is_packed(path: Path) -> bool:
    """Whether a file is no text, by its name."""
    return path.suffix.lower() in (*PACKED, ".mat")


def read_table(path: Path, expected: Sequence[str] = ()) -> Table:
    """Read a file of any of the known kinds, tolerant of rows and cells that cannot be used; else InputError.

    `expected` are names of columns that the header may have; they tell it from a heading.
    """
    require_file(path)
    if path.suffix.lower() == ".mat":
        return _matlab(path)
    if path.suffix.lower() in PACKED:
        return _packed(path)
    return _text(path, expected)


def table_dialect(path: Path, expected: Sequence[str] = ()) -> Dialect:
    """How a table is written; one that is no text is in the plain form, with its own names and units."""
    if not is_packed(path):
        return find_dialect(path, expected)
    return read_table(path, expected).dialect


def _text(path: Path, expected: Sequence[str]) -> Table:
    import pandas as pd

    with user_text(path) as stream:
        text = stream.read()
    if "\0" in text:
        raise InputError(f"{path.name} is not text; what can be read: {READABLE}")
    dialect = find_dialect(path, expected)
    names = list(dialect.names)
    while names and not names[-1]:
        names.pop()
    mark = "\t" if dialect.separator == " " else dialect.separator
    kept, long_rows = [], 0
    for line in text.splitlines()[dialect.skipped :]:
        row = line.rstrip()
        if not row.strip() or is_comment(row):
            continue
        row = mark.join(row.split()) if dialect.separator == " " else row
        if row.count(mark) > MOST_COLUMNS:
            long_rows += 1
            continue
        while row.endswith(mark) and row.count(mark) >= len(names):
            row = row[:-1].rstrip(" ")
        if row.count(mark) >= len(names) and '"' not in row:
            long_rows += 1
        else:
            kept.append(row)
    if long_rows and not kept:
        raise InputError(
            f"{path.name}: every row has more cells than the header; for decimal commas separate the columns by "
            "semicolons"
        )
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(kept)),
            sep=mark,
            header=None,
            names=list(range(len(names))),
            skipinitialspace=True,
            low_memory=False,
            index_col=False,
        )
    except (ValueError, pd.errors.ParserError) as error:
        raise _damaged(path, error) from None
    units = dict(zip(names, dialect.units, strict=False)) if any(dialect.units) else {}
    return Table(
        columns={name: frame[k] for k, name in enumerate(names)},
        units=units,
        long_rows=long_rows,
        repeated=tuple(name for name in dict.fromkeys(names) if names.count(name) > 1),
        notes=dialect.notes,
    )


def _packed(path: Path) -> Table:
    import pandas as pd

    kind = path.suffix.lower()
    try:
        _require_moderate(path)
        frame = pd.read_parquet(path) if kind == ".parquet" else pd.read_excel(path)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except ImportError:
        raise InputError(
            f"{path.name}: {kind} files need the package {PACKED[kind]} (pip install {PACKED[kind]}); or save it as CSV"
        ) from None
    except Exception as error:  # noqa: BLE001 - these readers raise what they like on a damaged file
        raise _damaged(path, error) from None
    units = {}
    if len(frame) and all(isinstance(cell, str) and not is_number(cell) for cell in frame.iloc[0]):
        units = {str(name).strip(): str(cell) for name, cell in frame.iloc[0].items()}
        frame = frame.iloc[1:]
    return _of_frame(frame, units)


def _damaged(path: Path, error: Exception) -> InputError:
    """What a reader says of a file; some quote its first bytes."""
    way = f"what can be read: {READABLE}"
    return InputError(f"{path.name} cannot be read ({error}); {way}", discreet=f"{path.name} cannot be read; {way}")


def _require_moderate(path: Path) -> None:
    """Refuse a file that unpacks to more than can be meant, before it is unpacked."""
    size = 0
    match path.suffix.lower():
        case ".xlsx":
            with zipfile.ZipFile(path) as packed:
                size = sum(part.file_size for part in packed.infolist())
        case ".parquet":
            from pyarrow.parquet import read_metadata

            found = read_metadata(path)
            require_columns(found.num_columns, path.name)
            size = 8 * found.num_rows * found.num_columns
        case ".mat":
            from scipy.io import whosmat

            size = sum(8 * math.prod(shape) for _, shape, _ in whosmat(path))
    if size > MOST_BYTES:
        raise too_large(path)


def _matlab(path: Path) -> Table:
    import pandas as pd
    from scipy.io import loadmat

    try:
        _require_moderate(path)
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except NotImplementedError:
        raise InputError(f"{path.name} is a MATLAB 7.3 file; save it with -v7, or as CSV") from None
    except Exception as error:  # noqa: BLE001 - loadmat raises what it likes on a damaged file
        raise _damaged(path, error) from None
    vectors: dict[str, Any] = {}
    for name, value in content.items():
        parts = {f: getattr(value, f) for f in value._fieldnames} if hasattr(value, "_fieldnames") else {name: value}
        if not name.startswith("__"):
            vectors |= {k: v for k, v in parts.items() if isinstance(v, np.ndarray) and v.ndim == 1 and v.size > 1}
    lengths = sorted({v.size for v in vectors.values()})
    if not vectors:
        raise InputError(f"{path.name} holds no vectors; save time and tensions as vectors of one length")
    rows = max(lengths, key=lambda n: sum(v.size == n for v in vectors.values()))
    return _of_frame(pd.DataFrame({k: v for k, v in vectors.items() if v.size == rows}), {})


def _of_frame(frame: "pd.DataFrame", units: Mapping[str, str]) -> Table:
    names: Sequence[str] = [str(name).strip() for name in frame.columns]
    require_columns(len(names), "the table")
    return Table(columns={name: frame.iloc[:, k] for k, name in enumerate(names)}, units=units)
