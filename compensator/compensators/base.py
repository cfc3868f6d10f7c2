"""Compensators: ways from a wanted tension to a force, and how well a played force does."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.scenario.sampling import Reference
from tendonff.models.capstan import CapstanLaw
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.inverse import Inversion, invert
from tendonff.ocp.simulate import Outcome, Simulation, simulate
from tendonff.ocp.tracking.limits import ForceLimits

FloatArray = NDArray[np.float64]


class Compensator(StrEnum):
    """Where a force profile comes from.

    Attributes
    ----------
    NONE
        The wanted tension itself as force.
    CAPSTAN
        The static inverse of the capstan law, within the actuator's limits.
    INVERSE
        The exact inverse of the chain, within the same limits.
    OPTIMAL
        The answer of the optimal-control problem.
    """

    NONE = "none"
    CAPSTAN = "capstan"
    INVERSE = "inverse"
    OPTIMAL = "optimal"


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """How far the delivered tension is from the wanted one.

    Parameters
    ----------
    rmse_N : float
        Root mean square error [N].
    rmse_percent_of_range : float
        The same over the range of the reference [%].
    peak_error_N : float
        Largest absolute error [N].
    """

    rmse_N: float
    rmse_percent_of_range: float
    peak_error_N: float


def score(reference_N: FloatArray, output_N: FloatArray) -> Score:
    """Compare a delivered tension with the wanted one.

    Parameters
    ----------
    reference_N, output_N : ndarray, shape (n,)
        Rows at the same times [N].
    """
    error = output_N - reference_N
    rmse = float(np.sqrt(np.mean(error**2)))
    span = float(np.ptp(reference_N))
    # A constant reference has no range; its own height is then the natural measure.
    return Score(
        rmse_N=rmse,
        rmse_percent_of_range=100 * rmse / (span if span > 0 else float(np.max(np.abs(reference_N)))),
        peak_error_N=float(np.max(np.abs(error))),
    )


def capstan_force(transmission: Transmission, reference: Reference) -> FloatArray:
    """Static inverse of the capstan law, clipped and rate-limited to the actuator, shape (n,) [N].

    Parameters
    ----------
    transmission : Transmission
    reference : Reference
    """
    wanted = CapstanLaw.of(transmission).input_history_N(reference.tension_N, reference.initial_tension_N)
    return ForceLimits.of(transmission.actuator).apply(wanted, reference.step_s, reference.initial_tension_N)


def exact_inverse(transmission: Transmission, level: Level, reference: Reference) -> Inversion:
    """Exact inverse of the chain at a level, before limits.

    Parameters
    ----------
    transmission : Transmission
    level : Level
    reference : Reference
    """
    chain = Chain.of(transmission, level)
    return invert(chain, reference.tension_N, reference.step_s, initial_tension_N=reference.initial_tension_N)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """The chain that a force is played on.

    Parameters
    ----------
    level : Level
    segments : int, optional
        Masses; default: the path's own.
    refinement : int, optional
        Steps per row of the profile; the force is linear in between.
    """

    level: Level
    segments: int | None = None
    refinement: int = 1


def play(transmission: Transmission, plant: Plant, force_N: FloatArray, reference: Reference) -> Simulation:
    """Play a force profile on a plant, from rest at the reference's initial tension.

    Parameters
    ----------
    transmission : Transmission
    plant : Plant
    force_N : ndarray, shape (n,)
        Rows of the reference's grid [N].
    reference : Reference

    Returns
    -------
    Simulation
        On the plant's own grid, every `refinement`-th row of which is a row of the reference.
    """
    fine = force_N
    if plant.refinement > 1:
        rows = (len(force_N) - 1) * plant.refinement + 1
        fine = np.interp(np.arange(rows) / plant.refinement, np.arange(len(force_N)), force_N)
    return simulate(
        Chain.of(transmission, plant.level, plant.segments),
        fine,
        reference.step_s / plant.refinement,
        initial_tension_N=reference.initial_tension_N,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """One compensator's force on one plant.

    Parameters
    ----------
    compensator : str
        Name of the compensator.
    plant : Plant
    output_N : ndarray, shape (n,)
        Delivered tension at the rows of the reference [N].
    score : Score
    slack : str
        Where the tendon went slack; empty where it stayed taut.
    """

    compensator: str
    plant: Plant
    output_N: FloatArray
    score: Score
    slack: str


def play_and_score(
    transmission: Transmission, plant: Plant, compensator: str, force_N: FloatArray, reference: Reference
) -> Played:
    """Play a force profile and score what arrives.

    Parameters
    ----------
    transmission : Transmission
    plant : Plant
    compensator : str
        Name for the result.
    force_N : ndarray, shape (n,)
    reference : Reference

    Raises
    ------
    SolveError
        If the simulation fails.
    """
    played = play(transmission, plant, force_N, reference).require()
    output = played.output_tension_N[:: plant.refinement]
    return Played(
        compensator=compensator,
        plant=plant,
        output_N=output,
        score=score(reference.tension_N, output),
        slack=played.message if played.outcome is Outcome.SLACK else "",
    )


def binding_limits(limited: Mapping[str, tuple[FloatArray, FloatArray]]) -> tuple[str, ...]:
    """Say for which compensators the actuator's limits changed the force, and for how long.

    Parameters
    ----------
    limited : mapping of str to (ndarray, ndarray)
        Force before and after the limits, by compensator [N].
    """
    notes = []
    for name, (before, after) in limited.items():
        changed = np.abs(before - after) > 1e-9 * max(float(np.max(np.abs(before))), 1.0)
        if changed.any():
            notes.append(
                f"{name}: the actuator's limits change the force in {100 * float(changed.mean()):.3g} % of the rows, "
                f"by up to {float(np.max(np.abs(before - after))):.3g} N"
            )
    return tuple(notes)
