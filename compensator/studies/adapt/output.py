"""The files of the self-tuning study."""

import csv
import os
from dataclasses import asdict
from pathlib import Path

from tendonff.compensator.files.writing import atomic_directory, atomic_file
from tendonff.compensator.reporting.page import summary_head, write_pages
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.studies.adapt.figures import adaptation_figures
from tendonff.compensator.studies.adapt.report import adaptation_report
from tendonff.compensator.studies.adapt.result import Scheme, TensionStudy

_MOST_ROWS = 2000


def write_files(result: TensionStudy, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
    """Write the files of `AdaptationStudy.write`."""
    figures = adaptation_figures(result)
    with atomic_directory(folder) as partial:
        write_estimates(result, partial / "estimate.csv")
        write_pages(partial, summary(result), figures, adaptation_report(result, figures), pdf=pdf)


def estimate_table(result: TensionStudy) -> dict[str, list[str | float]]:
    """The columns of `estimate.csv`: every plant over time, at most 2000 samples each."""
    names = [f"{parameter}_factor" for parameter in result.tuning.parameters]
    schemes = [scheme for scheme in Scheme if scheme in result.cases[0].traces]
    heads = ["plant", "time_s", "reference_N", *(f"tension_{s}_N" for s in schemes), "true_mu_factor", *names]
    lines: list[tuple[str | float, ...]] = []
    for case in result.cases:
        tuned = case.traces[Scheme.SELF_TUNING]
        for row in range(0, len(case.time_s), max(1, len(case.time_s) // _MOST_ROWS)):
            tensions = [case.traces[scheme].tension_N[row] for scheme in schemes]
            numbers = [case.time_s[row], case.reference_N[row], *tensions, case.mu_factor[row], *tuned.factors[row]]
            lines.append((case.variation.name, *numbers))
    return {name: list(column) for name, column in zip(heads, zip(*lines, strict=True), strict=True)}


def write_estimates(result: TensionStudy, path: Path) -> None:
    """Write `estimate.csv`."""
    columns = estimate_table(result)
    with atomic_file(path) as partial, partial.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        for plant, *numbers in zip(*columns.values(), strict=True):
            writer.writerow([plant, *(f"{number:.9g}" for number in numbers)])


def summary(result: TensionStudy) -> dict[str, object]:
    """The contents of `summary.json`."""
    tuning, known, certificate = result.tuning, result.information, result.certificate
    return {
        **summary_head(result.scenario),
        "headline": result.headline,
        "sensor": tuning.sensor,
        "parameters": list(tuning.parameters),
        "information": {
            "known_after_s": {name: known.known_after_s(k) for k, name in enumerate(tuning.parameters)},
            "deviation_at_end": {name: known.deviation[-1, k] for k, name in enumerate(tuning.parameters)},
            "correlation": known.correlation,
            "sentences": list(known.sentences()),
        },
        "feedback": None
        if certificate is None
        else asdict(certificate)
        | {"recommended_gain_per_s": certificate.recommended_gain_per_s, "certified": certificate.holds},
        "interval": None
        if result.interval is None
        else {"spread": result.interval.spread, "margin": result.interval.margin},
        "plants": {
            case.variation.name: {
                "limit": case.is_limit,
                "worst_second": dict(zip(("times_plain", "percent_of_range"), case.worst_second, strict=True)),
                **{
                    scheme.value: {
                        "rmse_percent_of_range": trace.rmse_percent,
                        "settled_rmse_percent_of_range": trace.settled_percent,
                        "time_to_one_percent_s": trace.time_to_one_percent_s,
                        "frozen_after_s": trace.frozen_after_s,
                        "factors_at_end": dict(zip(tuning.parameters, trace.factors[-1].tolist(), strict=True)),
                    }
                    for scheme, trace in case.traces.items()
                },
            }
            for case in result.cases
        },
        "warnings": list(result.warnings),
    }


VIEWS = Views(write=write_files, columns=estimate_table, figures=adaptation_figures)
