"""Parquet files; of a column of lists `NAME[k]` is the k-th element."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tendonff.compensator.files.dialect import require_columns
from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Table, of_frame
from tendonff.compensator.files.text import require_moderate

_ELEMENT = re.compile(r"(.+)\[(\d+)\]")


def _kind(of: Any, pa: Any) -> str:
    """Kind of a column: "text", "number", "list", or "" for what is not read."""
    types = pa.types
    if types.is_dictionary(of):
        of = of.value_type
    if types.is_string(of) or types.is_large_string(of):
        return "text"
    if types.is_list(of) or types.is_large_list(of) or types.is_fixed_size_list(of):
        return "list" if _kind(of.value_type, pa) == "number" else ""
    return "number" if types.is_primitive(of) or types.is_decimal(of) else ""


def _read(path: Path, expected: Sequence[str]) -> Table:
    import pyarrow as pa
    from pyarrow.parquet import read_metadata, read_schema, read_table

    size = read_metadata(path)
    require_columns(size.num_columns, path.name)
    groups = (size.row_group(k) for k in range(size.num_row_groups))
    require_moderate(path, 8 * sum(g.column(k).num_values for g in groups for k in range(g.num_columns)))
    kinds = {field.name: _kind(field.type, pa) for field in read_schema(path)}
    texts = [name for name, kind in kinds.items() if kind == "text"]
    # Texts as places in their dictionary: a row then takes no more than a number does, however long its text is.
    frame = read_table(path, columns=[n for n, kind in kinds.items() if kind], read_dictionary=texts).to_pandas()
    frame = frame.assign(**{name: frame[name].astype(object) for name in texts if name in frame})
    lists = [name for name in frame.columns if len(frame) and isinstance(frame[name].iloc[0], (list, np.ndarray))]
    offered = tuple(f"{name}[{k}]" for name in lists for k in range(len(frame[name].iloc[0])))
    elements = {}
    for name in expected:
        match = _ELEMENT.fullmatch(name)
        if match and match[1] in lists and name in offered:
            elements[name] = frame[match[1]].map(lambda row, k=int(match[2]): row[k] if k < len(row) else np.nan)
    plain = of_frame(frame.drop(columns=lists))
    return Table(columns={**plain.columns, **elements}, units=plain.units, offered=offered)


PARQUET = Reader(
    name=".parquet", suffixes=(".parquet",), read=_read, package="pyarrow", extra="parquet", magic=(b"PAR1",)
)
