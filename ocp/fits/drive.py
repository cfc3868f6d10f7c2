"""Dry friction of a drive, from its force, the tension behind it and its position.

The drive's balance, m dv/dt = F - T - b v - f_d, has everything measured but its friction. The bristle of f_d follows
the travel alone, so the fit needs no simulation of the tendon.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np

from tendonff.models.tendon.friction import RubbingEnd
from tendonff.ocp.fits.least_squares import Residuals, Solution, Unknown, solve
from tendonff.ocp.step.protocol import Array

COULOMB, DAMPING, OFFSET = "coulomb_N", "damping_N_s_per_m", "offset_N"

_BLOCK_S = 0.25
_LEAST_N = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveRun:
    """Measurement at the drive without a gap, evenly sampled and smoothed."""

    step_s: float
    # force_N, tension_N: shape (n,); of the actuator, and of the tendon at its end
    force_N: Array
    tension_N: Array
    position_m: Array  # shape (n,); positive when it pulls


@cache
def _bristle() -> ca.Function:
    """Move of the bristle with its slope over coulomb_N: (f, slope), (move, coulomb, sigma) -> (f, slope)."""
    f, slope, move, coulomb, sigma = (ca.SX.sym(name) for name in ("f", "slope", "move", "coulomb", "sigma"))
    end = RubbingEnd(
        mass_kg=1.0, damping_N_s_per_m=0.0, stiffness_N_per_m=0.0, coulomb_N=coulomb, bristle_stiffness_N_per_m=sigma
    )
    (after,) = end.implicit(move, (f,), ca.SX(1))
    by = ca.jacobian(after, f) * slope + ca.jacobian(after, coulomb)
    return ca.Function("bristle", [ca.vertcat(f, slope), ca.vertcat(move, coulomb, sigma)], [ca.vertcat(after, by)])


def bristle_force(position_m: Array, coulomb_N: float, bristle_stiffness_N_per_m: float) -> tuple[Array, Array]:
    """Friction force along a travel, shape (n,), that starts at rest, and its slope over coulomb_N."""
    rows = len(position_m) - 1
    numbers = [np.diff(position_m), np.full(rows, coulomb_N), np.full(rows, bristle_stiffness_N_per_m)]
    found = np.asarray(_bristle().mapaccum(rows)([0.0, 0.0], np.stack(numbers)))
    force, slope = np.hstack([np.zeros((2, 1)), found])
    return force, slope


def fit_drive(
    runs: Sequence[DriveRun], mass_kg: float, bristle_stiffness_N_per_m: float, start_N: float, noise_N: float
) -> Solution:
    """Fit friction of slip, damping and the offset between both force readings; a usual residual has the size
    `noise_N`.
    """
    balances = []
    for run in runs:
        v = np.gradient(run.position_m, run.step_s)
        balances.append((run.force_N - run.tension_N - mass_kg * np.gradient(v, run.step_s), v))
    blocks = np.concatenate(
        [1000 * k + np.arange(len(run.force_N)) * run.step_s // _BLOCK_S for k, run in enumerate(runs)]
    ).astype(int)

    def evaluate(values: Mapping[str, float]) -> Residuals:
        rows, slopes = [], []
        for run, (balance, v) in zip(runs, balances, strict=True):
            force, by = bristle_force(run.position_m, values[COULOMB], bristle_stiffness_N_per_m)
            rows.append(force + values[DAMPING] * v + values[OFFSET] - balance)
            slopes.append(np.column_stack([by, v, np.ones(len(v))]))
        return Residuals(values=np.concatenate(rows) / noise_N, slopes=np.vstack(slopes) / noise_N, blocks=blocks)

    size = max(start_N, noise_N)
    unknowns = (
        Unknown(name=COULOMB, start=start_N, low=_LEAST_N, high=1e6, scale=size),
        Unknown(name=DAMPING, start=0.0, low=0.0, high=1e6, scale=10.0),
        Unknown(name=OFFSET, start=0.0, low=-1e6, high=1e6, scale=size),
    )
    return solve(evaluate, unknowns)
