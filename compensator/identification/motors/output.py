"""Writing what the identification of several motors found: `fitted.toml`, `fit.json`, figures, report, routine."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from shlex import quote

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.files.text import as_argument
from tendonff.compensator.files.writing import atomic_directory, write_csv, write_json, write_text
from tendonff.compensator.identification.answer.result import estimate_columns, reasons_of
from tendonff.compensator.identification.joint.fitted import moved_files
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.result import MotorsComparison, MotorsIdentification, next_step
from tendonff.compensator.identification.motors.routine import MotorsRoutine
from tendonff.compensator.reporting.colours import BLUE, INK, VERMILION
from tendonff.compensator.reporting.page import FileNote, Provenance, Report, Section, Table, pictures_of, write_report
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, save_figure, thinned
from tendonff.compensator.reporting.results import Views

_CAPTIONS = {
    "torque": "Torque of each motor: measured, and by the model from the motors' angles.",
    "residuals": "Residuals. Systematic structure indicates unmodelled physics.",
    "joint": "Angle of each joint: encoder, and by the model from the motors' angles.",
}


def write_files(result: MotorsIdentification, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
    """Write the files of `MotorsIdentification.write`."""
    figures = identification_figures(result)
    with atomic_directory(folder) as partial:
        write_text(partial / "fitted.toml", moved_files(result.text, result.asked.source, Path(folder)))
        write_json(partial / "fit.json", result.as_json())
        for name, figure in figures.items():
            save_figure(figure, partial / name, pdf=pdf)
        write_report(partial / "report.html", identification_report(result, figures))


def write_routine(routine: MotorsRoutine, folder: Path, *, pdf: bool = False) -> None:
    """Write suggested motor angles; makes the folder."""
    columns = {"time_s": routine.time_s}
    columns |= {f"motor_{name}_rad": angle for name, angle in zip(routine.names, routine.motor_rad.T, strict=True)}
    with atomic_directory(folder) as partial:
        write_csv(partial / "suggested_motors.csv", columns)
        with figure_style():
            figure, axes = new_figure(2, 1, share_x=True, height_in=4.6)
            for panel, names, angles in (
                (axes[0, 0], routine.names, routine.motor_rad),
                (axes[1, 0], routine.joints, routine.joint_rad),
            ):
                for name, angle in zip(names, angles.T, strict=True):
                    panel.plot(routine.time_s, angle, label=name)
                panel.legend(loc="upper right", fontsize=7)
            axes[0, 0].set(ylabel="motor angle [rad]")
            axes[1, 0].set(xlabel="time [s]", ylabel="joint angle [rad]")
        save_figure(figure, partial / "suggested_motors", pdf=pdf)


def identification_figures(found: MotorsIdentification) -> dict[str, Figure]:
    """All figures by file name, of the file that judges or was fitted first."""
    file = min(found.comparisons, key=lambda c: c.role != "validate")
    with figure_style():
        figures = {
            "torque": _panels(file, found.motors, file.torque_N_m, file.model_N_m, lambda n: f"{n}\n[N m]", "measured"),
            "residuals": _residuals(file, found.motors),
        }
        measured = np.flatnonzero(np.isfinite(file.joint_rad).all(axis=0))
        if measured.size:
            names = tuple(found.joints[k] for k in measured)
            encoder, model = (np.degrees(each[:, measured]) for each in (file.joint_rad, file.model_rad))
            figures["joint"] = _panels(file, names, encoder, model, lambda n: f"{n}\n[deg]", "encoder")
    return figures


def _panels(
    file: MotorsComparison,
    names: Sequence[str],
    measured: Array,
    model: Array,
    label: Callable[[str], str],
    what: str,
) -> Figure:
    figure, axes = new_figure(len(names), 1, share_x=True, height_in=1.3 * len(names) + 0.9)
    rows = thinned(len(file.time_s))
    for k, (panel, name) in enumerate(zip(axes[:, 0], names, strict=True)):
        panel.plot(file.time_s[rows], measured[rows, k], color=INK, label=what)
        panel.plot(file.time_s[rows], model[rows, k], color=VERMILION, linestyle="--", label="model")
        panel.set(ylabel=label(name))
    axes[0, 0].set_title(f"{file.name} ({'validation' if file.role == 'validate' else 'fitted'})")
    axes[-1, 0].set_xlabel("time [s]")
    legend_below(figure, axes[-1, 0])
    return figure


def _residuals(file: MotorsComparison, names: Sequence[str]) -> Figure:
    figure, axes = new_figure(len(names), 1, share_x=True, height_in=1.3 * len(names) + 0.7)
    rows = thinned(len(file.time_s))
    share = 100 * (file.model_N_m - file.torque_N_m) / np.maximum(np.ptp(file.torque_N_m, axis=0), 1e-300)
    for k, (panel, name) in enumerate(zip(axes[:, 0], names, strict=True)):
        panel.axhline(0, color=INK, linewidth=0.6)
        panel.plot(file.time_s[rows], share[rows, k], color=BLUE)
        panel.set(ylabel=f"{name}\n[% of range]")
    axes[-1, 0].set_xlabel("time [s]")
    return figure


def identification_report(found: MotorsIdentification, figures: Mapping[str, Figure]) -> Report:
    """The page of an identification."""
    pictures = pictures_of(figures, _CAPTIONS)
    estimates = Table(
        caption="Estimates; not identifiable: the scenario's value",
        columns=("value", "unit", "estimate", "95 % interval", "identifiable", "scenario", "why"),
        rows=[
            (
                e.name,
                unit,
                e.value,
                None if e.interval is None else f"{e.interval[0]:.4g} to {e.interval[1]:.4g}",
                "yes" if e.identifiable else "no",
                e.scenario,
                why,
            )
            for e, unit, why in zip(found.estimates, found.units, reasons_of(found.estimates), strict=True)
        ],
        digits=4,
    )
    files = Table(
        caption="RMS error by file",
        columns=(
            *("file", "role"),
            *(f"torque {name} [% of range]" for name in found.motors),
            *(f"{name} [deg]" for name in found.joints),
            "data issues",
        ),
        rows=[
            (
                c.name,
                c.role,
                *c.torque_percent.tolist(),
                *(float(each) if np.isfinite(each) else None for each in c.joint_rms_deg),
                "; ".join(c.findings) or "none",
            )
            for c in found.comparisons
        ],
    )
    data = "".join(f" --{'data' if c.role == 'fit' else 'validate'} {quote(c.name)}" for c in found.comparisons)
    return Report(
        title=f"Identification: {found.asked.name}",
        summary=f"{found.headline} Next: {step}" if (step := next_step(found)) else found.headline,
        fine_print=found.missing.replace("not identifiable (see the report)", "Not identifiable"),
        warnings=found.warnings,
        sections=(
            Section(title="Model and measurement", blocks=tuple(pictures[n] for n in _CAPTIONS if n in pictures)),
            Section(title="Estimates", blocks=(estimates,)),
            Section(title="Measured files", blocks=(files,)),
        ),
        provenance=Provenance(
            scenario=found.asked,
            command=f"tendonff identify {as_argument(found.asked.source)}{data} --out DIR",
            inputs=found.inputs,
        ),
        files=(
            FileNote(name="fitted.toml", content="the scenario with the estimates put in"),
            FileNote(name="fit.json", content="estimates, intervals, correlations and errors for other programs"),
        ),
    )


VIEWS = Views(
    write=write_files,
    columns=lambda found: estimate_columns(found.estimates),
    figures=identification_figures,
)
