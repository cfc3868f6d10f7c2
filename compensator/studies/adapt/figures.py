"""Figures of the self-tuning study."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tendonff.compensator.reporting.colours import BLUE, GREEN, INK, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, thinned
from tendonff.compensator.studies.adapt.result import Case, Scheme, TensionStudy, friction_off, moving_rms

STYLES = {
    Scheme.FEEDFORWARD: (VERMILION, "--", "feedforward alone"),
    Scheme.FEEDBACK: (ORANGE, "-.", "feedback alone"),
    Scheme.SELF_TUNING: (BLUE, "-", "self-tuning"),
}


def adaptation_figures(result: TensionStudy) -> dict[str, Figure]:
    """All figures by file name."""
    with figure_style():
        return {
            "overview": overview_figure(result),
            "friction": case_figure(result, next(case for case in result.cases if case.variation == friction_off(1.2))),
            "drift": case_figure(result, max(result.cases, key=lambda case: case.time_s[-1])),
            "information": information_figure(result),
            **({} if result.interval is None else {"bounds": bounds_figure(result, result.interval.spread)}),
        }


def overview_figure(result: TensionStudy) -> Figure:
    """Error on every plant, on a logarithmic axis."""
    figure, axes = new_figure(height_in=0.26 * len(result.cases) + 1.0)
    panel = axes[0, 0]
    places = np.arange(len(result.cases))[::-1]
    for scheme, (colour, _, label) in STYLES.items():
        errors = [case.traces[scheme].settled_percent if scheme in case.traces else np.nan for case in result.cases]
        if not np.all(np.isnan(errors)):
            marker = "o" if scheme is Scheme.SELF_TUNING else "|"
            panel.plot(errors, places, linestyle="", marker=marker, color=colour, label=label)
    panel.set_yticks(places, [case.variation.name for case in result.cases])
    panel.set(xscale="log", xlabel="RMS error after 2 s, % of reference range", title="Plants that differ")
    panel.xaxis.set_major_formatter("{x:g}")
    panel.axvline(1.0, color="0.6", linewidth=0.8)
    legend_below(figure, panel, columns=3)
    return figure


def case_figure(result: TensionStudy, case: Case) -> Figure:
    """Error and estimate over time on one plant."""
    figure, axes = new_figure(2, 1, share_x=True, height_in=4.2)
    rows, scale = thinned(len(case.time_s)), result.reference.range_N / 100
    for scheme, trace in case.traces.items():
        colour, line, label = STYLES[scheme]
        error = moving_rms(trace.tension_N - case.reference_N, result.reference.step_s) / scale
        axes[0, 0].plot(case.time_s[rows], np.maximum(error[rows], 1e-3), color=colour, linestyle=line, label=label)
    axes[0, 0].set(yscale="log", ylabel="error, % of range", title=f"Error (RMS over 0.25 s): {case.variation.name}")
    axes[0, 0].yaxis.set_major_formatter("{x:g}")
    _estimates(result, case, axes[1, 0], rows)
    legend_below(figure, axes[0, 0], columns=3)
    return figure


def _estimates(result: TensionStudy, case: Case, panel: Axes, rows: slice) -> None:
    trace = case.traces[Scheme.SELF_TUNING]
    for k, (name, colour) in enumerate(zip(result.tuning.parameters, (BLUE, GREEN), strict=False)):
        value, band = trace.factors[rows, k], 2 * trace.deviation[rows, k]
        panel.fill_between(case.time_s[rows], value - band, value + band, color=colour, alpha=0.2, linewidth=0)
        panel.plot(case.time_s[rows], value, color=colour, label=f"{name}, estimate ± 2 standard deviations")
    panel.plot(case.time_s[rows], case.mu_factor[rows], color=INK, linestyle=":", label="mu, true")
    low, high = trace.factors.min(), trace.factors.max()
    panel.set_ylim(min(low, case.mu_factor.min()) - 0.1, max(high, case.mu_factor.max()) + 0.1)
    panel.set(xlabel="time [s]", ylabel="parameter factor [-]")
    panel.legend(loc="lower right")


def information_figure(result: TensionStudy) -> Figure:
    """Standard deviation of each factor along the reference."""
    known = result.information
    rows = thinned(len(known.time_s))
    figure, axes = new_figure(height_in=2.6)
    for k, name in enumerate(known.tuning.parameters):
        axes[0, 0].plot(known.time_s[rows], 100 * known.deviation[rows, k], label=name)
    axes[0, 0].axhline(3.0, color="0.6", linewidth=0.8)
    axes[0, 0].set(
        yscale="log", xlabel="time [s]", ylabel="standard deviation, %", title="What this reference can identify"
    )
    axes[0, 0].yaxis.set_major_formatter("{x:g}")
    axes[0, 0].legend()
    return figure


def bounds_figure(result: TensionStudy, spread: float) -> Figure:
    """The certified interval of the output tension along the reference, with the spread of mu theta that it admits."""
    reference, (low, high) = result.reference, result.bounds_N or (np.empty(0), np.empty(0))
    rows = thinned(len(reference.time_s))
    figure, axes = new_figure(height_in=2.8)
    panel = axes[0, 0]
    panel.fill_between(reference.time_s[rows], low[rows], high[rows], color=BLUE, alpha=0.25, linewidth=0)
    panel.plot(reference.time_s[rows], reference.tension_N[rows], color=INK, label="reference")
    panel.set(
        xlabel="time [s]",
        ylabel="output tension [N]",
        title=f"Certified interval, mu theta within {100 * spread:.0f} %",
    )
    panel.legend()
    return figure
