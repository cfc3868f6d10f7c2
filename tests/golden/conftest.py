"""The golden set's fixture: what a command wrote, in a short and reviewable form, against what is stored.

A table is stored as every k-th row, together with each column's sum, root mean square and largest magnitude over all
rows; a JSON or TOML file as it is, with long lists thinned alike; the arrays in exported C as a hash of all their bits
and every k-th number; other texts as they are. What a clock or the version says is left out.
"""

import csv
import difflib
import hashlib
import io
import json
import math
import re
import shutil
import tomllib
from collections.abc import Callable, Iterator
from collections.abc import Set as AbstractSet
from pathlib import Path

import numpy as np
import pytest

STORED = Path(__file__).resolve().parent / "stored"
ROWS = 40  # of a long column, evenly spread, first and last included
TOLERANCE = 1e-12  # of the largest magnitude in the column
ALWAYS_LEFT_OUT = {"build_s", "solve_s", "time_per_simulated_second_s", "tool", "tendonff"}  # wall clock and version
TOTALS = ("sum", "rms", "max")
THINNED = "thinned"  # key of the rows of a long list in JSON

Leaf = tuple[str, str, object]  # place, column, value


def thinned(count: int) -> list[int]:
    """Numbers of the rows that are stored."""
    return sorted({round(i) for i in np.linspace(0, count - 1, min(count, ROWS))}) if count else []


def number(text: str) -> float | None:
    """The number a text is, or None."""
    try:
        return float(text)
    except ValueError:
        return None


def totals(values: np.ndarray) -> dict[str, float]:
    """Sum, root mean square and largest magnitude; exactly rounded sums, so that they depend on the numbers alone."""
    known = [float(v) for v in values if math.isfinite(v)]
    squares = math.fsum(v * v for v in known)
    return {
        "sum": math.fsum(known),
        "rms": math.sqrt(squares / max(1, len(known))),
        "max": max(map(abs, known), default=0.0),
    }


def without_version(text: str) -> str:
    """A text without this version's number."""
    return re.sub(r"\btendonff \d+\.\d+[\w.+]*", "tendonff VERSION", text)


def plain(text: str) -> str:
    """A text without version and clock, and with what is only rounding (below 1e-9) as `tiny`."""
    text = without_version(text)
    text = re.sub(r"iterations, [\d.]+ s\b", "iterations, TIME s", text)
    return re.sub(r"\b\d(\.\d+)?e-(09|[1-9]\d)\b", "tiny", text)


def short_table(text: str) -> str:
    """A CSV table as every k-th row and the totals of its columns."""
    header, *rows = list(csv.reader(io.StringIO(text)))
    numeric = [all(number(cell) is not None or not cell for cell in column) for column in zip(*rows, strict=True)]
    out = io.StringIO()
    write = csv.writer(out, lineterminator="\n").writerow
    write(["row", *header])
    for i in thinned(len(rows)):
        write([i, *rows[i]])
    columns = [
        totals(np.array([float(cell) for cell in column if cell])) if is_number else None
        for column, is_number in zip(zip(*rows, strict=True), numeric, strict=True)
    ]
    for name in TOTALS:
        write([name, *("" if column is None else repr(column[name]) for column in columns)])
    return out.getvalue()


def short_value(value: object, left_out: AbstractSet[str]) -> object:
    """A JSON value without clock and version, its long lists of numbers thinned."""
    match value:
        case dict():
            return {k: short_value(v, left_out) for k, v in value.items() if k not in left_out}
        case list() if len(value) > ROWS and all(isinstance(v, int | float) for v in value):
            array = np.array(value, dtype=float)
            return {"rows": len(value), **totals(array), THINNED: [value[i] for i in thinned(len(value))]}
        case list():
            return [short_value(v, left_out) for v in value]
        case str():
            return plain(value)
        case _:
            return value


