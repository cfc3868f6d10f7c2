"""Form and comparison of the golden set: what a command wrote, short and reviewable, against what is stored.

A table is stored as every k-th row, together with each column's mean, root mean square and largest magnitude over all
rows; a JSON or TOML file as it is, with long lists thinned alike; the arrays in exported code likewise, apart from the
text around them; other texts as they are. Wall clock, version and checksums of arrays are left out.

Processors, math libraries and compilers round differently, so a number is compared within a share of the *scale of its
quantity*: the largest magnitude in its column (list, array), or the floor of its unit where that is larger. Numbers in
texts are compared as numbers too, what is between them as it is. The exact mode, for changes that shall move no result
on one machine, stores everything in full and compares tables and data to 1e-12, texts to the byte.
"""

import csv
import difflib
import io
import itertools
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from pathlib import Path

import numpy as np

ROWS = 40  # of a long column, evenly spread, first and last included
# Share of the scale, at least ten times the largest difference (6e-11) over the environments of `tests/environments.py`
# and processors with and without AVX-512; `test_golden.py` states what amplifies rounding beyond it.
TOLERANCE = 1e-9
SINGLE = 2.5e-7  # of numbers that are written in single precision: two units in the last place
EXACT = 1e-12
TOTALS = ("mean", "rms", "max")
THINNED = "thinned"  # key of the rows of a long list in JSON
COUNTS = frozenset({"iterations"})  # of searches that end at a tolerance: rounding may add one
CLOCKS = frozenset({"build_s", "solve_s", "time_per_simulated_second_s", "tool", "tendonff"})  # and the version

# Least scale of a quantity, by the unit at the end of its name: what is far below it is rounding, not a result.
FLOORS: Mapping[str, float] = {
    "error_N": 10.0,
    "N": 1.0,
    "percent_of_range": 10.0,
    "percent": 10.0,
    "per_s": 1.0,
    "m_per_s": 1e-2,
    "N_per_s": 10.0,
    "m": 1e-2,
    "rad": 1e-2,
    "s": 1.0,
    "dB": 10.0,
    "W": 1.0,
    "matrix": 1.0,  # of correlations
    "likelihood": 1.0,  # its logarithm
}

_NUMBER = re.compile(r"(?<![\w.])(?:(?<![\w)\]])[-+\u2212])?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?=[fF]?(?!\w))")
# Arrays of exported C and of Structured Text.
_ARRAY = re.compile(
    r"(?P<name>\w+)(?P<head>(?:\[[^\]]*\])+ = \{|\s*: ARRAY\[[^\]]*\] OF \w+ := \[)"
    r"(?P<body>[-+\d.eEfF,\s{}]*)(?=[}\]];)"
)
# Columns of numbers of a self test: what they are, and the numbers themselves.
_COLUMN = re.compile(r" {4}/\* (?P<name>[^*]*: [^*]*) \*/\n(?P<body>[^/;{]*)\n")
# Where a self test has its numbers, and which lines of its scripts go to which of them: equal columns are stored once.
_SCRIPT = re.compile(r"(static const \w+ test_(?:lines|numbers)\[\] = \{)[^;]*\};")
# What a self test asks of its drive at random: answers of the machine that exports, not of the model.
_DRIVEN = re.compile(r"static const \w+ drive_(?:expected|tolerance|status)\[[^;]*;\n")
# Digest of all that a unit holds, to the last digit of its numbers.
_TOKEN = re.compile(r'\b(guid|instantiationToken)="[^"]*"')

Leaf = tuple[str, str, object]  # place, column, value
Tolerance = Callable[[str], float]  # share of the scale, by the place


def number(text: str) -> float | None:
    """The number a text is, or None."""
    try:
        return float(text)
    except ValueError:
        return None


def floor_of(name: str) -> float:
    """Least scale of a quantity, by the longest unit that its name ends in."""
    fitting = [unit for unit in FLOORS if name == unit or name.endswith(f"_{unit}")]
    return FLOORS[max(fitting, key=len)] if fitting else 0.0


def totals(values: np.ndarray) -> dict[str, float]:
    """Mean, root mean square and largest magnitude; exactly rounded sums, so that they depend on the numbers alone."""
    known = [float(v) for v in values if math.isfinite(v)]
    count = max(1, len(known))
    return {
        "mean": math.fsum(known) / count,
        "rms": math.sqrt(math.fsum(v * v for v in known) / count),
        "max": max(map(abs, known), default=0.0),
    }


