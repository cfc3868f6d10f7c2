"""`tendonff table`: make the table of a scenario, say how good it is, and write it."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.base import Plant, Score, play_and_score
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_json, write_text
from tendonff.compensator.reporting.plots import BLUE, VERMILION, figure_style, new_figure, save_figure
from tendonff.compensator.scenario.sampling import Reference, largest_tension, sample_reference
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.compensator.tables.build import BuiltTable, build_table, usual_rate
from tendonff.compensator.tables.table import BranchTable, FloatArray, Table, table_force, table_range_N
from tendonff.models.capstan import Branch
from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.ocp.tracking.limits import ForceLimits

BOUND_SHARE = 0.005
"""Interpolation error that a table may have unless told otherwise, as a share of the reference's range."""

FORMULA = (
    "(force_N + adhesion_N)/(reference_N + adhesion_N) = bilinear(reference_N, share); "
    "share = tension_since_reversal_N/(reference_N + adhesion_N); "
    "tension_since_reversal_N = abs(reference_N - turn_N); "
    "branch = pull while the reference rises, release while it falls; "
    "at a reversal turn_N is set so that the force goes on without a jump (out of full slip: the reference there); "
    "beyond the last share the force of the last share holds"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TableRun:
    """A table for one wrap angle and rate.

    Parameters
    ----------
    built : BuiltTable
    total_angle_rad : float
        Wrap angle [rad].
    """

    built: BuiltTable
    total_angle_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioTables:
    """Tables of a scenario: the first for its own wrap angle and rate, or for the axes that were asked for.

    Parameters
    ----------
    scenario : Scenario
    level : Level
    reference : Reference
    runs : tuple of TableRun
    axes : tuple of str
        Further columns of the file.
    scores : dict of Level to Score
        What the scenario's own table delivers on each level, within the actuator's limits.
    """

    scenario: Scenario
    level: Level
    reference: Reference
    runs: tuple[TableRun, ...]
    axes: tuple[str, ...]
    scores: dict[Level, Score]


def covered_range(scenario: Scenario, reference: Reference) -> tuple[float, float]:
    """Range of reference tension that a table of this scenario covers [N].

    Parameters
    ----------
    scenario : Scenario
    reference : Reference
    """
    wanted = np.append(reference.tension_N, reference.initial_tension_N)
    return table_range_N(wanted, largest_tension(scenario.transmission))


def scenario_table(
    scenario: Scenario,
    reference: Reference,
    *,
    level: Level | None = None,
    bound_N: float | None = None,
    rate_N_per_s: float | None = None,
    total_angle_rad: float | None = None,
) -> BuiltTable:
    """The table of a scenario.

    Parameters
    ----------
    scenario : Scenario
    reference : Reference
    level : Level, optional
        Default: the scenario's own.
    bound_N : float, optional
        Largest interpolation error [N]; default: 0.5 % of the reference's range.
    rate_N_per_s : float, optional
        Rate of the reference that the table is for [N/s]; default: the median rate of the scenario's.
    total_angle_rad : float, optional
        Another wrap angle [rad].
    """
    transmission = scenario.transmission
    if total_angle_rad is not None:
        path = replace(transmission.path, total_angle_rad=total_angle_rad)
        transmission = replace(transmission, path=path)
    span = reference.range_N or 0.1 * float(reference.tension_N[0])
    return build_table(
        Chain.of(transmission, level or scenario.run.level),
        covered_range(scenario, reference),
        bound_N=BOUND_SHARE * span if bound_N is None else bound_N,
        rate_N_per_s=usual_rate(reference.tension_N, reference.step_s) if rate_N_per_s is None else rate_N_per_s,
        step_s=reference.step_s,
    )


def limited_table_force(scenario: Scenario, reference: Reference, table: Table) -> FloatArray:
    """Force of the table for the scenario's reference, within the actuator's limits, shape (n,) [N].

    Parameters
    ----------
    scenario : Scenario
    reference : Reference
    table : Table
    """
    wanted = table_force(table, reference.tension_N, reference.initial_tension_N)
    return ForceLimits.of(scenario.transmission.actuator).apply(wanted, reference.step_s, reference.initial_tension_N)


def make_tables(
    scenario: Scenario,
    *,
    level: Level | None = None,
    bound_N: float | None = None,
    angles_rad: Sequence[float] = (),
    rates_N_per_s: Sequence[float] = (),
) -> ScenarioTables:
    """Tables over the axes that were asked for, and the scores of the scenario's own.

    Parameters
    ----------
    scenario : Scenario
    level : Level, optional
    bound_N : float, optional
        Largest interpolation error [N].
    angles_rad : sequence of float, optional
        Wrap angles [rad], > 0; a further column of the file.
    rates_N_per_s : sequence of float, optional
        Rates of the reference [N/s], > 0; a further column of the file.
    """
    for name, values in (("angles", angles_rad), ("rates", rates_N_per_s)):
        for value in values:
            if not 0 < value < float("inf"):
                raise InputError(f"--{name}: every value must be a finite number > 0, got {value}")
    level = level or scenario.run.level
    reference = sample_reference(scenario)
    own_angle = scenario.transmission.path.total_angle_rad
    own = scenario_table(scenario, reference, level=level, bound_N=bound_N)
    runs = [TableRun(built=own, total_angle_rad=own_angle)]
    if angles_rad or rates_N_per_s:
        runs = [
            TableRun(
                built=scenario_table(
                    scenario, reference, level=level, bound_N=bound_N, rate_N_per_s=rate, total_angle_rad=angle
                ),
                total_angle_rad=angle,
            )
            for angle in sorted(angles_rad or [own_angle])
            for rate in sorted(rates_N_per_s or [own.rate_N_per_s])
        ]
    force = limited_table_force(scenario, reference, own.table)
    scores = {
        on: play_and_score(scenario.transmission, Plant(level=on), "table", force, reference).score for on in Level
    }
    axes = (("total_angle_rad",) if angles_rad else ()) + (("rate_N_per_s",) if rates_N_per_s else ())
    return ScenarioTables(
        scenario=scenario, level=level, reference=reference, runs=tuple(runs), axes=axes, scores=scores
    )


def table_csv(tables: ScenarioTables) -> str:
    """Text of `table.csv`: one row per node.

    Parameters
    ----------
    tables : ScenarioTables
    """
    lines = [",".join(["reference_N", "branch", "tension_since_reversal_N", "force_N", *tables.axes])]
    for run in tables.runs:
        further = {"total_angle_rad": run.total_angle_rad, "rate_N_per_s": run.built.rate_N_per_s}
        suffix = "".join(f",{further[axis]!r}" for axis in tables.axes)
        table = run.built.table
        for branch in Branch:
            nodes = table.branch(branch)
            for reference, forces in zip(table.reference_N.tolist(), nodes.force_N.tolist(), strict=True):
                travelled = (nodes.share * (reference + table.adhesion_N)).tolist()
                lines += [
                    f"{reference!r},{branch},{since!r},{force!r}{suffix}"
                    for since, force in zip(travelled, forces, strict=True)
                ]
    return "\n".join([*lines, ""])


def table_from_csv(text: str, adhesion_N: float = 0.0) -> Table:
    """Read a table back from the text of `table.csv` (without further axes).

    Parameters
    ----------
    text : str
    adhesion_N : float, optional
        p [N].
    """
    header, *rows = [line.split(",") for line in text.strip().splitlines()]
    if header != ["reference_N", "branch", "tension_since_reversal_N", "force_N"]:
        raise ParameterError(f"expected a table without further axes, got the columns {', '.join(header)}")
    references = np.array(sorted({float(row[0]) for row in rows}))

    def branch(name: Branch) -> BranchTable:
        values = np.array([[float(r[0]), float(r[2]), float(r[3])] for r in rows if r[1] == name])
        values = values.reshape(references.size, -1, 3)
        return BranchTable(share=values[0, :, 1] / (references[0] + adhesion_N), force_N=values[:, :, 2])

    return Table(
        reference_N=references,
        adhesion_N=adhesion_N,
        pull=branch(Branch.PULL),
        release=branch(Branch.RELEASE),
    )


def table_summary(tables: ScenarioTables) -> dict[str, object]:
    """What `table.json` says: formula, model, parameters, ranges, errors, and the nodes.

    Parameters
    ----------
    tables : ScenarioTables
    """
    scenario = tables.scenario

    def run(item: TableRun) -> dict[str, object]:
        built, table = item.built, item.built.table
        return {
            "total_angle_rad": item.total_angle_rad,
            "rate_N_per_s": built.rate_N_per_s,
            "bound_N": built.bound_N,
            "interpolation_error_N": built.error_N,
            "resolution_N": built.resolution_N,
            "checked_points": built.checked,
            "nodes": table.nodes,
            "reference_N": table.reference_N,
            "share": {b: table.branch(b).share for b in Branch},
            "force_N": {b: table.branch(b).force_N for b in Branch},
        }

    first = tables.runs[0].built.table
    return {
        "schema": 1,
        "formula": FORMULA,
        "model": "tendon chain, quasi-static reversals out of full slip through the exact inverse, without masses",
        "level": tables.level,
        "segments": scenario.transmission.path.segments,
        "scenario": scenario.name,
        "scenario_hash": scenario_hash(scenario),
        "tendonff": version("tendonff"),
        "parameters": asdict(scenario.transmission),
        "valid_reference_N": [float(first.reference_N[0]), float(first.reference_N[-1])],
        "adhesion_N": first.adhesion_N,
        "expected_error": {level: asdict(score) for level, score in tables.scores.items()},
        "tables": [run(item) for item in tables.runs],
    }


def write_tables(tables: ScenarioTables, folder: Path) -> None:
    """Write `table.csv`, `table.json`, `table.h` and a figure.

    Parameters
    ----------
    tables : ScenarioTables
    folder : Path
    """
    from tendonff.compensator.export.c_project import table_header

    write_text(folder / "table.csv", table_csv(tables))
    write_json(folder / "table.json", json.loads(json.dumps(table_summary(tables), default=np.ndarray.tolist)))
    write_text(folder / "table.h", table_header(tables.scenario, tables.runs[0].built, tables.level))
    with figure_style():
        _draw(tables, folder)


def _draw(tables: ScenarioTables, folder: Path) -> None:
    """Force over reference on both branches with transitions, and the transition on its own."""
    run = tables.runs[0]
    table, p = run.built.table, run.built.table.adhesion_N
    figure, axes = new_figure(1, 2, height_in=3.0)
    left, right = axes[0]
    low, high = table.reference_N[0], table.reference_N[-1]
    colours = {Branch.PULL: BLUE, Branch.RELEASE: VERMILION}
    names = {Branch.PULL: "reference rises (pull)", Branch.RELEASE: "reference falls (release)"}
    for branch in Branch:
        nodes, sign = table.branch(branch), 1.0 if branch is Branch.PULL else -1.0
        left.plot(table.reference_N, nodes.force_N[:, -1], color=colours[branch], label=names[branch])
        for turn in np.linspace(low, high, 7)[1:-1]:
            end = high if branch is Branch.PULL else low
            way = turn + (end - turn) * np.linspace(0, 1, 400) ** 2
            share = sign * (way - turn) / (way + p)
            inside = share <= nodes.share[-1]
            force = table.force_N(way[inside], branch, share[inside])
            left.plot(way[inside], force, color=colours[branch], linewidth=0.7)
        middle = float(table.reference_N[0] + table.reference_N[-1]) / 2
        dense = np.linspace(0, nodes.share[-1], 400)
        travelled = dense * (middle + p)
        right.plot(travelled, table.force_N(np.full(400, middle), branch, dense), color=colours[branch])
        at_nodes = table.force_N(np.full(nodes.share.size, middle), branch, nodes.share)
        right.plot(nodes.share * (middle + p), at_nodes, ".", color=colours[branch], markersize=4)
    left.set(xlabel="reference tension [N]", ylabel="force [N]", title="slip (thick) and reversals (thin)")
    left.legend(loc="upper left")
    right.set(xlabel="tension since the reversal [N]", title=f"transition at {middle:.3g} N and its nodes")
    save_figure(figure, folder / "table")
