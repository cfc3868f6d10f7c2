"""How much model does the task need? Every compensator, designed on each level, played on every level.

Rooms: `compare` (the matrix and what follows from it), `compare_levels` (what a level does differently, and its cost),
`compare_figures` and `compare_report` (what people look at).
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Literal

import numpy as np

from tendonff.compensator.compare.levels import LevelCost, LevelTraits, level_cost, level_traits
from tendonff.compensator.compensators.base import (
    Compensator,
    FloatArray,
    Plant,
    capstan_force,
    exact_inverse,
    play,
    score,
)
from tendonff.compensator.files.progress import Advance, silent
from tendonff.compensator.scenario.sampling import Reference, sample_reference
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.models.capstan import CapstanLaw
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.crosscheck import NUDGE
from tendonff.ocp.inverse import InverseStatus
from tendonff.ocp.simulate import Outcome
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.result import TrackStatus
from tendonff.ocp.tracking.track import track

CAPSTAN_PLANT: Literal["capstan"] = "capstan"
"""Name of the static law as a plant."""

REFINEMENTS = (4, 2, 1)
"""Steps to a row of the profile; the first gives the figures, the others the spread."""
ENOUGH_PERCENT = 0.5
"""A simpler level is enough if its design costs no more than this on the most detailed plant [% of range]."""

_LAG_ROWS = 4000
_LAG_SHARE = 0.25  # of the duration: a lag is sought within this, either way


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One compensator, designed on one level, played on one plant.

    Parameters
    ----------
    compensator : Compensator
    design_level : Level
        `none` and `capstan` do not depend on it and repeat.
    plant_level : str
        A `Level`, or "capstan" for the static law.
    rmse_percent_of_range, peak_error_N : float
        Of a replay with a quarter of the step.
    lag_s : float
        Delay of the output against the reference [s]; negative when it leads.
    spread_percent_of_range : float
        Largest rms difference to replays with half the step, the whole step, and a force that differs in the ninth
        digit, which stands for a solver's tolerance [% of range]. Errors that differ by less are equal.
    """

    compensator: Compensator
    design_level: Level
    plant_level: str
    rmse_percent_of_range: float
    peak_error_N: float
    lag_s: float
    spread_percent_of_range: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """All compensators on all levels.

    Parameters
    ----------
    scenario : Scenario
    reference : Reference
    entries : tuple of Entry
        Compensator by compensator, design level by design level, plant by plant.
    outputs_N : dict of (Compensator, Level, str) to ndarray, shape (n,)
        Delivered tension by compensator, design level and plant, at the rows of the reference [N].
    traits : dict of str to LevelTraits
        What each level and the static law do differently.
    costs : dict of str to LevelCost
    recommendation : str
        One sentence.
    warnings : tuple of str
    """

    scenario: Scenario
    reference: Reference
    entries: tuple[Entry, ...]
    outputs_N: dict[tuple[Compensator, Level, str], FloatArray]
    traits: dict[str, LevelTraits]
    costs: dict[str, LevelCost]
    recommendation: str
    warnings: tuple[str, ...]

    def entry(self, compensator: Compensator, design_level: Level, plant_level: str) -> Entry:
        """One cell of the matrix."""
        wanted = (compensator, design_level, plant_level)
        return next(e for e in self.entries if (e.compensator, e.design_level, e.plant_level) == wanted)


def plants() -> tuple[str, ...]:
    """Names of the plants: the levels, then the static law."""
    return (*(level.value for level in Level), CAPSTAN_PLANT)


def compare(scenario: Scenario, *, advance: Advance = silent) -> Comparison:
    """Compare the fidelity levels with each other and with the static law on one scenario.

    Parameters
    ----------
    scenario : Scenario
    advance : callable, optional
        Told parts done and parts in all.

    Raises
    ------
    InputError
        If the reference cannot be delivered.
    SolveError
        If a simulation fails.
    """
    transmission = scenario.transmission
    reference = sample_reference(scenario)
    warnings = list(reference.warnings)
    total = len(Level) * (3 + len(plants()))
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        advance(done, total)

    entries: list[Entry] = []
    outputs: dict[tuple[Compensator, Level, str], FloatArray] = {}
    seen: dict[tuple[bytes, str], tuple[Entry, FloatArray]] = {}
    for level in Level:
        forces = _forces(transmission, level, reference, warnings)
        step()
        for plant in plants():
            for compensator, force in forces.items():
                key = (force.tobytes(), plant)
                if key not in seen:  # none and capstan do not depend on the design level
                    seen[key] = _entry(transmission, compensator, level, plant, force, reference, warnings)
                found, output = seen[key]
                entries.append(
                    Entry(**{**asdict(found), "compensator": compensator, "design_level": level, "plant_level": plant})
                )
                outputs[compensator, level, plant] = output
            step()
    traits, costs = {}, {}
    for plant in (*Level, None):
        name = CAPSTAN_PLANT if plant is None else plant.value
        traits[name] = level_traits(transmission, plant, reference)
        costs[name] = level_cost(transmission, plant, reference)
        if plant is not None:
            step()
            step()
    order = {c: k for k, c in enumerate(Compensator)}
    entries.sort(key=lambda e: order[e.compensator])  # stable: levels and plants keep their order
    return Comparison(
        scenario=scenario,
        reference=reference,
        entries=tuple(entries),
        outputs_N=outputs,
        traits=traits,
        costs=costs,
        recommendation=recommend(tuple(entries)),
        warnings=tuple(dict.fromkeys((*warnings, *_noise(entries)))),
    )


