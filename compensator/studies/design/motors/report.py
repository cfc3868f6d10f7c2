"""The page of a design of motor angles."""

import math
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from matplotlib.figure import Figure

from tendonff.compensator.compensators.expected import CONTRIBUTIONS, robustness_table
from tendonff.compensator.feedback.report import CAPTIONS as FEEDBACK_CAPTIONS
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.reporting.colours import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, Style
from tendonff.compensator.reporting.interactive import zoomed
from tendonff.compensator.reporting.page import (
    Block,
    Interactive,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
)
from tendonff.compensator.studies.design.motors.result import MotorDesign
from tendonff.compensator.studies.design.page import design_page

Curve: TypeAlias = tuple[FloatArray, Style]

_CAPTIONS = {
    "joint": "What was wanted, and the errors of all compensators, on the verifying mechanism.",
    "tension": "Tensions at the far ends under the exact inverse.",
    "motor": "What the motors turn beyond the ratio alone, and the torque that they give.",
    "contributions": CONTRIBUTIONS,
    "pretension": "Left: lost motion over friction of the drive as the pre-tension rises. Right: the torque from which "
    "a tendon goes slack; the dotted line is the largest of the reference. The dot is this scenario.",
}


def interactive_panels(result: MotorDesign) -> Interactive:
    """Angles or torques, motors and errors, to be zoomed: of one joint all profiles, of several the exact inverse."""
    goal, task = result.goal, result.task
    scale = goal.unit.factor
    reached, motor, error = dict[str, Curve](), dict[str, Curve](), dict[str, Curve]()
    if not goal.is_named:
        reached["reference"] = (scale * task.target[:, 0], Style(color=INK, linestyle="-"))
        for c in result.compensators:
            profile = result.profiles[c.name]
            reached[c.label] = (scale * profile.reached[:, 0], c.style)
            motor[c.label] = (profile.motor_rad[:, 0], c.style)
            error[c.label] = (scale * profile.error[:, 0], c.style)
    else:
        inverse = result.profiles["inverse"]
        reached = _curves(goal.names, scale * inverse.reached)
        motor = _curves(task.motors, inverse.motor_rad)
        error = _curves(goal.names, scale * inverse.error)
    shown = goal.unit.shown
    panels = {f"{goal.quantity} [{shown}]": reached, "motor [rad]": motor, f"error [{shown}]": error}
    whose = "Exact inverse" if goal.is_named else "All profiles"
    return zoomed(task.target_time_s, panels, f"{whose}, {task.masses} masses a tendon, the design's own parameters.")


