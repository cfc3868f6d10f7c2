"""Columns of a measured file, as every reader returns them."""

import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.files.dialect import Dialect, is_number, require_columns

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns of a file, before any judgement.

    Parameters
    ----------
    columns : mapping of str to Series
        By name, in the file's order.
    units : mapping of str to str
        By name; empty where the file states none.
    long_rows : int
        Rows that had more cells than the header and were left out.
    repeated : tuple of str
        Names that stand more than once in the header; `columns` has the last of each.
    notes : tuple of str
        What was taken for granted.
    offered : tuple of str
        Further columns that the file could give, where only those that were asked for are read.
    """

    columns: "Mapping[str, pd.Series[Any]]"
    units: Mapping[str, str]
    long_rows: int = 0
    repeated: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    offered: tuple[str, ...] = ()

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


def unpacked_size(path: Path) -> int:
    """Bytes that a zipped file unpacks to."""
    with zipfile.ZipFile(path) as packed:
        return sum(part.file_size for part in packed.infolist())


def of_frame(frame: "pd.DataFrame") -> Table:
    """A table of a data frame; a first row of words states units."""
    units = {}
    if len(frame) and len(frame.columns) and all(isinstance(c, str) and not is_number(c) for c in frame.iloc[0]):
        units = {str(name).strip(): str(cell) for name, cell in frame.iloc[0].items()}
        frame = frame.iloc[1:]
    require_columns(len(frame.columns), "the table")
    names: Sequence[str] = [str(name).strip() for name in frame.columns]
    return Table(columns={name: frame.iloc[:, k] for k, name in enumerate(names)}, units=units)


def of_vectors(vectors: Mapping[str, Array], units: Mapping[str, str] | None = None) -> Table:
    """A table of the vectors of the length that holds most numbers; matrices give a column `NAME[k]` each."""
    import pandas as pd

    flat: dict[str, Array] = {}
    for name, value in vectors.items():
        array = np.squeeze(np.asarray(value))
        if array.ndim == 1 and array.size > 1:
            flat[name] = array
        elif array.ndim == 2:
            tall = array if array.shape[0] >= array.shape[1] else array.T
            require_columns(tall.shape[1], name)
            flat |= {f"{name}[{k}]": tall[:, k] for k in range(tall.shape[1])}
    sizes = sorted({v.size for v in flat.values()})
    rows = max(sizes, key=lambda n: sum(v.size == n for v in flat.values()), default=0)
    kept = {name: pd.Series(v) for name, v in flat.items() if v.size == rows}
    return Table(columns=kept, units={k: u for k, u in (units or {}).items() if k in kept and u})


def resolved(expected: Iterable[str], names: Sequence[str]) -> dict[str, str]:
    """Names of the expected columns in a file with long names (`group/dataset`, `topic.field`).

    A column is named whole or, where only one ends so, by the last part of its name.
    """
    found = {}
    for wanted in expected:
        last = [name for name in names if wanted in (name, PurePath(name).name, name.rpartition(".")[2])]
        if wanted in names:
            found[wanted] = wanted
        elif len(last) == 1:
            found[wanted] = last[0]
    return found


def joined(channels: "Mapping[str, tuple[Array, Array]]") -> "dict[str, pd.Series[Any]]":
    """Channels with clocks [s] of their own on the clock of the first, under the name `time_s`.

    Between two samples a channel is a straight line; before its first and after its last it is missing.
    """
    import pandas as pd

    clock, _ = next(iter(channels.values()))
    columns = {"time_s": pd.Series(clock)}
    for name, (time, values) in channels.items():
        same = len(time) == len(clock) and bool(np.all(time == clock))
        on_clock = values if same else np.interp(clock, time, values, left=np.nan, right=np.nan)
        columns[name] = pd.Series(on_clock)
    return columns
