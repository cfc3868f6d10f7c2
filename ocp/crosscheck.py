"""How far a simulation can be trusted: step halving, and adaptive integrators on the same equations.

Where a stiff bristle meets friction that falls with speed, neighbouring trajectories part: the result then depends on
the step, the tolerance and the last digit of the force, and no solver converges point by point. Both checks look for
that and say how wide the spread is.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import casadi as ca
import numpy as np

from tendonff.models.chain import Chain, chain_equations
from tendonff.models.errors import ParameterError
from tendonff.models.layout import INPUT_NAMES, ChainInputs, ChainState
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.simulate import Simulator, describe_failure, simulate
from tendonff.ocp.step.protocol import Array

NUDGE = 1e-9
"""Relative change of the force that must not matter in a reproducible run."""

SPREAD_LIMIT = 1e-3
"""Peak difference, as a share of the range, above which runs that should agree count as apart."""

_LEAST_GAIN = 0.7
"""A run that converges loses at least this factor of its difference when the step is halved."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCheck:
    """What runs with h, h/2 and h/4, and one with a nudged force, say about the run with h.

    Parameters
    ----------
    step_s : float
        h [s].
    range_N : float
        Largest minus smallest output tension of the run with h.
    rms_N, peak_N : float
        Output tension with h against h/2.
    order : float
        Observed order, log2 of the ratio of two successive rms differences, between 0.5 and 2; NaN where they vanish.
    error_N : float
        Estimated rms error of the run with h, extrapolated with that order.
    spread_N : float
        Largest distance at any instant between runs that a reproducible trajectory would not tell apart.
    reproducible : bool
    """

    step_s: float
    range_N: float
    rms_N: float
    peak_N: float
    order: float
    error_N: float
    spread_N: float
    reproducible: bool

    def percent(self, value_N: float) -> float:
        """A tension in % of the range; 0 where the tension does not move.

        Parameters
        ----------
        value_N : float
        """
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
            f"{self.rms_N:.3g} N rms, {self.peak_N:.3g} N at most{shares}"
        )
        if self.reproducible:
            return f"{found}; estimated error {self.error_N:.3g} N rms ({self.percent(self.error_N):.2g} % of range)"
        return (
            f"{found}; not reproducible point by point: runs that differ only in step and in the ninth digit of the "
            f"force lie up to {self.spread_N:.3g} N apart ({self.percent(self.spread_N):.2g} % of range); impacts, or "
            "friction that falls with speed on a stiff bristle, do that; trust means and ranges, not instants, or use "
            "a softer bristle or mu_static = mu_dynamic"
        )


