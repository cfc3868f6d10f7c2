"""Table of a joint's motor angles over its angle and the way it turns: the quasi-static law, to be looked up."""

import os
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.expected import expectation_summary, robustness_table
from tendonff.compensator.compensators.motors.joint import JointTask, motor_names
from tendonff.compensator.compensators.motors.registry import MotorCompensator, motor_compensator
from tendonff.compensator.compensators.motors.task import MotorTask
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
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.driven.reference import JointQuantity
from tendonff.models.joint.quasi_static import directions, static_motor_rad

BOUND_SHARE = 1e-3
"""Largest interpolation error of a table, over the range of the reference [-]."""

BRANCHES = {"up": 1.0, "down": -1.0}
"""Way the joint turns, towards larger or smaller angles."""

_LEAST, _MOST = 5, 1025  # nodes on a branch


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointTable:
    """Motor angles of a joint over its angle and the way it turns.

    Attributes
    ----------
    scenario : JointScenario
    angle_rad : ndarray, shape (nodes,)
    motor_rad : dict of str to ndarray, shape (nodes, motors)
        Of each branch, relative to the start.
    error_rad : float
        Largest interpolation error, as an angle of the joint.
    masses : int
        Of each tendon of the plants.
    expectation : Expectation
        Of the table, the ratio alone and the exact inverse.
    """

    scenario: JointScenario
    angle_rad: FloatArray
    motor_rad: dict[str, FloatArray]
    error_rad: float
    masses: int
    expectation: Expectation

    @property
    def headline(self) -> str:
        """Nodes and worst errors."""
        worst = self.expectation.worst_percent
        return (
            f"{len(BRANCHES) * len(self.angle_rad)} nodes. Worst RMS error, % of range: table {worst['table']:.2g}, "
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
        """Of both branches."""
        return len(BRANCHES) * len(self.angle_rad)

    @property
    def lines(self) -> tuple[str, ...]:
        """The finding in words."""
        return (self.headline,)

    def write(self, folder: str | os.PathLike[str], *, prefix: str = "tff", pdf: bool = False) -> None:
        """Write `table.csv`, `table.h`, `summary.json`, a figure and `report.html`, all or nothing; makes the folder.

        The names in `table.h` begin with `prefix`.
        """
        with figure_style():
            figures = {"table": _figure(self)}
        motors = _motors(self.scenario)
        rows = [
            (float(angle), branch, *motor)
            for branch, values in self.motor_rad.items()
            for angle, motor in zip(self.angle_rad, values.tolist(), strict=True)
        ]
        with atomic_directory(folder) as partial:
            write_text(partial / "table.csv", csv_text(["angle_rad", "branch", *motors], rows))
            write_text(partial / "table.h", _header(self, prefix))
            write_pages(partial, self.summary, figures, _report(self, figures), pdf=pdf)

    @property
    def summary(self) -> dict[str, object]:
        """The contents of `summary.json`."""
        return {
            **summary_head(self.scenario),
            "nodes": len(BRANCHES) * len(self.angle_rad),
            "interpolation_error_rad": self.error_rad,
            "expectation": expectation_summary(self.expectation, self.masses),
        }


def tabulate_joint(scenario: JointScenario) -> JointTable:
    """Tabulate the quasi-static law of a joint over the range of its reference.

    Arguments and errors as of `tendonff.make_table`.
    """
    task, file = JointTask.of(scenario), scenario.source.name
    sampled, mechanism = task.sampled, task.mechanism
    if scenario.reference.quantity is JointQuantity.TORQUE:
        raise InputError(f"{file}: a table over the angle has no room for a torque; export the inverse by export-c")
    if any(t.follows(name) for t in mechanism.tendons for name in sampled.others(mechanism.joint.name)):
        raise InputError(f"{file}: no table can hold a path that other joints move; export the inverse by export-c")
    low, high = float(sampled.angle_rad.min()), float(sampled.angle_rad.max())
    bound = BOUND_SHARE * sampled.range
    arm, drum = abs(mechanism.arms_at(low)[0]), mechanism.drum_radius_m[0] / mechanism.drive.gear_ratio
    nodes = _LEAST
    while True:
        angle, fine = np.linspace(low, high, nodes), np.linspace(low, high, 2 * nodes - 1)
        motor = {name: _branch(task, angle, way) for name, way in BRANCHES.items()}
        between = [_branch(task, fine, way) - _looked_up(angle, motor[name], fine) for name, way in BRANCHES.items()]
        error = float(np.abs(between).max()) * drum / arm
        if error <= bound or nodes >= _MOST:
            break
        nodes = 2 * nodes - 1
    table = MotorCompensator(
        name="table",
        label="table over angle and direction",
        style=Style(color=GREEN, linestyle="-"),
        motor_rad=lambda own: _command(own, angle, motor),
    )
    each = (motor_compensator(task, "linear"), table, motor_compensator(task, "inverse"))
    commands = {one.name: one.command_rad(task) for one in each}
    return JointTable(
        scenario=scenario,
        angle_rad=angle,
        motor_rad=motor,
        error_rad=error,
        masses=task.masses,
        expectation=task.expect(commands),
    )


def _branch(task: JointTask, angle_rad: FloatArray, way: float) -> FloatArray:
    """Motor angles relative to the start, shape (rows, motors), while the joint turns one way."""
    joint = task.mechanism.joint
    angle = np.concatenate([task.sampled.angle_rad[:1], angle_rad])  # a run counts from its start at rest
    ways = np.append(0.0, np.full(len(angle_rad), way))
    held = joint.static_torque_N_m(angle) + ways * joint.coulomb_N_m
    return static_motor_rad(task.mechanism, angle, held, direction=ways)[1:]


def _looked_up(nodes_rad: FloatArray, motor_rad: FloatArray, angle_rad: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(angle_rad, nodes_rad, column) for column in motor_rad.T])


