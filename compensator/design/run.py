"""The main job: from a scenario to the force profile, with proof on every level and on a finer chain."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

from tendonff.compensator.compensators.base import (
    Compensator,
    FloatArray,
    Plant,
    Played,
    binding_limits,
    capstan_force,
    exact_inverse,
    play_and_score,
)
from tendonff.compensator.design.robustness import (
    Robustness,
    robustness,
    robustness_summary,
    robustness_warnings,
    samples_of,
)
from tendonff.compensator.files.progress import Advance, silent
from tendonff.compensator.files.writing import write_csv, write_json
from tendonff.compensator.scenario.filters import noise_advice, ripple_advice
from tendonff.compensator.scenario.reference import CsvReference
from tendonff.compensator.scenario.sampling import Reference, sample_reference
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.ocp.inverse import InverseStatus, invert
from tendonff.ocp.stability import Foresight, foresee
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.result import Tracking, TrackStatus
from tendonff.ocp.tracking.robust import Objective, Sample, track_robust
from tendonff.ocp.tracking.track import track

FINE_SEGMENTS = 40
FINE_REFINEMENT = 10
"""The proof plant: so many masses, and so many steps to a row of the profile."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Force profiles for one scenario and what each delivers.

    Parameters
    ----------
    scenario : Scenario
    reference : Reference
    forces_N : dict of Compensator to ndarray, shape (n,)
        Profile of each compensator [N].
    played : tuple of Played
        Every compensator on every level.
    proof : tuple of Played
        Every compensator on the design level with more masses and a smaller step.
    tracking : Tracking
        How the optimal-control problem ended.
    foresight : Foresight
        Where friction that weakens with speed makes feedforward fail.
    robustness : Robustness or None
        Error bands under the scenario's uncertainty; None where all is certain.
    warnings : tuple of str
        What the user should know.
    """

    scenario: Scenario
    reference: Reference
    forces_N: dict[Compensator, FloatArray]
    played: tuple[Played, ...]
    proof: tuple[Played, ...]
    tracking: Tracking
    foresight: Foresight
    robustness: Robustness | None
    warnings: tuple[str, ...]

    @property
    def level(self) -> Level:
        """Fidelity level of the design model."""
        return self.scenario.run.level

    def on_level(self, compensator: Compensator, level: Level) -> Played:
        """What a compensator delivers on a level."""
        return next(p for p in self.played if p.compensator == compensator and p.plant.level is level)


def design(scenario: Scenario, *, advance: Advance = silent) -> Design:
    """Design the force profile of a scenario by every compensator, and play each on every level.

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
    transmission, level = scenario.transmission, scenario.run.level
    total = 4 + len(Compensator) * (len(Level) + 1)
    reference = sample_reference(scenario)
    limits = ForceLimits.of(transmission.actuator)
    warnings = list(reference.warnings)

    inversion = exact_inverse(transmission, level, reference)
    if inversion.status is InverseStatus.WOULD_PUSH:
        warnings.append(f"inverse: {inversion.message}")
    warnings += _noise_warning(scenario, reference) or _ripple_warning(scenario, reference, inversion.force_N)
    advance(1, total)
    start = reference.initial_tension_N
    inverse_force = limits.apply(inversion.force_N, reference.step_s, start)
    static_force = capstan_force(transmission, reference)
    advance(2, total)
    samples = samples_of(scenario)
    tracking = _track(scenario, samples, reference, limits)
    warnings += _tracking_warnings(tracking)
    advance(3, total)
    forces = {
        Compensator.NONE: reference.tension_N,
        Compensator.CAPSTAN: static_force,
        Compensator.INVERSE: inverse_force,
        Compensator.OPTIMAL: tracking.force_N,
    }
    warnings += binding_limits({"inverse": (inversion.force_N, inverse_force)})
    foresight = foresee(
        Chain.of(transmission, level),
        reference.tension_N,
        reference.step_s,
        force_N=tracking.force_N,
        initial_tension_N=start,
    )
    warnings += foresight.warnings
    bands = robustness(scenario, samples, forces, reference) if len(samples) > 1 else None
    if bands is not None:
        warnings += robustness_warnings(bands)
    advance(4, total)

    played: list[Played] = []
    proof: list[Played] = []
    for compensator, force in forces.items():
        for plant_level in Level:
            plant = Plant(level=plant_level)
            played.append(play_and_score(transmission, plant, compensator, force, reference))
            advance(4 + len(played) + len(proof), total)
        fine = Plant(level=level, segments=FINE_SEGMENTS, refinement=FINE_REFINEMENT)
        proof.append(play_and_score(transmission, fine, compensator, force, reference))
        advance(4 + len(played) + len(proof), total)
    warnings += _worse_than_nothing([p for p in played if p.plant.level is level])
    slack = [p for p in played if p.slack]
    warnings += [f"{p.compensator} on {p.plant.level}: {p.slack}" for p in slack]
    return Design(
        scenario=scenario,
        reference=reference,
        forces_N=forces,
        played=tuple(played),
        proof=tuple(proof),
        tracking=tracking,
        foresight=foresight,
        robustness=bands,
        warnings=tuple(warnings),
    )


