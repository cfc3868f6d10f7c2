"""Files, figure and report of the table of a joint."""

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.expected import expectation_summary, robustness_table
from tendonff.compensator.compensators.motors.joint import motor_names
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.reporting.colours import INK, VERMILION
from tendonff.compensator.reporting.page import (
    FileNote,
    Report,
    Section,
    Text,
    pictures_of,
    provenance_of,
    summary_head,
)
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure
from tendonff.compensator.studies.tables.motor import MotorTables, channels
from tendonff.compensator.studies.tables.output import Pages


def table_columns(result: MotorTables) -> dict[str, list[object]]:
    """The columns of `table.csv`: one row per node."""
    motors, by_speed = channels(result.scenario), len(result.law.speeds_rad_per_s) > 1
    rows = [
        (float(angle), branch, *((speed,) if by_speed else ()), *motor)
        for branch, every in result.law.motor_rad.items()
        for speed, values in zip(result.law.speeds_rad_per_s, every, strict=True)
        for angle, motor in zip(result.law.angle_rad, values.tolist(), strict=True)
    ]
    names = ["angle_rad", "branch", *(["speed_rad_per_s"] if by_speed else []), *motors]
    return {name: list(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}


def summary(result: MotorTables) -> dict[str, object]:
    """The contents of `summary.json`."""
    return {
        **summary_head(result.scenario),
        "nodes": result.nodes,
        "interpolation_error_rad": result.law.error_rad,
        "expectation": expectation_summary(result.expectation, result.masses),
    }


def table_header(result: MotorTables, prefix: str) -> str:
    """The table as constants of C."""
    guard, joint = f"{prefix.upper()}_JOINT_TABLE", result.scenario.mechanism.joint.name
    motors, speeds = channels(result.scenario), result.law.speeds_rad_per_s
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
        for branch, every in result.law.motor_rad.items()
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
            f"#define {guard}_NODES ({len(result.law.angle_rad)})\n#define {guard}_MOTORS ({len(motors)})\n",
            f"static const double {prefix}_joint_table_angle_rad[{guard}_NODES] = {{{row(result.law.angle_rad)}}};\n",
            *(axis if by_speed else ()),
            *branches,
            "#endif\n",
        )
    )


def table_figures(table: MotorTables) -> dict[str, Figure]:
    """The figure by file name."""
    with figure_style():
        return {"table": _figure(table)}


def _figure(result: MotorTables) -> Figure:
    """Motor angle beyond a straight line, over the joint's angle."""
    figure, axes = new_figure(1, 1)
    panel, angle = axes[0, 0], result.law.angle_rad
    for k, motor in enumerate(motor_names(result.scenario.mechanism)):
        middle = 0.5 * sum(values[0, :, k] for values in result.law.motor_rad.values())
        line = np.polyval(np.polyfit(angle, middle, 1), angle)
        for (branch, values), colour in zip(result.law.motor_rad.items(), (INK, VERMILION), strict=True):
            label = f"{branch}" + (f", {motor}" if len(motor_names(result.scenario.mechanism)) > 1 else "")
            style = ("-", "--")[k % 2]
            panel.plot(np.rad2deg(angle), np.rad2deg(values[0, :, k] - line), style, color=colour, label=label)
    panel.set(xlabel="joint angle [deg]", ylabel="motor less a line [deg]")
    legend_below(figure, panel, columns=4)
    return figure


def table_report(result: MotorTables, figures: dict[str, Figure]) -> Report:
    """The page of a table."""
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
        warnings=result.warnings,
        sections=(
            Section(title="Motor over angle and direction", blocks=(pictures_of(figures, captions)["table"], text)),
            Section(
                title="What to expect on a rig",
                blocks=(robustness_table(result.expectation, labels, result.masses),),
            ),
        ),
        provenance=provenance_of(result.scenario, "table", result.options),
        files=(
            FileNote(name="table.csv", content="motor angles relative to the start, by angle and branch"),
            FileNote(name="table.h", content="the same as constants of C"),
            FileNote(name="summary.json", content="everything on this page for other programs"),
        ),
    )


VIEWS = Pages(
    columns=table_columns,
    header=table_header,
    numbers=summary,
    file="summary.json",
    figures=table_figures,
    report=table_report,
).views