def short_json(value: object, left_out: AbstractSet[str]) -> str:
    """A JSON value in its stored form."""
    return json.dumps(short_value(value, left_out), indent=1, ensure_ascii=False) + "\n"


def arrays(folder: Path, solved: AbstractSet[str]) -> str:
    """Every array of numbers in the C files of a folder: count, hash of all its bits, every k-th number.

    Spelling and layout of the numbers do not matter, only the values. Those in `solved` are stored as numbers that are
    compared with a tolerance.
    """
    found: dict[str, object] = {}
    for file in sorted(folder.glob("*.[ch]")):
        for name, body in re.findall(r"(\w+)\[[^\]]*\] = \{([^{}]*)\}", file.read_text(encoding="utf-8")):
            values = [number(cell.strip().rstrip("fF")) for cell in body.split(",") if cell.strip()]
            known = [v for v in values if v is not None]
            if len(known) < len(values) or not values:
                continue  # rows of names, not numbers
            if name in solved:
                found[f"{file.name} {name}"] = short_value(known, set())
                continue
            found[f"{file.name} {name}"] = {
                "count": len(known),
                "sha256_of_hex": hashlib.sha256(" ".join(v.hex() for v in known).encode()).hexdigest(),
                "thinned": " ".join(repr(known[i]) for i in thinned(len(known))),
            }
    return json.dumps(found, indent=1) + "\n"


def leaves(value: object, alone: bool, path: str = "", key: str = "") -> Iterator[Leaf]:
    """Path, column and value of everything in a JSON value.

    The column is the last key, or with `alone` the path, so that every number is judged by its own magnitude.
    """
    match value:
        case dict():
            for k, v in value.items():
                total = THINNED in value and k in (*TOTALS, THINNED)
                column = k if not total else f"sum of {key}" if k == "sum" else key
                yield from leaves(v, alone, f"{path}.{k}" if path else k, column)
        case list():
            for i, v in enumerate(value):
                yield from leaves(v, alone, f"{path}[{i}]", key)
        case _:
            yield path, path if alone else key, value


def cells(text: str) -> Iterator[Leaf]:
    """Path, column and value of every cell of a stored table."""
    header, *rows = list(csv.reader(io.StringIO(text)))
    for row in rows:
        for name, cell in zip(header, row, strict=True):
            value = number(cell)
            # A sum grows with the rows and has a column of its own; names of rows are text.
            column = f"sum of {name}" if row[0] == "sum" else name
            yield f"row {row[0]}, column {name}", column, cell if value is None or name == "row" else value


def differences(old: Iterator[Leaf], new: Iterator[Leaf], share: float) -> list[str]:
    """What differs, a line each: place, old, new and the difference relative to the column's largest magnitude."""
    was, now = list(old), list(new)
    largest: dict[str, float] = {}
    for _, column, value in was:
        if isinstance(value, float) and math.isfinite(value):
            largest[column] = max(largest.get(column, 0.0), abs(value))
    before, after = {p: (c, v) for p, c, v in was}, {p: v for p, _, v in now}
    lines = [f"{p}: {before[p][1]!r} is gone" for p in before if p not in after]
    lines += [f"{p}: {after[p]!r} is new" for p in after if p not in before]
    for place, (column, value) in before.items():
        if place not in after:
            continue
        other = after[place]
        if isinstance(value, float) and isinstance(other, int | float) and not isinstance(other, bool):
            scale = largest.get(column, 0.0)
            if value == other or (math.isnan(value) and math.isnan(other)):
                continue
            relative = abs(value - other) / scale if scale else math.inf
            if not relative <= share:
                lines.append(f"{place}: {value!r} -> {other!r}, relative difference {relative:.2e} > {share:.0e}")
        elif value != other:
            lines.append(f"{place}: {value!r} -> {other!r}")
    return lines


