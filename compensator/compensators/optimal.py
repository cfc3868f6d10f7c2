"""The optimal profile: the force within the limits whose output comes closest to the reference.

Here, and nowhere else, it is decided whether the profile is made for the nominal transmission or for all that the
scenario's uncertainty admits.
"""

import numpy as np

from tendonff.compensator.compensators.base import CModule, Compensator, Problem
from tendonff.compensator.compensators.expectation import worst_corner
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import Profile, ProfileStatus
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import VERMILION, Style
from tendonff.models.chain import Chain
from tendonff.models.parameters.drive import Drive
from tendonff.models.parameters.uncertainty import Objective
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
    """Solve the optimal-control problem, for the nominal transmission or for all samples."""
    reference, asked = problem.reference, problem.asked
    wanted, step, start = problem.followed_N, reference.step_s, reference.initial_tension_N
    chain, limits, options = problem.chain, problem.limits, problem.options
    if asked.least_time:
        goal, rows = float(wanted[-1]), len(wanted)
        return track_transition(
            chain, start, goal, rows, step, limits, options, tolerance_N=asked.tolerance_N, progress=progress
        )
    if asked.tolerance_N is not None:
        given = asked.tolerance_N
        return track_band(chain, wanted, step, limits, given, options, initial_tension_N=start, progress=progress)
    if asked.preview_s is not None:
        given = asked.preview_s
        return track_preview(chain, wanted, step, limits, given, options, initial_tension_N=start, progress=progress)
    exact, objective, chains = problem.inversion, problem.uncertainty.objective, counted(problem)
    if reference.periodic:
        return track_cycle(
            chains,
            wanted,
            step,
            limits,
            options,
            initial_tension_N=start,
            inversion=exact,
            power=POWER[objective],
            progress=progress,
        )
    if len(chains) == 1:
        return track(chain, wanted, step, limits, options, initial_tension_N=start, inversion=exact, progress=progress)
    return track_robust(
        chains,
        wanted,
        step,
        limits,
        objective,
        options,
        initial_tension_N=start,
        inversion=exact,
        progress=progress,
    )


def counted(problem: Problem) -> tuple[Chain, ...]:
    """The chains whose errors the search makes small, the nominal one first; that alone where nothing else counts.

    For the worst case: the corner of all intervals that is worst for the exact inverse, and the opposite one. For the
    mean: all samples. Of a position drive the nominal one alone, since the search is for a force, and the same command
    gives every chain another.
    """
    position = problem.transmission.actuator.drive is Drive.POSITION
    if not problem.is_robust or position or problem.asked.goal:
        return (problem.chain,)
    doubt, reference = problem.doubt, problem.reference
    if problem.uncertainty.objective is Objective.MEAN:
        samples = doubt.samples[1:]
    else:
        profile = Profile(force_N=problem.limited(problem.inversion.force_N))
        ends = doubt.samples[: 1 + 2 * len(doubt.spreads)]
        outputs = [Plant(end.transmission, problem.level).respond(profile, reference).output_N for end in ends]
        corner = worst_corner(doubt, np.array(outputs) - reference.tension_N)
        samples = (doubt.at(corner), doubt.at([-place for place in corner]))
    return (problem.chain, *(Chain.of(sample.transmission, problem.level) for sample in samples))


def _purpose(problem: Problem) -> tuple[str, ...]:
    """What a profile was not made for: the least error against the reference, or an uncertain position drive."""
    if problem.asked.is_followed:
        if problem.is_robust and problem.transmission.actuator.drive is Drive.POSITION:
            text = "optimal: made for the nominal parameters: over [robust] the search compares forces, not commands"
            return (text,)
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
