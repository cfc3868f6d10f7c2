"""The report of an identification."""

from collections.abc import Mapping
from dataclasses import fields
from shlex import quote

from matplotlib.figure import Figure

from tendonff.compensator.files.text import as_argument
from tendonff.compensator.identification.answer.estimate import reasons_of
from tendonff.compensator.identification.answer.result import RULE, AnyIdentification, headline
from tendonff.compensator.reporting.page import (
    Block,
    Cell,
    FileNote,
    Provenance,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
)
from tendonff.compensator.scenario.measurement import Measurement

_CAPTIONS = {
    "time": "Measured and predicted, over time.",
    "torque": "Torque of each motor, measured and by the law from the motors' angles alone.",
    "loop": "Measured and predicted, over what drives it: friction opens loops.",
    "residuals": "Residuals. Systematic structure indicates unmodelled physics.",
    "relaxation": "Measured and predicted elongation.",
    "joint": "Angle of each joint: encoder, and the law from the motors' angles.",
    "sensor": "Angle of the joint: encoder, and the virtual sensor from the motor, with its 95 % band.",
    "torque_at_joint": "Torque at the joint: measured, and by the law from the motor, with its 95 % band.",
}
_SUGGESTED = {
    "suggested_force": ("Suggested excitation.", "a force file for the next measurement"),
    "suggested_motor": (
        "Suggested routine: motor angle, and what the fitted mechanism is expected to do.",
        "motor angles for the next log",
    ),
}
"""Caption of the figure and content of the file, by the name of both."""

_OF_FILES = {
    "condition_rad": "{} [rad]",
    "rms_N": "RMS error [N]",
    "rms_m": "RMS error [m]",
    "range_N": "range [N]",
    "range_m": "range [m]",
    "rms_percent_of_range": "% of its range",
    "torque_rms_N_m": "torque of {}, RMS [N m]",
    "torque_percent_of_range": "torque of {}, % of range",
    "joint_rms_deg": "{}, RMS [deg]",
    "joint_by_torques_rms_deg": "{} by torques alone, RMS [deg]",
    "mu_theta": "mu theta of {}",
}
"""Columns of the table of files, by their keys in `fit.json`."""

_PLAIN = {
    "torque_constant_N_m_per_A": "--torque-constant",
    "drum_radius_m": "--drum-radius",
    "gear_ratio": "--gear-ratio",
    "cutoff_Hz": "--cutoff",
    "skip_s": "--skip",
}
"""Options that are a number."""


def identification_report(found: AnyIdentification, figures: Mapping[str, Figure]) -> Report:
    """The page of an identification."""
    notes = [
        FileNote(name="fitted.toml", content="the scenario with the estimates put in"),
        FileNote(name="fit.json", content="estimates, intervals, correlations and errors for other programs"),
    ]
    after = list[Block]()
    for name, (caption, content) in _SUGGESTED.items():
        if name in figures:
            text = f"{name}.csv is for the next log of this rig; it excites what was not identifiable so far."
            after += [Text(text), *pictures_of({name: figures[name]}, {name: caption}).values()]
            notes.append(FileNote(name=f"{name}.csv", content=content))
    shown = {name: figures[name] for name in _CAPTIONS if name in figures}
    data = "".join(f" --{'data' if f.role == 'fit' else 'validate'} {quote(f.name)}" for f in found.files)
    static = "" if found.explain is None or any(law.stage == "dynamic" for law in found.laws) else " --static"
    sections = (
        ("Estimates", [_estimates(found)]),
        ("Friction by section", [_by_section(found)]),
        ("Model and measurement", list(pictures_of(shown, _CAPTIONS).values())),
        ("Choice of the law", [_laws(found), _effects(found), _sliding(found), _looks(found)]),
        ("Measured files", [_files(found)]),
        ("Next measurement", after),
    )
    filled = ((title, [b for b in blocks if not isinstance(b, Table) or b.rows]) for title, blocks in sections)
    return Report(
        title=f"Identification: {found.asked.name}",
        summary=headline(found),
        fine_print=found.missing.replace("not identifiable (see the report)", "Not identifiable"),
        warnings=found.warnings,
        sections=tuple(Section(title=title, blocks=blocks) for title, blocks in filled if blocks),
        provenance=Provenance(
            scenario=found.asked,
            command=f"tendonff identify {as_argument(found.asked.source)}{data}{_options(found.how)}{static} --out DIR",
            inputs=found.inputs,
        ),
        files=tuple(notes),
    )


