"""A simulation against the adaptive integrators of SUNDIALS, on the same equations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.models.tendon.chain import Chain
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.crosscheck import SPREAD_LIMIT
from tendonff.ocp.tendon.simulate import simulate

ADAPTIVE = (Method.CVODES, Method.IDAS)
"""Methods with step control."""


def by_method(
    chain: Chain, force_N: Array, step_s: float, initial_tension_N: float, method: Method, tolerance: float
) -> Array:
    """Output tension by an integrator at a relative tolerance, shape (n,) [N]; SolveError if it gives up."""
    run = simulate(
        chain,
        force_N,
        step_s,
        initial_tension_N=initial_tension_N,
        method=method,
        rtol=tolerance,
        atol=1e-3 * tolerance,
    )
    return run.require().output_tension_N


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
    method: Method = Method.CVODES,
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
    force = np.asarray(force_N, dtype=np.float64)
    accurate = sorted(tolerances)
    outputs = np.stack([by_method(chain, force, step_s, initial_tension_N, method, each) for each in accurate])
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
