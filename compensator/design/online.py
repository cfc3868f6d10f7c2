"""`tendonff design --online`: what a filter of a reference that arrives live costs and buys."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.stream.run import NOISE_GOAL_DB, Candidate, StreamChoice, choose_stream
from tendonff.compensator.export.text.c_text import accepted_range
from tendonff.compensator.files.text import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.reporting.plots import GREY, INK, legend_below, new_figure, save_figure
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.ocp.errors import SolveError

_PREVIEW_S = 0.05
"""Longest filter that is drawn, where the scenario's own are shorter [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Online:
    """Filters of all lengths, and the one that the scenario's `[stream]` admits and the goal picks.

    Parameters
    ----------
    choice : StreamChoice
        What `export-c` builds in.
    longer : tuple of Candidate
        Further ones, of which those longer than the lag allowed need preview.
    lag_max_s : float
        Lag that the scenario accepts [s].
    """

    choice: StreamChoice
    longer: tuple[Candidate, ...]
    lag_max_s: float

    @property
    def sentence(self) -> str:
        """The pick in one line."""
        picked = self.choice.picked
        lag = picked.design.filter.lag_s
        timing = f"{-1e3 * lag:.3g} ms of preview" if lag < 0 else f"{1e3 * lag:.3g} ms of lag"
        return (
            f"live reference: {timing}, {len(picked.design.filter.taps)} taps, error {picked.score.percent} % of "
            f"range, {picked.noise_dB:+.1f} dB of the reference's noise in the force above 30 Hz"
        )

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write `online.csv` and the figure `online` into an existing folder."""
        rows = (*self.choice.candidates, *self.longer)
        write_csv(
            Path(folder) / "online.csv",
            {
                "lag_s": [c.design.filter.lag_s for c in rows],
                "filter_s": [_length_s(c) for c in rows],
                "keeps_parabolas": [int(c.design.filter.is_flat) for c in rows],
                "rmse_percent_of_range": [c.score.rmse_percent_of_range for c in rows],
                "force_noise_dB": [c.noise_dB for c in rows],
                "picked": [int(c is self.choice.picked) for c in rows],
            },
        )
        save_figure(online_figure(self), Path(folder) / "online")


def study_online(scenario: Scenario) -> Online:
    """Try filters on the scenario's reference with the noise of a converter.

    Raises
    ------
    SolveError
        If no filtered force can be simulated.
    """
    if scenario.joints:
        raise InputError(
            f"{scenario.source.name} [joints]: live references are for a path at rest; `export-c` gives an inverse "
            "that takes joint angles, and `design` without --online the profile"
        )
    problem = Problem.of(scenario)
    accepted = accepted_range(problem)
    choice = choose_stream(problem, scenario.stream, accepted)
    longer = choose_stream(problem, replace(scenario.stream, preview_s=_PREVIEW_S), accepted)
    if choice is None or longer is None:
        raise SolveError(
            "no force of a live reference can be simulated on this chain; check it with tendonff simulate, "
            "or let the reference move more slowly"
        )
    return Online(choice=choice, longer=longer.candidates, lag_max_s=scenario.stream.lag_max_s)


def online_figure(result: Online) -> Figure:
    """Error over noise in the force: one curve for each kind of filter, a point for each length, the pick ringed."""
    figure, axes = new_figure(height_in=3.6)
    panel = axes[0, 0]
    every = (*result.choice.candidates, *result.longer)
    for is_flat, color, label in ((False, INK, "least noise"), (True, GREY, "keeps parabolas too")):
        row = sorted((c for c in every if c.design.filter.is_flat is is_flat), key=_length_s)
        if not row:
            continue
        noise = np.array([c.noise_dB for c in row])
        error = np.array([c.score.rmse_percent_of_range for c in row])
        lags = np.array([_length_s(c) <= result.lag_max_s * (1 + 1e-9) for c in row])
        panel.plot(noise, error, color=color, linewidth=0.8)
        panel.plot(noise[lags], error[lags], "o", color=color, label=f"{label}, as lag or preview")
        panel.plot(noise[~lags], error[~lags], "o", color=color, fillstyle="none", label=f"{label}, needs preview")
        for each in row[:: max(1, len(row) // 6)]:
            at = (each.noise_dB, each.score.rmse_percent_of_range)
            text = f"{1e3 * _length_s(each):.3g} ms"
            panel.annotate(text, at, xytext=(4, 4), textcoords="offset points", fontsize=7, color=color)
    picked = result.choice.picked
    ring = {"markersize": 12, "fillstyle": "none", "color": INK}
    panel.plot(picked.noise_dB, picked.score.rmse_percent_of_range, "o", label="picked", **ring)
    panel.axvline(NOISE_GOAL_DB, color=INK, linewidth=0.8, linestyle=(0, (6, 3)))
    panel.set(
        xlabel="noise in the force over noise in the reference, above 30 Hz [dB]",
        ylabel="RMS error [% of range]",
        yscale="log",
        title=f"Reference in steps of {result.choice.resolution_N:.3g} N, one of them noise",
    )
    legend_below(figure, panel, columns=2)
    return figure


def _length_s(candidate: Candidate) -> float:
    """Lag of the filter alone [s]."""
    return candidate.design.filter.half * candidate.design.filter.step_s
