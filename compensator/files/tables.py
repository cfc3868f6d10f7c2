"""Tables as loggers write them: text with any usual separator, also packed, and the formats of `formats`."""

import io
from collections.abc import Sequence
from pathlib import Path

from tendonff.compensator.files.dialect import MOST_COLUMNS, Dialect, find_dialect, is_comment
from tendonff.compensator.files.formats.registry import READABLE, damaged, read_packed, reader_of
from tendonff.compensator.files.formats.table import Table
from tendonff.compensator.files.text import InputError, user_text

__all__ = ["Table", "is_packed", "read_table", "table_dialect"]


def is_packed(path: Path) -> bool:
    """Whether a file is no text."""
    return reader_of(path) is not None


def read_table(path: Path, expected: Sequence[str] = (), header: Sequence[str] = ()) -> Table:
    """Read a file of any of the known kinds, tolerant of rows and cells that cannot be used; else InputError.

    `expected` are names of columns that the file may have: they tell a header from a heading, and of bags and the like
    only they are read. `header` names the columns of a text that has no header.
    """
    reader = reader_of(path)
    return _text(path, expected, header) if reader is None else read_packed(reader, path, expected)


def table_dialect(path: Path, expected: Sequence[str] = ()) -> Dialect:
    """Dialect of a table; one that is no text is in the plain form, with its own names and units."""
    return read_table(path, expected).dialect if is_packed(path) else find_dialect(path, expected)


def _text(path: Path, expected: Sequence[str], header: Sequence[str]) -> Table:
    import pandas as pd

    with user_text(path) as stream:
        text = stream.read()
    if "\0" in text:
        raise InputError(f"{path.name} is not text; what can be read: {READABLE}")
    dialect = find_dialect(path, expected, header)
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
        if (row.count(mark) >= len(names) and '"' not in row) or row.count('"') % 2:  # an open quote would go on
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
        raise damaged(path, error) from None
    units = dict(zip(names, dialect.units, strict=False)) if any(dialect.units) else {}
    return Table(
        columns={name: frame[k] for k, name in enumerate(names)},
        units=units,
        long_rows=long_rows,
        repeated=tuple(name for name in dict.fromkeys(names) if names.count(name) > 1),
        notes=dialect.notes,
    )
