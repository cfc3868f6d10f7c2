"""Spreadsheets."""

from collections.abc import Sequence
from pathlib import Path
from zipfile import is_zipfile

from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Table, of_frame, unpacked_size
from tendonff.compensator.files.text import require_moderate

_PART = 4
"""A spreadsheet of a fourth of the bytes of others takes about half a minute to read."""


def _read(path: Path, _: Sequence[str]) -> Table:
    import pandas as pd

    if is_zipfile(path):
        require_moderate(path, unpacked_size(path), _PART)
    return of_frame(pd.read_excel(path))


XLSX = Reader(name=".xlsx", suffixes=(".xlsx",), read=_read, package="openpyxl")
XLS = Reader(name=".xls", suffixes=(".xls",), read=_read, package="xlrd")
