"""Filters of a reference that arrives live, where the scenario has [stream]: what they cost and buy."""

import math
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.stream import (
    NOISE_GOAL_DB,
    Candidate,
    StreamChoice,
    StreamFilter,
    choose_stream,
    over_preview,
    rate_binds,
)
from tendonff.compensator.reporting.colours import GREY, INK
from tendonff.compensator.reporting.plots import legend_below, new_figure
from tendonff.compensator.scenario.settings import Stream
from tendonff.models.capstan import CapstanLaw
from tendonff.ocp.errors import SolveError

_PREVIEW_S = 0.05  # longest filter that is drawn, where the scenario's own are shorter [s]
_PREVIEW_SHARES = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0, 1.3)  # of the time for the largest jump


@dataclass(frozen=True, slots=True, kw_only=True)
class Online:
    """Filters of all lengths, and the one that the scenario's `[stream]` admits and the goal picks.

    Attributes
    ----------
    choice : StreamChoice
        Contains what `export-c` builds in.
    longer : tuple of Candidate
        Further ones, of which those longer than the lag allowed need preview.
    lag_max_s : float
        Lag that the scenario accepts [s].
    over_preview : tuple of Candidate
        The picked filter with more and more preview; empty where the rate limit does not bind.
    jump_s : float
        Time that the rate limit needs for the capstan law's jump at the largest reference [s].
    optimum_percent : float or None
        RMS error of the optimal profile, which knows all of the reference [% of range]; None where it is not known.
    """

    choice: StreamChoice
    longer: tuple[Candidate, ...]
    lag_max_s: float
    over_preview: tuple[Candidate, ...] = ()
    jump_s: float = 0.0
    optimum_percent: float | None = None

    @property
    def sentence(self) -> str:
        """The pick in one line."""
        picked = self.choice.picked
        lag = picked.design.filter.lag_s
        timing = f"{-1e3 * lag:.3g} ms of preview" if lag < 0 else f"{1e3 * lag:.3g} ms of lag"
        found = (
            f"live reference: {timing}, {len(picked.design.filter.taps)} taps, error {picked.score.percent} % of "
            f"range, {picked.noise_dB:+.1f} dB of the reference's noise in the force above 30 Hz"
        )
        if not self.over_preview:
            return found
        last = min(self.over_preview, key=lambda c: abs(c.design.filter.lag_s + self.jump_s))
        optimum = "" if self.optimum_percent is None else f"; the optimal profile has {self.optimum_percent:.3g} %"
        return (
            f"{found}. The rate limit binds: with preview for the largest jump ({1e3 * self.jump_s:.3g} ms) "
            f"{last.score.percent} %{optimum}"
        )

    @property
    def columns(self) -> dict[str, list[float]]:
        """Columns of `online.csv`."""
        rows = (*self.choice.candidates, *self.longer, *self.over_preview)
        return {
            "lag_s": [c.design.filter.lag_s for c in rows],
            "filter_s": [_length_s(c) for c in rows],
            "ramp_s": [c.design.ahead * c.design.filter.step_s for c in rows],
            "overshoot": [0.0 if c.design.ramp is None else c.design.ramp.overshoot for c in rows],
            "keeps_parabolas": [int(c.design.filter.is_flat) for c in rows],
            "rmse_percent_of_range": [c.score.rmse_percent_of_range for c in rows],
            "force_noise_dB": [c.noise_dB for c in rows],
            "picked": [int(c is self.choice.picked) for c in rows],
        }


def study_online(problem: Problem, stream: Stream, optimum_percent: float | None = None) -> Online:
    """Try filters on a problem's reference with the noise of a converter; SolveError if none can be simulated.

    Shown beside them: the RMS error of the optimal profile on the same model [% of range], where it is given.
    """
    if problem.chain.motion is not None:
        raise SolveError(
            "no filter is drawn where joints move the path: it would need their future angles; the exported stream "
            "takes present ones"
        )
    choice = choose_stream(problem, stream)
    further = replace(stream, preview_s=_PREVIEW_S)
    longer = choose_stream(problem, further, with_ramps=False)
    if choice is None or longer is None:
        raise SolveError(
            "no force of a live reference can be simulated on this chain; check it with tendonff simulate, "
            "or let the reference move more slowly"
        )
    jump = 0.0
    over: tuple[Candidate, ...] = ()
    if rate_binds(problem):
        law, reference = CapstanLaw.of(problem.transmission), problem.reference
        width = math.exp(law.pull_exponent) - math.exp(-law.release_exponent)
        jump = (float(reference.tension_N.max()) + law.adhesion_N) * width / problem.limits.rate_N_per_s
        design = choice.picked.design
        needed = (design.filter.half + 1) * design.filter.step_s
        over = over_preview(problem, design, [max(needed, share * jump) for share in _PREVIEW_SHARES])
    return Online(
        choice=choice,
        longer=longer.candidates,
        lag_max_s=stream.lag_max_s,
        over_preview=over,
        jump_s=jump,
        optimum_percent=optimum_percent,
    )


def online_figure(result: Online) -> Figure:
    """Error over noise in the force: one curve for each kind of filter, a point for each length, the pick ringed."""
    rows = 2 if result.over_preview else 1
    figure, axes = new_figure(rows=rows, height_in=1.2 + 2.4 * rows)
    panel = axes[0, 0]
    best: dict[StreamFilter, Candidate] = {}
    ramps = result.choice.picked.design.ramp is not None  # whose errors are not those of filters alone
    shown = [c for c in result.choice.candidates if c.design.ramp] if ramps else result.choice.candidates
    for each in sorted((*shown, *(() if ramps else result.longer)), key=lambda c: -c.score.rmse):
        best[each.design.filter] = each
    every = tuple(best.values())
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
    if result.over_preview:
        _draw_preview(axes[1, 0], result)
    return figure


def _draw_preview(panel: Axes, result: Online) -> None:
    """Error over preview where the rate limit binds, beside what the optimal profile reaches."""
    time_ms = [-1e3 * c.design.filter.lag_s for c in result.over_preview]
    error = [c.score.rmse_percent_of_range for c in result.over_preview]
    panel.plot(time_ms, error, "o-", color=INK, linewidth=0.8)
    panel.axvline(1e3 * result.jump_s, color=GREY, linewidth=0.8, linestyle=(0, (6, 3)))
    panel.annotate("largest jump at this rate", (1e3 * result.jump_s, max(error)), ha="right", va="top", rotation=90)
    if result.optimum_percent is not None:
        panel.axhline(result.optimum_percent, color=GREY, linewidth=0.8)
        panel.annotate("optimal profile", (time_ms[0], result.optimum_percent), va="bottom")
    panel.set(
        xlabel="preview [ms]", ylabel="RMS error [% of range]", yscale="log", title="Preview against the rate limit"
    )


def _length_s(candidate: Candidate) -> float:
    """Lag of the filter alone [s]."""
    return candidate.design.filter.half * candidate.design.filter.step_s
