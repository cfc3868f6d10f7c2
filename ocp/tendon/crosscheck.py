"""Numerical accuracy of a simulation: against itself with half the step, and with a command changed in last digits.

Where a stiff bristle meets friction that falls with speed, neighbouring trajectories part: the result then depends on
the step, the tolerance and the last digit of the force, and no solver converges point by point.
"""

import math
from collections.abc import Callable, Mapping
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
    """Accuracy of the run with h, from runs with h/2, h/4 and a perturbed command.

    Attributes
    ----------
    quantity, unit : str
        What is simulated, in words, and the unit of the numbers below.
    step_s : float
        h [s].
    range : float
        Largest minus smallest output of the run with h; of several outputs the largest one.
    rms, peak : float
        Outputs with h against those with h/2.
    error : float
        Estimated RMS error of the run with h, extrapolated with the observed order, from 0.5 to 2.
    spread : float
        Largest distance at any instant between runs that agree for a reproducible trajectory.
    reproducible : bool
    """

    quantity: str
    unit: str
    step_s: float
    range: float
    rms: float
    peak: float
    error: float
    spread: float
    reproducible: bool

    def percent(self, value: float) -> float:
        """A value in % of the range; 0 where nothing moves."""
        return 100 * value / self.range if self.range > 0 else 0.0

    @property
    def text(self) -> str:
        """The finding in words, in the unit and in % of range."""
        shares = (
            f" ({self.percent(self.rms):.2g} % and {self.percent(self.peak):.2g} % of range)" if self.range > 0 else ""
        )
        found = (
            f"{self.quantity} against a run with step {self.step_s / 2:g} s: "
            f"{self.rms:.3g} {self.unit} RMS, {self.peak:.3g} {self.unit} at most{shares}"
        )
        if self.reproducible:
            return (
                f"{found}; estimated error {self.error:.3g} {self.unit} RMS ({self.percent(self.error):.2g} % of range)"
            )
        return (
            f"{found}; not reproducible point by point: runs that differ only in step and in the ninth digit of the "
            f"command lie up to {self.spread:.3g} {self.unit} apart ({self.percent(self.spread):.2g} % of range); "
            "impacts, or friction that falls with speed on a stiff bristle, do that; trust means and ranges, not "
            "instants, or use a softer bristle or mu_static = mu_dynamic"
        )


class StepTally:
    """Outputs with h, h/2, h/4 and under a nudged command, chunk by chunk in bounded memory."""

    def __init__(self, quantity: str, unit: str, step_s: float) -> None:
        self._quantity, self._unit, self._step_s = quantity, unit, step_s
        self._count = 0
        self._squares = {2: 0.0, 4: 0.0}
        self._peaks = {2: 0.0, 4: 0.0}
        self._nudge_peak = self._spread = self._largest = 0.0
        self._lowest, self._highest = np.full(1, math.inf), np.full(1, -math.inf)

    def add(self, outputs: Mapping[int, Array], nudged: Array) -> None:
        """Rows that follow the last ones, h apart, shape (rows,) or (rows, outputs): by 1, 2 and 4 parts of a step."""
        for parts in (2, 4):
            difference = outputs[parts // 2] - outputs[parts]
            self._squares[parts] += float(np.sum(difference**2))
            self._peaks[parts] = max(self._peaks[parts], _peak(difference))
        output = outputs[1]
        self._nudge_peak = max(self._nudge_peak, _peak(output - nudged))
        together = np.stack([output, nudged, outputs[2], outputs[4]])
        self._spread = max(self._spread, _peak(np.ptp(together, axis=0)))
        self._count += output.size
        self._largest = max(self._largest, _peak(output))
        self._lowest = np.minimum(self._lowest, output.min(axis=0, initial=math.inf))
        self._highest = np.maximum(self._highest, output.max(axis=0, initial=-math.inf))

    def result(self) -> StepCheck:
        """Result of the rows so far."""
        first, second = (math.sqrt(self._squares[parts] / max(self._count, 1)) for parts in (2, 4))
        span = max(float(np.max(self._highest - self._lowest)), 0.0)
        order = math.log2(first / second) if first > 0 and second > 0 else math.nan
        order = min(max(order, 0.5), 2.0)  # keeps NaN
        gain = 2.0 ** (order if order > 0 else 1.0)
        limit = max(SPREAD_LIMIT * span, 1000 * NUDGE * self._largest)
        apart = self._nudge_peak > limit or (second > _LEAST_GAIN * first and self._peaks[4] > limit)
        return StepCheck(
            quantity=self._quantity,
            unit=self._unit,
            step_s=self._step_s,
            range=span,
            rms=first,
            peak=self._peaks[2],
            error=first * gain / (gain - 1),
            spread=self._spread,
            reproducible=not apart,
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
        self._tally = StepTally("output tension", "N", step_s)

    def add(self, time_s: Array, output_N: Array, force_at: Callable[[Array], Array]) -> None:
        """Check the rows, shape (rows,), h apart, that follow the last ones, under the force at any instants [N].

        SolveError if a step of the finer runs cannot be solved.
        """
        outputs = {1: output_N}
        for parts, run in self._runs.items():
            before = np.arange(parts - 1, -1, -1, dtype=np.float64) * (self._step_s / parts)
            times = (time_s[:, None] - before).ravel()
            outputs[parts] = self._advance(run, times, force_at(times), self._step_s / parts)[parts - 1 :: parts]
        self._tally.add(outputs, self._advance(self._nudged, time_s, force_at(time_s) * (1 + NUDGE), self._step_s))

    def _advance(self, run: Simulator, time_s: Array, force_N: Array, step_s: float) -> Array:
        rows = run.advance(ChainInputs.of_force(force_N))
        if (good := len(rows.tension_N)) < len(time_s):
            raise SolveError(describe_failure(self._chain, rows, float(time_s[good]), step_s))
        return rows.tension_N[:, -1]

    def result(self) -> StepCheck:
        """Result of the rows so far."""
        return self._tally.result()


def _peak(difference: Array) -> float:
    return float(np.abs(difference).max(initial=0.0))
