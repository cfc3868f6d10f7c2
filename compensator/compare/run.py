"""Model level needed for a task: every compensator, designed on each level, simulated on every level."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.compare.levels import level_cost, level_traits
from tendonff.compensator.compare.output import Comparison
from tendonff.compensator.compare.result import CAPSTAN_PLANT, ENOUGH_PERCENT, PLANTS, Entry
from tendonff.compensator.compensators.base import SLOW_PARTS, Compensator, Problem, answers_of
from tendonff.compensator.compensators.expectation import (
    FRICTIONLESS,
    ErrorBand,
    error_bands,
    expectation_of,
    two_digits,
)
from tendonff.compensator.compensators.optimal import Optimal
from tendonff.compensator.compensators.plant import Plant, Slack
from tendonff.compensator.compensators.profile import FloatArray, Profile, ProfileStatus
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.compensators.score import ignored_motion, scale_of, score, slack_warnings
from tendonff.compensator.files.progress import Parts, Progress, silent
from tendonff.compensator.scenario.sampled.joint_motion import moved
from tendonff.compensator.scenario.sampled.sampling import Reference, sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import CapstanLaw
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.crosscheck import NUDGE
from tendonff.ocp.tracking.options import TrackOptions

FEEDFORWARDS = tuple(c for c in COMPENSATORS if not isinstance(c, Optimal))
"""Compensators compared by default: the optimal profile on each level takes longer than all the rest."""

REFINEMENTS = (4, 2, 1)  # steps to a row of the profile; the first gives the figures, the others the spread

_SMOOTHED = "smoothed"
_NO_MODEL = (_SMOOTHED, FRICTIONLESS)  # depend on the level, but hold no model of its friction
_LAG_ROWS = 4000
_LAG_SHARE = 0.25  # of the duration: a lag is sought within this, either way


def compare(
    scenario: Scenario,
    *,
    compensators: Sequence[Compensator] = FEEDFORWARDS,
    options: TrackOptions | None = None,
    progress: Progress = silent,
) -> Comparison:
    """Compare the fidelity levels with each other and with the static law on one scenario.

    Of the compensators, by default all but the optimal profile, "none", "capstan" and one beside "smoothed" that knows
    the level must be among them; the options say what the optimal profile is optimised for. InputError if the reference
    cannot be delivered, SolveError if a simulation fails.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> comparison = tf.compare(scenario)  # doctest: +SKIP
    >>> print(comparison.headline)  # doctest: +SKIP
    """
    reference = sample_reference(scenario)
    transmission = moved(scenario, float(reference.time_s[-1]), periodic=scenario.reference.periodic)
    warnings = list(reference.warnings)
    shares = sum(1 if c.is_fast else SLOW_PARTS for c in compensators)
    parts = Parts(progress, len(Level) * (shares + len(PLANTS) + 2))
    entries: list[Entry] = []
    outputs: dict[tuple[str, Level, str], FloatArray] = {}
    usable: dict[tuple[str, Level], Profile] = {}
    failed: dict[str, str] = {}
    seen: dict[tuple[bytes, str], tuple[Entry, FloatArray]] = {}
    slack: dict[tuple[str, str], Slack] = {}
    for level in Level:
        problem = Problem.of(scenario, level=level, reference=reference, options=options)
        answers = answers_of(problem, compensators, parts)
        profiles, failed = answers.profiles, failed | answers.failed | answers.refused
        for name, profile in profiles.items():
            if profile.status is not ProfileStatus.GOOD:
                warnings.append(f"{name} designed on {level}: {profile.message}")
            if profile.status is not ProfileStatus.FAILED:
                usable[name, level] = profile
        warnings += [f"designed on {level}: {note}" for note in problem.unsettled]
        if _is_bound(profiles) and not any(isinstance(c, Optimal) for c in compensators):
            warnings.append(_NOT_SEARCHED)
        for plant in PLANTS:
            for name, profile in profiles.items():
                command = b"" if profile.command_m is None else profile.command_m.tobytes()
                key = (profile.force_N.tobytes() + command, plant)
                if key not in seen:  # none and capstan do not depend on the design level
                    seen[key] = _entry(transmission, name, level, plant, profile, reference, slack)
                found, outputs[name, level, plant] = seen[key]
                entries.append(replace(found, compensator=name, design_level=level, plant_level=plant))
            parts.done()
    bands = error_bands(problem.doubt, Level.PRESLIDING, usable, reference)  # on the most detailed level
    compensators = [c for c in compensators if c.name not in failed]
    entries = [entry for entry in entries if entry.compensator not in failed]
    text, best = recommend(entries, compensators, bands, str(problem.doubt))
    on_level = {name: band for (name, level), band in bands.items() if level is best}
    traits, costs = {}, {}
    for model in (*Level, None):
        name = CAPSTAN_PLANT if model is None else model.value
        traits[name] = level_traits(transmission, model, reference)
        costs[name] = level_cost(transmission, model, reference)
        if model is not None:
            parts.done(2)
    order = {c.name: k for k, c in enumerate(compensators)}
    entries.sort(key=lambda e: order[e.compensator])  # stable: levels and plants keep their order
    return Comparison(
        scenario=scenario,
        reference=reference,
        compensators=tuple(compensators),
        entries=tuple(entries),
        outputs_N=outputs,
        traits=traits,
        costs=costs,
        bands=bands,
        expectation=expectation_of(problem.doubt, Level.PRESLIDING, on_level, reference.share_of),
        recommended_level=best,
        recommendation=text,
        ignored=ignored_motion(Problem.of(scenario, reference=reference, options=options)),
        warnings=tuple(
            dict.fromkeys(
                (*warnings, *(f"{n}: {why}" for n, why in failed.items()), *slack_warnings(slack), *_noise(entries))
            )
        ),
    )


_NOT_SEARCHED = (
    "the actuator's limits change the exact inverse: the optimal profile, which is made for them, is not compared "
    "here; add --optimal"
)


def _is_bound(profiles: Mapping[str, Profile]) -> bool:
    """Whether limits, or a push that no tendon gives, keep the exact inverse from what it would do."""
    inverse = profiles.get("inverse")
    return inverse is not None and bool(inverse.warnings)


def recommend(
    entries: Sequence[Entry],
    compensators: Sequence[Compensator],
    bands: Mapping[tuple[str, Level], ErrorBand],
    doubt: str,
) -> tuple[str, Level]:
    """Recommended design level, in one sentence; the most detailed level represents the real transmission.

    What counts is the error to expect on a rig: the worst over what may be the real transmission, by name of the
    compensator and design level; `doubt` names it in words.
    """
    fixed = {c.name for c in compensators if not c.knows_the_level}
    plant = Level.PRESLIDING.value
    on_plant = [e for e in entries if e.plant_level == plant]

    def error(entry: Entry) -> float:
        band = bands.get((entry.compensator, entry.design_level))
        return math.inf if band is None else band.worst.rmse_percent_of_range

    def designed(level: Level) -> Entry:
        models = [e for e in on_plant if e.design_level is level and e.compensator not in {*fixed, *_NO_MODEL}]
        return min(models, key=error)

    smoothed = [e for e in on_plant if e.compensator == _SMOOTHED and e.design_level is Level.PRESLIDING]
    candidates = [
        ("The reference applied directly", next(e for e in on_plant if e.compensator == "none")),
        ("The static capstan law", next(e for e in on_plant if e.compensator == "capstan")),
        *(("The capstan law with a smoothed sign change", entry) for entry in smoothed),
        *((f"The {level} level", designed(level)) for level in Level),
    ]
    ideal = min((entry for _, entry in candidates), key=error)
    best = f"{two_digits(error(ideal))} %"
    over = f" of range on the {plant} plant, for {doubt}"
    for name, entry in candidates:
        margin = max(ENOUGH_PERCENT, entry.spread_percent_of_range, ideal.spread_percent_of_range)
        if error(entry) <= error(ideal) + margin:
            if entry.plant_level == entry.design_level and entry.compensator not in {*fixed, *_NO_MODEL}:
                break
            text = f"{name} is enough here: RMS error {two_digits(error(entry))} %{over}; the best design {best}."
            return text, entry.design_level
    others = ", ".join(f"{name[0].lower()}{name[1:]} {two_digits(error(entry))} %" for name, entry in candidates[1:-1])
    return f"Design on the {plant} level: RMS error {best}{over}, against {others}.", Level.PRESLIDING


def _entry(
    transmission: Transmission,
    name: str,
    level: Level,
    plant: str,
    profile: Profile,
    reference: Reference,
    slack: dict[tuple[str, str], Slack],
) -> tuple[Entry, FloatArray]:
    """Simulate a plant under a profile, with the spread over step and tolerance."""
    if plant == CAPSTAN_PLANT:
        # Exact for a force that is linear between rows: nothing to refine.
        law, rows, start = CapstanLaw.of(transmission), profile.force_N, reference.initial_tension_N
        if reference.periodic:  # the second period is that of the steady state
            rows = np.concatenate([rows[:-1], rows])
        outputs = [law.output_history_N(rows, start)[-len(profile.force_N) :]]
    else:
        outputs = list(_replays(transmission, Level(plant), profile, reference, (name, plant), slack))
    result = score(reference.tension_N, outputs[0])
    spread = max((float(np.sqrt(np.mean((other - outputs[0]) ** 2))) for other in outputs[1:]), default=0.0)
    entry = Entry(
        compensator=name,
        design_level=level,
        plant_level=plant,
        rmse_percent_of_range=result.rmse_percent_of_range,
        peak_error_N=result.peak_error,
        lag_s=lag(reference.tension_N, outputs[0], reference.step_s),
        spread_percent_of_range=100 * spread / scale_of(reference.tension_N),
    )
    return entry, outputs[0]


def _replays(
    transmission: Transmission,
    level: Level,
    profile: Profile,
    reference: Reference,
    what: tuple[str, str],
    slack: dict[tuple[str, str], Slack],
) -> Iterator[FloatArray]:
    """Output tension with ever larger steps, then with a force that is a little different."""
    for refinement in REFINEMENTS:
        run = Plant(transmission, level, refinement=refinement).respond(profile, reference).require()
        if refinement == REFINEMENTS[0] and run.slack is not None:
            slack[what] = run.slack
        yield run.output_N
    # Steps are solved to rounding, so a tolerance is the last digits: the answer must not depend on them.
    start = reference.initial_tension_N
    nudged = replace(
        profile,
        force_N=start + (profile.force_N - start) * (1 + NUDGE),
        command_m=None if profile.command_m is None else profile.command_m * (1 + NUDGE),
    )
    yield Plant(transmission, level, refinement=REFINEMENTS[0]).respond(nudged, reference).require().output_N


def lag(reference_N: FloatArray, output_N: FloatArray, step_s: float) -> float:
    """Shift at which the output resembles the reference most [s], positive when it comes late; 0 for constants."""
    stride = max(1, len(reference_N) // _LAG_ROWS)
    wanted, got = reference_N[::stride], output_N[::stride]
    most = int(_LAG_SHARE * len(wanted))
    if most < 1 or np.ptp(wanted) == 0 or np.ptp(got) == 0:
        return 0.0
    likeness = _likeness(wanted, got, most)
    best = int(np.argmax(likeness))
    offset = 0.0
    if 0 < best < len(likeness) - 1:  # the top of the parabola through three points
        before, top, after = likeness[best - 1 : best + 2]
        bend = before - 2 * top + after
        offset = 0.5 * float(before - after) / float(bend) if bend < 0 else 0.0
    return (best - most + offset) * stride * step_s


def _likeness(wanted: FloatArray, got: FloatArray, most: int) -> FloatArray:
    """Correlation of the output, moved forward by -most .. most rows, with the reference, over the rows both have."""
    n, shift = len(wanted), np.arange(-most, most + 1)
    a, b = wanted - wanted.mean(), got - got.mean()
    size = 2 * n
    products = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)[
        shift
    ]  # sums of a[k] b[k + shift]
    count = n - np.abs(shift)

    def over_common(values: FloatArray, first: NDArray[np.int_]) -> FloatArray:
        sums = np.concatenate([[0.0], np.cumsum(values)])
        total: FloatArray = sums[first + count] - sums[first]
        return total

    of_a, of_b = np.maximum(-shift, 0), np.maximum(shift, 0)
    mean_a, mean_b = over_common(a, of_a) / count, over_common(b, of_b) / count
    spread_a = np.maximum(over_common(a**2, of_a) - count * mean_a**2, 0)
    spread_b = np.maximum(over_common(b**2, of_b) - count * mean_b**2, 0)
    scale = np.sqrt(spread_a * spread_b)
    likeness: FloatArray = np.divide(
        products - count * mean_a * mean_b, scale, out=np.zeros(len(shift)), where=scale > 0
    )
    return likeness


def _noise(entries: list[Entry]) -> list[str]:
    """Warning where the spread hides differences."""
    worst = max(entries, key=lambda e: e.spread_percent_of_range)
    if worst.spread_percent_of_range < ENOUGH_PERCENT:
        return []
    note = (
        f"the response on the {worst.plant_level} level depends on the time step by up to "
        f"{worst.spread_percent_of_range:.2g} % of range ({worst.compensator} designed on {worst.design_level}): "
        "errors that differ by less are equal. Jumps of the force do that, and stick-slip (mu_static > mu_dynamic)"
    )
    return [note]
