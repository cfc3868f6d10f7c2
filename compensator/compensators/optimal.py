"""The optimal profile: the force within the limits whose output comes closest to the reference.

Here, and nowhere else, it is decided whether the profile is made for the nominal transmission or for all that the
scenario's uncertainty admits.
"""

from tendonff.compensator.compensators.base import (
    CModule,
    Compensator,
    FloatArray,
    Problem,
    Profile,
    ProfileStatus,
    Style,
)
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import VERMILION
from tendonff.models.chain import Chain
from tendonff.ocp.tracking.goals.cycle import track_cycle
from tendonff.ocp.tracking.goals.preview import track_preview
from tendonff.ocp.tracking.goals.tolerance import track_band
from tendonff.ocp.tracking.goals.transition import track_transition
from tendonff.ocp.tracking.result import Tracking, TrackStatus
from tendonff.ocp.tracking.robust import POWER, track_robust
from tendonff.ocp.tracking.track import track

_STATUS = {
    TrackStatus.EXACT: ProfileStatus.GOOD,
    TrackStatus.OPTIMAL: ProfileStatus.GOOD,
    TrackStatus.INFEASIBLE: ProfileStatus.FAILED,
    TrackStatus.FAILED: ProfileStatus.FAILED,
}


class Optimal(Compensator):
    """The answer of the optimal-control problem."""

    name = "optimal"
    label = "optimal profile"
    style = Style(color=VERMILION, linestyle="--")
    is_fast = False
    c_module = CModule(name="profile", content="optimal profile", plays_back=True)

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:
        """Answer by optimal control; see `Compensator.profile`."""
        tracking = solve(problem, progress=progress)
        status = _STATUS.get(tracking.status, ProfileStatus.DOUBTFUL)
        return Profile(
            force_N=tracking.force_N,
            status=status,
            message="" if status is ProfileStatus.GOOD else tracking.message,
            warnings=(*_purpose(problem), *tracking_warnings(tracking)),
            tracking=tracking,
        )


def solve(problem: Problem, *, progress: Progress = silent) -> Tracking:
    """Solve the optimal-control problem, for the nominal transmission or for all samples.

    Parameters
    ----------
    progress : callable, optional
        Told iterations done and iterations at most.
    """
    reference = problem.reference
    wanted, step, start = problem.followed_N, reference.step_s, reference.initial_tension_N
    if reference.periodic:
        return track_cycle(
            (problem.chain, *(Chain.of(sample.transmission, problem.level) for sample in problem.samples[1:])),
            wanted,
            step,
            problem.limits,
            problem.options,
            initial_tension_N=start,
            inversion=problem.inversion,
            power=POWER[problem.objective],
            progress=progress,
        )
    if problem.asked.goal:
        return _other_goal(problem, wanted, progress)
    if not problem.samples:
        return track(
            problem.chain,
            wanted,
            step,
            problem.limits,
            problem.options,
            initial_tension_N=start,
            inversion=problem.inversion,
            progress=progress,
        )
    return track_robust(
        problem.samples,
        problem.level,
        wanted,
        step,
        problem.limits,
        problem.objective,
        problem.options,
        initial_tension_N=start,
        inversion=problem.inversion,
        progress=progress,
    )


def _other_goal(problem: Problem, wanted_N: FloatArray, progress: Progress) -> Tracking:
    """What `[optimal]` asks for instead of the least error with all of the reference known."""
    reference, asked = problem.reference, problem.asked
    step, start, limits, options = reference.step_s, reference.initial_tension_N, problem.limits, problem.options
    if asked.least_time:
        return track_transition(
            problem.chain,
            start,
            float(wanted_N[-1]),
            len(wanted_N),
            step,
            limits,
            options,
            tolerance_N=asked.tolerance_N,
            progress=progress,
        )
    if asked.tolerance_N is not None:
        return track_band(
            problem.chain,
            wanted_N,
            step,
            limits,
            asked.tolerance_N,
            options,
            initial_tension_N=start,
            progress=progress,
        )
    return track_preview(
        problem.chain,
        wanted_N,
        step,
        limits,
        asked.preview_s or 0.0,
        options,
        initial_tension_N=start,
        progress=progress,
    )


def _purpose(problem: Problem) -> tuple[str, ...]:
    """That the errors against the reference are not what a profile was made for."""
    if problem.asked.is_followed:
        return ()
    asked = problem.asked.goal
    return (
        f"optimal: made for {asked}: its errors against the reference are what it was allowed, not what it aims at",
    )


def tracking_warnings(tracking: Tracking) -> tuple[str, ...]:
    """What limits the optimal profile, in the user's terms."""
    if tracking.status is TrackStatus.EXACT:
        return ()
    found = [] if tracking.status is TrackStatus.OPTIMAL else [f"optimal: {tracking.message}"]
    found += [f"optimal: {caution}" for caution in tracking.cautions]
    found += tracking.reasons
    if tracking.departures:
        worst = max(tracking.departures, key=lambda departure: abs(departure.peak_error_N))
        found.append(
            f"optimal: error above 1 % of range in {len(tracking.departures)} "
            f"{'interval' if len(tracking.departures) == 1 else 'intervals'}; worst {worst}"
        )
    return tuple(found)
