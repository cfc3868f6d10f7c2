"""Result of `watch`, and the files that it writes."""

import math
import os
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.files.text import as_argument
from tendonff.compensator.files.writing import atomic_directory, write_csv
from tendonff.compensator.identification.answer.estimate import unit_of
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.reporting.colours import BLUE, GREY, INK, ORANGE, VERMILION
from tendonff.compensator.reporting.page import (
    FileNote,
    Provenance,
    Report,
    Section,
    Table,
    pictures_of,
    summary_head,
    write_pages,
)
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure
from tendonff.compensator.reporting.results import Result, Views
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.studies.watch.chart import LONGEST_S, Alarm, Course, clock
from tendonff.compensator.studies.watch.windows import WATCHED, Window

_CAPTIONS = {
    "history": "Friction, pre-tension and gear friction over those of the first minutes, each window of use with its "
    "95 % band; dotted: the change that is looked for; vertical lines: files.",
    "test": "Sum of the sequential test over the one that raises the alarm.",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Watch(Result):
    """Drift of a joint over its use.

    Attributes
    ----------
    scenario : JointScenario
        The joint that is watched.
    windows : tuple of Window
        Stretches of use, in order.
    courses : tuple of Course
        One for each number that is watched; empty where no window identifies anything.
    inputs : tuple of Path
        The logs.
    accepted : tuple of str
        Values that look like another unit and are right, as the user says.
    """

    shown_by: ClassVar[str] = "studies.watch.output"

    scenario: JointScenario
    windows: tuple[Window, ...]
    courses: tuple[Course, ...]
    inputs: tuple[Path, ...]
    accepted: tuple[str, ...] = ()

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """Changes that were found, the first one first."""
        found = [course.alarm for course in self.courses if course.alarm is not None]
        return tuple(sorted(found, key=lambda alarm: alarm.used_s))

    @property
    def headline(self) -> str:
        """The answer in a sentence."""
        if not self.courses:
            reasons = Counter(w.why for w in self.windows)
            return f"No window of these files tells anything: {reasons.most_common(1)[0][0]}."
        if self.alarms:
            return "Alarm: " + "; ".join(alarm.sentence for alarm in self.alarms) + "."
        last = ", ".join(f"{c.drift.label} {100 * (_late(c) - 1):+z.0f} ±{100 * _band(c):.0f} %" for c in self.courses)
        over = f"over {clock(self.windows[-1].used_s)} of use"
        if missing := self._not_shown:
            return f"No alarm {over}, but {missing} Last windows: {last}, against the first minutes."
        return f"No drift {over}: {last}, against the first minutes."

    @property
    def _not_shown(self) -> str:
        """Changes that these logs cannot show, and what would; empty where they show all."""
        blind = [c for c in self.courses if not c.shown]
        if not blind:
            return ""
        looked = " or ".join(f"{c.drift.label} {100 * c.drift.change:+.0f} % ({_use(c)})" for c in blind)
        return (
            f"these logs cannot show {looked}: slow pushes against a stop in each log (identify --suggest) show most."
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Messages for the user."""
        silent = [w for w in self.windows if not w.values]
        found = [*self.accepted, *([self._not_shown] if self.alarms and self._not_shown else [])]
        if not _states_mu(self.scenario):
            found.insert(0, _NOT_IDENTIFIED.format(file=self.scenario.source.name))
        if silent and len(silent) < len(self.windows):
            why = Counter(w.why for w in silent).most_common(1)[0][0]
            found.append(f"{len(silent)} of {len(self.windows)} windows are left out, most because {why}")
        return tuple(found)

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `watch.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder."""
        figures = watch_figures(self)
        with atomic_directory(folder) as partial:
            write_csv(partial / "watch.csv", _columns(self))
            write_pages(partial, self._summary(), figures, watch_report(self, figures), pdf=pdf)

    def _summary(self) -> dict[str, object]:
        return {
            **summary_head(self.scenario),
            "used_s": self.windows[-1].used_s if self.windows else 0.0,
            "windows": len(self.windows),
            "windows_that_tell": sum(bool(w.values) for w in self.windows),
            "alarms": [
                {
                    "key": str(a.drift.number),
                    "change": a.change,
                    "since_s": a.since_s,
                    "used_s": a.used_s,
                    "file": a.name,
                    "text": a.sentence,
                }
                for a in self.alarms
            ],
            "watched": {
                str(c.drift.number): {
                    "first": c.base,
                    "last_over_first": _late(c),
                    "half_band": _band(c),
                    "looked_for": c.drift.change,
                    "shown": c.shown,
                    "sure_after_s": c.sure_s if math.isfinite(c.sure_s) else None,
                }
                for c in self.courses
            },
            "warnings": list(self.warnings),
        }


_NOT_IDENTIFIED = (
    "{file}: its numbers were not identified on this joint ([robust] states no interval of mu_dynamic), and what watch "
    "takes as known may be wrong; run tendonff identify first, and watch its fitted.toml"
)


def _states_mu(scenario: JointScenario) -> bool:
    """Whether the scenario states an interval of friction, as identification writes it."""
    keys = {key for spread in scenario.robust.spread for key in spread.keys}
    return scenario.robust.mu > 0 or any(key.endswith(Parameter.MU.spec.key) for key in keys)


def _late(course: Course) -> float:
    """Value over the base in the last windows."""
    return float(np.median(course.ratio[-5:]))


def _use(course: Course) -> str:
    """Use after the first minutes that would show a change."""
    if math.isfinite(course.sure_s):
        return f"{clock(course.sure_s)} of such use would"
    return f"{clock(LONGEST_S)} of such use would not"


def _band(course: Course) -> float:
    """Half a 95 % band of the last windows, as a share."""
    return float(np.median(course.high[-5:] / np.maximum(course.ratio[-5:], 1e-300) - 1))


def _columns(found: Watch) -> dict[str, np.ndarray]:
    """Watched numbers of each window; not a number where the logs cannot show a change.

    Free strokes tell the product of friction and pre-tension. What each is then comes from how the law departs from
    the rig, which is in no band.
    """
    fitted = [w for w in found.windows if w.values]
    names = [path.name for path in found.inputs]
    columns = {
        "used_s": np.array([w.used_s for w in fitted]),
        "file": np.array([float(names.index(w.name) + 1) for w in fitted]),
        "torque_percent_of_range": np.array([w.percent for w in fitted]),
    }
    for number in WATCHED:
        columns[str(number)] = np.array([w.values[number] for w in fitted])
    for course in found.courses:
        name, base = str(course.drift.number), course.base
        columns |= {f"{name}_low": base * course.low, f"{name}_high": base * course.high}
        if not course.shown:
            columns |= {key: np.full(len(fitted), np.nan) for key in (name, f"{name}_low", f"{name}_high")}
    return columns


def watch_figures(found: Watch) -> dict[str, Figure]:
    """All figures by file name; none where no window tells anything."""
    if not found.courses:
        return {}
    with figure_style():
        figure, axes = new_figure(len(found.courses), 1, share_x=True, height_in=2.0 * len(found.courses) + 0.5)
        for panel, course in zip(axes[:, 0], found.courses, strict=True):
            hours = course.used_s / 3600
            panel.fill_between(hours, 100 * (course.low - 1), 100 * (course.high - 1), color=BLUE, alpha=0.2, lw=0)
            panel.plot(hours, 100 * (course.ratio - 1), ".-", color=BLUE, markersize=3, linewidth=0.8)
            panel.axhline(0, color=INK, linewidth=0.6)
            panel.axhline(100 * course.drift.change, color=GREY, linestyle=":")
            for border in _borders(found):
                panel.axvline(border / 3600, color=GREY, linewidth=0.4)
            if course.alarm is not None:
                panel.axvline(course.alarm.used_s / 3600, color=VERMILION, label="alarm")
                legend_below(figure, panel)
            panel.set(ylabel="change [%]", title=course.drift.label)
        axes[-1, 0].set_xlabel("time of use [h]")
        test, panels = new_figure(1, 1, height_in=2.4)
        for course, colour in zip(found.courses, (BLUE, ORANGE, INK), strict=True):
            panels[0, 0].plot(course.used_s / 3600, course.total, color=colour, label=course.drift.label)
        panels[0, 0].axhline(1, color=GREY, linestyle=":")
        panels[0, 0].set(xlabel="time of use [h]", ylabel="sum of the test [-]")
        legend_below(test, panels[0, 0])
        return {"history": figure, "test": test}


VIEWS = Views(write=Watch.write, columns=_columns, figures=watch_figures)


def _borders(found: Watch) -> list[float]:
    """Times of use at which another file begins."""
    pairs = zip(found.windows[:-1], found.windows[1:], strict=True)
    return [before.used_s for before, after in pairs if before.name != after.name]


def watch_report(found: Watch, figures: dict[str, Figure]) -> Report:
    """The page with the history."""
    table = Table(
        caption="Watched numbers, against the first minutes of use",
        columns=(
            "number",
            "first",
            "change in the last windows [%]",
            "half a 95 % band [%]",
            "looked for [%]",
            "sure after [min of use]",
            "alarm",
        ),
        rows=[
            (
                f"{c.drift.label} ({c.drift.number}, {unit_of(c.drift.number)})",
                c.base,
                100 * (_late(c) - 1),
                100 * _band(c),
                100 * c.drift.change,
                c.sure_s / 60 if math.isfinite(c.sure_s) else None,
                None if c.alarm is None else f"after {clock(c.alarm.used_s)}",
            )
            for c in found.courses
        ],
    )
    names = list(dict.fromkeys(w.name for w in found.windows))
    files = Table(
        caption="Files",
        columns=("file", "windows", "of which identify friction", "median RMS error of the torque [% of range]"),
        rows=[_row(name, [w for w in found.windows if w.name == name]) for name in names],
    )
    pictures = pictures_of(figures, _CAPTIONS)
    data = "".join(f" --data {quote(path.name)}" for path in found.inputs)
    return Report(
        title=f"Watch: {found.scenario.name}",
        summary=found.headline,
        warnings=found.warnings,
        sections=tuple(
            section
            for section in (
                Section(title="History", blocks=(pictures["history"], table) if pictures else ()),
                Section(title="Sequential test", blocks=(pictures["test"],) if pictures else ()),
                Section(title="Measured files", blocks=(files,)),
            )
            if section.blocks
        ),
        provenance=Provenance(
            scenario=found.scenario,
            command=f"tendonff watch {as_argument(found.scenario.source)}{data} --out DIR",
            inputs=found.inputs,
        ),
        files=(
            FileNote(
                name="watch.csv",
                content="watched numbers of each window with 95 % bands, NaN where no change would show",
            ),
            FileNote(name="summary.json", content="alarms and changes for other programs"),
        ),
    )


def _row(name: str, windows: list[Window]) -> tuple[str, int, int, float | None]:
    fitted = [w.percent for w in windows if w.values]
    return name, len(windows), len(fitted), float(np.median(fitted)) if fitted else None
