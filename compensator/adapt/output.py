"""The files of the self-tuning study."""

import csv
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from tendonff.compensator.adapt.figures import adaptation_figures
from tendonff.compensator.adapt.report import adaptation_report
from tendonff.compensator.adapt.result import AdaptationData, Scheme
from tendonff.compensator.files.writing import atomic_directory, atomic_file
from tendonff.compensator.reporting.page import summary_head, write_pages

_MOST_ROWS = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptationStudy(AdaptationData):
    """A study that can be written.

    Attributes
    ----------
    scenario : Scenario
        The scenario it was made for.
    reference : Reference
        Desired tension, sampled.
    tuning : Tuning
        Numbers of the recursion.
    information : Information
        Along the reference, on the scenario's own plant.
    certificate : FeedbackCertificate or None
        Of the integral action; None without a measured output tension.
    interval : CertifiedInterval or None
        Along the reference; None where the path moves.
    bounds_N : tuple[ndarray, ndarray] or None
        That interval for the design's force, shape (n,) each.
    cases : tuple of Case
        Every plant.
    headline : str
        One sentence.
    warnings : tuple of str
        What the user should know.
    """

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `estimate.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder."""
        figures = adaptation_figures(self)
        with atomic_directory(folder) as partial:
            write_estimates(self, partial / "estimate.csv")
            write_pages(partial, summary(self), figures, adaptation_report(self, figures), pdf=pdf)


def write_estimates(result: AdaptationData, path: Path) -> None:
    """Write `estimate.csv`: every plant over time, at most 2000 samples each."""
    names = [f"{parameter}_factor" for parameter in result.tuning.parameters]
    schemes = [scheme for scheme in Scheme if scheme in result.cases[0].traces]
    with atomic_file(path) as partial, partial.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(
            ["plant", "time_s", "reference_N", *(f"tension_{s}_N" for s in schemes), "true_mu_factor", *names]
        )
        for case in result.cases:
            tuned = case.traces[Scheme.SELF_TUNING]
            for row in range(0, len(case.time_s), max(1, len(case.time_s) // _MOST_ROWS)):
                tensions = [case.traces[scheme].tension_N[row] for scheme in schemes]
                numbers = [case.time_s[row], case.reference_N[row], *tensions, case.mu_factor[row], *tuned.factors[row]]
                writer.writerow([case.variation.name, *(f"{number:.9g}" for number in numbers)])


def summary(result: AdaptationData) -> dict[str, object]:
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
