"""The least effort within a band around the reference.

Friction makes every reversal dear: the force has to cross the dead zone. Within a band the output need not follow what
is smaller than the band's width, and turns later and earlier than the reference. Of all outputs in the band the one
that moves only when it must has the least travel and the fewest turns; by the static law the force then has, too. The
search starts there; where limits bind, the band is a constraint, and the travel of the force is what is made small.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from tendonff.models.capstan import held_within
from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.ocp.batch import Progress
from tendonff.ocp.inverse import invert
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.band import Band
from tendonff.ocp.tracking.diagnosis import departures
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackingProblem, TrackOptions, travel_N
from tendonff.ocp.tracking.result import Tracking, TrackStatus
from tendonff.ocp.tracking.track import solve_tracking

_LAID = 0.95  # of the tolerance: there the path is laid
_AIMED = 0.98  # of the tolerance: corners are rounded, and the search kept, within this
_ROUNDED = 0.05  # of the horizon: the longest corner
_TRAVEL = 1e-3  # what doubling the travel costs, relative to the squared range
_NEAR = 1e-2  # weight of the squared distance to the path of least travel
_KEPT = 1e4  # weight of the squared distance to the band


def least_travel_path(reference_N: Array, tolerance_N: float) -> Array:
    """The output within a band that travels least, and turns least, from the first reference on, shape (n,).

    It moves only when it must, so it rises to the tolerance below each peak and falls to the tolerance above each
    valley; what is smaller than the band's width it passes by. On the way from one to the other it lies midway between
    the latest and the earliest such output: where the reference itself goes one way, on the reference.

    Parameters
    ----------
    reference_N : ndarray, shape (n,)
    tolerance_N : float
        Half of the band's width [N].
    """
    lazy = held_within(float(reference_N[0]), reference_N - tolerance_N, reference_N + tolerance_N)
    moved = np.flatnonzero(np.diff(lazy)) + 1
    if not moved.size:
        return lazy
    turned = np.diff(np.sign(lazy[moved] - lazy[moved - 1])) != 0
    turns = np.concatenate([[0], moved[:-1][turned], [len(lazy) - 1]])
    path = lazy.copy()
    for start, end in zip(turns[:-1].tolist(), turns[1:].tolist(), strict=True):
        part, low, high = reference_N[start : end + 1], *sorted((lazy[start], lazy[end]))
        side = 1.0 if lazy[end] >= lazy[start] else -1.0
        latest = np.maximum.accumulate(side * part)
        earliest = np.minimum.accumulate(side * part[::-1])[::-1]
        path[start : end + 1] = np.clip(side * 0.5 * (latest + earliest), low, high)
    return path


def turns_of(force_N: Array, least_N: float) -> int:
    """How often a force turns, swings below `least_N` left out."""
    lazy = held_within(float(force_N[0]), force_N - 0.5 * least_N, force_N + 0.5 * least_N)
    way = np.sign(np.diff(lazy))
    return int(np.count_nonzero(np.diff(way[way != 0])))


def track_band(
    chain: Chain,
    reference_N: Array,
    step_s: float,
    limits: ForceLimits,
    tolerance_N: float,
    options: TrackOptions = TrackOptions(),  # noqa: B008 - frozen
    *,
    initial_tension_N: float | None = None,
    progress: Progress | None = None,
) -> Tracking:
    """Find the force of least travel whose output stays within a band around the reference.

    With `effort_weight` the mean squared force counts beside the travel.

    Parameters
    ----------
    chain : Chain
    reference_N : ndarray, shape (n,)
        Middle of the band [N].
    step_s : float
    limits : ForceLimits
    tolerance_N : float
        Half of the band's width [N], > 0.
    options : TrackOptions, optional
    initial_tension_N : float, optional
        Default: the first reference.
    progress : callable, optional

    Returns
    -------
    Tracking
        Errors are those against the reference; departures those from the band. Where the band cannot be kept it is the
        best achievable.
    """
    if not tolerance_N > 0:
        raise ParameterError(f"tolerance_N must be > 0, got {tolerance_N}; leave it out to follow the reference")
    reference = np.asarray(reference_N, dtype=np.float64)
    start = float(reference[0]) if initial_tension_N is None else initial_tension_N
    path = _rounded(least_travel_path(reference, _LAID * tolerance_N), reference, _AIMED * tolerance_N)
    inverse = invert(chain, path, step_s, initial_tension_N=start)
    travel_weight = max(options.travel_weight, _TRAVEL)
    problem = TrackingProblem.of(
        (chain,),
        path,
        step_s,
        limits,
        replace(options, travel_weight=travel_weight),
        initial_tension_N=start,
        inverse_N=inverse.force_N,
    )
    kept = _AIMED * tolerance_N
    band = Band(low_N=reference - kept, high_N=reference + kept, weight=_KEPT / _NEAR)
    problem = replace(
        problem,
        plants=tuple(replace(plant, weight=_NEAR) for plant in problem.plants),
        goal=replace(problem.goal, band=band),
    )
    found = solve_tracking(problem, inverse, options, progress)
    exact = limits.apply(invert(chain, reference, step_s, initial_tension_N=start).force_N, step_s, start)
    return _told(found, reference, step_s, tolerance_N, exact)


def _rounded(path_N: Array, reference_N: Array, tolerance_N: float) -> Array:
    """The path with its corners rounded as far as the band admits: at a corner the chain asks for a jerk."""
    width = int(_ROUNDED * len(path_N))
    while width >= 2:
        ends = [np.full(width, end) for end in path_N[[0, -1]]]
        padded = np.concatenate([2 * ends[0] - path_N[width:0:-1], path_N, 2 * ends[1] - path_N[-2 : -width - 2 : -1]])
        smooth: Array = uniform_filter1d(uniform_filter1d(padded, width | 1), width | 1)[width:-width]
        if np.all(np.abs(smooth - reference_N) <= tolerance_N):
            return smooth
        width //= 2
    return path_N


@dataclass(frozen=True, slots=True)
class _Effort:
    travel_N: float
    turns: int

    @classmethod
    def of(cls, force_N: Array, least_N: float) -> "_Effort":
        return cls(travel_N(force_N), turns_of(force_N, least_N))

    def __str__(self) -> str:
        return f"{self.travel_N:.4g} N in {self.turns + 1} {'stroke' if self.turns == 0 else 'strokes'}"


def _told(found: Tracking, reference: Array, step_s: float, tolerance: float, exact_N: Array) -> Tracking:
    """The answer against the reference and its band."""
    error = found.predicted_output_N - reference
    outside = np.sign(error) * np.maximum(np.abs(error) - tolerance, 0.0)
    worst = int(np.argmax(np.abs(outside)))
    least = 0.01 * float(np.ptp(exact_N))
    effort = f"the force travels {_Effort.of(found.force_N, least)}, the exact inverse {_Effort.of(exact_N, least)}"
    peak = float(np.max(np.abs(error)))
    status, reasons = found.status, found.reasons
    if outside[worst] == 0:
        kept = f"the output stays within {tolerance:.4g} N of the reference"
        reasons = ()
        if status is not TrackStatus.EXACT:
            status = TrackStatus.OPTIMAL if status is TrackStatus.BEST_ACHIEVABLE else status
    else:
        kept = (
            f"the output leaves the band of {tolerance:.4g} N by up to {abs(outside[worst]):.3g} N, "
            f"at t = {worst * step_s:.4g} s: no profile was found that keeps it"
        )
        if status not in (TrackStatus.FAILED, TrackStatus.INFEASIBLE):
            status = TrackStatus.BEST_ACHIEVABLE
    return replace(
        found,
        status=status,
        message=f"{kept}; {effort}",
        reasons=reasons,
        departures=departures(reference + outside, reference, step_s),
        rms_error_N=float(np.sqrt(np.mean(error**2))),
        peak_error_N=peak,
    )
