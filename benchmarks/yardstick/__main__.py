"""The table and the figure: `python -m benchmarks.yardstick [--only NAME ...] [--out FOLDER]`.

A column whose package is absent is left out and named. Without any package but numpy the formulas remain.
"""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path

from benchmarks.yardstick.adapters import formulas
from benchmarks.yardstick.answers import answer
from benchmarks.yardstick.case import Array, Case, all_cases, error_percent

Found = dict[str, Array] | tuple[dict[str, Array], dict[str, Array]] | None
Adapter = Callable[[Case], Found]
OURS = "tendonff presliding"
FIRST = (OURS, "Newton", "MuJoCo frictionloss")  # what narrow pages show


def adapters() -> tuple[dict[str, Adapter], dict[str, str]]:
    """Those that can be run here, and what the others lack."""
    found: dict[str, Adapter] = {"capstan formula": formulas.capstan, "play over total angle": formulas.play}
    absent = {}
    for name, module in (
        ("tendonff", "tendonff_chain"),
        ("Newton", "newton_xpbd"),
        ("MuJoCo frictionloss", "mujoco_loss"),
    ):
        try:
            code = import_module(f"benchmarks.yardstick.adapters.{module}")
        except ModuleNotFoundError as error:
            absent[name] = str(error.name)
            continue
        if name == "tendonff":
            found |= {f"tendonff {level}": partial(code.answer, level=level) for level in code.LEVELS}
        else:
            found[name] = code.answer
    return {name: found[name] for name in [*FIRST, *found] if name in found}, absent


def errors(names: list[str], runs: dict[str, Adapter], cases: list[Case]) -> dict[str, dict[str, float | None]]:
    """Error of each adapter in each case [% of range]; None where it cannot express the case."""
    table: dict[str, dict[str, float | None]] = {}
    for case in cases:
        exact = answer(case)
        table[case.key] = {}
        for name in names:
            found = runs[name](case)
            if found is None:
                table[case.key][name] = None
            elif isinstance(found, tuple):  # with the tensions that its ends had
                table[case.key][name] = error_percent(case, found[0], answer(replace(case, recorded=found[1])))
            else:
                table[case.key][name] = error_percent(case, found, exact)
    return table


def failures(table: dict[str, dict[str, float | None]], cases: list[Case], name: str) -> list[str]:
    """Cases in which an adapter is beyond the tolerance."""
    limits = {case.key: case.tolerance_percent for case in cases}
    return [key for key, row in table.items() if (error := row[name]) is not None and error > limits[key]]


def text_of(table: dict[str, dict[str, float | None]], cases: list[Case], names: list[str]) -> str:
    """The table in Markdown: a failure has a cross, the best of a row is bold."""
    lines = [f"| case | passes at | {' | '.join(names)} |", "|---" * (len(names) + 2) + "|"]
    for case in cases:
        row, cells = table[case.key], []
        best = min((value for value in row.values() if value is not None), default=0.0)
        for name in names:
            value = row[name]
            if value is None:
                cells.append("–")
                continue
            shown = f"{value:.2g}" if value < 99.5 else f"{value:.0f}"
            shown = f"**{shown}**" if value == best else shown
            cells.append(shown + (" ✗" if value > case.tolerance_percent else ""))
        lines.append(f"| {case.name} | {case.tolerance_percent:g} | {' | '.join(cells)} |")
    failed = [str(len(failures(table, cases, name))) for name in names]
    judged = [str(sum(row[name] is not None for row in table.values())) for name in names]
    counts = [f"{bad} of {of}" for bad, of in zip(failed, judged, strict=True)]
    lines.append(f"| failed | | {' | '.join(counts)} |")
    return "\n".join(lines)


def draw(table: dict[str, dict[str, float | None]], cases: list[Case], names: list[str], file: Path) -> None:
    """Rows of cases, marks of adapters, bars up to the tolerance."""
    from matplotlib import rc_context  # only the figure needs it
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.add_subplot()
    floor, marks = 1e-3, "os^Dv<>PX*"
    rows = {case.key: len(cases) - k for k, case in enumerate(cases)}
    for case in cases:
        axes.barh(rows[case.key], max(case.tolerance_percent, floor) - floor, left=floor, color="0.9", height=0.7)
    for k, name in enumerate(names):
        values = {key: value for key, row in table.items() if (value := row[name]) is not None}
        places = [rows[key] + 0.25 * (0.5 - k / max(len(names) - 1, 1)) for key in values]
        axes.plot([max(v, floor) for v in values.values()], places, marks[k], label=name, markersize=5, alpha=0.85)
    axes.set(xscale="log", xlabel="RMS error, % of range (grey: passes)", xlim=(floor, None))
    axes.set_yticks(list(rows.values()), [case.name for case in cases])
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    with rc_context({"svg.hashsalt": "yardstick"}):  # equal tables give equal files
        figure.savefig(file, metadata={"Date": None})


def main() -> int:
    """Run what is asked for, print the table, write it with the figure; 1 where the chain of tendonff fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", action="append", help="columns whose name begins like this")
    parser.add_argument("--out", type=Path, help="folder for table.md, errors.json and errors.svg")
    options = parser.parse_args()
    runs, absent = adapters()
    names = [name for name in runs if not options.only or name.lower().startswith(tuple(map(str.lower, options.only)))]
    cases = all_cases()
    table = errors(names, runs, cases)
    text = text_of(table, cases, names)
    print(text)
    for name, package in absent.items():
        print(f"left out: {name}, which needs the package {package}")
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "table.md").write_text(text + "\n", encoding="utf-8")
        (options.out / "errors.json").write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
        draw(table, cases, names, options.out / "errors.svg")
    return int(OURS in names and bool(failures(table, cases, OURS)))


if __name__ == "__main__":
    sys.exit(main())
