"""Stage (b): stiffness, relaxing stiffness and relaxation time from force and elongation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.static import block_numbers
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.cleaning import Piece, Record
from tendonff.models.capstan import CapstanLaw
from tendonff.models.parameters import Tendon
from tendonff.ocp.fits.elongation import TENDON_PARAMETERS, elongation
from tendonff.ocp.fits.least_squares import Residuals, Unknown, solve
from tendonff.ocp.fits.static import StaticParameter

PROFILE_POINTS = 9


def mean_tension(piece: Piece, values: Mapping[StaticParameter, float]) -> Array:
    """Mean tension over the path of a piece, by the play law started from its first output, shape (n,) [N]."""
    law = CapstanLaw(
        pull_exponent=values[StaticParameter.PULL],
        release_exponent=values[StaticParameter.RELEASE],
        adhesion_N=values[StaticParameter.ADHESION],
    )
    near = piece.input_N - values[StaticParameter.INPUT_BIAS]
    far = float(piece.output_N[0]) - values[StaticParameter.OUTPUT_BIAS]
    shares = np.linspace(0, 1, PROFILE_POINTS)
    profile = law.profile_history_N(near, shares, far)
    return np.asarray(np.trapezoid(profile, shares, axis=1))


def stretches_within(x: Array, reach: float) -> list[tuple[int, int]]:
    """First rows of stretches over which a signal stays within a reach, and those after their last rows."""
    stretches, start, low, high = [], 0, x[0], x[0]
    for k, value in enumerate(x):
        low, high = min(low, value), max(high, value)
        if high - low > reach:
            stretches.append((start, k))
            start, low, high = k, value, value
    return [*stretches, (start, len(x))]


def longest_hold_s(records: Sequence[Record]) -> float:
    """Longest time over which the input stays within 2 % of its range [s]."""
    span = max(float(np.ptp(r.joined("input_N"))) for r in records)
    longest = 0.0
    for record in records:
        thin = max(1, int(0.02 / record.step_s))
        for piece in record.pieces:
            holds = stretches_within(piece.input_N[::thin], TUNED.hold_share * span)
            longest = max(longest, *((stop - 1 - start) * (record.step_s * thin) for start, stop in holds))
    return longest


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """A piece, thinned to what the low-pass leaves."""

    step_s: float
    force_N: Array
    elongation_m: Array
    good: Mask


def _thinned(record: Record, piece: Piece, values: Mapping[StaticParameter, float]) -> _Run:
    thin = max(1, int(1 / (6 * record.cutoff_Hz * record.step_s)))
    return _Run(
        step_s=thin * record.step_s,
        force_N=mean_tension(piece, values)[::thin],
        elongation_m=piece.elongation_m()[::thin],
        good=piece.good[::thin],
    )


def fit_tendon(records: Sequence[Record], values: Mapping[StaticParameter, float], tendon: Tendon) -> dict[str, float]:
    """k1, k2, tau by force and elongation of records with positions; `values` are those of the capstan law."""
    runs = [_thinned(r, p, values) for r in records for p in r.pieces]
    swing = max(float(np.ptp(r.force_N)) for r in runs)
    travel = max(float(np.ptp(r.elongation_m)) for r in runs)
    unit = 0.01 * max(travel, 1e-15)
    stiffness = max(swing, 1e-12) / max(travel, 1e-15)
    seconds = sum(r.step_s * len(r.force_N) for r in runs)
    offsets = [
        Unknown(name=f"{kind}_{k}", start=0.0, low=-np.inf, high=np.inf, scale=travel)
        for k in range(len(runs))
        for kind in ("zero", "start")
    ]
    blocks = block_numbers([np.arange(len(r.good), dtype=np.float64) * r.step_s for r in runs], seconds)

    def evaluate(at: Mapping[str, float]) -> Residuals:
        differences, slopes = [], []
        k1, k2, tau = (at[name] for name in TENDON_PARAMETERS)
        for k, run in enumerate(runs):
            step, force, wanted, good = run.step_s, run.force_N, run.elongation_m, run.good
            # Centred: the zero of the elongation is then that of the mean, and independent of the stiffness.
            found = elongation((k1, k2, tau), force - force.mean(), step)
            x = found.elongation_m + at[f"zero_{k}"] + at[f"start_{k}"] * found.fading
            differences.append(np.where(good, x - (wanted - wanted.mean()), 0.0) / unit)
            block = np.zeros((len(x), 3 + len(offsets)))
            block[:, :3] = found.slopes
            fade = at[f"start_{k}"] * found.fading * np.arange(len(x)) * step
            constant = tau * (k1 + k2) / k1
            by = (-tau * k2 / k1**2, tau / k1, (k1 + k2) / k1)
            block[:, :3] += (fade / constant**2)[:, None] * np.array(by)
            block[:, 3 + 2 * k], block[:, 4 + 2 * k] = 1.0, found.fading
            slopes.append(np.where(good[:, None], block, 0.0) / unit)
        return Residuals(values=np.concatenate(differences), slopes=np.concatenate(slopes), blocks=blocks)

    k1, k2, tau = TENDON_PARAMETERS
    starts = []
    for first in (0.3 * tendon.relaxation_time_s, tendon.relaxation_time_s, 3 * tendon.relaxation_time_s):
        usual = {
            k1: (stiffness, 1e-3 * stiffness, 1e3 * stiffness, 0.3),
            k2: (0.3 * stiffness, 1e-6 * stiffness, 1e3 * stiffness, 1),
            tau: (first, 1e-3, 1e3, 0.5),
        }
        positive = [
            Unknown(name=name, start=at, low=low, high=high, scale=scale, logarithmic=True)
            for name, (at, low, high, scale) in usual.items()
        ]
        starts.append(solve(evaluate, [*positive, *offsets], most=40))
    solution = min(starts, key=lambda s: s.cost)
    return {name: solution.values[name] for name in TENDON_PARAMETERS}