def without_version(text: str) -> str:
    """A text without this version's number."""
    return re.sub(r"\btendonff \d+\.\d+[\w.+]*", "tendonff VERSION", text)


class Form:
    """The stored form of what a command wrote.

    Parameters
    ----------
    exact : bool, optional
        In full, for a comparison on one machine.
    """

    def __init__(self, exact: bool = False) -> None:
        self._rows = None if exact else ROWS
        self._left_out = CLOCKS if exact else CLOCKS | COUNTS
        self._exact = exact

    def _thinned(self, count: int) -> list[int]:
        """Numbers of the rows that are stored."""
        kept = count if self._rows is None else min(count, self._rows)
        return sorted({round(i) for i in np.linspace(0, count - 1, kept)}) if count else []

    def table(self, text: str) -> str:
        """A CSV table as every k-th row and the totals of its columns."""
        header, *rows = list(csv.reader(io.StringIO(text)))
        out = io.StringIO()
        write = csv.writer(out, lineterminator="\n").writerow
        write(["row", *header])
        for i in self._thinned(len(rows)):
            write([i, *rows[i]])
        columns = []
        for column in zip(*rows, strict=True):
            numeric = all(number(cell) is not None or not cell for cell in column)
            columns.append(totals(np.array([float(cell) for cell in column if cell])) if numeric else None)
        for name in TOTALS:
            write([name, *("" if column is None else repr(column[name]) for column in columns)])
        return out.getvalue()

    def _value(self, value: object, left_out: AbstractSet[str]) -> object:
        match value:
            case dict():
                return {k: self._value(v, left_out) for k, v in value.items() if k not in left_out}
            case list() if len(value) > ROWS and all(isinstance(v, int | float) for v in value):
                array = np.array(value, dtype=float)
                kept = [value[i] for i in self._thinned(len(value))]
                return {"rows": len(value), **totals(array), THINNED: kept}
            case list():
                return [self._value(v, left_out) for v in value]
            case str():
                return self.messages(value)
            case _:
                return value

    def data(self, value: object, left_out: AbstractSet[str] = frozenset()) -> str:
        """A JSON or TOML value, its long lists of numbers thinned."""
        return json.dumps(self._value(value, left_out | self._left_out), indent=1, ensure_ascii=False) + "\n"

    def file(self, file: Path, left_out: AbstractSet[str] = frozenset()) -> str:
        """A JSON or TOML file."""
        text = file.read_text(encoding="utf-8")
        return self.data(tomllib.loads(text) if file.suffix == ".toml" else json.loads(text), left_out)

    def messages(self, text: str) -> str:
        """A text without version, clock and counts of iterations, with what is only rounding as `tiny`.

        Nor does it say that there is no compiler.
        """
        text = re.sub(r"^.*Results are the same, several times slower\n", "", without_version(text), flags=re.MULTILINE)
        text = re.sub(r"iterations, [\d.]+ s\b", "iterations, TIME s", text)
        if not self._exact:
            text = re.sub(r"\b\d+ iterations\b", "SOME iterations", text)
        return re.sub(r" *\b\d(\.\d+)?e-(09|[1-9]\d)\b", " tiny", text)

    def code(self, text: str) -> str:
        """An exported text without its arrays, and without the lines of a self test that say where they are."""
        text = _DRIVEN.sub("", without_version(text))
        if self._exact:
            return text
        text = _TOKEN.sub(r'\1="TOKEN"', text)
        return _ARRAY.sub(lambda m: f"{m['name']}{m['head']} NUMBERS ", _SCRIPT.sub(r"\1 NUMBERS };", text))

    def arrays(self, folder: Path) -> str:
        """Every array of numbers in the exported code of a folder: count, totals, every k-th number."""
        found: dict[str, object] = {}
        for file in sorted(f for f in folder.rglob("*") if f.suffix in {".c", ".h", ".st"}):
            text = _DRIVEN.sub("", file.read_text(encoding="utf-8"))
            for match in itertools.chain(_ARRAY.finditer(text), _COLUMN.finditer(text)):
                values = [float(cell) for cell in _NUMBER.findall(match["body"])]
                name = f"{file.name} {match['name']}"
                while name in found:  # the same name in another function
                    name += "'"
                array = np.array(values)
                kept = [values[i] for i in self._thinned(len(values))]
                found[name] = {"rows": len(values), **totals(array), THINNED: kept}
        return json.dumps(found, indent=1) + "\n"