class Golden:
    """The stored files of one example and command.

    Parameters
    ----------
    folder : Path
        Where they are.
    update : bool
        Write them anew instead of comparing.
    """

    def __init__(self, folder: Path, update: bool) -> None:
        self._folder, self._update = folder, update
        self._fresh: dict[str, str] = {}
        self._share: dict[str, float] = {}
        self._alone: set[str] = set()

    def table(self, file: Path, share: float = TOLERANCE) -> None:
        """Add a CSV table.

        Parameters
        ----------
        file : Path
        share : float, optional
            Tolerance as a share of a column's largest magnitude.
        """
        self._add(file.name, short_table(file.read_text(encoding="utf-8")), share)

    def data(
        self, file: Path, left_out: frozenset[str] = frozenset(), share: float = TOLERANCE, alone: bool = False
    ) -> None:
        """Add a JSON or TOML file.

        Parameters
        ----------
        file : Path
        left_out : frozenset of str, optional
            Keys that are not stored.
        share : float, optional
            Tolerance as a share of the largest magnitude under the same key.
        alone : bool, optional
            Judge every number by its own magnitude, where one key holds several quantities.
        """
        text = file.read_text(encoding="utf-8")
        value = tomllib.loads(text) if file.suffix == ".toml" else json.loads(text)
        self._add(f"{file.stem}.json", short_json(value, left_out | ALWAYS_LEFT_OUT), share)
        if alone:
            self._alone.add(f"{file.stem}.json")

    def text(self, name: str, text: str) -> None:
        """Add a text as it is, without the version."""
        self._add(name, without_version(text), 0.0)

    def messages(self, text: str) -> None:
        """Add what the command printed."""
        self._add("messages.txt", plain(text), 0.0)

    def arrays(self, folder: Path, solved: AbstractSet[str] = frozenset(), share: float = TOLERANCE) -> None:
        """Add every array in exported C, to the bit; those in `solved` within a share of their largest magnitude."""
        self._add("arrays.json", arrays(folder, solved), share)

    def _add(self, name: str, text: str, share: float) -> None:
        assert name not in self._fresh, f"{name} was added twice"
        self._fresh[name], self._share[name] = text, share

    def settle(self) -> list[str]:
        """Compare with what is stored, or store; returns what differs."""
        if self._update:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder.mkdir(parents=True)
            for name, text in self._fresh.items():
                (self._folder / name).write_text(text, encoding="utf-8", newline="\n")
            return []
        stored = {f.name: f.read_text(encoding="utf-8") for f in self._folder.glob("*")}
        place = self._folder.relative_to(STORED)
        lines = [f"{place}/{name}: stored, but no longer written" for name in stored if name not in self._fresh]
        for name, text in self._fresh.items():
            if name not in stored:
                lines.append(f"{place}/{name}: not stored yet")
            elif text != stored[name]:
                found = self._compared(name, stored[name], text)
                lines += [f"{place}/{name}: {line}" for line in found[:20]]
                if len(found) > 20:
                    lines.append(f"{place}/{name}: and {len(found) - 20} more")
        return lines

    def _compared(self, name: str, old: str, new: str) -> list[str]:
        share = self._share[name]
        if name.endswith(".csv"):
            return differences(cells(old), cells(new), share)
        if name.endswith(".json"):
            alone = name in self._alone
            return differences(leaves(json.loads(old), alone), leaves(json.loads(new), alone), share)
        return list(difflib.unified_diff(old.splitlines(), new.splitlines(), "stored", "now", lineterm="", n=0))


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Iterator[Callable[[str], Golden]]:
    """The stored files `example/command`, compared (or written, with `--golden-update`) as the test ends."""
    opened: list[Golden] = []

    def of(place: str) -> Golden:
        opened.append(Golden(STORED / place, request.config.getoption("--golden-update")))
        return opened[-1]

    yield of
    lines = [line for each in opened for line in each.settle()]
    if lines:
        pytest.fail(
            "differs from the golden set (--golden-update stores what is written now):\n" + "\n".join(lines),
            pytrace=False,
        )
