"""The page of a joint's design."""

import math
from collections.abc import Mapping

from matplotlib.figure import Figure

from tendonff.compensator.compensators.expected import robustness_table
from tendonff.compensator.feedback.report import CAPTIONS as FEEDBACK_CAPTIONS
from tendonff.compensator.feedback.report import feedback_section
from tendonff.compensator.joint.design.result import JointDesign
from tendonff.compensator.reporting.colours import INK, Style
from tendonff.compensator.reporting.interactive import zoomed
from tendonff.compensator.reporting.page import (
    Block,
    FileNote,
    Interactive,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
    provenance_of,
)

_CAPTIONS = {
    "joint": "Joint angle and reference, and the errors, on the verifying mechanism.",
    "tension": "Tensions at the joint under the exact inverse.",
    "motor": "What the motor turns beyond the ratio alone, and the torque that it gives.",
    "contributions": "RMS error of the recommended profile with one parameter at the worse end of its interval.",
    "pretension": "Left: lost motion over friction of the drive as the pre-tension rises. Right: the torque from which "
    "a tendon goes slack; the dotted line is the largest of the reference. The dot is this scenario.",
}


def interactive_panels(result: JointDesign) -> Interactive:
    """Angle or torque, motor and error of all profiles, to be zoomed."""
    scale, shown = (180 / math.pi, "deg") if result.is_angle else (1.0, "N m")
    wanted = result.sampled.wanted[result.sampled.lead :]
    reached = {"reference": (scale * wanted, Style(color=INK, linestyle="-"))}
    motor, error = {}, {}
    for c in result.compensators:
        profile = result.profiles[c.name]
        reached[c.label] = (scale * profile.reached, c.style)
        motor[c.label] = (profile.motor_rad[:, 0], c.style)
        error[c.label] = (scale * profile.error, c.style)
    goal = "joint angle" if result.is_angle else "torque of the joint"
    panels = {f"{goal} [{shown}]": reached, "motor [rad]": motor, f"error [{shown}]": error}
    return zoomed(result.sampled.run_time_s, panels, f"{result.masses} masses a tendon, the design's own parameters.")


def joint_report(result: JointDesign, figures: Mapping[str, Figure], view: Interactive | None = None) -> Report:
    """The page of a design."""
    unit = "deg" if result.is_angle else "N m"
    scale = 180 / math.pi if result.is_angle else 1.0
    errors = Table(
        caption=f"Error on the verifying mechanism, {result.masses} masses a tendon and step/{result.refinement}",
        columns=("compensator", f"RMS [{unit}]", "RMS [% of range]", f"peak [{unit}]"),
        rows=[
            (c.label, scale * p.rms, result.percent(p.rms), scale * p.peak)
            for c in result.compensators
            for p in (result.profiles[c.name],)
        ],
    )
    pictures = pictures_of(figures, _CAPTIONS | FEEDBACK_CAPTIONS)
    first = "Joint angle" if result.is_angle else "Torque of the joint"
    sections = [
        Section(title=first, blocks=(pictures["joint"], errors)),
        *([] if view is None else [Section(title="Interactive view", blocks=(view,))]),
        Section(title="Robustness to parameter uncertainty", blocks=(*_robustness(result), pictures["contributions"])),
        *([feedback_section(result.feedback, pictures)] if result.feedback else []),
        *(
            [Section(title="Data sheet of the loop", blocks=(_sheet(result), pictures["pretension"]))]
            if result.sheet
            else []
        ),
        Section(title="Tensions", blocks=(pictures["tension"],)),
        Section(title="Motor", blocks=(pictures["motor"],)),
    ]
    scenario = result.scenario
    return Report(
        title=f"Design: {scenario.name}",
        summary=result.headline,
        fine_print=result.fine_print,
        warnings=result.warnings,
        sections=tuple(sections),
        provenance=provenance_of(scenario, "design"),
        files=(
            FileNote(name="profile.csv", content="motor commands, tensions and torque of every sample"),
            FileNote(name="summary.json", content="errors and data sheet for other programs"),
        ),
    )


def _robustness(result: JointDesign) -> tuple[Block, ...]:
    """Errors over what is uncertain, and what the robust profile is made for."""
    found, middle = result.expectation, result.middle
    table = robustness_table(found, {c.name: c.label for c in result.compensators}, result.masses)
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


def _backlash_of_joint(result: JointDesign) -> float:
    """Half the play of the gear, as an angle of the joint at the start [rad]."""
    mechanism = result.scenario.mechanism
    arms = mechanism.arms_at(float(result.sampled.angle_rad[0]))
    drum = mechanism.drum_radius_m[0] / mechanism.drive.gear_ratio
    return 0.5 * mechanism.drive.play_rad * drum / abs(arms[0])


def _sheet(result: JointDesign) -> Table:
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