def _command(task: MotorTask, nodes_rad: FloatArray, motor_rad: dict[str, FloatArray]) -> FloatArray:
    """Motor angles by the table, shape (rows, motors); at the start at rest none."""
    angle = task.sampled.angle_rad
    ways = directions(angle)[:, None]
    up, down = (_looked_up(nodes_rad, motor_rad[name], angle) for name in BRANCHES)
    found: FloatArray = np.where(ways > 0, up, np.where(ways < 0, down, 0.0))
    found[0] = 0.0
    return found


def _motors(scenario: JointScenario) -> list[str]:
    names = motor_names(scenario.mechanism)
    return ["motor_rad"] if names == ("motor",) else [f"motor_{name}_rad" for name in names]


def _header(result: JointTable, prefix: str) -> str:
    """The table as constants of C."""
    guard, joint = f"{prefix.upper()}_JOINT_TABLE", result.scenario.mechanism.joint.name
    motors = _motors(result.scenario)

    def row(values: FloatArray) -> str:
        return ", ".join(repr(float(value)) for value in values)

    branches = [
        f"static const double {prefix}_joint_table_{branch}_rad[{guard}_NODES][{guard}_MOTORS] = {{\n"
        + "".join(f"    {{{row(node)}}},\n" for node in values)
        + "};\n"
        for branch, values in result.motor_rad.items()
    ]
    return "\n".join(
        (
            f"/* Motor angles relative to the start [rad] over the angle of the joint {joint} [rad],",
            f" * for both ways it turns; straight between the nodes. Columns: {', '.join(motors)}.",
            f" * Scenario {result.scenario.digest()}. */",
            f"#ifndef {guard}_H\n#define {guard}_H\n",
            f"#define {guard}_NODES ({len(result.angle_rad)})\n#define {guard}_MOTORS ({len(motors)})\n",
            f"static const double {prefix}_joint_table_angle_rad[{guard}_NODES] = {{{row(result.angle_rad)}}};\n",
            *branches,
            "#endif\n",
        )
    )


def _figure(result: JointTable) -> Figure:
    """Motor angle beyond a straight line, over the joint's angle."""
    figure, axes = new_figure(1, 1)
    panel, angle = axes[0, 0], result.angle_rad
    for k, motor in enumerate(motor_names(result.scenario.mechanism)):
        middle = 0.5 * sum(values[:, k] for values in result.motor_rad.values())
        line = np.polyval(np.polyfit(angle, middle, 1), angle)
        for (branch, values), colour in zip(result.motor_rad.items(), (INK, VERMILION), strict=True):
            label = f"{branch}" + (f", {motor}" if len(motor_names(result.scenario.mechanism)) > 1 else "")
            style = ("-", "--")[k % 2]
            panel.plot(np.rad2deg(angle), np.rad2deg(values[:, k] - line), style, color=colour, label=label)
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
