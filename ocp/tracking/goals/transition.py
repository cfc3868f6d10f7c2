"""The least time from one tension to another, within the limits of the actuator.

By the static law the force ramps at its largest rate from the tension of the start to the force that holds the other
one in slip, so the time is that of the ramp. On the chain inertia, damping and soft bristles count, so the duration is
found by bisection: for each the output has to be within the tolerance from its end on, and is free before.
"""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.ocp.batch import Progress
from tendonff.ocp.inverse import invert
from tendonff.ocp.simulate import simulate
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.band import Band
from tendonff.ocp.tracking.diagnosis import departures, law_of
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackingProblem, TrackOptions
from tendonff.ocp.tracking.result import Tracking, TrackStatus
from tendonff.ocp.tracking.track import solve_tracking

TOLERANCE = 0.01
"""Of the change: how near the output has to stay unless told otherwise."""

_AIMED = 0.9  # of the tolerance: what the search is kept within
_NEAR = 1e-3  # weight of the squared distance to a smooth transition
_KEPT = 1e3  # weight of the squared distance to the band
_PRECISION = 0.01  # of the duration: where bisection ends
_LEAST = 0.25  # of the static law's time: shorter ones are not tried
_NO_CHANGE = 1e-3  # of the tension: what smoothing may leave between two that are meant to be equal
_SHOWN = 6  # durations are solved for, ...
_SHORTEST = 60  # and so many rows at least; then the output is held
_CALM = 0.2  # of the horizon at least, in which the output has to stay


def static_time_s(law: CapstanLaw, start_N: float, end_N: float, limits: ForceLimits) -> float:
    """Least time from rest at a tension to another output by the static law [s]; infinite where it is out of reach."""
    force = float(law.input_for_N(end_N, Branch.PULL if end_N > start_N else Branch.RELEASE))
    if not limits.minimum_N <= force <= limits.maximum_N:
        return float("inf")
    return abs(force - limits.start(start_N)) / limits.rate_N_per_s


def settled_row(output_N: Array, end_N: float, tolerance_N: float) -> int:
    """First row from which on the output stays within the tolerance; their count where it does not."""
    off = np.flatnonzero(np.abs(output_N - end_N) > tolerance_N)
    return int(off[-1]) + 1 if off.size else 0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Transition:
    chain: Chain
    rows: int
    step_s: float
    limits: ForceLimits
    start_N: float
    end_N: float
    tolerance_N: float
    options: TrackOptions

    def solved(self, duration: int) -> Tracking:
        """The profile that shall have settled after so many rows, over some time more."""
        rows = min(self.rows, max(_SHOWN * duration, _SHORTEST))
        place = np.minimum(np.arange(rows) / duration, 1.0)
        path = self.start_N + (self.end_N - self.start_N) * place**3 * (10 + place * (6 * place - 15))
        inverse = invert(self.chain, path, self.step_s, initial_tension_N=self.start_N)
        problem = TrackingProblem.of(
            (self.chain,),
            path,
            self.step_s,
            self.limits,
            self.options,
            initial_tension_N=self.start_N,
            inverse_N=inverse.force_N,
        )
        kept, free = _AIMED * self.tolerance_N, np.arange(rows) < duration
        low, high = (np.where(free, side * np.inf, self.end_N + side * kept) for side in (-1.0, 1.0))
        problem = replace(
            problem,
            plants=tuple(replace(plant, weight=_NEAR) for plant in problem.plants),
            goal=replace(problem.goal, band=Band(low_N=low, high_N=high, weight=_KEPT / _NEAR)),
        )
        return solve_tracking(problem, inverse, replace(self.options, restarts=0))

    def held(self, found: Tracking) -> Tracking:
        """The profile until the end of the horizon: the output stays where it is by the exact inverse."""
        left = self.rows - len(found.force_N)
        if left <= 0:
            return found
        run = simulate(self.chain, found.force_N, self.step_s, initial_tension_N=self.start_N)
        still = np.full(left + 1, found.predicted_output_N[-1])
        after = invert(self.chain, still, self.step_s, state=run.final).force_N[1:]
        force = self.limits.apply(np.concatenate([found.force_N, after]), self.step_s)
        whole = simulate(self.chain, force, self.step_s, initial_tension_N=self.start_N).require()
        return replace(
            found,
            time_s=whole.time_s,
            force_N=force,
            predicted_output_N=whole.output_tension_N,
            least_tension_N=float(whole.tension_N[1:].min()),
            largest_tension_N=float(whole.tension_N[1:].max()),
        )

    def settled(self, found: Tracking) -> int:
        return settled_row(found.predicted_output_N, self.end_N, self.tolerance_N)


