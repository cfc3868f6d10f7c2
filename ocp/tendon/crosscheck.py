"""Numerical accuracy of a simulation: against itself with half the step, and with a force that differs in last digits.

Where a stiff bristle meets friction that falls with speed, neighbouring trajectories part: the result then depends on
the step, the tolerance and the last digit of the force, and no solver converges point by point.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tendonff.models.layout import ChainInputs, ChainState
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.simulate import Simulator, describe_failure

NUDGE = 1e-9
"""Relative change of the force that must not matter in a reproducible run."""

SPREAD_LIMIT = 1e-3
"""Peak difference, as a share of the range, above which runs that should agree count as apart."""

_LEAST_GAIN = 0.7
"""A run that converges loses at least this factor of its difference when the step is halved."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCheck:
    """Accuracy of the run with h, from runs with h/2, h/4 and a perturbed force."""

    step_s: float  # h [s]
    range_N: float  # largest minus smallest output tension of the run with h
    # rms_N, peak_N: output tension with h against h/2
    rms_N: float
    peak_N: float
    error_N: float  # estimated rms error of the run with h, extrapolated with the observed order, from 0.5 to 2
    spread_N: float  # largest distance at any instant between runs that agree for a reproducible trajectory
    reproducible: bool

    def percent(self, value_N: float) -> float:
        """A tension in % of the range; 0 where the tension does not move."""
        return 100 * value_N / self.range_N if self.range_N > 0 else 0.0

    @property
    def text(self) -> str:
        """The finding in words, in N and in % of range."""
        shares = (
            f" ({self.percent(self.rms_N):.2g} % and {self.percent(self.peak_N):.2g} % of range)"
            if self.range_N > 0
            else ""
        )
        found = (
            f"output tension against a run with step {self.step_s / 2:g} s: "
            f"{self.rms_N:.3g} N RMS, {self.peak_N:.3g} N at most{shares}"
        )
        if self.reproducible:
            return f"{found}; estimated error {self.error_N:.3g} N RMS ({self.percent(self.error_N):.2g} % of range)"
        return (
            f"{found}; not reproducible point by point: runs that differ only in step and in the ninth digit of the "
            f"force lie up to {self.spread_N:.3g} N apart ({self.percent(self.spread_N):.2g} % of range); impacts, or "
            "friction that falls with speed on a stiff bristle, do that; trust means and ranges, not instants, or use "
            "a softer bristle or mu_static = mu_dynamic"
        )


class StepHalving:
    """Runs with h/2, h/4 and a nudged force beside a run with h, chunk by chunk in bounded memory.

    State and force [N] are those at the start of the run with h that is checked.
    """

    def __init__(self, chain: Chain, step_s: float, state: ChainState, force_N: float) -> None:
        self._chain, self._step_s = chain, step_s
        start, nudged = (ChainInputs.of_force(np.array([force])) for force in (force_N, force_N * (1 + NUDGE)))
        self._runs = {parts: Simulator(chain, step_s / parts, state, start) for parts in (2, 4)}
        self._nudged = Simulator(chain, step_s, state, nudged)
        self._rows = 0
        self._squares = {2: 0.0, 4: 0.0}
        self._peaks = {2: 0.0, 4: 0.0}
        self._nudge_peak = self._spread = 0.0
        self._lowest, self._highest = math.inf, -math.inf

    def add(self, time_s: Array, output_N: Array, force_at: Callable[[Array], Array]) -> None:
        """Check the rows, shape (rows,), h apart, that follow the last ones, under the force at any instants [N].

        SolveError if a step of the finer runs cannot be solved.
        """
        outputs = {1: output_N}
        for parts, run in self._runs.items():
            before = np.arange(parts - 1, -1, -1, dtype=np.float64) * (self._step_s / parts)
            times = (time_s[:, None] - before).ravel()
            outputs[parts] = self._advance(run, times, force_at(times), self._step_s / parts)[parts - 1 :: parts]
        nudged = self._advance(self._nudged, time_s, force_at(time_s) * (1 + NUDGE), self._step_s)
        for parts in (2, 4):
            difference = outputs[parts // 2] - outputs[parts]
            self._squares[parts] += float(difference @ difference)
            self._peaks[parts] = max(self._peaks[parts], _peak(difference))
        self._nudge_peak = max(self._nudge_peak, _peak(output_N - nudged))
        together = np.stack([output_N, nudged, outputs[2], outputs[4]])
        self._spread = max(self._spread, _peak(np.ptp(together, axis=0)))
        self._rows += len(output_N)
        self._lowest = min(self._lowest, float(output_N.min(initial=math.inf)))
        self._highest = max(self._highest, float(output_N.max(initial=-math.inf)))

    def _advance(self, run: Simulator, time_s: Array, force_N: Array, step_s: float) -> Array:
        rows = run.advance(ChainInputs.of_force(force_N))
        if (good := len(rows.tension_N)) < len(time_s):
            raise SolveError(describe_failure(self._chain, rows, float(time_s[good]), step_s))
        return rows.tension_N[:, -1]

    def result(self) -> StepCheck:
        """Result of the rows so far."""
        first, second = (math.sqrt(self._squares[parts] / max(self._rows, 1)) for parts in (2, 4))
        span = max(self._highest - self._lowest, 0.0)
        order = math.log2(first / second) if first > 0 and second > 0 else math.nan
        order = min(max(order, 0.5), 2.0)  # keeps NaN
        gain = 2.0 ** (order if order > 0 else 1.0)
        limit = max(SPREAD_LIMIT * span, 1000 * NUDGE * abs(self._highest))
        apart = self._nudge_peak > limit or (second > _LEAST_GAIN * first and self._peaks[4] > limit)
        return StepCheck(
            step_s=self._step_s,
            range_N=span,
            rms_N=first,
            peak_N=self._peaks[2],
            error_N=first * gain / (gain - 1),
            spread_N=self._spread,
            reproducible=not apart,
        )


def _peak(difference: Array) -> float:
    return float(np.abs(difference).max(initial=0.0))