def _track(scenario: Scenario, samples: tuple[Sample, ...], reference: Reference, limits: ForceLimits) -> Tracking:
    """The optimal profile, for the nominal parameters or for all that the uncertainty admits."""
    level, start = scenario.run.level, reference.initial_tension_N
    if len(samples) == 1:
        chain = Chain.of(scenario.transmission, level)
        return track(chain, reference.tension_N, reference.step_s, limits, initial_tension_N=start)
    objective = Objective(scenario.robust.objective.value)
    return track_robust(
        samples, level, reference.tension_N, reference.step_s, limits, objective, initial_tension_N=start
    )


def _worse_than_nothing(played: Sequence[Played]) -> list[str]:
    """Compensators that leave more on their own level than the reference itself as force."""
    nothing = next(p.score for p in played if p.compensator is Compensator.NONE)
    return [
        f"{p.compensator} leaves {p.score.rmse_percent_of_range:.3g} % of range, more than no compensation "
        f"({nothing.rmse_percent_of_range:.3g} %): do not use it for this reference and these limits"
        for p in played
        if p.score.rmse_N > 1.01 * nothing.rmse_N
    ]


def _tracking_warnings(tracking: Tracking) -> list[str]:
    """What limits the optimal profile, in the user's terms."""
    if tracking.status is TrackStatus.EXACT:
        return []
    found = [] if tracking.status is TrackStatus.OPTIMAL else [f"optimal: {tracking.message}"]
    found += tracking.reasons
    if tracking.departures:
        worst = max(tracking.departures, key=lambda departure: abs(departure.peak_error_N))
        found.append(
            f"optimal: off the reference by more than 1 % in {len(tracking.departures)} "
            f"{'stretch' if len(tracking.departures) == 1 else 'stretches'}; most {worst}"
        )
    return found


def _noise_warning(scenario: Scenario, reference: Reference) -> list[str]:
    """Warning of a noisy CSV reference that no filter was asked for."""
    spec = scenario.reference
    if not isinstance(spec, CsvReference) or spec.cutoff_Hz is not None:
        return []
    chain, step, start = (
        Chain.of(scenario.transmission, scenario.run.level),
        reference.step_s,
        reference.initial_tension_N,
    )

    def force_of(tension: FloatArray) -> FloatArray:
        return invert(chain, tension, step, initial_tension_N=start).force_N

    advice = noise_advice(reference.tension_N, step, force_of, file=spec.file)
    return [] if advice is None else [advice.message]


def _ripple_warning(scenario: Scenario, reference: Reference, force_N: FloatArray) -> list[str]:
    """Warning of a force rate that swings between the samples of a file."""
    spec = scenario.reference
    if not isinstance(spec, CsvReference):
        return []
    advice = ripple_advice(force_N, reference.step_s, reference.sample_interval_s, file=spec.file)
    return [] if advice is None else [advice]


def summary(result: Design) -> dict[str, object]:
    """The contents of `summary.json`.

    Parameters
    ----------
    result : Design
    """

    def scores(played: tuple[Played, ...], compensator: Compensator) -> dict[str, object]:
        return {p.plant.level.value: asdict(p.score) for p in played if p.compensator == compensator}

    return {
        "schema": 1,
        "scenario": result.scenario.name,
        "scenario_hash": scenario_hash(result.scenario),
        "tool": f"tendonff {version('tendonff')}",
        "design_level": result.level.value,
        "reference_range_N": result.reference.range_N,
        "compensators": {c.value: scores(result.played, c) for c in Compensator},
        "proof": {
            "segments": FINE_SEGMENTS,
            "step_s": result.reference.step_s / FINE_REFINEMENT,
            "compensators": {c.value: scores(result.proof, c) for c in Compensator},
        },
        "ocp": {
            "status": result.tracking.status.value,
            "message": result.tracking.message,
            "reasons": list(result.tracking.reasons),
            "departures": [asdict(departure) for departure in result.tracking.departures],
            "iterations": result.tracking.iterations,
            "build_s": result.tracking.build_s,
            "solve_s": result.tracking.solve_s,
        },
        "foresight": {
            "unstable_share": result.foresight.unstable_share,
            "largest_growth_per_s": result.foresight.largest_growth_per_s,
            "expected_error_N": finite(result.foresight.expected_error_N),
            "stretches": [asdict(stretch) for stretch in result.foresight.stretches],
        },
        "robust": None if result.robustness is None else robustness_summary(result.robustness),
        "warnings": list(result.warnings),
    }


def finite(value: float) -> float | None:
    """The value, or None (null in JSON) where it is not a finite number."""
    return value if math.isfinite(value) else None


def profile_columns(result: Design) -> dict[str, FloatArray]:
    """The columns of `profile.csv`.

    Parameters
    ----------
    result : Design
    """
    forces = {f"force_{c.value}_N": result.forces_N[c] for c in Compensator}
    return {"time_s": result.reference.time_s, "reference_N": result.reference.tension_N, **forces}


def write_design(result: Design, folder: Path) -> None:
    """Write profile, summary, figures and report into an existing folder.

    Parameters
    ----------
    result : Design
    folder : Path
        Usually the inside of `files.atomic_directory`.
    """
    from tendonff.compensator.design.figures import design_figures
    from tendonff.compensator.design.report import design_report
    from tendonff.compensator.reporting.page import write_report
    from tendonff.compensator.reporting.plots import save_figure

    write_csv(folder / "profile.csv", profile_columns(result))
    write_json(folder / "summary.json", summary(result))
    figures = design_figures(result)
    for name, figure in figures.items():
        save_figure(figure, folder / name)
    write_report(folder / "report.html", design_report(result, figures))