def _forces(
    transmission: Transmission, level: Level, reference: Reference, warnings: list[str]
) -> dict[Compensator, FloatArray]:
    """Profile of each compensator designed on a level."""
    limits, start = ForceLimits.of(transmission.actuator), reference.initial_tension_N
    inversion = exact_inverse(transmission, level, reference)
    if inversion.status is InverseStatus.WOULD_PUSH:
        warnings.append(f"inverse designed on {level}: {inversion.message}")
    tracking = track(
        Chain.of(transmission, level), reference.tension_N, reference.step_s, limits, initial_tension_N=start
    )
    if tracking.status not in (TrackStatus.EXACT, TrackStatus.OPTIMAL):
        warnings.append(f"optimal designed on {level}: {tracking.message}")
    return {
        Compensator.NONE: reference.tension_N,
        Compensator.CAPSTAN: capstan_force(transmission, reference),
        Compensator.INVERSE: limits.apply(inversion.force_N, reference.step_s, start),
        Compensator.OPTIMAL: tracking.force_N,
    }


def _entry(
    transmission: Transmission,
    compensator: Compensator,
    level: Level,
    plant: str,
    force_N: FloatArray,
    reference: Reference,
    warnings: list[str],
) -> tuple[Entry, FloatArray]:
    """Play a force on a plant, with the spread over step and tolerance."""
    if plant == CAPSTAN_PLANT:
        # Exact for a force that is linear between rows: nothing to refine.
        outputs = [CapstanLaw.of(transmission).output_history_N(force_N, reference.initial_tension_N)]
    else:
        outputs = list(_replays(transmission, Level(plant), force_N, reference, f"{compensator} on {plant}", warnings))
    result = score(reference.tension_N, outputs[0])
    span = _span(reference)
    spread = max((float(np.sqrt(np.mean((other - outputs[0]) ** 2))) for other in outputs[1:]), default=0.0)
    entry = Entry(
        compensator=compensator,
        design_level=level,
        plant_level=plant,
        rmse_percent_of_range=result.rmse_percent_of_range,
        peak_error_N=result.peak_error_N,
        lag_s=lag(reference.tension_N, outputs[0], reference.step_s),
        spread_percent_of_range=100 * spread / span,
    )
    return entry, outputs[0]


def _span(reference: Reference) -> float:
    """What percentages refer to: as in `compensators.score`, the height of a constant reference."""
    return reference.range_N if reference.range_N > 0 else float(np.max(np.abs(reference.tension_N)))


def _replays(
    transmission: Transmission, level: Level, force_N: FloatArray, reference: Reference, what: str, warnings: list[str]
) -> Iterator[FloatArray]:
    """Output tension with ever larger steps, then with a force that is a little different."""
    for refinement in REFINEMENTS:
        plant = Plant(level=level, refinement=refinement)
        played = play(transmission, plant, force_N, reference).require()
        if played.outcome is Outcome.SLACK and refinement == REFINEMENTS[0]:
            warnings.append(f"{what}: {played.message}")
        yield played.output_tension_N[::refinement]
    # Steps are solved to rounding, so a tolerance is the last digits: the answer must not depend on them.
    nudged = reference.initial_tension_N + (force_N - reference.initial_tension_N) * (1 + NUDGE)
    plant = Plant(level=level, refinement=REFINEMENTS[0])
    yield play(transmission, plant, nudged, reference).require().output_tension_N[:: REFINEMENTS[0]]


