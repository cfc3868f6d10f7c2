"""Dry friction of a drive and its gear, from its force, the tension behind it and its position.

The drive's balance, m dv/dt = F - T - b v - f_d, has everything measured but its friction. The bristle of f_d follows
the travel alone, so the fit needs no simulation of the tendon.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np

from tendonff.models.gear import DriveLaw
from tendonff.models.tendon.friction import GearedEnd
from tendonff.ocp.fits.least_squares import Residuals, Solution, Unknown, solve
from tendonff.ocp.step.protocol import Array

COULOMB, LOST, DAMPING, OFFSET = "coulomb_N", "lost_share", "damping_N_s_per_m", "offset_N"

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
    """Move of the bristle with its slopes over coulomb_N and lost_share: (f, slopes), (move, tension, ...) -> same."""
    f, move, tension, coulomb, lost, sigma = (ca.SX.sym(n) for n in ("f", "move", "tension", COULOMB, LOST, "sigma"))
    slopes, unknown = ca.SX.sym("slopes", 2), ca.vertcat(coulomb, lost)
    end = GearedEnd(
        mass_kg=1.0,
        damping_N_s_per_m=0.0,
        stiffness_N_per_m=0.0,
        coulomb_N=coulomb,
        bristle_stiffness_N_per_m=sigma,
        lost_share=lost,
    )
    (after,) = end.implicit(move, (f,), ca.SX(1), tension)
    by = ca.jacobian(after, f) * slopes + ca.jacobian(after, unknown).T
    return ca.Function(
        "bristle", [ca.vertcat(f, slopes), ca.vertcat(move, tension, unknown, sigma)], [ca.vertcat(after, by)]
    )


def bristle_force(run: DriveRun, law: DriveLaw, bristle_stiffness_N_per_m: float) -> tuple[Array, Array]:
    """Friction force along a run from rest, shape (n,), and its slopes over coulomb_N and lost_share, shape (n, 2)."""
    rows = len(run.position_m) - 1
    known = [np.full(rows, x) for x in (law.coulomb_N, law.lost_share, bristle_stiffness_N_per_m)]
    numbers = np.stack([np.diff(run.position_m), run.tension_N[1:], *known])
    found = np.asarray(_bristle().mapaccum(rows)([0.0, 0.0, 0.0], numbers))
    whole = np.hstack([np.zeros((3, 1)), found])
    return whole[0], whole[1:].T


def fit_drive(
    runs: Sequence[DriveRun],
    mass_kg: float,
    bristle_stiffness_N_per_m: float,
    start: DriveLaw,
    noise_N: float,
    *,
    with_gear: bool = False,
) -> Solution:
    """Fit friction of slip, damping and the offset between both force readings; a usual residual has the size
    `noise_N`. The gear's lost share is that of `start`, or fitted as well.
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
            law = DriveLaw(coulomb_N=values[COULOMB], lost_share=values.get(LOST, start.lost_share))
            force, by = bristle_force(run, law, bristle_stiffness_N_per_m)
            rows.append(force + values[DAMPING] * v + values[OFFSET] - balance)
            slopes.append(np.column_stack([by if with_gear else by[:, :1], v, np.ones(len(v))]))
        return Residuals(values=np.concatenate(rows) / noise_N, slopes=np.vstack(slopes) / noise_N, blocks=blocks)

    size = max(start.coulomb_N, noise_N)
    gear = Unknown(name=LOST, start=start.lost_share, low=0.0, high=0.95, scale=0.05)
    unknowns = (
        Unknown(name=COULOMB, start=start.coulomb_N, low=_LEAST_N, high=1e6, scale=size),
        *((gear,) if with_gear else ()),
        Unknown(name=DAMPING, start=0.0, low=0.0, high=1e6, scale=10.0),
        Unknown(name=OFFSET, start=0.0, low=-1e6, high=1e6, scale=size),
    )
    return solve(evaluate, unknowns)
