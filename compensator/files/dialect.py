"""Dialect of a text table: its separator, its decimal mark, and the lines of header, units and numbers.

Spreadsheets, loggers and oscilloscopes write the same numbers in many ways. What the text tells is taken from it and
said in notes; what it does not tell is asked about.
"""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from tendonff.compensator.files.text import InputError, user_text

MOST_COLUMNS = 5000
"""Columns that a table may have."""

_COMMENTS = ("#", "%", "//")
_LOOKED_AT = 200  # lines by which the format is recognised
_LONGEST = 100_000  # characters of a line that are looked at
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}
_NO_TABLES = {".toml", ".xml", ".urdf"}  # suffixes of scenarios and models, given by mistake
_DATE = re.compile(r"\d{4}-\d\d-\d\d|\d{1,2}:\d\d:")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """Dialect of a table."""

    separator: str = ","  # character between cells; a space stands for any number of them
    decimal: str = "."  # decimal mark, "." or ","
    names: tuple[str, ...]  # columns of the header, without blanks around them
    # what a line of units below the header says, one text a column; all empty where there is none
    units: tuple[str, ...]
    skipped: int  # lines before the first row of numbers
    first: tuple[str, ...] = ()  # cells of the first row below the header and the units; empty where there is none
    # in what the file differs from the plain form: header in the first line, commas, decimal points
    notes: tuple[str, ...] = ()

    def is_dated(self, name: str) -> bool:
        """Whether a column holds dates or times of day, by its first cell."""
        at = self.names.index(name)
        return at < len(self.first) and _DATE.match(self.first[at]) is not None

    def cells(self, line: str) -> list[str]:
        """Cells of a line, without blanks around them; csv.Error where its quotes make no sense."""
        return _split(line, self.separator)

    def number(self, text: str) -> float:
        """A cell as a number; ValueError where it is none."""
        if self.decimal == "," and "." in text:
            raise ValueError(text)
        return float(text.replace(self.decimal, "."))


def is_comment(line: str) -> bool:
    """Whether a line is a remark."""
    return line.lstrip(' "').startswith(_COMMENTS)


def find_dialect(path: Path, expected: Sequence[str] = (), header: Sequence[str] = ()) -> Dialect:
    """Find out from its first lines how a table is written.

    `expected` names tell its header from a heading; `header` names the columns of a text that has none.

    InputError if the file is empty, is no table, or its first line is a row of numbers.
    """
    if path.suffix.lower() in _NO_TABLES:
        raise InputError(f"{path.name} is no table; a file of columns under a header line, such as a CSV, belongs here")
    with user_text(path) as stream:
        lines = [line.rstrip("\r\n") for line in islice(iter(lambda: stream.readline(_LONGEST), ""), _LOOKED_AT)]
    try:
        return _dialect_of(lines, expected, header, path.name)
    except csv.Error as error:
        raise InputError(f"{path.name} row 1: the header cannot be read ({error})") from None


def _dialect_of(lines: Sequence[str], expected: Sequence[str], given: Sequence[str], file: str) -> Dialect:
    written = [k for k, line in enumerate(lines) if line.strip() and not is_comment(line)]
    if not written:
        raise InputError(f"{file} is empty; the first line must name the columns")
    for k in written:
        require_columns(max(len(lines[k].split()), *(lines[k].count(mark) for mark in ",;\t|")), file)
    separator = _separator([lines[k] for k in written], expected)
    cells = {k: _split(lines[k], separator) for k in written}
    if given:
        return _without_header(cells, separator, given, file)
    header = _header(cells, expected)
    if all(is_number(cell) for cell in cells[header]):
        remark = _commented_header(lines, written[0], separator, len(cells[header]))
        if remark is None:
            first = cells[header][0]
            refused = f"{file} row 1: the first line must name the columns, got numbers"
            way = f"name the {len(cells[header])} columns with --columns"
            raise InputError(f"{refused} ({first}, ...); {way}", discreet=f"{refused}; {way}")
        header = remark
        cells[header] = _split(lines[header].lstrip(' "#%/'), separator)
    names = tuple(cells[header])
    if not any(names):
        raise InputError(f"{file} is empty; the first line must name the columns")
    below = [k for k in written if k > header]
    units: tuple[str, ...] = ("",) * len(names)
    first_row = header + 1
    if below and _are_units(cells[below[0]], len(names)):
        units, first_row = tuple(cell.strip("[]() ") for cell in cells[below[0]]), below[0] + 1
    rows = [cells[k] for k in below if k >= first_row]
    comma = _has_decimal_commas(rows, separator)
    notes = _notes(separator, comma=comma)
    if left_out := sum(1 for k in written if k < header):
        notes.append(f"{left_out} {'line' if left_out == 1 else 'lines'} above the header left out")
    return Dialect(
        separator=separator,
        decimal="," if comma else ".",
        names=names,
        units=units,
        skipped=first_row,
        first=tuple(rows[0]) if rows else (),
        notes=tuple(notes),
    )


