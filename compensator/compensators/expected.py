"""Expected errors over what is uncertain, as files, figures and pages show them."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.expectation import ErrorBand, Expectation, sample_words
from tendonff.compensator.reporting.colours import GREY, INK, Style
from tendonff.compensator.reporting.page import Cell, Table
from tendonff.compensator.reporting.plots import legend_below, new_figure

BOUND: dict[str, Any] = {"color": INK, "linewidth": 0.8, "linestyle": (0, (6, 3))}
CONTRIBUTIONS = (
    "RMS error of the recommended profile at the worse end of each interval alone, all else nominal; the line is the "
    "worst case with all of them together. Grey: the worst case with a drive of each class, where none is stated."
)
"""Caption of `contributions_figure`."""

_MOST_BARS = 12


def expectation_summary(found: Expectation, segments: int) -> dict[str, object]:
    """Errors over all that may be the real transmission; null is what could not be simulated."""
    unit = found.unit.key

    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    def band(errors: ErrorBand) -> dict[str, object]:
        return {
            f"nominal_rmse_{unit}": finite(errors.nominal.rmse),
            f"expected_rmse_{unit}": finite(errors.expected_rmse),
            f"likely_rmse_{unit}": [finite(rmse) for rmse in errors.likely_rmse],
            f"worst_rmse_{unit}": finite(errors.worst.rmse),
            f"worst_peak_{unit}": finite(errors.worst_peak),
            "worst_values": dict(errors.worst_sample.numbers),
            "amplification": finite(errors.amplification),
            "slack_samples": errors.slack_samples,
        }

    return {
        "uncertainty": [spread.words for spread in found.doubt.spreads],
        "is_assumed": found.doubt.is_assumed,
        "samples": len(found.doubt.samples),
        "segments": segments,
        "recommended": found.recommended,
        f"expected_rmse_{unit}": finite(found.best.expected_rmse),
        f"likely_rmse_{unit}": [finite(rmse) for rmse in found.best.likely_rmse],
        f"rmse_{unit}": finite(found.best.worst.rmse),
        f"peak_{unit}": finite(found.best.worst_peak),
        "worst_percent_of_range": {name: finite(value) for name, value in found.worst_percent.items()},
        "contributions": [{"key": each.key, f"rmse_{unit}": finite(each.rmse)} for each in found.contributions],
        "drive_not_stated": [
            {
                "class": each.kind.value,
                f"rmse_{unit}": finite(each.worst.rmse),
                "percent_of_range": finite(each.worst.rmse_percent_of_range),
            }
            for each in found.behind
        ],
        "compensators": {name: band(errors) for name, errors in found.bands.items()},
    }


def contributions_figure(found: Expectation, style: Style) -> Figure:
    """RMS error of the recommended profile by each uncertain number alone, beside the worst case of all."""
    factor = found.unit.factor
    shown = [each for each in found.contributions if np.isfinite(each.rmse)][:_MOST_BARS][::-1]
    drives = [each for each in found.behind if np.isfinite(each.worst.rmse)][::-1]
    figure, axes = new_figure(1, 1, height_in=1.0 + 0.28 * (len(shown) + len(drives)))
    panel = axes[0, 0]
    not_stated = [f"drive, not stated: {each.kind}" for each in drives]
    panel.barh(not_stated, [factor * each.worst.rmse for each in drives], color=GREY)
    panel.barh([each.key for each in shown], [factor * each.rmse for each in shown], color=style.color)
    panel.set_ylim(-0.6, len(shown) + len(drives) - 0.4)  # a single bar does not fill the panel
    panel.axvline(
        factor * found.best.nominal.rmse, color=GREY, linewidth=0.8, linestyle=":", label="nominal parameters"
    )
    if np.isfinite(found.best.worst.rmse):
        panel.axvline(factor * found.best.worst.rmse, label="all together, worst case", **BOUND)
    panel.set(xlabel=f"RMS error [{found.unit.shown}]", xlim=(0, None))
    legend_below(figure, panel, columns=2)
    return figure


def robustness_table(found: Expectation, labels: Mapping[str, str], segments: int) -> Table:
    """Errors of each profile, by its name and label, over the samples on plants of so many masses."""
    unit, rows = found.unit, list[tuple[Cell, ...]]()
    for name, band in found.bands.items():
        worst, over = band.worst, 100 * band.amplification
        at = "[robust.other_law]" if worst is band.other else sample_words(band.worst_sample.numbers) or "nominal"
        errors = (worst.rmse_percent_of_range, unit.factor * worst.rmse, unit.factor * band.worst_peak)
        rows.append((labels[name], band.nominal.rmse_percent_of_range, band.likely, *errors, over, at))
    identified = found.doubt.uncertainty.correlation
    law = ", with the identified law taken for right" if identified is not None and identified.noise is not None else ""
    return Table(
        caption=f"Errors over {len(found.doubt.samples)} samples of the parameters on {segments} masses; "
        f"expected: eight of ten draws lie there{law}; over-compensation: largest swing of the output beyond the "
        "reference's",
        columns=(
            "profile",
            "nominal [% of range]",
            "expected [% of range]",
            "worst [% of range]",
            f"worst RMS [{unit.shown}]",
            f"peak [{unit.shown}]",
            "over-compensation [%]",
            "worst at",
        ),
        rows=rows,
        least=1e-3,
    )
