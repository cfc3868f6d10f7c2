"""The page of the identification of a joint."""

from collections.abc import Mapping
from shlex import quote

from matplotlib.figure import Figure

from tendonff.compensator.files.text import as_argument
from tendonff.compensator.identification.answer.result import reasons_of
from tendonff.compensator.identification.joint.estimates import DERIVED
from tendonff.compensator.identification.joint.parameters import JointNumber
from tendonff.compensator.identification.joint.result import JointIdentification, next_step
from tendonff.compensator.identification.joint.sensor import UNITS
from tendonff.compensator.identification.joint.torque import UNITS as TORQUE_UNITS
from tendonff.compensator.reporting.page import Block, FileNote, Provenance, Report, Section, Table, Text, pictures_of

_CAPTIONS = {
    "torque": "Torque of the motor, measured and by the law from the motor's angle alone.",
    "loop": "The same over the motor's angle: loops of friction, and pushes against a stop.",
    "residuals": "Residuals. Systematic structure indicates unmodelled physics.",
    "joint": "Angle of the joint: encoder, and the law from the motor's angle.",
    "sensor": "Angle of the joint: encoder, and the virtual sensor from the motor, with its 95 % band.",
    "torque_at_joint": "Torque at the joint: measured, and by the law from the motor, with its 95 % band.",
    "suggested_motor": "Suggested routine: motor angle, and what the fitted mechanism is expected to do.",
}


def identification_report(found: JointIdentification, figures: Mapping[str, Figure]) -> Report:
    """The page of an identification."""
    pictures = pictures_of(figures, _CAPTIONS)
    units = {str(n): n.spec.unit for n in JointNumber} | DERIVED | {"torque_scale": "-"}
    units |= {f"sensor_{name}": unit for name, unit in UNITS.items()}
    units |= {f"torque_{name}": unit for name, unit in TORQUE_UNITS.items()}
    estimates = Table(
        caption="Estimates; not identifiable: the scenario's value, or one that belongs to it",
        columns=("value", "unit", "estimate", "95 % interval", "identifiable", "scenario", "why"),
        rows=[
            (
                e.name,
                units[e.name],
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
    first = Table(
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
    effects = Table(
        caption="Effects that were tried: gain of log-likelihood that each promises; taken up from 4 on",
        columns=("effect", "gain", "taken up"),
        rows=list(found.laws),
    )
    files = Table(
        caption="Error by file",
        columns=("file", "role", "torque, RMS [N m]", "% of range", "joint, RMS [deg]", "data issues"),
        rows=[
            (
                c.name,
                c.role,
                c.torque_rms_N_m,
                c.torque_percent,
                c.joint_rms_deg,
                "; ".join(f.text for f in c.findings) or "none",
            )
            for c in found.comparisons
        ],
    )
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
    return Report(
        title=f"Identification: {found.asked.name}",
        summary=f"{found.headline} Next: {step}" if (step := next_step(found)) else found.headline,
        fine_print=found.missing.replace("not identifiable (see the report)", "Not identifiable"),
        warnings=found.warnings,
        sections=tuple(
            section
            for section in (
                Section(title="Estimates", blocks=(estimates,)),
                Section(title="Model and measurement", blocks=shown),
                Section(title="Choice of the law", blocks=(effects, first)),
                Section(title="Measured files", blocks=(files,)),
                Section(title="Next measurement", blocks=after),
            )
            if section.blocks
        ),
        provenance=Provenance(
            scenario=found.asked,
            command=f"tendonff identify {as_argument(found.asked.source)}{data} --out DIR",
            inputs=found.inputs,
        ),
        files=tuple(notes),
    )