def _without_header(cells: dict[int, list[str]], separator: str, given: Sequence[str], file: str) -> Dialect:
    """Dialect of a text whose columns the user names: every line is a row of numbers."""
    first, *_ = rows = list(cells.values())
    if len(first) != len(given):
        raise InputError(f"{file} row 1 has {len(first)} cells, --columns names {len(given)}; give a name for each")
    comma = _has_decimal_commas(rows, separator)
    return Dialect(
        separator=separator,
        decimal="," if comma else ".",
        names=tuple(given),
        units=("",) * len(given),
        skipped=min(cells),
        first=tuple(first),
        notes=tuple(_notes(separator, comma=comma)),
    )


def require_columns(count: int, file: str) -> None:
    """Refuse a table with very many columns."""
    if count > MOST_COLUMNS:
        raise InputError(f"{file} has more than {MOST_COLUMNS} columns; give those that are needed")


def _has_decimal_commas(rows: Sequence[Sequence[str]], separator: str) -> bool:
    return separator != "," and any(_DECIMAL_COMMA.fullmatch(cell) for row in rows for cell in row)


def _notes(separator: str, *, comma: bool) -> list[str]:
    texts = ((separator != ",", f"cells separated by {_SEPARATORS[separator]}"), (comma, "decimal commas"))
    return [text for is_so, text in texts if is_so]


def _separator(lines: Sequence[str], expected: Sequence[str]) -> str:
    """The separator that cuts most lines into rows of equal width that hold numbers, else finds the expected names."""

    def rank(separator: str) -> tuple[int, int, int]:
        rows = [_split(line, separator) for line in lines]
        known = max(len(set(row) & set(expected)) for row in rows)
        width, count = Counter(len(row) for row in rows).most_common(1)[0]
        if width == 1:
            return 0, known, 0
        return sum(len(row) == width and _holds_numbers(row, separator) for row in rows), known, count

    def _holds_numbers(row: Sequence[str], separator: str) -> bool:
        texts = [cell if separator == "," else cell.replace(",", ".") for cell in row]
        return 2 * sum(not text or is_number(text) or _DATE.match(text) is not None for text in texts) > len(row)

    return max(_SEPARATORS, key=rank)  # the first of equals


def _header(cells: dict[int, list[str]], expected: Sequence[str]) -> int:
    """Line of the header: the one with expected names, else the words right above the rows of numbers."""
    known = {k: len(set(row) & set(expected)) for k, row in cells.items()}
    if max(known.values()) > 0:
        return max(known, key=lambda k: (known[k], -k))
    order = sorted(cells)
    rows = len(order)  # where the rows of numbers begin that go on to the end
    while rows > 0 and any(is_number(cell.replace(",", ".")) for cell in cells[order[rows - 1]]):
        rows -= 1
    if 1 < rows < len(order) and _are_units(cells[order[rows - 1]], len(cells[order[rows - 2]])):
        rows -= 1
    if not 0 < rows < len(order) or len(cells[order[rows - 1]]) != len(cells[order[rows]]):
        return order[0]
    return order[rows - 1]


def _commented_header(lines: Sequence[str], first: int, separator: str, width: int) -> int | None:
    """The last remark above the numbers, where it names as many columns as they have."""
    above = [k for k in range(first) if lines[k].strip()]
    if not above:
        return None
    names = _split(lines[above[-1]].lstrip(' "#%/'), separator)
    return above[-1] if len(names) == width and not any(is_number(name) for name in names) else None


def _are_units(row: Sequence[str], width: int) -> bool:
    """A line below the header that says units: short words and no number."""
    if len(row) != width or any(is_number(cell.replace(",", ".")) for cell in row):
        return False
    return all(re.fullmatch(r"[\[(]?[^\W\d_]{0,4}[-%°µ/²^·*\w]{0,6}[\])]?", cell) for cell in row) and any(
        cell.strip("[]() ") in _UNIT_WORDS for cell in row
    )


_UNIT_WORDS = frozenset(re.split(" ", "s sec ms us µs min h N mN kN lbf m mm cm um µm rad deg ° Nm mNm V mV A mA -"))


def _split(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def is_number(text: str) -> bool:
    """Whether a cell reads as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
