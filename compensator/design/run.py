"""The main job: from a scenario to the force profile, verified on every level and on a finer chain."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tendonff.compensator.compensators.base import Compensator, FloatArray, Problem, Profile, ProfileStatus, with_motion
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.compensators.score import (
    SimulatedPlant,
    Verified,
    harm_warnings,
    ignored_motion,
    slack_warnings,
    verify,
)
from tendonff.compensator.design.drive_use import drive_warnings
from tendonff.compensator.design.expectation import expect, robustness, robustness_warnings
from tendonff.compensator.design.output import Design
from tendonff.compensator.design.result import FINE_REFINEMENT, FINE_SEGMENTS
from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.scenario.reference import CsvReference, Hold
from tendonff.compensator.scenario.sampled.from_file import noise_advice, ripple_advice
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.errors import TendonffError
from tendonff.models.fidelity import Level
from tendonff.ocp.errors import SolveError
from tendonff.ocp.inverse import invert
from tendonff.ocp.stability import predict_stick_slip
from tendonff.ocp.tracking.problem import TrackOptions

_PARTS_OF_THE_SEARCH = 8  # the optimal profile takes about as long as so many other parts


def design(
    scenario: Scenario,
    *,
    compensators: Sequence[Compensator] = COMPENSATORS,
    options: TrackOptions | None = None,
    strict: bool = False,
    progress: Progress = silent,
) -> Design:
    """Design the force profile of a scenario by every compensator, and simulate each on every level.

    InputError if the reference cannot be delivered, SolveError if a simulation or every compensator fails; what one of
    them raises is the message of its profile.

    Parameters
    ----------
    compensators : sequence of Compensator, optional
        Default: all; the one named "none" is what the others are compared with.
    options : TrackOptions, optional
        What the optimal profile is optimised for; default: what the scenario asks for.
    strict : bool, optional
        Refuse a reference out of the actuator's reach, instead of designing the best achievable profile.
    progress : callable, optional
        Told parts done and parts in all.
    """
    problem = Problem.of(scenario, reference=sample_reference(scenario, strict=strict), options=options)
    reference, transmission, level = problem.reference, problem.transmission, problem.level
    shares = {c.name: 1 if c.is_fast else _PARTS_OF_THE_SEARCH for c in compensators}
    parts = Parts(progress, sum(shares.values()) + len(compensators) * (len(Level) + 1))
    warnings = [*reference.warnings, *_file_warnings(scenario, problem)]
    warnings += [*_hold_notes(problem), *problem.unsettled]
    profiles: dict[str, Profile] = {}
    for compensator in compensators:
        share = shares[compensator.name]
        profiles[compensator.name] = _answer(compensator, problem, parts.inside(share))
        warnings += profiles[compensator.name].warnings
        parts.done(share)
    if all(profile.status is ProfileStatus.FAILED for profile in profiles.values()):
        raise SolveError("; ".join(profile.message for profile in profiles.values()))
    forces = {name: profile.force_N for name, profile in profiles.items()}
    stick_slip = predict_stick_slip(
        problem.chain,
        reference.tension_N,
        reference.step_s,
        force_N=next((p.force_N for p in profiles.values() if p.tracking is not None), None),
        inversion=problem.inversion,
    )
    warnings += stick_slip.warnings
    bands = robustness(problem, forces) if problem.samples else None
    if bands is not None:
        warnings += robustness_warnings(bands)
    usable = {name: p.force_N for name, p in profiles.items() if p.status is not ProfileStatus.FAILED}
    expectation = expect(problem, scenario.robust, usable, bands)

    verified: list[Verified] = []
    proof: list[Verified] = []
    fine = SimulatedPlant(level=level, segments=FINE_SEGMENTS, refinement=FINE_REFINEMENT)
    for name, profile in profiles.items():
        for plant, found in (*((SimulatedPlant(level=each), verified) for each in Level), (fine, proof)):
            found.append(verify(transmission, plant, name, profile, reference))
            parts.done()
    judged = [v for v in verified if v.plant.level is level]
    followed = [v for v in judged if problem.asked.is_followed or v.compensator != "optimal"]
    warnings += harm_warnings({v.compensator: v.score for v in followed}, reference.tension_N)
    warnings += _promises(judged, proof, is_compared=bands is None and problem.asked.is_followed)
    warnings += slack_warnings({(v.compensator, v.plant.level.value): v.slack for v in verified if v.slack})
    result = Design(
        scenario=scenario,
        reference=reference,
        compensators=tuple(compensators),
        profiles=profiles,
        verified=tuple(verified),
        proof=tuple(proof),
        stick_slip=stick_slip,
        robustness=bands,
        expectation=expectation,
        ignored=ignored_motion(problem),
        warnings=tuple(warnings),
    )
    return replace(result, warnings=(*result.warnings, *drive_warnings(result)))


def _answer(compensator: Compensator, problem: Problem, progress: Progress) -> Profile:
    """The profile of one compensator; where it raises, a failed one that holds the force of the start."""
    try:
        return with_motion(problem, compensator.name, compensator.profile(problem, progress=progress))
    except (TendonffError, ArithmeticError, np.linalg.LinAlgError) as error:
        reason = str(error) if isinstance(error, TendonffError) else f"{type(error).__name__}: {error}"
        message = f"{compensator.name}: failed: {reason}"
        start = problem.limits.start(problem.reference.initial_tension_N)
        force = np.full(len(problem.reference.tension_N), start)
        failed = Profile(force_N=force, status=ProfileStatus.FAILED, message=message, warnings=(message,))
        return with_motion(problem, compensator.name, failed)


_KEPT = 2.0  # times the error on the design level that the finer chain may leave
_SMALL = 0.5  # % of range: errors below this are not worth a word


def _promises(designed: Sequence[Verified], proof: Sequence[Verified], *, is_compared: bool) -> list[str]:
    """Profiles that leave far more on the finer chain than where they were designed, and what beats the optimal one.

    A robust profile, and one with another goal, is not meant to be best with the nominal parameters.
    """
    found = []
    for here, fine in zip(designed, proof, strict=True):
        before, after = here.score.rmse_percent_of_range, fine.score.rmse_percent_of_range
        if here.compensator in ("inverse", "optimal") and after > max(_KEPT * before, _SMALL):
            found.append(
                f"{here.compensator}: {here.score.percent} % of range on the design model, {fine.score.percent} % with "
                f"{FINE_SEGMENTS} masses at a {FINE_REFINEMENT}th of the step: trust the second, or raise segments"
            )
    scores = {v.compensator: v.score for v in proof}
    best = min(scores, key=lambda name: scores[name].rmse_N)
    if (
        is_compared
        and "optimal" in scores
        and scores["optimal"].rmse_N > max(1.02 * scores[best].rmse_N, 1e-3 * _SMALL)
    ):
        optimal, other = scores["optimal"], scores[best]
        if optimal.rmse_percent_of_range > _SMALL:
            found.append(
                f"optimal: {optimal.percent} % of range on the finer chain, where {best} leaves {other.percent} %: "
                f"use {best} here"
            )
    return found


def _file_warnings(scenario: Scenario, problem: Problem) -> list[str]:
    """Noise of a CSV reference that no filter was asked for, else a force rate that swings between its samples."""
    spec, reference = scenario.reference, problem.reference
    if not isinstance(spec, CsvReference):
        return []
    step, force = reference.step_s, problem.inversion.force_N

    def force_of(tension: FloatArray) -> FloatArray:
        if tension is reference.tension_N:
            return force
        return invert(problem.chain, tension, step, initial_tension_N=reference.initial_tension_N).force_N

    advice = None if spec.cutoff_Hz is not None else noise_advice(reference.tension_N, step, force_of, file=spec.file)
    advice = advice or ripple_advice(force, step, reference.sample_interval_s, file=spec.file)
    return [] if advice is None else [advice]


def _hold_notes(problem: Problem) -> list[str]:
    """What keeping the force in the holds costs."""
    kept = problem.kept
    if kept is None or problem.reference.hold is not Hold.KEEP:
        return []
    share = 100 * kept.drift_N / max(problem.reference.range_N, 1e-300)
    message = (
        f'hold = "keep": the force stays in {len(kept.holds)} stretches, which moves the output by up to '
        f"{kept.drift_N:.3g} N ({share:.2g} % of range) on the design model"
    )
    return [message]
