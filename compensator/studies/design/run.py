"""The main job: from a scenario to the force profile, verified on every level and on a finer chain."""

from collections.abc import Sequence
from dataclasses import replace

from tendonff.compensator.compensators.base import SLOW_PARTS, Compensator, Problem, answers_of
from tendonff.compensator.compensators.every import chosen
from tendonff.compensator.compensators.ignored import ignored_motion
from tendonff.compensator.compensators.live import expect_live
from tendonff.compensator.compensators.plant import FINE_REFINEMENT, FINE_SEGMENTS, Plant
from tendonff.compensator.compensators.profile import FloatArray, ProfileStatus
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.compensators.score import (
    Verified,
    harm_warnings,
    scale_of,
    slack_warnings,
    verify,
)
from tendonff.compensator.files.notices import Remark, by_urgency
from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.scenario.reference import CsvReference, Hold
from tendonff.compensator.scenario.sampled.from_file import noise_advice, ripple_advice
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.studies.design.drive_use import drive_warnings
from tendonff.compensator.studies.design.online import study_online
from tendonff.compensator.studies.design.result import Design
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.errors import SolveError
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.stability import predict_stick_slip


@in_turn
def design(
    scenario: Scenario,
    *,
    compensators: Sequence[Compensator | str] = COMPENSATORS,
    strict: bool = False,
    progress: Progress = silent,
) -> Design:
    """Design the force profile of a scenario by every compensator, and simulate each on every level.

    Arguments and errors as of `tendonff.design`.
    """
    problem = Problem.of(scenario, reference=sample_reference(scenario, strict=strict))
    reference, transmission, level = problem.reference, problem.transmission, problem.level
    compensators = chosen(scenario, compensators)
    shares = sum(1 if c.is_fast else SLOW_PARTS for c in compensators)
    parts = Parts(progress, shares + len(compensators) * (len(Level) + 1))
    warnings = [*reference.warnings, *_file_warnings(scenario, problem)]
    warnings += [*_hold_notes(problem), *problem.notes]
    answers = answers_of(problem, compensators, parts)
    profiles = answers.profiles
    stick_slip = predict_stick_slip(
        problem.chain,
        reference.tension_N,
        reference.step_s,
        force_N=next((p.force_N for p in profiles.values() if p.tracking is not None), None),
        inversion=problem.inversion,
    )
    usable = {name: p for name, p in profiles.items() if p.status is not ProfileStatus.FAILED}
    expectation = problem.expect(usable)
    warnings += [*expectation.warnings, *answers.warnings(expectation.recommended)]
    small = 100 * stick_slip.expected_error_N < _SMALL * scale_of(reference.tension_N)
    warnings += [Remark(text) if small else text for text in stick_slip.warnings]

    verified: list[Verified] = []
    proof: list[Verified] = []
    plants = [*((Plant(transmission, each), verified) for each in Level), (Plant.fine(transmission, level), proof)]
    first: dict[bytes, str] = {}  # of equal profiles: they are tried once
    for name, profile in profiles.items():
        equal = first.setdefault(profile.given.tobytes(), name)
        for plant, found in plants:
            tried = next((v for v in found if v.compensator == equal and v.plant is plant), None)
            found.append(verify(plant, name, profile, reference) if tried is None else replace(tried, compensator=name))
            parts.done()
    judged = [v for v in verified if v.plant.level is level]
    warnings += harm_warnings({v.compensator: v.score for v in judged}, reference.wanted, expectation.recommended)
    warnings += _promises(judged, proof, is_compared=not problem.is_robust)
    slack = {(v.compensator, v.plant.level.value): v.slack for v in verified if v.slack}
    warnings += slack_warnings(slack, expectation.recommended)
    feedback = None
    if scenario.feedback is not None and "inverse" in profiles:
        from tendonff.compensator.feedback.tension import feedback_of  # slow to import, for few scenarios

        feedback = feedback_of(problem, scenario.feedback, profiles, scenario.source.name)
        warnings += feedback.warnings
    online = None
    if scenario.stream is not None:
        optimum = [v.score.rmse_percent_of_range for v in judged if v.compensator == "optimal"]
        try:
            online = study_online(problem, scenario.stream, next(iter(optimum), None))
        except SolveError as error:
            warnings.append(Remark(f"[stream]: {error}"))
    result = Design(
        scenario=scenario,
        reference=reference,
        compensators=tuple(c for c in compensators if c.name in profiles),
        profiles=profiles,
        failed=answers.failed,
        verified=tuple(verified),
        proof=tuple(proof),
        stick_slip=stick_slip,
        expectation=expectation,
        live=expect_live(problem, usable),
        ignored=ignored_motion(problem),
        feedback=feedback,
        online=online,
        warnings=tuple(warnings),
    )
    return replace(result, warnings=by_urgency((*result.warnings, *drive_warnings(result))))


_KEPT = 2.0  # times the error on the design level that the finer chain may leave
_SMALL = 0.5  # % of range: errors below this are not worth a word


def _promises(designed: Sequence[Verified], proof: Sequence[Verified], *, is_compared: bool) -> list[str]:
    """Profiles that leave far more on the finer chain than where they were designed, and what beats the optimal one.

    A robust profile is not meant to be best with the nominal parameters.
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
    best = min(scores, key=lambda name: scores[name].rmse)
    if is_compared and "optimal" in scores and scores["optimal"].rmse > max(1.02 * scores[best].rmse, 1e-3 * _SMALL):
        optimal, other = scores["optimal"], scores[best]
        if optimal.rmse_percent_of_range > _SMALL:
            found.append(
                f"optimal: {optimal.percent} % of range on the finer chain, where {best} has {other.percent} %: "
                f"use {best} here"
            )
    return found


def _file_warnings(scenario: Scenario, problem: Problem) -> list[str]:
    """Noise of an unfiltered CSV reference, else a force rate that ripples between its samples."""
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
    """Cost of keeping the force in the holds."""
    kept = problem.kept
    if kept is None or problem.reference.hold is not Hold.KEEP:
        return []
    share = 100 * kept.drift_N / max(problem.reference.range_N, 1e-300)
    message = Remark(
        f'hold = "keep": the force stays in {len(kept.holds)} stretches, which moves the output by up to '
        f"{kept.drift_N:.3g} N ({share:.2g} % of range) on the design model"
    )
    return [message]
