"""Table of a joint's motor angles over its angle and the way it turns: the quasi-static law, to be looked up."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.every import compensator_of
from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.expected import expectation_summary, robustness_table
from tendonff.compensator.compensators.motors.joint import JointTask, motor_names
from tendonff.compensator.compensators.motors.task import MotorCompensator, MotorTask
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.files.writing import atomic_directory, csv_text, write_text
from tendonff.compensator.reporting.colours import GREEN, INK, VERMILION, Style
from tendonff.compensator.reporting.page import (
    FileNote,
    Report,
    Section,
    Text,
    pictures_of,
    provenance_of,
    summary_head,
    write_pages,
)
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure
from tendonff.compensator.reporting.results import Result, Views
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.driven.reference import JointQuantity
from tendonff.compensator.scenario.sampled.joint_motion import posed
from tendonff.models.errors import require
from tendonff.models.fidelity import Level
from tendonff.models.joint.quasi_static import directions, static_motor_rad
from tendonff.models.turns import in_turn

BOUND_SHARE = 1e-3
"""Largest interpolation error of a table, over the range of the reference [-]."""

BRANCHES = {"up": 1.0, "down": -1.0}
"""Way the joint turns, towards larger or smaller angles."""

_LEAST, _MOST = 5, 1025  # nodes on a branch


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class JointTable(Result):
    """Motor angles of a joint over its angle and the way it turns.

    Attributes
    ----------
    scenario : JointScenario
    angle_rad : ndarray, shape (nodes,)
    speeds_rad_per_s : tuple of float
        Of the joint, by which its damping acts; (0,) for slow motion alone.
    motor_rad : dict of str to ndarray, shape (speeds, nodes, motors)
        Of each branch, relative to the start.
    error_rad : float
        Largest interpolation error, as an angle of the joint.
    masses : int
        Of each tendon of the plants.
    expectation : Expectation
        Of the table, the ratio alone and the exact inverse.
    """

    shown_by: ClassVar[str] = "studies.tables.joint"

    scenario: JointScenario
    angle_rad: FloatArray
    speeds_rad_per_s: tuple[float, ...]
    motor_rad: dict[str, FloatArray]
    error_rad: float
    masses: int
    expectation: Expectation

    @property
    def headline(self) -> str:
        """Nodes and worst errors."""
        worst = self.expectation.worst_percent
        return (
            f"{self.nodes} nodes. Worst RMS error, % of range: table {worst['table']:.2g}, "
            f"ratio alone {worst['linear']:.2g}, exact inverse {worst['inverse']:.2g}, for {self.expectation.doubt}"
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the user."""
        return self.harm

    @property
    def harm(self) -> tuple[str, ...]:
        """Why the table must not be used as it is: its error is above that of the ratio alone."""
        worst = self.expectation.worst_percent
        return (f"{self.headline}: worse than the ratio",) if worst["table"] > worst["linear"] else ()

    @property
    def nodes(self) -> int:
        """Of both branches and all speeds."""
        return len(BRANCHES) * len(self.speeds_rad_per_s) * len(self.angle_rad)

    @property
    def lines(self) -> tuple[str, ...]:
        """The finding in words."""
        return (self.headline,)

    def write(self, folder: str | os.PathLike[str], *, prefix: str = "tff", pdf: bool = False) -> None:
        """Write `table.csv`, `table.h`, `summary.json`, a figure and `report.html`, all or nothing; makes the folder.

        The names in `table.h` begin with `prefix`.
        """
        figures, columns = _figures(self), self.columns
        with atomic_directory(folder) as partial:
            write_text(partial / "table.csv", csv_text(columns, zip(*columns.values(), strict=True)))
            write_text(partial / "table.h", _header(self, prefix))
            write_pages(partial, self.summary, figures, _report(self, figures), pdf=pdf)

    @property
    def columns(self) -> dict[str, list[object]]:
        """Columns of `table.csv`."""
        motors, by_speed = _motors(self.scenario), len(self.speeds_rad_per_s) > 1
        rows = [
            (float(angle), branch, *((speed,) if by_speed else ()), *motor)
            for branch, every in self.motor_rad.items()
            for speed, values in zip(self.speeds_rad_per_s, every, strict=True)
            for angle, motor in zip(self.angle_rad, values.tolist(), strict=True)
        ]
        names = ["angle_rad", "branch", *(["speed_rad_per_s"] if by_speed else []), *motors]
        return {name: list(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}

    @property
    def summary(self) -> dict[str, object]:
        """The contents of `summary.json`."""
        return {
            **summary_head(self.scenario),
            "nodes": self.nodes,
            "interpolation_error_rad": self.error_rad,
            "expectation": expectation_summary(self.expectation, self.masses),
        }


@in_turn
def tabulate_joint(
    scenario: JointScenario,
    *,
    level: Level | None = None,
    bound: float | None = None,
    angles_rad: Sequence[float] = (),
    rates: Sequence[float] = (),
    pose_rad: Mapping[str, float] = MappingProxyType({}),
) -> JointTable:
    """Tabulate the quasi-static law of a joint over the range of its reference.

    Arguments and errors as of `tendonff.make_table`.
    """
    scenario = posed(scenario, pose_rad) if pose_rad else scenario
    task, file = JointTask.of(scenario, level), scenario.source.name
    sampled, mechanism = task.sampled, task.mechanism
    if scenario.reference.quantity is JointQuantity.TORQUE:
        raise InputError(f"{file}: a table over the angle has no room for a torque; export the inverse by export-c")
    others = sampled.others(mechanism.joint.name)
    if any(np.ptp(angle) > 0 for name, angle in others.items() if any(t.follows(name) for t in mechanism.tendons)):
        raise InputError(
            f"{file}: no table can hold a path that other joints move; hold them by --pose, or export the inverse by "
            "export-c"
        )
    low, high = float(sampled.angle_rad.min()), float(sampled.angle_rad.max())
    speeds, given = _speeds(rates), _nodes(angles_rad, low, high)
    bound = BOUND_SHARE * sampled.range if bound is None else bound
    require("bound", bound, above=0, hint="it is an angle of the joint [rad]")
    arm, drum = abs(mechanism.arms_at(low)[0]), mechanism.drum_radius_m[0] / mechanism.drive.gear_ratio
    nodes = _LEAST
    while True:
        angle = given if given is not None else np.linspace(low, high, nodes)
        fine = np.sort(np.r_[angle, 0.5 * (angle[1:] + angle[:-1])])
        motor = {name: np.stack([_branch(task, angle, way, w) for w in speeds]) for name, way in BRANCHES.items()}
        between = [
            _branch(task, fine, way, speeds[0]) - _looked_up(angle, motor[name][0], fine)
            for name, way in BRANCHES.items()
        ]
        error = float(np.abs(between).max()) * drum / arm
        if error <= bound or nodes >= _MOST or given is not None:
            break
        nodes = 2 * nodes - 1
    table = MotorCompensator(
        name="table",
        label="table over angle and direction",
        style=Style(color=GREEN, linestyle="-"),
        profile=lambda own: _command(own, angle, speeds, motor),
    )
    each = (compensator_of(task, "linear"), table, compensator_of(task, "inverse"))
    commands = {one.name: task.answer(one) for one in each}
    return JointTable(
        scenario=scenario,
        angle_rad=angle,
        speeds_rad_per_s=speeds,
        motor_rad=motor,
        error_rad=error,
        masses=task.masses,
        expectation=task.expect(commands),
    )


def _speeds(rates: Sequence[float]) -> tuple[float, ...]:
    for rate in rates:
        if not 0 < rate < math.inf:
            raise InputError(f"--rates: every value must be a finite number > 0, got {rate}")
    return tuple(sorted(rates)) or (0.0,)


def _nodes(angles_rad: Sequence[float], low_rad: float, high_rad: float) -> FloatArray | None:
    """Nodes that were asked for; None for none."""
    if not len(angles_rad):
        return None
    nodes: FloatArray = np.unique(np.asarray(angles_rad, dtype=np.float64))
    if len(nodes) < 2 or not (nodes[0] <= low_rad and high_rad <= nodes[-1]):
        raise InputError(
            f"--angles: the nodes must reach over the reference, from {low_rad:.4g} to {high_rad:.4g} rad, got "
            f"{', '.join(f'{node:g}' for node in nodes)}"
        )
    return nodes


def _branch(task: JointTask, angle_rad: FloatArray, way: float, speed_rad_per_s: float) -> FloatArray:
    """Motor angles relative to the start, shape (rows, motors), while the joint turns one way at a speed."""
    joint = task.mechanism.joint
    angle = np.concatenate([task.sampled.angle_rad[:1], angle_rad])  # a run counts from its start at rest
    ways = np.append(0.0, np.full(len(angle_rad), way))
    resisted = joint.coulomb_N_m + joint.damping_N_m_s_per_rad * speed_rad_per_s
    held = joint.static_torque_N_m(angle) + ways * resisted
    still = task.sampled.others(joint.name)
    others = {name: np.full(len(angle), rows[0]) for name, rows in still.items()}
    return static_motor_rad(task.mechanism, angle, held, others, ways)[1:]


def _looked_up(nodes_rad: FloatArray, motor_rad: FloatArray, angle_rad: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(angle_rad, nodes_rad, column) for column in motor_rad.T])