def lag(reference_N: FloatArray, output_N: FloatArray, step_s: float) -> float:
    """Shift at which the output resembles the reference most [s], positive when it comes late; 0 for constants.

    Parameters
    ----------
    reference_N, output_N : ndarray, shape (n,)
        Rows at the same times [N].
    step_s : float
    """
    stride = max(1, len(reference_N) // _LAG_ROWS)
    wanted, got = reference_N[::stride], output_N[::stride]
    most = int(_LAG_SHARE * len(wanted))
    if most < 1 or np.ptp(wanted) == 0 or np.ptp(got) == 0:
        return 0.0
    likeness = np.array([_likeness(wanted, got, shift) for shift in range(-most, most + 1)])
    best = int(np.argmax(likeness))
    offset = 0.0
    if 0 < best < len(likeness) - 1:  # the top of the parabola through three points
        before, top, after = likeness[best - 1 : best + 2]
        bend = before - 2 * top + after
        offset = 0.5 * float(before - after) / float(bend) if bend < 0 else 0.0
    return (best - most + offset) * stride * step_s


def _likeness(wanted: FloatArray, got: FloatArray, shift: int) -> float:
    """Correlation of the output, moved forward by `shift` rows, with the reference."""
    a, b = (wanted[: len(wanted) - shift], got[shift:]) if shift >= 0 else (wanted[-shift:], got[:shift])
    a, b = a - a.mean(), b - b.mean()
    scale = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / scale if scale > 0 else 0.0


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


def recommend(entries: tuple[Entry, ...]) -> str:
    """Which level to design on, in one sentence; the most detailed level stands for the real transmission.

    Parameters
    ----------
    entries : tuple of Entry
    """
    plant = Level.PRESLIDING.value
    on_plant = [e for e in entries if e.plant_level == plant]

    def best(candidates: list[Entry]) -> Entry:
        return min(candidates, key=lambda e: e.rmse_percent_of_range)

    def designed(level: Level) -> Entry:
        clever = (Compensator.INVERSE, Compensator.OPTIMAL)
        return best([e for e in on_plant if e.design_level is level and e.compensator in clever])

    candidates = [
        ("No compensation", "the wanted tension itself as force", _first(on_plant, Compensator.NONE)),
        ("The static capstan law", "it", _first(on_plant, Compensator.CAPSTAN)),
        *((f"The {level} level", "its design", designed(level)) for level in Level),
    ]
    ideal = best([entry for _, _, entry in candidates])
    loss = f"{ideal.rmse_percent_of_range:.2g} %"
    for name, what, entry in candidates:
        margin = max(ENOUGH_PERCENT, entry.spread_percent_of_range, ideal.spread_percent_of_range)
        if entry.rmse_percent_of_range <= ideal.rmse_percent_of_range + margin:
            if entry.plant_level == entry.design_level and entry.compensator not in (
                Compensator.NONE,
                Compensator.CAPSTAN,
            ):
                break
            verb = "is needed" if name == "No compensation" else "is enough here"
            return (
                f"{name} {verb}: {what} leaves {entry.rmse_percent_of_range:.2g} % of range on the {plant} plant, "
                f"the best design {loss}."
            )
    others = ", ".join(
        f"{name[0].lower()}{name[1:]} {entry.rmse_percent_of_range:.2g} %" for name, _, entry in candidates[1:-1]
    )
    return f"Design on the {plant} level: on the {plant} plant its design leaves {loss} of range, against {others}."


def _first(entries: list[Entry], compensator: Compensator) -> Entry:
    return next(e for e in entries if e.compensator is compensator)


def summary(result: Comparison) -> dict[str, object]:
    """The contents of `summary.json`.

    Parameters
    ----------
    result : Comparison
    """
    return {
        "schema": 1,
        "scenario": result.scenario.name,
        "scenario_hash": scenario_hash(result.scenario),
        "tool": f"tendonff {version('tendonff')}",
        "reference_range_N": result.reference.range_N,
        "recommendation": result.recommendation,
        "enough_percent_of_range": ENOUGH_PERCENT,
        "matrix": [asdict(entry) for entry in result.entries],
        "levels": {
            name: {
                "relaxation_percent": traits.relaxation_percent,
                "loop_area_percent": traits.loop_area_percent,
                "dead_zone_N": traits.dead_zone_N,
                "reversal_width_N": traits.reversal_width_N,
                "time_per_simulated_second_s": result.costs[name].time_per_simulated_second_s,
                "states": result.costs[name].states,
                "parameters_to_identify": list(result.costs[name].parameters),
            }
            for name, traits in result.traits.items()
        },
        "warnings": list(result.warnings),
    }