def _curves(names: Sequence[str], columns: FloatArray) -> dict[str, Curve]:
    colours, dashes = (INK, BLUE, ORANGE, GREEN, PURPLE, GREY), ("-", "--", ":", "-.")
    return {
        name: (column, Style(color=colours[k % len(colours)], linestyle=dashes[k // len(colours) % 4]))
        for k, (name, column) in enumerate(zip(names, columns.T, strict=True))
    }


def design_report(result: MotorDesign, figures: Mapping[str, Figure], view: Interactive | None = None) -> Report:
    """The page of a design."""
    goal, scale = result.goal, result.goal.unit.factor
    each = goal.each
    unit = goal.unit.shown
    errors = Table(
        caption=f"RMS error [{unit}] on the verifying mechanism, {result.verifying}",
        columns=("compensator", *each, "all joints" if each else "RMS", "RMS [% of range]", f"peak [{unit}]"),
        rows=[
            (
                c.label,
                *((scale * p.rms_each).tolist() if each else ()),
                scale * p.rms,
                result.percent(p.rms),
                scale * p.peak,
            )
            for c in result.compensators
            for p in (result.profiles[c.name],)
        ],
    )
    pictures = pictures_of(figures, _CAPTIONS | FEEDBACK_CAPTIONS)
    sheet: tuple[Block, ...] = tuple(_sheets_of_joints(result)) if result.tendons else ()
    if result.sheet is not None:
        sheet = (_sheet_of_loop(result), pictures["pretension"])
    return design_page(
        result,
        pictures,
        view,
        first=Section(title=goal.title, blocks=(pictures["joint"], errors)),
        robustness=(*_robustness(result), pictures["contributions"]),
        own=(
            *([Section(title="Data sheet", blocks=sheet)] if sheet else []),
            Section(title="Tensions", blocks=(pictures["tension"],)),
            Section(title="Motors", blocks=(pictures["motor"],)),
        ),
        fine_print=result.fine_print,
        files=(
            "references, motor commands and torques, tensions of every sample",
            "errors and data sheet for other programs",
        ),
    )


def _robustness(result: MotorDesign) -> tuple[Block, ...]:
    """Errors over what is uncertain, and what the robust profile is made for."""
    found, middle = result.expectation, result.task.middle
    table = robustness_table(found, {c.name: c.label for c in result.compensators}, result.doubt_masses)
    if middle is None:
        note = f"For {found.doubt}."
        if found.doubt.is_assumed:
            note += " State what is uncertain in [robust.spread], the stiffness too: then a further profile is designed"
            note += " for the middle of the compliances."
        return table, Text(note)
    stiffness = ", ".join(f"{t.name} {t.tendon.stiffness_N_per_m:.6g} N/m" for t in middle.tendons)
    return table, Text(
        f"For {found.doubt}. Lost motion is proportional to the compliance of the tendons, so a design for the middle "
        f"of the compliances has the least error at the worse end, and more than the others where the stiffness is "
        f"right. It assumes {stiffness}: to use it on a controller, write these values into the scenario that is "
        "exported."
    )


def _backlash_of_joint(result: MotorDesign) -> float:
    """Half the play of the gear, as an angle of the joint at the start [rad]."""
    mechanism = result.task.system
    arms = mechanism.arms_at(float(result.task.sampled.angle_rad[0]))
    drum = mechanism.drum_radius_m[0] / mechanism.drive.gear_ratio
    return float(0.5 * mechanism.drive.play_rad * drum / abs(arms[0]))


def _sheet_of_loop(result: MotorDesign) -> Table:
    """Closed forms, in words."""
    sheet = result.sheet
    rows: list[tuple[str, float, str]] = []
    if sheet is not None:
        rows = [
            ("lost motion of the joint, either way", math.degrees(sheet.lost_motion_rad), "deg"),
            *(
                [("backlash of the gear, either way", math.degrees(play), "deg")]
                if (play := _backlash_of_joint(result))
                else []
            ),
            ("friction torque at the drum, either direction", sheet.drive_torque_N_m, "N m"),
            ("the same as a force", sheet.drive_force_N, "N"),
            ("least tension at the joint, turning without load", sheet.least_tension_N, "N"),
            ("torque that makes a tendon slack, against the load", sheet.slack_torque_N_m, "N m"),
            ("the same while the joint yields", sheet.slack_torque_paying_out_N_m, "N m"),
            ("largest torque of the reference", sheet.largest_torque_N_m, "N m"),
            ("least pre-tension without slack", sheet.least_pretension_N, "N"),
            ("recommended pre-tension", sheet.recommended_pretension_N, "N"),
            ("slope against a hard stop: ratio with both tendons taut to one slack", sheet.stop_ratio, "-"),
        ]
    return Table(
        caption="Closed forms: full sliding, quasi-static, both tendons taut",
        columns=("quantity", "value", "unit"),
        rows=rows,
    )


def _sheets_of_joints(result: MotorDesign) -> list[Table]:
    """Data sheet: numbers of each tendon over the motion, and of each joint at its start."""
    found, tendons, joints = result.inversion, result.tendons, result.joints
    columns = ["tendon", "largest wrap angle [deg]", "tension ratio of full sliding [-]"]
    columns += ["least tension [N]", "largest tension [N]", "largest at the drum [N]"]
    columns += ["drive friction [N]", "lost motion of the motor [deg]"]
    rows: list[list[str | float | None]] = [
        [
            each.name,
            math.degrees(each.wrap_angle_rad),
            each.tension_ratio,
            float(found.tension_N[:, k].min()),
            float(found.tension_N[:, k].max()),
            float(found.drum_N[:, k].max()),
            each.drive_friction_N,
            math.degrees(each.lost_motion_rad),
        ]
        for k, each in enumerate(tendons)
    ]
    if any(each.least_pretension_N is not None for each in tendons):
        columns.append("least pre-tension [N]")
        for row, each in zip(rows, tendons, strict=True):
            row.append(each.least_pretension_N)
    tables = [Table(caption="Tendons over the motion", columns=tuple(columns), rows=[tuple(row) for row in rows])]
    if all(each.lost_motion_rad is None for each in joints):
        return tables
    reach = all(each.torque_N_m is not None for each in joints)
    head: tuple[str, ...] = ("joint", "lost motion by tendon lengths alone [deg]")
    head += ("least torque [N m]", "largest torque [N m]") if reach else ()
    cells = [
        (
            each.name,
            None if each.lost_motion_rad is None else math.degrees(each.lost_motion_rad),
            *((each.torque_N_m or ()) if reach else ()),
        )
        for each in joints
    ]
    said = "" if reach else "; reachable torques appear here once every motor states torque_max_N_m"
    return [*tables, Table(caption=f"Joints at the start, the others at rest{said}", columns=head, rows=cells)]