def _command(
    task: MotorTask, nodes_rad: FloatArray, speeds_rad_per_s: tuple[float, ...], motor_rad: dict[str, FloatArray]
) -> FloatArray:
    """Motor angles by the table, shape (rows, motors); at the start at rest none."""
    angle, rows = task.sampled.angle_rad, np.arange(len(task.sampled.angle_rad))
    ways = directions(angle)[:, None]
    speed = np.abs(np.gradient(angle, task.scenario.run.step_s))
    at = np.interp(speed, speeds_rad_per_s, np.arange(float(len(speeds_rad_per_s))))
    below = at.astype(int)
    above, share = np.minimum(below + 1, len(speeds_rad_per_s) - 1), (at - below)[:, None]

    def branch(name: str) -> FloatArray:
        each = np.stack([_looked_up(nodes_rad, values, angle) for values in motor_rad[name]])
        found: FloatArray = (1 - share) * each[below, rows] + share * each[above, rows]
        return found

    found: FloatArray = np.where(ways > 0, branch("up"), np.where(ways < 0, branch("down"), 0.0))
    found[0] = 0.0
    return found


def _motors(scenario: JointScenario) -> list[str]:
    names = motor_names(scenario.mechanism)
    return ["motor_rad"] if names == ("motor",) else [f"motor_{name}_rad" for name in names]


