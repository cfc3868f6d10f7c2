"""The optimal profile: the force within the limits whose output comes closest to the reference.

Here, and nowhere else, it is decided whether the profile is made for the nominal transmission or for all that the
scenario's uncertainty admits.
"""

import numpy as np

from tendonff.compensator.compensators.base import CModule, Compensator, Problem
from tendonff.compensator.compensators.expectation import worst_corner
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import Profile, ProfileStatus
from tendonff.compensator.files.notices import Remark
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import VERMILION, Style
from tendonff.models.parameters.drive import Drive
from tendonff.models.parameters.uncertainty import Objective
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tracking.cycle import track_cycle
from tendonff.ocp.tracking.result import Tracking, TrackStatus
from tendonff.ocp.tracking.track import track_robust

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
    """Solve the optimal-control problem, for the nominal transmission or for what the uncertainty admits."""
    reference, chains = problem.reference, counted(problem)
    method = track_cycle if reference.periodic else track_robust
    return method(
        chains,
        problem.followed_N,
        reference.step_s,
        problem.limits,
        problem.uncertainty.objective,
        problem.options,
        initial_tension_N=reference.initial_tension_N,
        inversion=problem.inversion,
        progress=progress,
    )


def counted(problem: Problem) -> tuple[Chain, ...]:
    """The chains whose errors the search makes small, the nominal one first; that alone where nothing else counts.

    For the worst case: the corner of all intervals that is worst for the exact inverse, and the opposite one. For the
    mean: all samples. Of a position drive the nominal one alone, since the search is for a force, and the same command
    gives every chain another.
    """
    position = problem.transmission.actuator.drive is Drive.POSITION
    if not problem.is_robust or position:
        return (problem.chain,)
    doubt, reference = problem.doubt, problem.reference
    if problem.uncertainty.objective is Objective.MEAN:
        samples = doubt.samples[1:]
    else:
        profile = Profile(force_N=problem.limited(problem.inversion.force_N))
        ends = doubt.samples[: 1 + 2 * len(doubt.spreads)]
        outputs = [Plant(end.system, problem.level).respond(profile, reference).output_N for end in ends]
        corner = worst_corner(doubt, np.array(outputs) - reference.tension_N)
        samples = (doubt.at(corner), doubt.at([-place for place in corner]))
    return (problem.chain, *(Chain.of(sample.system, problem.level) for sample in samples))


def _purpose(problem: Problem) -> tuple[str, ...]:
    """Warning that an uncertain position drive was not part of the design of a profile."""
    if problem.is_robust and problem.transmission.actuator.drive is Drive.POSITION:
        text = "optimal: made for the nominal parameters: over [robust] the search compares forces, not commands"
        return (Remark(text),)
    return ()


def tracking_warnings(tracking: Tracking) -> tuple[str, ...]:
    """Active limits of the optimal profile, by the scenario's keys."""
    if tracking.status is TrackStatus.EXACT:
        return ()
    found = [] if tracking.status is TrackStatus.OPTIMAL else [f"optimal: {tracking.message}"]
    found += tracking.reasons
    if tracking.departures:
        worst = max(tracking.departures, key=lambda departure: abs(departure.peak_error_N))
        found.append(
            f"optimal: error above 1 % of range in {len(tracking.departures)} "
            f"{'interval' if len(tracking.departures) == 1 else 'intervals'}; worst {worst}"
        )
    return tuple(found)
