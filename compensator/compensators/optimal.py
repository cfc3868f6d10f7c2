"""The optimal profile: the force within the limits whose output comes closest to the reference.

Here, and nowhere else, it is decided whether the profile is made for the nominal transmission or for all that the
scenario's uncertainty admits.
"""

import numpy as np

from tendonff.compensator.compensators.base import CModule, Compensator, Problem
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import FloatArray, Profile, ProfileStatus
from tendonff.compensator.compensators.superposition import Superposition
from tendonff.compensator.compensators.uncertain import Sample
from tendonff.compensator.files.notices import Danger, Remark
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import VERMILION, Style
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.drive import Drive
from tendonff.models.parameters.uncertainty import Objective
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.optimal.cycle import track_cycle
from tendonff.ocp.optimal.track import track_robust
from tendonff.ocp.reference.motion import tension_of_motion
from tendonff.ocp.tracking.diagnosis import PeakBeyond
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.result import Tracking, TrackStatus

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
    is_compared = False
    c_module = CModule(name="profile", content="optimal profile", plays_back=True)

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:
        """Answer by optimal control; see `Compensator.profile`."""
        tracking = solve(problem, progress=progress)
        status = _STATUS.get(tracking.status, ProfileStatus.DOUBTFUL)
        return Profile(
            force_N=tracking.force_N,
            status=status,
            message="" if status is ProfileStatus.GOOD else tracking.message,
            warnings=(*_purpose(problem), *tracking_warnings(tracking, problem.reference)),
            tracking=tracking,
        )


def solve(problem: Problem, *, progress: Progress = silent) -> Tracking:
    """Solve the optimal-control problem, for the nominal transmission or for what the uncertainty admits."""
    reference, samples = problem.reference, counted(problem)
    method = track_cycle if reference.periodic else track_robust
    return method(
        (problem.chain, *(Chain.of(sample.system, problem.level) for sample in samples)),
        problem.followed_N,
        reference.step_s,
        problem.limits,
        problem.uncertainty.objective,
        problem.options,
        initial_tension_N=reference.initial_tension_N,
        inversion=problem.inversion,
        progress=progress,
        others_N=[_followed_N(problem, sample.system) for sample in samples],
    )


def posed(problem: Problem) -> TrackingProblem:
    """The optimal-control problem from rest, as `solve` searches it."""
    reference, samples = problem.reference, counted(problem)
    return TrackingProblem.from_rest(
        (problem.chain, *(Chain.of(sample.system, problem.level) for sample in samples)),
        (problem.followed_N, *(_followed_N(problem, sample.system) for sample in samples)),
        reference.step_s,
        problem.limits,
        problem.options,
        start_N=reference.initial_tension_N,
        inverse=problem.inversion,
        objective=problem.uncertainty.objective,
    )


def _followed_N(problem: Problem, transmission: Transmission) -> FloatArray:
    """Tension that delivers the reference on a transmission: a position takes what its own load asks for [N]."""
    reference = problem.reference
    if reference.position_m is None or transmission.load == problem.transmission.load:
        return problem.followed_N
    start = reference.initial_tension_N
    return tension_of_motion(
        transmission.load, reference.position_m, reference.step_s, start, periodic=reference.periodic
    )


def counted(problem: Problem) -> tuple[Sample[Transmission], ...]:
    """Transmissions beside the nominal one whose errors the search makes small; none where nothing else counts.

    For the worst case: the corner of all intervals that is worst for the exact inverse, and the opposite one. For the
    mean: all samples. For both another law that the measurements do not exclude. Of a position drive the nominal one
    alone, since the search is for a force, and the same command gives every chain another.
    """
    position = problem.transmission.actuator.drive is Drive.POSITION
    if not problem.is_robust or position:
        return ()
    doubt, reference = problem.doubt, problem.reference
    by_other = () if doubt.other is None else (doubt.other,)
    if problem.uncertainty.objective is Objective.MEAN:
        return (*doubt.samples[1:], *by_other)
    profile = Profile(force_N=problem.limited(problem.inversion.force_N))
    ends = doubt.samples[: 1 + 2 * len(doubt.spreads)]
    found = [Plant(end.system, problem.level).respond(profile, reference).delivered(reference) for end in ends]
    corner = Superposition.of(doubt, np.array(found) - reference.wanted).worst_corner()
    return doubt.at(corner), doubt.at([-place for place in corner]), *by_other


def _purpose(problem: Problem) -> tuple[str, ...]:
    """Warning that an uncertain position drive was not part of the design of a profile."""
    if problem.is_robust and problem.transmission.actuator.drive is Drive.POSITION:
        text = "optimal: made for the nominal parameters: over [robust] the search compares forces, not commands"
        return (Remark(text),)
    return ()


def tracking_warnings(tracking: Tracking, reference: Reference) -> tuple[str, ...]:
    """Active limits of the optimal profile of a reference, by the scenario's keys; without what the reference says."""
    if tracking.status is TrackStatus.EXACT:
        return ()
    is_said = any(isinstance(text, Danger) for text in reference.warnings)
    found = [] if tracking.status is TrackStatus.OPTIMAL else [f"optimal: {tracking.message}"]
    if is_said and tracking.status is TrackStatus.BEST_ACHIEVABLE:
        found = []  # its numbers stand beside the profile
    found += [text for text in tracking.reasons if not (is_said and isinstance(text, PeakBeyond))]
    if tracking.departures:
        error = "error above 1 % of range" if reference.position_m is None else "tension error above 1 % of its range"
        worst = max(tracking.departures, key=lambda departure: abs(departure.peak_error_N))
        found.append(
            f"optimal: {error} in {len(tracking.departures)} "
            f"{'interval' if len(tracking.departures) == 1 else 'intervals'}; worst {worst}"
        )
    return tuple(found)
