"""The report of an identification."""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from shlex import quote

from tendonff.compensator.files.text import as_argument
from tendonff.compensator.identification.answer.result import (
    RULE,
    Estimate,
    Identification,
    headline,
    missing,
    reasons_of,
)
from tendonff.compensator.reporting.page import Block, FileNote, PictureFile, Provenance, Report, Section, Table, Text
from tendonff.compensator.scenario.measurement import Measurement

_CAPTIONS = {
    "time": "Measured and predicted output tension.",
    "loop": "Output over input tension.",
    "residuals": "Residuals. Systematic structure indicates unmodelled physics.",
    "relaxation": "Measured and predicted elongation.",
}


_PLAIN = {
    "torque_constant_N_m_per_A": "--torque-constant",
    "drum_radius_m": "--drum-radius",
    "gear_ratio": "--gear-ratio",
    "cutoff_Hz": "--cutoff",
    "skip_s": "--skip",
}
"""Options that are a number."""


def identification_report(found: Identification, pictures: Mapping[str, Path]) -> Report:
    """The page of an identification whose figures lie in files, by name."""
    estimates = Table(
        caption=(
            "Estimates; not identifiable: the scenario's value, or what the law takes for it; doubtful: fitted with "
            "the others"
        ),
        columns=("value", "estimate", "standard error", "95 % interval", "identifiable", "why"),
        rows=[
            (e.name, e.value, e.standard_error, _interval(e.interval), _standing(e), why)
            for e, why in zip(found.estimates, reasons_of(found.estimates), strict=True)
        ],
        digits=4,
    )
    laws = Table(
        caption=f"Laws that were compared, RMS error in % of range; chosen: {RULE}",
        columns=("law", "stage", "free values", "fitted files", "held-out data", "chosen"),
        rows=[(w.name, w.stage, w.free_values, w.fit_percent, w.validation_percent, w.chosen) for w in found.laws],
    )
    files = Table(
        caption="Error by file",
        columns=("file", "role", "RMS error", "range", "% of its range", "data issues"),
        rows=[
            (
                f.error.name,
                f.role,
                f.error.rms,
                f.error.span,
                f.error.percent,
                "; ".join(finding.text for finding in f.findings) or "none",
            )
            for f in found.files
        ],
    )
    sliding = Table(
        caption="Gross sliding, before any model: ln of input over output tension",
        columns=("branch", "ln ratio", "5 to 95 %", "samples", "remark"),
        rows=[(str(g.branch), g.log_ratio, _interval(g.interval), g.rows, g.reason) for g in found.sliding],
    )
    by_section = Table(
        caption="Friction by section, between neighbouring tension cells, with standard errors",
        columns=("from", "to", "angle [rad]", "mu pulling", "+-", "mu releasing", "+-"),
        rows=[
            (s.start, s.stop, s.stop_rad - s.start_rad, s.mu, s.mu_error, s.mu_release, s.mu_release_error)
            for s in found.sections
        ],
    )
    shown: list[Block] = [
        PictureFile(path=pictures[name], caption=caption) for name, caption in _CAPTIONS.items() if name in pictures
    ]
    excitation = pictures.get("suggested_force")
    after: tuple[Block, ...] = ()
    notes = [
        FileNote(name="fitted.toml", content="the scenario with the estimates put in; the one printed below"),
        FileNote(name="fit.json", content="estimates, intervals, correlations and errors for other programs"),
    ]
    if excitation is not None:
        text = (
            "suggested_force.csv is a force for the next measurement on this rig; it excites what was not identifiable "
            "so far."
        )
        after = (Text(text), PictureFile(path=excitation, caption="Suggested excitation."))
        notes.append(FileNote(name="suggested_force.csv", content="a force file for the next measurement"))
    name = as_argument(found.scenario.source)
    data = "".join(f" --{'data' if f.role == 'fit' else 'validate'} {quote(f.error.name)}" for f in found.files)
    static = "" if any(law.stage == "dynamic" for law in found.laws) else " --static"
    return Report(
        title=f"Identification: {found.scenario.name}",
        summary=headline(found),
        fine_print=missing(found).replace("not identifiable (see the report)", "Not identifiable"),
        warnings=found.warnings,
        sections=tuple(
            section
            for section in (
                Section(title="Estimates", blocks=(estimates,)),
                Section(title="Friction by section", blocks=(by_section,) if found.sections else ()),
                Section(title="Model and measurement", blocks=shown),
                Section(title="Choice of the law", blocks=(laws, sliding)),
                Section(title="Measured files", blocks=(files,)),
                Section(title="Next measurement", blocks=after),
            )
            if section.blocks
        ),
        provenance=Provenance(
            scenario=found.scenario,
            command=f"tendonff identify {name}{data}{_options(found.asked)}{static} --out DIR",
            inputs=found.inputs,
        ),
        files=tuple(notes),
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
        elif name in _PLAIN:
            words.append(f"{_PLAIN[name]} {value:g}")
        elif name == "explain":
            words.append(f"--explain {value}")
    return "".join(f" {word}" for word in words)


def _standing(estimate: Estimate) -> str:
    return "yes" if estimate.identifiable else "doubtful" if estimate.fitted else "no"


def _interval(bounds: tuple[float, float] | None) -> str | None:
    return None if bounds is None else f"{bounds[0]:.4g} to {bounds[1]:.4g}"