def _estimates(found: AnyIdentification) -> Table:
    return Table(
        caption=(
            "Estimates; not identifiable: the scenario's value, or what the law takes for it; doubtful: fitted with "
            "the others"
        ),
        columns=("value", "unit", "estimate", "95 % interval", "identifiable", "scenario", "why"),
        rows=[
            (e.name, e.unit, e.value, _interval(e.interval), e.standing, e.scenario, why)
            for e, why in zip(found.estimates, reasons_of(found.estimates), strict=True)
        ],
        digits=4,
    )


def _by_section(found: AnyIdentification) -> Table:
    return Table(
        caption="Friction by section, between neighbouring tension cells, with standard errors",
        columns=("from", "to", "angle [rad]", "mu pulling", "+-", "mu releasing", "+-"),
        rows=[
            (s.start, s.stop, s.stop_rad - s.start_rad, s.mu, s.mu_error, s.mu_release, s.mu_release_error)
            for s in found.sections
        ],
    )


def _laws(found: AnyIdentification) -> Table:
    return Table(
        caption=f"Laws that were compared, RMS error in % of range; chosen: {RULE}",
        columns=("law", "stage", "free values", "fitted files", "held-out data", "chosen"),
        rows=[(w.name, w.stage, w.free_values, w.fit_percent, w.validation_percent, w.chosen) for w in found.laws],
    )


def _effects(found: AnyIdentification) -> Table:
    return Table(
        caption="Effects that were tried: gain of log-likelihood that each promises; worth it from 4 on",
        columns=("effect", "gain", "taken up"),
        rows=[(e.name, e.gain_of_log_likelihood, e.taken_up) for e in found.effects],
    )


def _sliding(found: AnyIdentification) -> Table:
    return Table(
        caption="Gross sliding, before any model: ln of input over output tension",
        columns=("branch", "ln ratio", "5 to 95 %", "samples", "remark"),
        rows=[(str(g.branch), g.log_ratio, _interval(g.interval), g.rows, g.reason) for g in found.sliding],
    )


def _looks(found: AnyIdentification) -> Table:
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


def _files(found: AnyIdentification) -> Table:
    """Errors by file; what is known of no file has no column, mu theta only where it differs between files."""
    columns, first = dict[str, list[Cell]](), found.files[0]
    for key, title in _OF_FILES.items():
        if key == "mu_theta" and not first.named("condition_rad"):
            continue
        for name in first.named(key):
            columns[title.format(name)] = [file.named(key)[name] for file in found.files]
        if isinstance(first.numbers.get(key), float):
            columns[title] = [float(file.numbers[key]) for file in found.files]  # type: ignore[arg-type]
    columns = {title: cells for title, cells in columns.items() if any(cell is not None for cell in cells)}
    return Table(
        caption="Error by file",
        columns=("file", "role", *columns, "data issues"),
        rows=[
            (file.name, file.role, *cells, "; ".join(finding.text for finding in file.findings) or "none")
            for file, *cells in zip(found.files, *columns.values(), strict=True)
        ],
    )


def _options(how: Measurement) -> str:
    """Options that read the files in the same way."""
    usual, words = Measurement(), []
    for name in (field.name for field in fields(how)):
        value = getattr(how, name)
        if value == getattr(usual, name):
            continue
        if name == "tension_columns":
            cells = zip(value, how.tension_angles_rad or (), strict=True)
            words += [f"--tension-column {quote(f'{column}={angle:g}')}" for column, angle in cells]
        elif name.endswith("_column"):
            words.append(f"--{name.replace('_', '-')} {quote(value)}")
        elif name.endswith("_scale"):
            words.append(f"--scale {name.removesuffix('_scale')}={value:g}")
        elif name.endswith("_offset_N"):
            words.append(f"--offset {name.removesuffix('_offset_N')}={value:g}")
        elif name == "tare_s":
            words.append(f"--tare {value[0]:g}:{value[1]:g}")
        elif name == "columns":
            words.append(f"--columns {quote(','.join(value))}")
        elif name in ("channels", "conditions"):
            words += [f"--{name.removesuffix('s')} {quote(each)}" for each in value]
        elif name in _PLAIN:
            words.append(f"{_PLAIN[name]} {value:g}")
        elif name == "explain":
            words.append(f"--explain {value}")
    return "".join(f" {word}" for word in words)


def _interval(bounds: tuple[float, float] | None) -> str | None:
    return None if bounds is None else f"{bounds[0]:.4g} to {bounds[1]:.4g}"
