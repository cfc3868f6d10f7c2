"""Spreadsheets."""

from collections.abc import Sequence
from pathlib import Path

from tendonff.compensator.files.formats.reader import Reader
from tendonff.compensator.files.formats.table import Table, of_frame


def _read(path: Path, _: Sequence[str]) -> Table:
    import pandas as pd

    return of_frame(pd.read_excel(path))


XLSX = Reader(name=".xlsx", suffixes=(".xlsx",), read=_read, package="openpyxl")
XLS = Reader(name=".xls", suffixes=(".xls",), read=_read, package="xlrd")