def _header(result: JointTable, prefix: str) -> str:
    """The table as constants of C."""
    guard, joint = f"{prefix.upper()}_JOINT_TABLE", result.scenario.mechanism.joint.name
    motors, speeds = _motors(result.scenario), result.speeds_rad_per_s
    by_speed = len(speeds) > 1
    shape = f"[{guard}_SPEEDS][{guard}_NODES][{guard}_MOTORS]" if by_speed else f"[{guard}_NODES][{guard}_MOTORS]"

    def row(values: FloatArray | tuple[float, ...]) -> str:
        return ", ".join(repr(float(value)) for value in values)

    def nodes(values: FloatArray) -> str:
        return "".join(f"    {{{row(node)}}},\n" for node in values)

    branches = [
        f"static const double {prefix}_joint_table_{branch}_rad{shape} = {{\n"
        + ("".join(f"    {{\n{nodes(values)}    }},\n" for values in every) if by_speed else nodes(every[0]))
        + "};\n"
        for branch, every in result.motor_rad.items()
    ]
    axis = (
        f"#define {guard}_SPEEDS ({len(speeds)})\n",
        f"static const double {prefix}_joint_table_speed_rad_per_s[{guard}_SPEEDS] = {{{row(speeds)}}};\n",
    )
    return "\n".join(
        (
            f"/* Motor angles relative to the start [rad] over the angle of the joint {joint} [rad],",
            f" * for both ways it turns; straight between the nodes. Columns: {', '.join(motors)}.",
            f" * Scenario {result.scenario.digest()}. */",
            f"#ifndef {guard}_H\n#define {guard}_H\n",
            f"#define {guard}_NODES ({len(result.angle_rad)})\n#define {guard}_MOTORS ({len(motors)})\n",
            f"static const double {prefix}_joint_table_angle_rad[{guard}_NODES] = {{{row(result.angle_rad)}}};\n",
            *(axis if by_speed else ()),
            *branches,
            "#endif\n",
        )
    )


def _figures(table: JointTable) -> dict[str, Figure]:
    with figure_style():
        return {"table": _figure(table)}


def _figure(result: JointTable) -> Figure:
    """Motor angle beyond a straight line, over the joint's angle."""
    figure, axes = new_figure(1, 1)
    panel, angle = axes[0, 0], result.angle_rad
    for k, motor in enumerate(motor_names(result.scenario.mechanism)):
        middle = 0.5 * sum(values[0, :, k] for values in result.motor_rad.values())
        line = np.polyval(np.polyfit(angle, middle, 1), angle)
        for (branch, values), colour in zip(result.motor_rad.items(), (INK, VERMILION), strict=True):
            label = f"{branch}" + (f", {motor}" if len(motor_names(result.scenario.mechanism)) > 1 else "")
            style = ("-", "--")[k % 2]
            panel.plot(np.rad2deg(angle), np.rad2deg(values[0, :, k] - line), style, color=colour, label=label)
    panel.set(xlabel="joint angle [deg]", ylabel="motor less a line [deg]")
    legend_below(figure, panel, columns=4)
    return figure


def _report(result: JointTable, figures: dict[str, Figure]) -> Report:
    labels = {"linear": "ratio alone", "table": "table", "inverse": "exact inverse"}
    captions = {
        "table": "Motor angles of both ways less the straight line between them: their distance is lost motion."
    }
    text = Text(
        "Take the branch of the way the reference turns, keep it while the joint stands, and cross over as fast as the "
        "motor can. The table knows friction, elasticity, springs and weight of the scenario at rest; inertia and the "
        "gradual onset of sliding after a reversal it does not."
    )
    return Report(
        title=f"Table: {result.scenario.name}",
        summary=f"{result.headline}.",
        sections=(
            Section(title="Motor over angle and direction", blocks=(pictures_of(figures, captions)["table"], text)),
            Section(
                title="What to expect on a rig",
                blocks=(robustness_table(result.expectation, labels, result.masses),),
            ),
        ),
        provenance=provenance_of(result.scenario, "table"),
        files=(
            FileNote(name="table.csv", content="motor angles relative to the start, by angle and branch"),
            FileNote(name="table.h", content="the same as constants of C"),
            FileNote(name="summary.json", content="everything on this page for other programs"),
        ),
    )


VIEWS = Views(write=JointTable.write, columns=lambda table: table.columns, figures=_figures)