class StepHalving:
    """Runs with h/2, h/4 and a nudged force beside a run with h, chunk by chunk in bounded memory.

    Parameters
    ----------
    chain : Chain
    step_s : float
        h [s] of the run that is checked.
    state : ChainState
        Where it starts.
    force_N : float
        Force at the start [N].
    engine : Engine, optional
    """

    def __init__(
        self, chain: Chain, step_s: float, state: ChainState, force_N: float, engine: Engine = Engine.AUTO
    ) -> None:
        self._chain, self._step_s = chain, step_s
        start, nudged = (ChainInputs.of_force(np.array([force])) for force in (force_N, force_N * (1 + NUDGE)))
        self._runs = {parts: Simulator(chain, step_s / parts, state, start, engine) for parts in (2, 4)}
        self._nudged = Simulator(chain, step_s, state, nudged, engine)
        self._rows = 0
        self._squares = {2: 0.0, 4: 0.0}
        self._peaks = {2: 0.0, 4: 0.0}
        self._nudge_peak = self._spread = 0.0
        self._lowest, self._highest = math.inf, -math.inf

    def add(self, time_s: Array, output_N: Array, force_at: Callable[[Array], Array]) -> None:
        """Check the rows that follow the last ones.

        Parameters
        ----------
        time_s : ndarray, shape (rows,)
            Their instants, h apart.
        output_N : ndarray, shape (rows,)
            Output tension of the run with h.
        force_at : callable
            Force at an array of instants [N].

        Raises
        ------
        SolveError
            If a step of the finer runs cannot be solved.
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
        """What the rows so far say."""
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
            order=order,
            error_N=first * gain / (gain - 1),
            spread_N=self._spread,
            reproducible=not apart,
        )


def _peak(difference: Array) -> float:
    return float(np.abs(difference).max(initial=0.0))


def check_step(
    chain: Chain, force_N: Array, step_s: float, *, initial_tension_N: float, engine: Engine = Engine.AUTO
) -> StepCheck:
    """Estimate the error of `simulate` for a force, and whether its trajectory is reproducible.

    Parameters
    ----------
    chain : Chain
    force_N : ndarray, shape (n,)
        f_c1 at 0, h, 2 h ..., piecewise linear between [N].
    step_s : float
        h [s].
    initial_tension_N : float
        T0 of the start at rest [N].
    engine : Engine, optional

    Raises
    ------
    SolveError
        If a run fails.
    """
    run = simulate(chain, force_N, step_s, initial_tension_N=initial_tension_N, engine=engine).require()
    halving = StepHalving(chain, step_s, chain.rest_state(initial_tension_N), float(force_N[0]), engine)
    halving.add(run.time_s[1:], run.output_tension_N[1:], lambda time_s: np.interp(time_s, run.time_s, run.force_N))
    return halving.result()


class Adaptive(StrEnum):
    """Adaptive integrator of the SUNDIALS suite.

    Attributes
    ----------
    CVODES
        Variable-order BDF for ordinary differential equations.
    IDAS
        The same for differential-algebraic equations.
    """

    CVODES = "cvodes"
    IDAS = "idas"


class AdaptiveIntegrator:
    """`chain_equations` under a force, by CasADi's interface to SUNDIALS.

    Parameters
    ----------
    chain : Chain
    step_s : float
        Distance of the rows [s]; the force is linear between them.
    rows : int
        Rows after the start.
    solver : Adaptive, optional
    tolerance : float, optional
        Relative, and absolute on states scaled to 1e-2 m/s, `scale_N` and the elongation that it causes [-].
    scale_N : float, optional
        Typical tension [N].
    """

    def __init__(
        self,
        chain: Chain,
        step_s: float,
        rows: int,
        *,
        solver: Adaptive = Adaptive.CVODES,
        tolerance: float = 1e-8,
        scale_N: float = 10.0,
    ) -> None:
        layout, equations = chain.layout, chain_equations(chain)
        self._chain = chain
        stretch = float(chain.link.rest(scale_N)[0]) / (chain.count + 1)
        self._scale = np.full(layout.size, stretch)
        self._scale[layout.part("v")] = 1e-2
        for name in (*layout.end_states, *layout.friction_states):
            self._scale[layout.part(name)] = scale_N
        self._scale[-2:] = stretch * (chain.count + 1)
        self._solver, self._rows, self._step_s = solver, rows, step_s
        count = 1 + equations.place.numel()  # force and path, with slopes at the row before, and its time
        y, t, piece = ca.SX.sym("y", layout.size), ca.SX.sym("t"), ca.SX.sym("piece", 2 * count + 1)
        slope = piece[count : 2 * count]
        now = piece[:count] + slope * (t - piece[2 * count])
        inputs = ca.vertcat(now[0], ca.SX.zeros(len(INPUT_NAMES) - 1))
        rate, tension = ca.substitute(
            [equations.rate, equations.tension_N],
            [equations.state, equations.inputs, equations.place, equations.place_rate],
            [self._scale * y, inputs, now[1:], slope[1:]],
        )
        grid = np.arange(rows + 1, dtype=np.float64) * step_s
        options = {"reltol": tolerance, "abstol": tolerance, "max_num_steps": 200_000}
        self._integrator = ca.integrator(
            "adaptive",
            solver.value,
            {"t": t, "x": y, "u": piece, "ode": rate / self._scale},
            0.0,
            grid[1:],
            options,
        )
        self._tension = ca.Function("tension", [y, t, piece], [tension], {"cse": True})

    def run(self, state: ChainState, force_N: Array) -> Array:
        """Tensions at the rows, the start included.

        Parameters
        ----------
        state : ChainState
        force_N : ndarray, shape (rows + 1,)

        Returns
        -------
        ndarray, shape (rows + 1, N + 1)

        Raises
        ------
        SolveError
            If the integrator gives up.
        """
        time = np.arange(self._rows + 1, dtype=np.float64) * self._step_s
        values = np.column_stack([force_N, self._chain.path_at(state.time_s + time).table()]).T
        pieces = np.vstack([values[:, :-1], np.diff(values) / self._step_s, time[:-1]])
        start = state.vector() / self._scale
        try:
            y = np.asarray(self._integrator(x0=start, u=pieces)["xf"])
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[-1]
            raise SolveError(f"{self._solver.value} gave up: {reason}; try a larger tolerance") from None
        y = np.column_stack([start, y])
        if not np.isfinite(y).all():
            raise SolveError(f"{self._solver.value} gave numbers that are not finite; try a larger tolerance")
        last = np.column_stack([pieces, pieces[:, -1]])
        return np.asarray(self._tension(y, time[None, :], last)).T


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveCheck:
    """`simulate` against an adaptive integrator.

    Parameters
    ----------
    solver : Adaptive
    rms_N, peak_N : float
        Output tension against the integrator at its tightest tolerance.
    range_N : float
        Largest minus smallest output tension there.
    spread_N : float
        Largest distance at any instant between the integrator's own tolerances: no comparison is finer than this.
    reproducible : bool
        The integrator agrees with itself within `SPREAD_LIMIT` of the range.
    """

    solver: Adaptive
    rms_N: float
    peak_N: float
    range_N: float
    spread_N: float
    reproducible: bool

    @property
    def text(self) -> str:
        """The finding in words."""
        share = 100 / self.range_N if self.range_N > 0 else 0.0
        found = (
            f"output tension against {self.solver.value}: {self.rms_N:.3g} N rms, {self.peak_N:.3g} N at most "
            f"({share * self.rms_N:.2g} % and {share * self.peak_N:.2g} % of range)"
        )
        apart = f"{self.spread_N:.3g} N ({share * self.spread_N:.2g} % of range)"
        if self.reproducible:
            return f"{found}; its own tolerances differ by {apart} at most"
        return f"{found}; not reproducible point by point, its own tolerances differ by up to {apart}"


def check_adaptive(
    chain: Chain,
    force_N: Array,
    step_s: float,
    *,
    initial_tension_N: float,
    solver: Adaptive = Adaptive.CVODES,
    tolerances: Sequence[float] = (1e-6, 1e-8),
) -> AdaptiveCheck:
    """Compare `simulate` with an adaptive integrator on the same equations, and the integrator with itself.

    Parameters
    ----------
    chain : Chain
    force_N : ndarray, shape (n,)
        f_c1 at 0, h, 2 h ..., piecewise linear between [N].
    step_s : float
        h [s].
    initial_tension_N : float
        T0 of the start at rest [N].
    solver : Adaptive, optional
    tolerances : sequence of float, optional
        At least two; the smallest is the reference.

    Raises
    ------
    SolveError
        If a run fails.
    """
    if len(tolerances) < 2 or not all(0 < tolerance < 1 for tolerance in tolerances):
        raise ParameterError(f"tolerances must be at least two numbers between 0 and 1, got {tuple(tolerances)}")
    state = chain.rest_state(initial_tension_N)
    force = np.asarray(force_N, dtype=np.float64)
    scale = max(initial_tension_N, float(np.abs(force).max(initial=0.0)), 1e-3)
    outputs = np.stack(
        [
            AdaptiveIntegrator(chain, step_s, len(force) - 1, solver=solver, tolerance=tolerance, scale_N=scale).run(
                state, force
            )[:, -1]
            for tolerance in sorted(tolerances)
        ]
    )
    ours = simulate(chain, force, step_s, initial_tension_N=initial_tension_N).require().output_tension_N
    difference, spread = ours - outputs[0], _peak(np.ptp(outputs, axis=0))
    span = float(np.ptp(outputs[0]))
    return AdaptiveCheck(
        solver=solver,
        rms_N=math.sqrt(float(difference @ difference) / len(difference)),
        peak_N=_peak(difference),
        range_N=span,
        spread_N=spread,
        reproducible=spread <= SPREAD_LIMIT * span,
    )
