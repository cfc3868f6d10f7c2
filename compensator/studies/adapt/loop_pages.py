"""Files, figures and report of the study of a joint that tunes itself."""

import os

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.writing import atomic_directory, write_csv
from tendonff.compensator.reporting.colours import BLUE, INK, VERMILION
from tendonff.compensator.reporting.page import (
    FileNote,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
    provenance_of,
    summary_head,
    write_pages,
)
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, thinned
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.studies.adapt.loop import SETTLED_S, LoopStudy, errors_of
from tendonff.compensator.studies.adapt.result import moving_rms


def write_files(study: LoopStudy, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
    """Write the files of `AdaptationStudy.write`."""
    figures = _figures(study)
    summary: dict[str, object] = {
        **summary_head(study.scenario),
        "headline": study.headline,
        "plants": {
            case.variation.name: {
                "plain_settled_rmse_deg": case.settled_deg(case.plain_rad),
                "settled_rmse_deg": case.settled_deg(case.tuned_rad),
                "factor_at_end": float(case.factor[-1]),
                "frozen_after_s": case.frozen_after_s,
            }
            for case in study.cases
        },
        "warnings": list(study.warnings),
    }
    with atomic_directory(folder) as partial:
        write_csv(partial / "estimate.csv", _columns(study))
        write_pages(partial, summary, figures, _report(study, figures), pdf=pdf)


def _columns(study: LoopStudy) -> dict[str, FloatArray]:
    rows = thinned(len(study.time_s))
    columns = {"time_s": study.time_s[rows], "reference_rad": study.reference_rad[rows]}
    for k, case in enumerate(study.cases, start=1):
        columns |= {f"error_{k}_rad": case.tuned_rad[rows], f"factor_{k}": case.factor[rows]}
    return columns


def _figures(study: LoopStudy) -> dict[str, Figure]:
    with figure_style():
        return {"overview": _overview(study), "friction": _course(study)}


def _overview(study: LoopStudy) -> Figure:
    figure, axes = new_figure(height_in=0.26 * len(study.cases) + 1.0)
    panel, places = axes[0, 0], np.arange(len(study.cases))[::-1]
    for errors, colour, marker, label in (
        (errors_of(list(study.cases))[0], VERMILION, "|", "inverse alone"),
        (errors_of(list(study.cases))[1], BLUE, "o", "self-tuning"),
    ):
        found = [max(case.settled_deg(e), 1e-4) for case, e in zip(study.cases, errors, strict=True)]
        panel.plot(found, places, linestyle="", marker=marker, color=colour, label=label)
    panel.set_yticks(places, [case.variation.name for case in study.cases])
    panel.set(xscale="log", xlabel=f"RMS error after {SETTLED_S:g} s [deg]", title="Loops that differ")
    panel.xaxis.set_major_formatter("{x:g}")
    legend_below(figure, panel, columns=2)
    return figure


def _course(study: LoopStudy) -> Figure:
    case = next(case for case in study.cases if case.variation.mu > 1 and case.variation.pretension == 1)
    figure, axes = new_figure(2, 1, share_x=True, height_in=4.2)
    rows = thinned(len(study.time_s))
    for error, colour, label in ((case.plain_rad, VERMILION, "inverse alone"), (case.tuned_rad, BLUE, "self-tuning")):
        mean = np.rad2deg(moving_rms(error, case.step_s))
        axes[0, 0].plot(study.time_s[rows], mean[rows], color=colour, label=label)
    axes[0, 0].set(ylabel="error [deg]", title=f"Error (RMS over 0.25 s): {case.variation.name}")
    axes[1, 0].plot(study.time_s[rows], case.factor[rows], color=INK)
    axes[1, 0].set(xlabel="time [s]", ylabel="factor [-]")
    legend_below(figure, axes[0, 0], columns=2)
    return figure


def _report(study: LoopStudy, figures: dict[str, Figure]) -> Report:
    pictures = pictures_of(
        figures,
        {
            "overview": "Each row is a loop that differs from the scenario as its name says; sensor noise as stated.",
            "friction": "Above: error. Below: the factor that the controller uses.",
        },
    )
    table = Table(
        caption=f"RMS error after {SETTLED_S:g} s [deg]",
        columns=("loop", "inverse alone", "self-tuning", "factor at the end", "status"),
        rows=[
            (
                case.variation.name,
                case.settled_deg(case.plain_rad),
                case.settled_deg(case.tuned_rad),
                float(case.factor[-1]),
                "good" if case.frozen_after_s is None else f"frozen after {case.frozen_after_s:.2f} s",
            )
            for case in study.cases
        ],
    )
    return Report(
        title=f"Self-tuning: {study.scenario.name}",
        summary=study.headline,
        warnings=study.warnings,
        sections=(
            Section(
                title="Loops that differ",
                blocks=(
                    Text(
                        "The compensator has the scenario's parameters; the loop differs from them, has 40 masses a "
                        "tendon and sensor noise, and its motor follows its command. The joint's angle identifies the "
                        "lost motion alone, one number of friction, pre-tension and stiffness together: a factor of "
                        "0.8 may be friction or pre-tension. identify and watch separate them, with a push against a "
                        "stop."
                    ),
                    pictures["overview"],
                    table,
                ),
            ),
            Section(title="Error and factor over time", blocks=(pictures["friction"],)),
        ),
        provenance=provenance_of(study.scenario, "adapt"),
        files=(
            FileNote(name="estimate.csv", content="reference, and error and factor of every loop over time"),
            FileNote(name="summary.json", content="everything on this page for other programs"),
        ),
    )


VIEWS = Views(write=write_files, columns=_columns, figures=_figures)
