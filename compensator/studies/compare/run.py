"""Model level needed for a task: every compensator, designed on each level, simulated on every level."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tendonff.compensator.compensators.base import SLOW_PARTS, Compensator, Problem, answers_of
from tendonff.compensator.compensators.expectation import (
    error_bands,
    expectation_of,
)
from tendonff.compensator.compensators.optimal import Optimal
from tendonff.compensator.compensators.plant import Plant, Slack, delivered_of, followed
from tendonff.compensator.compensators.profile import FloatArray, Profile, ProfileStatus
from tendonff.compensator.compensators.registry import COMPENSATORS, chosen
from tendonff.compensator.compensators.score import ignored_motion, slack_warnings
from tendonff.compensator.files.notices import Remark, by_urgency
from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.reporting.results import Views, register_views
from tendonff.compensator.scenario.sampled.joint_motion import moved
from tendonff.compensator.scenario.sampled.sampling import Reference, sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.studies.compare.figures import compare_figures
from tendonff.compensator.studies.compare.levels import level_cost, level_traits
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
from tendonff.compensator.studies.compare.output import matrix_columns, write_files
from tendonff.compensator.studies.compare.own import own_force
from tendonff.compensator.studies.compare.result import CAPSTAN_PLANT, PLANTS, Comparison
from tendonff.models.capstan import CapstanLaw, behind_drive_N
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.turns import in_turn
from tendonff.ocp.tendon.crosscheck import NUDGE

FEEDFORWARDS = tuple(c for c in COMPENSATORS if not isinstance(c, Optimal))
"""Compensators compared by default: the optimal profile on each level takes longer than all the rest."""

SIMPLE = (
    Simple(name="none", words="The reference applied directly"),
    Simple(name="capstan", words="The capstan law"),
    Simple(name=SMOOTHED, words="The capstan law with a smoothed sign change"),
)

register_views(Comparison, Views(write=write_files, columns=matrix_columns, figures=compare_figures))


@in_turn
def compare(
    scenario: Scenario,
    *,
    compensators: Sequence[Compensator | str] = FEEDFORWARDS,
    progress: Progress = silent,
) -> Comparison:
    """Compare the fidelity levels with each other and with the capstan law on one scenario.

    Arguments and errors as of `tendonff.compare`.
    """
    reference, tried = sample_reference(scenario), (*chosen(compensators), *own_force(scenario))
    require_levels(tried)
    transmission = moved(scenario, float(reference.time_s[-1]), periodic=scenario.reference.periodic)
    warnings = list(reference.warnings)
    shares = sum(1 if c.is_fast else SLOW_PARTS for c in tried)
    parts = Parts(progress, len(Level) * (shares + len(PLANTS) + 2))
    entries: list[Entry] = []
    outputs: dict[tuple[str, Level, str], FloatArray] = {}
    usable: dict[tuple[str, Level], Profile] = {}
    failed: dict[str, str] = {}
    refused: dict[str, str] = {}
    seen: dict[tuple[bytes, str], tuple[Entry, FloatArray]] = {}
    slack: dict[tuple[str, str], Slack] = {}
    for level in Level:
        problem = Problem.of(scenario, level=level, reference=reference)
        answers = answers_of(problem, tried, parts)
        profiles, failed, refused = answers.profiles, failed | answers.failed, refused | answers.refused
        for name, profile in profiles.items():
            if profile.status is not ProfileStatus.GOOD:
                warnings.append(f"{name} designed on {level}: {profile.message}")
            if profile.status is not ProfileStatus.FAILED:
                usable[name, level] = profile
        warnings += [f"designed on {level}: {note}" for note in problem.unsettled]
        if _is_bound(profiles) and not any(isinstance(c, Optimal) for c in tried):
            warnings.append(Remark(_NOT_SEARCHED))
        for plant in PLANTS:
            for name, profile in profiles.items():
                key = (profile.force_N.tobytes() + profile.given.tobytes(), plant)
                if key not in seen:  # none and capstan do not depend on the design level
                    replays = _outputs(transmission, plant, profile, reference, (name, plant), slack)
                    seen[key] = entry_of(
                        replays, reference.wanted, reference.step_s, name=name, level=level, plant=plant
                    )
                found, outputs[name, level, plant] = seen[key]
                entries.append(replace(found, compensator=name, design_level=level, plant_level=plant))
            parts.done()
    bands = error_bands(problem.doubt, Level.PRESLIDING, usable, reference)  # on the most detailed level
    shown = [c for c in tried if c.name not in failed | refused]
    entries = [entry for entry in entries if entry.compensator not in failed | refused]
    text, best = recommend(entries, shown, bands, str(problem.doubt), SIMPLE)
    on_level = {name: band for (name, level), band in bands.items() if level is best}
    expectation = expectation_of(problem.doubt, Level.PRESLIDING, on_level, reference.share_of, reference.unit)
    traits, costs = {}, {}
    for model in (*Level, None):
        name = CAPSTAN_PLANT if model is None else model.value
        traits[name] = level_traits(transmission, model, reference)
        costs[name] = level_cost(transmission, model, reference)
        if model is not None:
            parts.done(2)
    order = {c.name: k for k, c in enumerate(shown)}
    entries.sort(key=lambda e: order[e.compensator])  # stable: levels and plants keep their order
    return Comparison(
        scenario=scenario,
        time_s=reference.time_s,
        wanted=reference.wanted,
        unit=reference.unit,
        plants=PLANTS,
        static="capstan",
        reference=reference,
        compensators=tuple(shown),
        entries=tuple(entries),
        outputs=outputs,
        traits=traits,
        costs=costs,
        bands=bands,
        expectation=expectation,
        recommended_level=best,
        recommendation=text,
        ignored=ignored_motion(Problem.of(scenario, reference=reference)),
        warnings=by_urgency(
            (
                *warnings,
                *(f"{n}: {why}" for n, why in failed.items()),
                *(Remark(f"{n}: {why}") for n, why in refused.items()),
                *slack_warnings(slack, expectation.recommended),
                *noise_warnings(entries),
            )
        ),
    )


_NOT_SEARCHED = (
    "the actuator's limits change the exact inverse: the optimal profile, which is made for them, is not compared "
    "here; --compensators none,capstan,smoothed,inverse,optimal compares it"
)


def _is_bound(profiles: Mapping[str, Profile]) -> bool:
    """Whether limits, or a push that no tendon gives, keep the exact inverse from what it would do."""
    inverse = profiles.get("inverse")
    return inverse is not None and bool(inverse.warnings)


def _outputs(
    transmission: Transmission,
    plant: str,
    profile: Profile,
    reference: Reference,
    what: tuple[str, str],
    slack: dict[tuple[str, str], Slack],
) -> Iterator[FloatArray]:
    """Response of a plant with ever larger steps, then with a force that is a little different."""
    if plant == CAPSTAN_PLANT:
        # Exact for a force that is linear between rows: nothing to refine.
        law, start = CapstanLaw.of(transmission), reference.initial_tension_N
        force = profile.command_N is not None
        rows = followed(transmission.actuator, profile.given, reference) if force else profile.force_N
        if reference.periodic:  # the second period is that of the steady state
            rows = np.concatenate([rows[:-1], rows])
        pulled = behind_drive_N(transmission.actuator.law, rows, start)
        tension = law.output_history_N(pulled, start)[-len(profile.force_N) :]
        yield delivered_of(transmission.load, tension, reference)
        return
    level = Level(plant)
    for refinement in REFINEMENTS:
        run = Plant(transmission, level, refinement=refinement).respond(profile, reference).require()
        if refinement == REFINEMENTS[0] and run.slack is not None:
            slack[what] = run.slack
        yield run.delivered(reference)
    # Steps are solved to rounding, so a tolerance is the last digits: the answer must not depend on them.
    start = reference.initial_tension_N
    nudged = replace(
        profile,
        force_N=start + (profile.force_N - start) * (1 + NUDGE),
        command_m=None if profile.command_m is None else profile.command_m * (1 + NUDGE),
        command_N=None if profile.command_N is None else start + (profile.command_N - start) * (1 + NUDGE),
    )
    yield (
        Plant(transmission, level, refinement=REFINEMENTS[0]).respond(nudged, reference).require().delivered(reference)
    )
