"""Tables as loggers write them: text with any usual separator, also packed; spreadsheets, Parquet, MATLAB files."""

import gzip
import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.reading import InputError, open_text

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

COMMENTS = ("#", "%", "//")
SEPARATORS = ("\t", ";", ",", "|")
READABLE = "text with a header (separated by commas, semicolons, tabs; also .gz), .xlsx, .parquet, .mat"
PACKED = {".xlsx": "openpyxl", ".xls": "xlrd", ".parquet": "pyarrow"}

UNITS = {
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "input": {"n": 1.0, "kn": 1e3, "mn": 1e-3},
    "joint": {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180},
    "position": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredTable:
    """Columns of a file, before any judgement.

    Parameters
    ----------
    columns : mapping of str to pandas.Series
        By name, in the file's order.
    units : mapping of str to str
        By name, from a row of units below the header; empty where there is none.
    long_rows : int
        Rows that had more cells than the header and were left out.
    """

    columns: "Mapping[str, pd.Series[Any]]"
    units: Mapping[str, str]
    long_rows: int = 0

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
        """A column of time as numbers; dates become seconds since the first, which is told in seconds since 1970."""
        import pandas as pd

        found = self.numbers(name)
        if np.isfinite(found).any() and not pd.api.types.is_datetime64_any_dtype(self.columns[name]):
            return found, None
        dates = pd.to_datetime(self.columns[name], errors="coerce", format="ISO8601", utc=True)
        if not dates.notna().any():
            return found, None
        first = dates.dropna().iloc[0]
        return np.asarray((dates - first).dt.total_seconds().to_numpy(dtype=np.float64)), float(first.timestamp())


def unit_factor(key: str, unit: str) -> float | None:
    """Factor to SI of a unit in a row of units; None where it is not known.

    Parameters
    ----------
    key : str
        "time", "input", "output", "actuator_force", "input_position" or "output_position".
    unit : str
    """
    kind = (
        "joint"
        if key.startswith("joint")
        else "position"
        if key.endswith("position")
        else "input"
        if key in ("output", "actuator_force")
        else key
    )
    word = unit.strip(" []()").replace("µ", "u").replace("μ", "u")
    known = UNITS[kind]
    return known.get(word) if word in known else known.get(word.lower()) if word.lower() in known else None


def read_table(path: Path) -> MeasuredTable:
    """Read a file of any of the known kinds.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        One message that says what can be read.
    """
    if path.suffix.lower() == ".mat":
        return _matlab(path)
    if path.suffix.lower() in PACKED:
        return _packed(path)
    return _text(path)


def _text(path: Path) -> MeasuredTable:
    import pandas as pd

    lines = list(_lines(path))
    if lines and lines[0].lower().startswith("sep="):
        lines = lines[1:]
    if not lines:
        raise InputError(f"{path.name} is empty; the first line must name the columns")
    separator = max(SEPARATORS, key=lambda mark: (lines[0].count(mark), mark == ","))
    if separator not in lines[0]:
        lines, separator = [",".join(line.split()) for line in lines], ","
    header = lines[0].rstrip(f" {separator}")
    width, kept, long_rows = header.count(separator), [header], 0
    for line in lines[1:]:
        row = line
        while row.endswith(separator) and row.count(separator) > width:
            row = row[:-1].rstrip()
        if row.count(separator) > width and '"' not in row:
            long_rows += 1
        else:
            kept.append(row)
    names = [name.strip().strip('"') for name in header.split(separator)]
    if names and all(_is_number(name) for name in names):
        raise InputError(f"{path.name} row 1: the first line must name the columns, got numbers ({names[0]}, ...)")
    units: dict[str, str] = {}
    if len(kept) > 1 and len(cells := [c.strip().strip('"') for c in kept[1].split(separator)]) == len(names):
        words = [c for c in cells if c]
        if words and all(
            re.fullmatch(r"[\[(]?[A-Za-zµμ%°][\w/*^.·²³ ]{0,7}[\])]?", c) and c.lower() != "nan" for c in words
        ):
            units = dict(zip(names, cells, strict=True))
            del kept[1]
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(kept)), sep=separator, skipinitialspace=True, low_memory=False, index_col=False
        )
    except (ValueError, pd.errors.ParserError) as error:
        raise InputError(f"{path.name} cannot be read as a table: {error}; what can be read: {READABLE}") from None
    return _of_frame(frame, units, long_rows)


def _lines(path: Path) -> Iterator[str]:
    """Lines of a text file that are neither blank nor comments."""
    try:
        if path.suffix.lower() == ".gz":
            with gzip.open(path, "rt", encoding="utf-8-sig") as packed:
                text = packed.read()
        else:
            with open_text(path) as stream:
                text = stream.read()
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except UnicodeDecodeError:
        raise InputError(f"{path.name} is not UTF-8 text; what can be read: {READABLE}") from None
    except (OSError, EOFError) as error:
        raise InputError(f"{path.name} cannot be unpacked ({error}); what can be read: {READABLE}") from None
    if "\0" in text:
        raise InputError(f"{path.name} is not text; what can be read: {READABLE}")
    for line in text.splitlines():
        bare = line.rstrip()
        if bare.strip() and not bare.lstrip().startswith(COMMENTS):
            yield bare


def _packed(path: Path) -> MeasuredTable:
    import pandas as pd

    kind = path.suffix.lower()
    try:
        frame = pd.read_parquet(path) if kind == ".parquet" else pd.read_excel(path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except ImportError:
        raise InputError(
            f"{path.name}: {kind} files need the package {PACKED[kind]} (pip install {PACKED[kind]}); or save it as CSV"
        ) from None
    except Exception as error:  # noqa: BLE001 - these readers raise what they like on a damaged file
        raise InputError(f"{path.name} cannot be read ({error}); what can be read: {READABLE}") from None
    units = {}
    if len(frame) and all(isinstance(cell, str) and not _is_number(cell) for cell in frame.iloc[0]):
        units = {str(name).strip(): str(cell) for name, cell in frame.iloc[0].items()}
        frame = frame.iloc[1:]
    return _of_frame(frame, units, 0)


def _matlab(path: Path) -> MeasuredTable:
    import pandas as pd
    from scipy.io import loadmat

    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except NotImplementedError:
        raise InputError(f"{path.name} is a MATLAB 7.3 file; save it with -v7, or as CSV") from None
    except Exception as error:  # noqa: BLE001 - loadmat raises what it likes on a damaged file
        raise InputError(f"{path.name} cannot be read ({error}); what can be read: {READABLE}") from None
    vectors: dict[str, Any] = {}
    for name, value in content.items():
        parts = {f: getattr(value, f) for f in value._fieldnames} if hasattr(value, "_fieldnames") else {name: value}
        if not name.startswith("__"):
            vectors |= {k: v for k, v in parts.items() if isinstance(v, np.ndarray) and v.ndim == 1 and v.size > 1}
    lengths = sorted({v.size for v in vectors.values()})
    if not vectors:
        raise InputError(f"{path.name} holds no vectors; save time and tensions as vectors of one length")
    rows = max(lengths, key=lambda n: sum(v.size == n for v in vectors.values()))
    return _of_frame(pd.DataFrame({k: v for k, v in vectors.items() if v.size == rows}), {}, 0)


def _of_frame(frame: "pd.DataFrame", units: Mapping[str, str], long_rows: int) -> MeasuredTable:
    names: Sequence[str] = [str(name).strip() for name in frame.columns]
    columns = {name: frame.iloc[:, k] for k, name in enumerate(names)}
    return MeasuredTable(columns=columns, units=units, long_rows=long_rows)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
