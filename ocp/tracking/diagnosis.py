"""Why a reference cannot be followed within limits, in the user's terms.

The numbers come from the capstan law: what the reference needs at the actuator while the tendon slips, and how
far the force must travel at a reversal before the output moves again. They are estimates for words, not for design.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.gear import DriveLaw
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import equivalent_exponent
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.limits import ForceLimits

_IDEAL = DriveLaw()
_DEPARTED = 0.01  # of the reference's range
_MERGE_S = 0.02  # departures closer than this share of the horizon are one


class PeakBeyond(str):
    """Reason that the reference's peak is more than the drive can hold, which its own warning states too."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Departure:
    """A stretch of time in which the output is more than 1 % of the range off the reference.

    Attributes
    ----------
    start_s, end_s : float
        Its start and end [s].
    peak_error_N : float
        Largest error there, signed: positive where the output is above the reference [N].
    peak_time_s : float
        Time of that error [s].
    """

    start_s: float
    end_s: float
    peak_error_N: float
    peak_time_s: float

    def __str__(self) -> str:
        """In words."""
        side = "above" if self.peak_error_N > 0 else "below"
        return (
            f"from {self.start_s:.4g} to {self.end_s:.4g} s up to {abs(self.peak_error_N):.3g} N {side} the reference "
            f"(t = {self.peak_time_s:.4g} s)"
        )


def departures(output_N: Array, reference_N: Array, step_s: float) -> tuple[Departure, ...]:
    """Where an output leaves its reference, both of shape (n,) [N], in order of time."""
    error = np.nan_to_num(output_N - reference_N, nan=math.inf)
    off = np.flatnonzero(np.abs(error) > _DEPARTED * float(np.ptp(reference_N)))
    if off.size == 0:
        return ()
    gap = max(int(_MERGE_S * len(error)), 1)
    found = []
    for piece in np.split(off, np.flatnonzero(np.diff(off) > gap) + 1):
        peak = int(piece[np.argmax(np.abs(error[piece]))])
        found.append(
            Departure(
                start_s=float(piece[0] * step_s),
                end_s=float(piece[-1] * step_s),
                peak_error_N=float(error[peak]),
                peak_time_s=peak * step_s,
            )
        )
    return tuple(found)


def law_of(chain: Chain) -> CapstanLaw:
    """Capstan law of a chain: the coefficients of its elements, put together again."""
    pull, release = chain.friction.slip_coefficients
    exponent, reference = chain.elements.load_dependence
    return CapstanLaw(
        pull_exponent=_exponent(pull, chain.count),
        release_exponent=_exponent(release, chain.count),
        adhesion_N=chain.elements.piece.adhesion_N,
        load_exponent=exponent,
        reference_tension_N=reference,
    )


def _exponent(coefficient: float | Array, count: int) -> float:
    """Mu theta of a row of elements."""
    return float(np.sum(np.broadcast_to(equivalent_exponent(np.asarray(coefficient)), (count,))))


def held_N(chain: Chain, limits: ForceLimits) -> float:
    """Output that the largest force holds against full slip, whatever the bristles add [N]."""
    return law_of(chain).largest_output_N(chain.drive.pulled_N(limits.maximum_N))


def reversals(reference_N: Array) -> NDArray[np.int_]:
    """Rows where the reference, shape (n,) [N], turns; ripple below 1 % of its range is left out."""
    least = _DEPARTED * float(np.ptp(reference_N))
    turns: list[int] = []
    low = high = 0
    direction = 0
    way = np.diff(reference_N)
    corners = np.flatnonzero(way[1:] * way[:-1] <= 0) + 1  # nowhere else does it turn
    for k in (*corners.tolist(), len(reference_N) - 1):
        value = float(reference_N[k])
        low = k if value < reference_N[low] else low
        high = k if value > reference_N[high] else high
        if direction >= 0 and reference_N[high] - value > least:
            if direction > 0:
                turns.append(high)
            direction, low = -1, k
        elif direction <= 0 and value - reference_N[low] > least:
            if direction < 0:
                turns.append(low)
            direction, high = 1, k
    return np.array(turns, dtype=np.int64)


def reasons(
    law: CapstanLaw,
    reference_N: Array,
    inverse_N: Array,
    step_s: float,
    limits: ForceLimits,
    minimum_tension_N: float,
    maximum_tension_N: float,
    drive: DriveLaw = _IDEAL,
) -> tuple[str, ...]:
    """Infeasible parts of the reference and the reasons, the hardest first within each kind.

    Reference and exact inverse have the shape (n,) [N]; the two tensions are bounds along the tendon [N].
    """
    found = [
        *_range_reasons(law, reference_N, step_s, limits, drive),
        *_rate_reasons(law, reference_N, step_s, limits),
        *_tension_reasons(law, reference_N, step_s, minimum_tension_N, maximum_tension_N),
    ]
    worst = limits.worst(inverse_N, step_s)
    if not found and worst.excess > 0:
        unit = "N/s" if worst.name.startswith("force_rate") else "N"
        found.append(
            f"the exact inverse needs {worst.value:.5g} {unit} at t = {worst.time_s:.4g} s, "
            f"{worst.name} is {worst.bound:.5g}"
        )
    return tuple(found)