def track_transition(
    chain: Chain,
    start_N: float,
    end_N: float,
    rows: int,
    step_s: float,
    limits: ForceLimits,
    options: TrackOptions = TrackOptions(),  # noqa: B008 - frozen
    *,
    tolerance_N: float | None = None,
    progress: Progress | None = None,
) -> Tracking:
    """Find the force that brings the output from rest to another tension in the least time, and keeps it there.

    Parameters
    ----------
    chain : Chain
    start_N, end_N : float
        Uniform tension of the start at rest, and the output wanted [N].
    rows : int
        Of the horizon, row 0 included: the output has to stay until its end.
    step_s : float
    limits : ForceLimits
    options : TrackOptions, optional
    tolerance_N : float, optional
        How near the output has to stay [N]; default: 1 % of the change.
    progress : callable, optional
        Callback(completed, total), in tried durations.

    Returns
    -------
    Tracking
        Errors are those against a jump to the other tension once the output has settled. Where it does not settle
        within the horizon it is the best achievable.
    """
    change = abs(end_N - start_N)
    if change <= _NO_CHANGE * max(start_N, end_N):
        raise ParameterError(
            f"least_time needs another tension at the end: the reference begins and ends at {start_N:g} N; "
            "leave it out to follow the reference"
        )
    tolerance = TOLERANCE * change if tolerance_N is None else tolerance_N
    if not 0 < tolerance < change:
        raise ParameterError(
            f"tolerance_N must lie between 0 and the change from {start_N:g} to {end_N:g} N, got {tolerance:g}; "
            "leave it out for 1 % of the change"
        )
    task = _Transition(
        chain=chain,
        rows=rows,
        step_s=step_s,
        limits=limits,
        start_N=start_N,
        end_N=end_N,
        tolerance_N=tolerance,
        options=options,
    )
    by_law = static_time_s(law_of(chain), start_N, end_N - np.sign(end_N - start_N) * tolerance, limits)
    most = max(int((1 - _CALM) * rows), 2)
    first = most if not np.isfinite(by_law) else int(np.clip(np.ceil(by_law / step_s), 2, most))
    low, high, best = max(int(_LEAST * first), 1), first, task.solved(first)
    tried = 1
    while task.settled(best) > high and high < most:  # longer ones, until one settles in time
        low, high = high, min(int(1.3 * high) + 2, most)
        best = task.solved(high)
        tried += 1
    high = min(high, task.settled(best))
    reached = task.settled(best) <= most
    while reached and high - low > max(1.0, _PRECISION * high):
        middle = (low + high) // 2
        found = task.solved(middle)
        settled = task.settled(found)
        if settled < high:
            best, high = found, settled
        low = max(low, middle) if settled > middle else min(low, high)
        tried += 1
        if progress is not None:
            progress(tried, tried + int(np.ceil(np.log2(max(high - low, 1)))))
    return _told(task.held(best), task, by_law)


def _told(found: Tracking, task: _Transition, by_law_s: float) -> Tracking:
    """The answer in words: how long it takes, and how long by the static law."""
    row, h = task.settled(found), task.step_s
    wanted = np.where(np.arange(task.rows) < row, found.predicted_output_N, task.end_N)
    error = found.predicted_output_N - wanted
    way = f"from {task.start_N:.4g} to {task.end_N:.4g} N"
    law = "out of reach by the static law" if not np.isfinite(by_law_s) else f"static law: {by_law_s:.3g} s"
    status, reasons = found.status, found.reasons
    if row < task.rows:
        message = f"{way} in {row * h:.4g} s ({law}), then within {task.tolerance_N:.3g} N until the end"
        reasons = ()
        status = TrackStatus.OPTIMAL if status in _USABLE else status
    else:
        error = found.predicted_output_N - task.end_N
        message = (
            f"{way}: the output does not come to stay within {task.tolerance_N:.3g} N before {(task.rows - 1) * h:.4g} "
            f"s ({law}); at the end it is {abs(error[-1]):.3g} N off"
        )
        status = TrackStatus.BEST_ACHIEVABLE if status in _USABLE else status
    return replace(
        found,
        status=status,
        message=message,
        reasons=reasons,
        departures=departures(task.end_N + error, np.full(task.rows, task.end_N), h) if row >= task.rows else (),
        rms_error_N=float(np.sqrt(np.mean(error**2))),
        peak_error_N=float(np.max(np.abs(error))),
    )


_USABLE = {
    TrackStatus.EXACT,
    TrackStatus.OPTIMAL,
    TrackStatus.ACCEPTABLE,
    TrackStatus.CLIPPED,
    TrackStatus.BEST_ACHIEVABLE,
}
