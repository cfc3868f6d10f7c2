"""Result of a sweep, and its rows on disk while it runs, so that a killed sweep resumes."""

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from tendonff.compensator.compensators.every import AnyCompensator, AnyScenario, compensator_of
from tendonff.compensator.compensators.expectation import Expectation, two_digits
from tendonff.compensator.compensators.next_step import next_step
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.text import as_argument
from tendonff.compensator.files.writing import atomic_file
from tendonff.compensator.reporting.results import Result
from tendonff.models.parameters.numbers import FACTORS

YIELD_PERCENT = (0.5, 1.0, 2.0, 5.0, 10.0)  # errors whose yields are reported [% of range]

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95, 1.0)


def key_label(key: str) -> str:
    """A varied key as figures and tables name it."""
    return f"factor on {key.replace('_', ' ')}" if key in FACTORS else key


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """Unit and the score of every compensator on it."""

    index: int
    values: tuple[float, ...]  # of the varied keys
    # of each compensator: RMS error [% of range], and largest error in the unit of the reference; NaN where it failed
    percent: tuple[float, ...]
    peak: tuple[float, ...]


# key, low value, high value, and every compensator's error at both with all else nominal [% of range]
Cost = tuple[str, float, float, tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Sweep(Result):
    """Scores over units."""

    shown_by: ClassVar[str] = "studies.design.sweep.output"

    scenario: AnyScenario
    options: str  # options of the command, in words
    keys: tuple[str, ...]  # varied keys of the scenario, or factors on its parameters
    compensators: tuple[str, ...]
    rows: tuple[Row, ...]  # in the order of their index
    # of the nominal scenario's profiles, on units drawn from its uncertainty; None for a grid, where every point has
    # profiles of its own
    expectation: Expectation | None

    @property
    def known(self) -> dict[str, AnyCompensator]:
        """The compensators by their names."""
        return {name: compensator_of(self.scenario, name) for name in self.compensators}

    @property
    def is_random(self) -> bool:
        """Units drawn from the uncertainty: the profiles are those of the nominal scenario."""
        return self.expectation is not None

    @property
    def budget(self) -> tuple[Cost, ...]:
        """Errors at both ends of each interval alone; empty for a grid."""
        found = self.expectation
        if found is None:
            return ()

        def at(sample: int) -> tuple[float, ...]:
            return tuple(found.bands[name].scores[sample].rmse_percent_of_range for name in self.compensators)

        costs: list[Cost] = []
        for k, spread in enumerate(found.doubt.spreads):
            low, high = found.doubt.ends(k)
            first, last = (found.doubt.samples[end].numbers[spread.keys[0]] for end in (low, high))
            costs.append((spread.name, first, last, at(low), at(high)))
        return tuple(costs)

    def percent(self, name: str) -> FloatArray:
        """Errors of a compensator, infinite where it failed [% of range]."""
        column = self.compensators.index(name)
        errors: FloatArray = np.nan_to_num(np.array([row.percent[column] for row in self.rows]), nan=np.inf)
        return errors

    def yield_of(self, name: str, percent: float) -> float:
        """Share of the units on which the error stays below a bound [% of range] [-]."""
        return float(np.mean(self.percent(name) < percent))

    def quantiles(self, name: str) -> tuple[float, ...]:
        """Errors that so many of the units stay within, at `QUANTILES` [% of range]."""
        return tuple(float(q) for q in np.quantile(self.percent(name), QUANTILES, method="inverted_cdf"))

    @property
    def headline(self) -> str:
        """Expected error, in two sentences."""
        best = min(self.compensators, key=lambda name: self.quantiles(name)[-1])
        if self.expectation is not None:
            best = self.expectation.recommended
        *_, most, worst = (max(q, 1e-3) for q in self.quantiles(best))
        label = self.known[best].label
        if self.expectation is None:
            return (
                f"RMS error of up to {two_digits(worst)} % of range over {len(self.rows)} points, best profile: "
                f"{label}. Every profile knows the parameters of its point; on a rig their uncertainty adds to that."
            )
        file = as_argument(self.scenario.source)
        then = next_step(self.expectation, file, f"tendonff export-c {file} --out c")
        other, law = self.expectation.bands[best].other, ""
        if other is not None:
            law = f"No unit has the law of [robust.other_law]: {two_digits(other.rmse_percent_of_range)} % with it. "
        return (
            f"95 % of {len(self.rows)} units drawn from the uncertainty have an RMS error below {two_digits(most)} % "
            f"of range with the {label}, {100 * self.yield_of(best, 1.0):.0f} % below 1 %. {law}"
            f"{self.expectation.headline(label, then)}"
        )

    def write(self, folder: str | os.PathLike[str], *, parquet: bool = False, pdf: bool = False) -> None:
        """Write `samples.csv` (and `samples.parquet`), `summary.json`, figures and `report.html`, all or nothing; makes
        the folder.
        """
        self._views.write(self, folder, parquet=parquet, pdf=pdf)


_PLAN, _ROWS = "sweep.json", "rows.partial.csv"


def kept_rows(folder: Path) -> int:
    """Number of rows that a sweep which was stopped has left in its folder."""
    path = folder / _ROWS
    return path.read_text(encoding="utf-8").count("\n") if path.exists() else 0


class Store:
    """The rows that are done, in a folder, made with the first; one that holds rows of another plan is refused."""

    def __init__(self, folder: Path, plan: dict[str, object]) -> None:
        self._path, self._plan = folder / _ROWS, plan
        file = folder / _PLAN
        if file.exists():
            if kept_rows(folder) and json.loads(file.read_text(encoding="utf-8")) != json.loads(json.dumps(plan)):
                raise InputError(f"{folder} holds another sweep; choose another --out, or delete it")
        elif folder.exists() and any(folder.iterdir()):
            raise InputError(f"{folder} is not empty and holds no sweep; choose another --out")

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
            rows[int(index)] = Row(index=int(index), values=values[:width], percent=scores[:half], peak=scores[half:])
        return rows

    def add(self, rows: Iterable[Row]) -> None:
        """Append rows, on disk before it returns."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        if not kept_rows(self._path.parent):
            with atomic_file(self._path.parent / _PLAN) as partial:
                partial.write_text(json.dumps(self._plan, indent=2) + "\n", encoding="utf-8")
        if self._path.exists():  # what was cut off goes
            text = self._path.read_text(encoding="utf-8")
            if not text.endswith("\n"):
                self._path.write_text(text[: text.rfind("\n") + 1], encoding="utf-8")
        with self._path.open("a", encoding="utf-8") as stream:
            for row in rows:
                stream.write(",".join([str(row.index), *map(repr, (*row.values, *row.percent, *row.peak))]) + "\n")
            stream.flush()
            os.fsync(stream.fileno())
