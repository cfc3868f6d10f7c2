"""A simulation against the adaptive integrators of SUNDIALS, on the same equations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import casadi as ca
import numpy as np
from scipy.interpolate import PchipInterpolator

from tendonff.models.layout import INPUT_NAMES, ChainState
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.crosscheck import SPREAD_LIMIT
from tendonff.ocp.tendon.simulate import simulate


class Adaptive(StrEnum):
    """Adaptive integrator of the SUNDIALS suite."""

    CVODES = "cvodes"  # variable-order BDF for ordinary differential equations
    IDAS = "idas"  # the same for differential-algebraic equations


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
        # the force is linear between rows, the path cubic: a jump of its speed would be a blow to every mass
        count, y, t = equations.place.numel(), ca.SX.sym("y", layout.size), ca.SX.sym("t")
        piece = ca.SX.sym("piece", 3 + 4 * count)
        since = t - piece[0]
        cubic, square, slope, place = ca.vertsplit(piece[3:], [k * count for k in range(5)])
        place = place + since * (slope + since * (square + since * cubic))
        place_rate = slope + since * (2 * square + since * 3 * cubic)
        inputs = ca.vertcat(piece[1] + piece[2] * since, ca.SX.zeros(len(INPUT_NAMES) - 1))
        rate, tension = ca.substitute(
            [equations.rate, equations.tension_N],
            [equations.state, equations.inputs, equations.place, equations.place_rate],
            [self._scale * y, inputs, place, place_rate],
        )
        grid = np.arange(rows + 1, dtype=np.float64) * step_s
        options = {"reltol": tolerance, "abstol": tolerance, "max_num_steps": 200_000}
        self._integrator = ca.integrator(
            "adaptive", solver.value, {"t": t, "x": y, "u": piece, "ode": rate / self._scale}, 0.0, grid[1:], options
        )
        self._tension = ca.Function("tension", [y, t, piece], [tension], {"cse": True})

    def run(self, state: ChainState, force_N: Array) -> Array:
        """Tensions at the rows, the start included.

        Parameters
        ----------
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
        path = PchipInterpolator(time, self._chain.path_at(state.time_s + time).table())
        slopes = np.diff(force_N) / self._step_s
        pieces = np.vstack([time[:-1], force_N[:-1], slopes, path.c.transpose(0, 2, 1).reshape(-1, self._rows)])
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
    """`simulate` against an adaptive integrator."""

    # rms_N, peak_N: output tension against the integrator at its tightest tolerance
    rms_N: float
    peak_N: float
    range_N: float  # largest minus smallest output tension there
    # largest distance at any instant between the integrator's own tolerances: no comparison is finer than this
    spread_N: float
    reproducible: bool  # the integrator agrees with itself within `SPREAD_LIMIT` of the range


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
    force_N : ndarray, shape (n,)
        f_c1 at 0, h, 2 h ..., piecewise linear between [N].
    step_s : float
        h [s].
    initial_tension_N : float
        T0 of the start at rest [N].
    tolerances : sequence of float, optional
        At least two; the smallest is the reference.

    Raises
    ------
    SolveError
        If a run fails.
    """
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
    difference, spread = ours - outputs[0], float(np.ptp(outputs, axis=0).max(initial=0.0))
    span = float(np.ptp(outputs[0]))
    return AdaptiveCheck(
        rms_N=math.sqrt(float(difference @ difference) / len(difference)),
        peak_N=float(np.abs(difference).max(initial=0.0)),
        range_N=span,
        spread_N=spread,
        reproducible=spread <= SPREAD_LIMIT * span,
    )
