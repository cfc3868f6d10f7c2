"""Designs of several scenarios, a whole hand: one report over all of them."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from matplotlib.figure import Figure

from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.files.notices import Danger
from tendonff.compensator.files.text import InputError, as_argument
from tendonff.compensator.files.writing import atomic_directory
from tendonff.compensator.reporting.colours import BLUE, INK
from tendonff.compensator.reporting.page import (
    Cell,
    FileNote,
    Provenance,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
    write_pages,
)
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure
from tendonff.compensator.studies.design.motors.result import MotorDesign
from tendonff.compensator.studies.design.result import Design

AnyDesign: TypeAlias = Design | MotorDesign


@dataclass(frozen=True, slots=True, kw_only=True)
class Designs:
    """Designs of several scenarios.

    Attributes
    ----------
    results : dict of str to Design or MotorDesign
        By the stem of the scenario's file, which is the folder of the result too.
    """

    results: Mapping[str, AnyDesign]

    @property
    def worst(self) -> str:
        """Stem of the scenario with the largest error, in % of its range."""
        return max(self.results, key=lambda name: self.results[name].expectation.best.worst.rmse_percent_of_range)

    @property
    def headline(self) -> str:
        """The largest error of all, and the next step there."""
        worst = self.results[self.worst]
        return f"{len(self.results)} scenarios; the largest error is that of {self.worst}. {worst.headline}"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Dangers of every scenario, with its name; other warnings are in its own report."""
        return tuple(
            Danger(f"{name}: {note}")
            for name, result in self.results.items()
            for note in result.warnings
            if isinstance(note, Danger)
        )

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write a folder for each scenario and `report.html` over all, all or nothing; makes the folder."""
        figures = {"errors": _errors_figure(self)}
        with atomic_directory(folder) as partial:
            for name, result in self.results.items():
                result.write(partial / name, pdf=pdf)
            summary = {"schema": 1, "scenarios": {name: _summary(result) for name, result in self.results.items()}}
            write_pages(partial, summary, figures, _report(self, figures), pdf=pdf)


def require_different(stems: Sequence[str]) -> None:
    """Refuse two scenarios whose files have the same name: each gets a folder of that name."""
    if twice := [stem for stem in stems if stems.count(stem) > 1]:
        raise InputError(f"two scenarios are called {twice[0]}.toml; each gets a folder of its name: rename one")


def _summary(result: AnyDesign) -> dict[str, object]:
    found, unit = result.expectation, result.expectation.unit
    worst = {f"rmse_{unit.key}": found.best.worst.rmse, f"peak_{unit.key}": found.best.worst_peak}
    worst["rmse_percent_of_range"] = found.best.worst.rmse_percent_of_range
    return {
        "scenario": result.scenario.name,
        "scenario_hash": result.scenario.digest(),
        "recommended": result.recommended.name,
        **{key: value if math.isfinite(value) else None for key, value in worst.items()},
        "headline": result.headline,
        "warnings": len(result.warnings),
    }


def _errors_figure(designs: Designs) -> Figure:
    """Worst and nominal error of each scenario."""
    with figure_style():
        figure, axes = new_figure(1, 1, height_in=1.2 + 0.24 * len(designs.results))
        panel, names = axes[0, 0], list(designs.results)[::-1]
        bands = [designs.results[name].expectation.best for name in names]
        worst = [band.worst.rmse_percent_of_range for band in bands]
        panel.barh(names, [value if math.isfinite(value) else 0.0 for value in worst], color=BLUE, label="worst case")
        nominal = [band.nominal.rmse_percent_of_range for band in bands]
        panel.plot(nominal, names, "|", color=INK, markersize=10, label="nominal parameters")
        panel.set(xlabel="RMS error [% of range]", xlim=(0, None), ylim=(-0.6, len(names) - 0.4))
        legend_below(figure, panel, columns=2)
        return figure


def _report(designs: Designs, figures: dict[str, Figure]) -> Report:
    rows: list[tuple[Cell, ...]] = []
    for name, result in designs.results.items():
        found, unit = result.expectation, result.expectation.unit
        rmse, peak = (two_digits(unit.factor * v) for v in (found.best.worst.rmse, found.best.worst_peak))
        percent = two_digits(found.best.worst.rmse_percent_of_range)
        errors = (f"{rmse} {unit.shown}", percent, f"{peak} {unit.shown}")
        rows.append((name, *errors, result.recommended.label, found.contributions[0].key, str(len(result.warnings))))
    table = Table(
        caption="Worst case over what is uncertain, with the recommended profile of each",
        columns=("scenario", "RMS error", "% of range", "peak", "profile", "largest contribution", "warnings"),
        rows=rows,
    )
    pictures = pictures_of(figures, {"errors": "Worst RMS error of each scenario, and with its own parameters."})
    headlines = tuple(Text(f"{name}: {result.headline}") for name, result in designs.results.items())
    scenarios = [result.scenario for result in designs.results.values()]
    files = " ".join(as_argument(scenario.source) for scenario in scenarios)
    return Report(
        title=f"Design of {len(scenarios)} scenarios",
        summary=designs.headline,
        warnings=designs.warnings,
        sections=(
            Section(title="What to expect", blocks=(pictures["errors"], table)),
            Section(title="Each scenario", blocks=headlines),
        ),
        provenance=Provenance(
            scenario=scenarios[0],
            command=f"tendonff design {files} --out DIR",
            inputs=[scenario.source for scenario in scenarios[1:]],
        ),
        files=[
            *(FileNote(name=f"{name}/report.html", content=f"the report of {name}") for name in designs.results),
            *(FileNote(name=f"{name}/profile.csv", content=f"the profiles of {name}") for name in designs.results),
            FileNote(name="summary.json", content="errors of all for other programs"),
        ],
    )
