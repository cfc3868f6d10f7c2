"""The page of a joint's design."""

import math
from collections.abc import Mapping

from matplotlib.figure import Figure

from tendonff.compensator.joint.result import LABELS, JointDesignData
from tendonff.compensator.reporting.page import FileNote, Provenance, Report, Section, Table, pictures_of

_CAPTIONS = {
    "joint": "Reached and wanted, and the errors, on the verifying mechanism.",
    "tension": "Tensions at the joint under the exact inverse.",
    "motor": "What the motor turns beyond the ratio alone, and the torque that it gives.",
    "pretension": "Left: lost motion over friction of the drive as the pre-tension rises. Right: the torque from which "
    "a tendon goes slack; the dotted line is the largest of the reference. The dot is this scenario.",
}


def joint_report(result: JointDesignData, figures: Mapping[str, Figure]) -> Report:
    """The page of a design."""
    unit = "deg" if result.is_angle else "N m"
    scale = 180 / math.pi if result.is_angle else 1.0
    errors = Table(
        caption=f"Error on the verifying mechanism, {result.masses} masses a tendon and step/{result.refinement}",
        columns=("compensator", f"RMS [{unit}]", "RMS [% of range]", f"peak [{unit}]"),
        rows=[
            (LABELS[name], scale * p.rms, result.percent(p.rms), scale * p.peak) for name, p in result.profiles.items()
        ],
    )
    spread = Table(
        caption="Error of the exact inverse with one parameter off, the worse way",
        columns=("key", "off by [%]", f"RMS [{unit}]", "RMS [% of range]"),
        rows=[(c.key, 100 * c.spread, scale * c.rms, result.percent(c.rms)) for c in result.contributions],
    )
    pictures = pictures_of(figures, _CAPTIONS)
    first = "Joint angle" if result.is_angle else "Torque of the joint"
    sections = [
        Section(title=first, blocks=(pictures["joint"], errors)),
        *([Section(title="Robustness to parameter uncertainty", blocks=(spread,))] if result.contributions else []),
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
        warnings=result.warnings,
        sections=tuple(sections),
        provenance=Provenance(
            scenario=scenario,
            command=f"tendonff design {scenario.source.name} --out DIR",
            inputs=tuple(path for path in scenario.inputs if path != scenario.reference_file()),
        ),
        files=(
            FileNote(name="profile.csv", content="motor commands, tensions and torque of every sample"),
            FileNote(name="summary.json", content="errors and data sheet for other programs"),
        ),
    )


def _backlash_of_joint(result: JointDesignData) -> float:
    """Half the play of the gear, as an angle of the joint at the start [rad]."""
    mechanism = result.scenario.mechanism
    arms = mechanism.arms_at(float(result.sampled.angle_rad[0]))
    drum = mechanism.drum_radius_m[0] / mechanism.drive.gear_ratio
    return 0.5 * mechanism.drive.play_rad * drum / abs(arms[0])


def _sheet(result: JointDesignData) -> Table:
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
            ("friction that the drum feels, either way", sheet.drive_torque_N_m, "N m"),
            ("the same as a force", sheet.drive_force_N, "N"),
            ("least tension at the joint, turning without load", sheet.least_tension_N, "N"),
            ("torque that makes a tendon slack, against the load", sheet.slack_torque_N_m, "N m"),
            ("the same while the joint gives way", sheet.slack_torque_paying_out_N_m, "N m"),
            ("largest torque of the reference", sheet.largest_torque_N_m, "N m"),
            ("least pre-tension without slack", sheet.least_pretension_N, "N"),
            ("recommended pre-tension", sheet.recommended_pretension_N, "N"),
            ("slope against a hard stop, both taut over one slack", sheet.stop_ratio, "-"),
        ]
    return Table(
        caption="Closed forms: full sliding, quasi-static, both tendons taut",
        columns=("quantity", "value", "unit"),
        rows=rows,
    )
