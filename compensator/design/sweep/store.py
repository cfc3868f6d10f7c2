"""Rows on disk while a sweep runs, so that one that was killed goes on where it stopped."""

import json
import os
from collections.abc import Iterable
from pathlib import Path

from tendonff.compensator.design.sweep.result import Row
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import atomic_file

_PLAN, _ROWS = "sweep.json", "rows.partial.csv"


class Store:
    """The rows that are done, in a folder, which is made; one that holds another plan is refused."""

    def __init__(self, folder: Path, plan: dict[str, object]) -> None:
        self._path = folder / _ROWS
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / _PLAN
        if file.exists():
            if json.loads(file.read_text(encoding="utf-8")) != json.loads(json.dumps(plan)):
                raise InputError(f"{folder} holds another sweep; choose another --out, or delete it")
        elif any(folder.iterdir()):
            raise InputError(f"{folder} is not empty and holds no sweep; choose another --out")
        else:
            with atomic_file(file) as partial:
                partial.write_text(json.dumps(plan, indent=2) + "\n", encoding="utf-8")

    def read(self, width: int) -> dict[int, Row]:
        """The rows done so far, of so many varied keys, by index; a last line that was cut off does not count."""
        if not self._path.exists():
            return {}
        rows = {}
        text = self._path.read_text(encoding="utf-8")
        for line in text[: text.rfind("\n") + 1].splitlines():
            index, *numbers = line.split(",")
            values = tuple(float(number) for number in numbers)
            scores = values[width:]
            half = len(scores) // 2
            rows[int(index)] = Row(index=int(index), values=values[:width], percent=scores[:half], peak_N=scores[half:])
        return rows

    def add(self, rows: Iterable[Row]) -> None:
        """Append rows, on disk before it returns."""
        if self._path.exists():  # what was cut off goes
            text = self._path.read_text(encoding="utf-8")
            if not text.endswith("\n"):
                self._path.write_text(text[: text.rfind("\n") + 1], encoding="utf-8")
        with self._path.open("a", encoding="utf-8") as stream:
            for row in rows:
                stream.write(",".join([str(row.index), *map(repr, (*row.values, *row.percent, *row.peak_N))]) + "\n")
            stream.flush()
            os.fsync(stream.fileno())