def leaves(value: object, alone: bool, path: str = "", key: str = "") -> Iterator[Leaf]:
    """Path, column and value of everything in a JSON value.

    The column is the last key, or with `alone` the path, so that every number is judged by its own magnitude.
    """
    match value:
        case dict():
            for k, v in value.items():
                total = THINNED in value and k in (*TOTALS, THINNED)
                yield from leaves(v, alone, f"{path}.{k}" if path else k, key if total else k)
        case list():
            for i, v in enumerate(value):
                yield from leaves(v, alone, f"{path}[{i}]", key)
        case _:
            yield path, f"{path} {key}" if alone else key, value


def cells(text: str) -> Iterator[Leaf]:
    """Path, column and value of every cell of a stored table."""
    header, *rows = list(csv.reader(io.StringIO(text)))
    for row in rows:
        for name, cell in zip(header, row, strict=True):
            value = number(cell)
            yield f"row {row[0]}, column {name}", name, cell if value is None or name == "row" else value


def differences(old: Iterator[Leaf], new: Iterator[Leaf], share: Tolerance, floors: bool = True) -> list[str]:
    """Lines of what differs: place, old, new and the difference relative to the scale of the quantity."""
    was, now = list(old), list(new)
    largest: dict[str, float] = {}
    for _, column, value in was:
        if isinstance(value, float) and math.isfinite(value):
            least = floor_of(column.rpartition(" ")[2]) if floors else 0.0
            largest[column] = max(largest.get(column, least), abs(value))
    before, after = {p: (c, v) for p, c, v in was}, {p: v for p, _, v in now}
    lines = [f"{p}: {before[p][1]!r} is gone" for p in before if p not in after]
    lines += [f"{p}: {after[p]!r} is new" for p in after if p not in before]
    for place, (column, value) in before.items():
        if place not in after:
            continue
        other = after[place]
        if isinstance(value, float) and isinstance(other, int | float) and not isinstance(other, bool):
            scale, most = largest.get(column, 0.0), share(place)
            if value == other or (math.isnan(value) and math.isnan(other)):
                continue
            relative = abs(value - other) / scale if scale else math.inf
            if not relative <= most:
                lines.append(f"{place}: {value!r} -> {other!r}, relative difference {relative:.2e} > {most:.0e}")
        elif isinstance(value, str) and isinstance(other, str):
            if not same_text(value, other, share(place)):
                lines.append(f"{place}: {value!r} -> {other!r}")
        elif value != other:
            lines.append(f"{place}: {value!r} -> {other!r}")
    return lines


def _last_place(written: str) -> float | None:
    """A unit in the last digit of a rounded decimal; None of a whole number, and of fewer digits than three.

    Those are compared as they are: that they fall on the other side of an edge by rounding is next to impossible, and
    a unit of them would be a large share of the number.
    """
    mantissa, _, exponent = written.lower().lstrip("-+\u2212").partition("e")
    if "." not in mantissa and not exponent:
        return None
    digits = mantissa.replace(".", "").lstrip("0")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals) if len(digits) >= 3 else None


def same_text(old: str, new: str, share: float) -> bool:
    """Whether two texts are equal up to the rounding of the numbers in them."""
    if old == new:
        return True
    if not share or _NUMBER.split(old) != _NUMBER.split(new):
        return False
    for was, now in zip(_NUMBER.findall(old), _NUMBER.findall(new), strict=True):
        if was == now:
            continue
        a, b = (float(n.replace("\u2212", "-")) for n in (was, now))
        units = [unit for n in (was, now) if (unit := _last_place(n)) is not None]
        if not units or abs(a - b) > 1.001 * max(units) + share * max(abs(a), abs(b)):
            return False
    return True


def text_differences(old: str, new: str, share: float) -> list[str]:
    """Lines that differ by more than the rounding of the numbers in them."""
    was, now = old.splitlines(), new.splitlines()
    if len(was) == len(now):  # what is the same up to rounding shall not be shown
        now = [o if same_text(o, n, share) else n for o, n in zip(was, now, strict=True)]
    return list(difflib.unified_diff(was, now, "stored", "now", lineterm="", n=0))


def compared(name: str, old: str, new: str, share: Tolerance, *, alone: bool = False, exact: bool = False) -> list[str]:
    """Lines of what differs between a stored file and what is written now."""
    if old == new:
        return []
    if name.endswith(".csv"):
        return differences(cells(old), cells(new), share, not exact)
    if name.endswith(".json"):
        return differences(leaves(json.loads(old), alone), leaves(json.loads(new), alone), share, not exact)
    return text_differences(old, new, 0.0 if exact else share(""))
