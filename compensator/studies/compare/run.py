"""Model level needed for a task: every compensator, designed on each level, simulated on every level."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from tendonff.compensator.compensators.base import CAPSTAN_PLANT, SLOW_PARTS, Problem, answers_of
from tendonff.compensator.compensators.every import (
    AnyCompensator,
    AnyScenario,
    chosen,
    known_to,
    problem_of,
)
from tendonff.compensator.compensators.expectation import expectation_of
from tendonff.compensator.compensators.ignored import ignored_motion
from tendonff.compensator.files.notices import Remark, by_urgency
from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.studies.compare.levels import level_traits
from tendonff.compensator.studies.compare.matrix import (
    REFINEMENTS,
    SMOOTHED,
    Entry,
    Simple,
    entry_of,
    noise_warnings,
    recommend,
    require_levels,
)
from tendonff.compensator.studies.compare.own import own_force
from tendonff.compensator.studies.compare.result import Comparison
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.tendon.crosscheck import NUDGE

SIMPLE = (
    Simple(name="none", words="The reference applied directly"),
    Simple(name="capstan", words="The capstan law"),
    Simple(name=SMOOTHED, words="The capstan law with a smoothed sign change"),
    Simple(name="linear", words="The ratio alone"),
    Simple(name="static", words="The quasi-static law"),
)
_STATIC = ("capstan", "static", "linear")  # what the exact inverse is drawn beside, the first that there is


@in_turn
def compare(
    scenario: AnyScenario,
    *,
    compensators: Sequence[AnyCompensator | str] | None = None,
    progress: Progress = silent,
) -> Comparison:
    """Compare the fidelity levels with each other on one scenario; arguments and errors as of `tendonff.compare`."""
    problems = {level: problem_of(scenario, level) for level in Level}
    own = problems[Level.PRESLIDING]
    tried = _usual(own) if compensators is None else chosen(scenario, compensators)
    tried = (*tried, *own_force(scenario))
    require_levels(tried)
    shares = sum(1 if c.is_fast else SLOW_PARTS for c in tried)
    more = 2 if CAPSTAN_PLANT in own.plants else 0
    parts = Parts(progress, len(Level) * (shares + len(own.plants) + more))
    warnings = list(own.warnings)
    entries: list[Entry] = []
    outputs: dict[tuple[str, Level, str], FloatArray] = {}
    usable: dict[tuple[str, Level], Any] = {}
    failed: dict[str, str] = {}
    refused: dict[str, str] = {}
    seen: dict[tuple[bytes, str], tuple[Entry, FloatArray]] = {}
    slack: dict[tuple[str, str], Any] = {}
    for level, problem in problems.items():
        answers = answers_of(problem, tried, parts)
        profiles, failed, refused = answers.profiles, failed | answers.failed, refused | answers.refused
        for name, profile in profiles.items():
            if fault := problem.fault(profile):
                warnings.append(f"{name} designed on {level}: {fault}")
            if problem.is_usable(profile):
                usable[name, level] = profile
        warnings += [f"designed on {level}: {note}" for note in problem.notes]
        if _is_bound(profiles) and not any(c.name == "optimal" for c in tried):
            warnings.append(Remark(_NOT_SEARCHED))
        for plant in own.plants:
            for name, profile in profiles.items():
                key = (problem.given(profile), plant)
                if key not in seen:  # what does not know the level is simulated once
                    replays = _outputs(problem, plant, profile, (name, plant), slack)
                    seen[key] = entry_of(replays, own.wanted, scenario.run.step_s, name=name, level=level, plant=plant)
                found, outputs[name, level, plant] = seen[key]
                entries.append(replace(found, compensator=name, design_level=level, plant_level=plant))
            parts.done()
    bands = own.bands(usable)  # on the most detailed level
    shown = [c for c in tried if c.name not in failed | refused]
    require_levels(shown)
    entries = [entry for entry in entries if entry.compensator not in failed | refused]
    text, best = recommend(entries, shown, bands, str(own.doubt), SIMPLE, own.unit)
    on_level = {name: band for (name, level), band in bands.items() if level is best}
    expectation = expectation_of(own.doubt, Level.PRESLIDING, on_level, own.share_of, own.unit, change=own.change)
    expectation = replace(expectation, behind=own.behind(expectation.best))
    order = {c.name: k for k, c in enumerate(shown)}
    entries.sort(key=lambda e: order[e.compensator])  # stable: levels and plants keep their order
    return Comparison(
        scenario=scenario,
        time_s=own.time_s,
        wanted=own.wanted,
        unit=own.unit,
        plants=own.plants,
        static=next((name for name in _STATIC if name in order), ""),
        compensators=tuple(shown),
        entries=tuple(entries),
        outputs=outputs,
        bands=bands,
        expectation=expectation,
        recommended_level=best,
        recommendation=text,
        warnings=by_urgency(
            (
                *warnings,
                *(f"{n}: {why}" for n, why in failed.items()),
                *(Remark(f"{n}: {why}") for n, why in refused.items()),
                *own.slack_notes(slack, expectation.recommended),
                *noise_warnings(entries),
            )
        ),
        **(_of_one_tendon(own, parts) if CAPSTAN_PLANT in own.plants else {}),
    )


def _usual(problem: Any) -> tuple[Any, ...]:
    """Compensators that are compared by default, with those whose refusal is a finding."""
    usual = (c for c in known_to(problem) if c.is_compared)
    return tuple(c for c in usual if c.is_refusal_stated or not c.refusal(problem))


def _of_one_tendon(problem: Problem, parts: Parts) -> dict[str, Any]:
    """Traits of the levels, and what it costs to ignore the motion of joints."""
    traits = {}
    for model in (*Level, None):
        name = CAPSTAN_PLANT if model is None else model.value
        traits[name] = level_traits(problem.transmission, model, problem.reference)
        if model is not None:
            parts.done(2)
    start = problem.reference.initial_tension_N
    return {"traits": traits, "initial_tension_N": start, "ignored": ignored_motion(problem)}


_NOT_SEARCHED = (
    "the actuator's limits change the exact inverse: the optimal profile, which is made for them, is not compared "
    "here; --compensators none,capstan,smoothed,inverse,optimal compares it"
)


def _is_bound(profiles: Mapping[str, Any]) -> bool:
    """Whether limits, or a push that no tendon gives, keep the exact inverse from what it would do."""
    return bool(getattr(profiles.get("inverse"), "warnings", ()))


def _outputs(
    problem: Any, plant: str, profile: Any, what: tuple[str, str], slack: dict[tuple[str, str], Any]
) -> Iterator[FloatArray]:
    """Response of a plant with ever larger steps, then with commands that are a little different."""
    for refinement in REFINEMENTS if plant != CAPSTAN_PLANT else REFINEMENTS[:1]:
        output, gone = problem.output_on(plant, profile, refinement=refinement)
        if refinement == REFINEMENTS[0] and gone:
            slack[what] = gone
        yield output
    if plant != CAPSTAN_PLANT:
        # Steps are solved to rounding, so a tolerance is the last digits: the answer must not depend on them.
        yield problem.output_on(plant, profile, refinement=REFINEMENTS[0], factor=1 + NUDGE)[0]