def _range_reasons(law: CapstanLaw, reference: Array, step_s: float, limits: ForceLimits, drive: DriveLaw) -> list[str]:
    found = list[str]()
    most = law.largest_output_N(drive.pulled_N(limits.maximum_N))
    least = law.smallest_output_N(drive.released_N(limits.minimum_N))
    rubs = "" if drive.is_ideal else " and the drive's own friction"
    high, low = int(np.argmax(reference)), int(np.argmin(reference))
    if reference[high] > most:
        needed = float(drive.force_N(law.input_for_N(reference[high], Branch.PULL), 1.0))
        found.append(
            PeakBeyond(
                f"the reference asks for {reference[high]:.4g} N at t = {high * step_s:.4g} s; through e^(mu theta) = "
                f"{math.exp(law.pull_exponent):.3g}{rubs} that needs {needed:.4g} N at the actuator, "
                f"{limits.maximum_name} is {limits.maximum_N:.4g}: at most {most:.4g} N arrive "
                "by slow pulling, and more only in passing"
            )
        )
    if reference[low] < least:
        needed = float(drive.force_N(law.input_for_N(reference[low], Branch.RELEASE), -1.0))
        found.append(
            f"the reference falls to {reference[low]:.4g} N at t = {low * step_s:.4g} s; friction holds it, so the "
            f"actuator must go down to {needed:.4g} N, force_min_N is {limits.minimum_N:.4g}: "
            f"by the capstan law no release there brings the output below {least:.4g} N"
        )
    return found


def _rate_reasons(law: CapstanLaw, reference: Array, step_s: float, limits: ForceLimits) -> list[str]:
    found = []
    rate = np.diff(reference) / step_s
    for branch, extreme, verb, exponent in (
        (Branch.PULL, _first_extreme(rate), "rises", law.pull_exponent),
        (Branch.RELEASE, _first_extreme(-rate), "falls", -law.release_exponent),
    ):
        needed, wanted = abs(float(rate[extreme])) * math.exp(exponent), abs(float(rate[extreme]))
        if (rate[extreme] > 0) == (branch is Branch.PULL) and needed > limits.rate_N_per_s:
            name = "e^(mu theta)" if branch is Branch.PULL else "e^(-mu theta)"
            found.append(
                f"the reference {verb} at {wanted:.3g} N/s at t = {(extreme + 1) * step_s:.4g} s; through {name} = "
                f"{math.exp(exponent):.3g} that needs {needed:.3g} N/s at the actuator, limit {limits.rate_N_per_s:.4g}"
            )
    turns = reversals(reference)
    if turns.size:
        at = reference[turns]
        travel = np.abs(law.input_for_N(at, Branch.PULL) - law.input_for_N(at, Branch.RELEASE))
        hold = travel / limits.rate_N_per_s
        half = np.minimum(np.maximum((hold / 2 / step_s).astype(int), 1), len(reference) - 1)
        before, after = reference[np.maximum(turns - half, 0)], reference[np.minimum(turns + half, len(reference) - 1)]
        missed = np.maximum(np.abs(before - at), np.abs(after - at))
        helpful = _rates_that_help(travel, reference, turns, step_s)
        bad = (missed > 0.5 * _DEPARTED * float(np.ptp(reference))) & (helpful > limits.rate_N_per_s)
        if bad.any():
            k = int(np.argmax(np.where(bad, missed, -1.0)))
            found.append(
                f"at {int(bad.sum())} of {turns.size} reversals the force must cross the deadband before the output "
                f"moves, most at t = {turns[k] * step_s:.4g} s: {travel[k]:.3g} N, at {limits.rate_N_per_s:.4g} N/s "
                f"that takes {hold[k]:.3g} s in which the output is constant; a rate limit of "
                f"{helpful.max():.3g} N/s would keep that below 1 % of the range"
            )
    return found


def _first_extreme(values: Array) -> int:
    """Where the largest value is reached first; along a straight line rounding would choose."""
    top = float(values.max())
    return int(np.argmax(values >= top - 1e-6 * abs(top)))


def _rates_that_help(travel: Array, reference: Array, turns: NDArray[np.int_], step_s: float) -> Array:
    """Rate at each reversal at which the reference moves less than 1 % of its range while the force travels [N/s]."""
    small, n, needed = _DEPARTED * float(np.ptp(reference)), len(reference), []
    for row, way in zip(turns.tolist(), travel.tolist(), strict=True):
        away = np.abs(reference - reference[row]) > small
        before, after = np.flatnonzero(away[:row]), np.flatnonzero(away[row:])
        first = before[-1] if before.size else 0
        last = row + after[0] if after.size else n - 1
        needed.append(way / ((last - first) * step_s))
    return np.array(needed)


def _tension_reasons(
    law: CapstanLaw, reference: Array, step_s: float, minimum_tension_N: float, maximum_tension_N: float
) -> list[str]:
    found = []
    low, high = int(np.argmin(reference)), int(np.argmax(reference))
    released = float(law.input_for_N(reference[low], Branch.RELEASE))
    if minimum_tension_N > 0 and released < minimum_tension_N:
        found.append(
            f"at t = {low * step_s:.4g} s the reference is {reference[low]:.4g} N; release leaves {released:.4g} N "
            f"near the actuator, minimum_tension_N is {minimum_tension_N:.4g}"
        )
    elif released <= 0:
        found.append(
            f"at t = {low * step_s:.4g} s the reference falls to {reference[low]:.4g} N; releasing to it would need "
            f"{released:.4g} N at the actuator, and a tendon cannot push: keep more tension"
        )
    pulled = float(law.input_for_N(reference[high], Branch.PULL))
    if pulled > maximum_tension_N:
        found.append(
            f"at t = {high * step_s:.4g} s the reference is {reference[high]:.4g} N; pulling takes {pulled:.4g} N near "
            f"the actuator, maximum_tension_N is {maximum_tension_N:.4g}"
        )
    return found
