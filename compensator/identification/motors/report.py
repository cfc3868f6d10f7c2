"""The page of the identification of driven joints."""

from collections.abc import Mapping
from shlex import quote

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.files.text import as_argument
from tendonff.compensator.identification.answer.result import reasons_of
from tendonff.compensator.identification.motors.result import MotorsIdentification, next_step
from tendonff.compensator.reporting.page import Block, FileNote, Provenance, Report, Section, Table, Text, pictures_of

_CAPTIONS = {
    "torque": "Torque of each motor, measured and by the law from the motors' angles alone.",
    "loop": "The same over the motor's angle: loops of friction, and pushes against a stop.",
    "residuals": "Residuals. Systematic structure indicates unmodelled physics.",
    "joint": "Angle of each joint: encoder, and the law from the motors' angles.",
    "sensor": "Angle of the joint: encoder, and the virtual sensor from the motor, with its 95 % band.",
    "torque_at_joint": "Torque at the joint: measured, and by the law from the motor, with its 95 % band.",
    "suggested_motor": "Suggested routine: motor angle, and what the fitted mechanism is expected to do.",
}


def identification_report(found: MotorsIdentification, figures: Mapping[str, Figure]) -> Report:
    """The page of an identification."""
    pictures = pictures_of(figures, _CAPTIONS)
    notes = [
        FileNote(name="fitted.toml", content="the scenario with the estimates put in"),
        FileNote(name="fit.json", content="estimates, intervals, correlations and errors for other programs"),
    ]
    after: tuple[Block, ...] = ()
    if "suggested_motor" in pictures:
        text = "suggested_motor.csv holds motor angles for the next log: what was not identifiable so far is moved."
        after = (Text(text), pictures["suggested_motor"])
        notes.append(FileNote(name="suggested_motor.csv", content="motor angles for the next log"))
    shown = tuple(pictures[name] for name in _CAPTIONS if name in pictures and name != "suggested_motor")
    data = "".join(f" --{'data' if c.role == 'fit' else 'validate'} {quote(c.name)}" for c in found.comparisons)
    conditions = (f"{c.name}:{j}={angle:.6g}" for c in found.comparisons for j, angle in c.standing_rad.items())
    data += "".join(f" --condition {quote(each)}" for each in conditions)
    sections = (
        Section(title="Estimates", blocks=(_estimates(found),)),
        Section(title="Model and measurement", blocks=shown),
        Section(title="Choice of the law", blocks=(_effects(found), *((_looks(found),) if found.looks else ()))),
        Section(title="Measured files", blocks=(_files(found),)),
        Section(title="Next measurement", blocks=after),
    )
    return Report(
        title=f"Identification: {found.asked.name}",
        summary=f"{found.headline} Next: {step}" if (step := next_step(found)) else found.headline,
        fine_print=found.missing.replace("not identifiable (see the report)", "Not identifiable"),
        warnings=found.warnings,
        sections=tuple(section for section in sections if section.blocks),
        provenance=Provenance(
            scenario=found.asked,
            command=f"tendonff identify {as_argument(found.asked.source)}{data} --out DIR",
            inputs=found.inputs,
        ),
        files=tuple(notes),
    )


def _estimates(found: MotorsIdentification) -> Table:
    return Table(
        caption="Estimates; not identifiable: the scenario's value, or one that belongs to it",
        columns=("value", "unit", "estimate", "95 % interval", "identifiable", "scenario", "why"),
        rows=[
            (
                e.name,
                found.units[e.name],
                e.value,
                None if e.interval is None else f"{e.interval[0]:.4g} to {e.interval[1]:.4g}",
                "yes" if e.identifiable else "no",
                e.scenario,
                why,
            )
            for e, why in zip(found.estimates, reasons_of(found.estimates), strict=True)
        ],
        digits=4,
    )


def _looks(found: MotorsIdentification) -> Table:
    return Table(
        caption="Closed forms, straight lines through strokes and pushes: a first look, 17 to 20 % off in mu theta",
        columns=("friction at the motor [N m]", "pushes", "mu theta", "T/k [mm]"),
        rows=[
            (
                look.drive_torque_N_m,
                len(look.pushes),
                look.exponent,
                None if look.tension_over_stiffness_m is None else 1e3 * look.tension_over_stiffness_m,
            )
            for look in found.looks
        ],
    )


def _effects(found: MotorsIdentification) -> Table:
    return Table(
        caption="Effects that were tried: gain of log-likelihood that each promises; worth it from 4 on",
        columns=("effect", "gain", "taken up"),
        rows=list(found.laws),
    )


def _files(found: MotorsIdentification) -> Table:
    columns = [f"torque {name}, {unit}" for name in found.motors for unit in ("RMS [N m]", "% of range")]
    columns += [f"{name}, RMS [deg]" for name in found.joints]
    bends = list(found.comparisons[0].standing_rad)
    felt = [k for k, each in enumerate(found.comparisons[0].felt_rms_deg) if np.isfinite(each)]
    columns += [f"{found.joints[k]} by torques alone, RMS [deg]" for k in felt]
    exponents = [f"mu theta of {name}" for name in found.comparisons[0].exponents] if bends else []
    return Table(
        caption="Error by file",
        columns=("file", "role", *(f"{name} [rad]" for name in bends), *exponents, *columns, "data issues"),
        rows=[
            (
                c.name,
                c.role,
                *(c.standing_rad[name] for name in bends),
                *(c.exponents.values() if bends else ()),
                *np.column_stack([c.torque_rms_N_m, c.torque_percent]).ravel().tolist(),
                *(float(each) if np.isfinite(each) else None for each in (*c.joint_rms_deg, *c.felt_rms_deg[felt])),
                "; ".join(f.text for f in c.findings) or "none",
            )
            for c in found.comparisons
        ],
    )
