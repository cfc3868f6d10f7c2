"""What the interactive page computes: one scenario with a few parameters changed, designed and played.

No page in here: `explore_page` draws it.
"""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import (
    Compensator,
    FloatArray,
    Plant,
    Score,
    capstan_force,
    exact_inverse,
    play_and_score,
)
from tendonff.compensator.scenario.sampling import Reference, sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.inverse import InverseStatus
from tendonff.ocp.tracking.limits import ForceLimits

SHOWN = (Compensator.NONE, Compensator.CAPSTAN, Compensator.INVERSE)
"""Fast enough to follow a slider; the optimal profile takes seconds: `tendonff design`."""

_MOST_POINTS = 1500


@dataclass(frozen=True, slots=True, kw_only=True)
class Knobs:
    """The parameters that the page lets one change.

    Parameters
    ----------
    mu : float
        Dynamic coefficient when pulling [-]; the static one and those of releasing keep their ratio to it.
    total_angle_deg : float
        Wrap angle [deg].
    bristle_stiffness_N_per_m : float
        Of the level that is shown [N/m].
    relaxation_time_s : float
        tau [s].
    force_rate_max_N_per_s : float
        The actuator's rate limit [N/s].
    """

    mu: float
    total_angle_deg: float
    bristle_stiffness_N_per_m: float
    relaxation_time_s: float
    force_rate_max_N_per_s: float

    @classmethod
    def of(cls, transmission: Transmission, level: Level) -> "Knobs":
        """Where the knobs stand for a transmission.

        Parameters
        ----------
        transmission : Transmission
        level : Level
        """
        friction = transmission.friction
        soft = level.features.soft_bristle
        return cls(
            mu=friction.mu_dynamic,
            total_angle_deg=float(np.degrees(transmission.path.total_angle_rad)),
            bristle_stiffness_N_per_m=(
                friction.soft_bristle_stiffness_N_per_m if soft else friction.bristle_stiffness_N_per_m
            ),
            relaxation_time_s=transmission.tendon.relaxation_time_s,
            force_rate_max_N_per_s=transmission.actuator.force_rate_max_N_per_s,
        )

    def apply(self, transmission: Transmission, level: Level) -> Transmission:
        """The transmission with these values.

        Parameters
        ----------
        transmission : Transmission
        level : Level
        """
        old = transmission.friction
        friction = replace(
            old,
            mu_dynamic=self.mu,
            mu_static=_in_proportion(old.mu_static, old.mu_dynamic, self.mu),
            mu_dynamic_release=_in_proportion(old.release_dynamic, old.mu_dynamic, self.mu),
            mu_static_release=_in_proportion(old.release_static, old.mu_dynamic, self.mu),
        )
        if level.features.soft_bristle:
            friction = replace(friction, soft_bristle_stiffness_N_per_m=self.bristle_stiffness_N_per_m)
        else:
            friction = replace(friction, bristle_stiffness_N_per_m=self.bristle_stiffness_N_per_m)
        return replace(
            transmission,
            path=replace(transmission.path, total_angle_rad=float(np.radians(self.total_angle_deg))),
            tendon=replace(transmission.tendon, relaxation_time_s=self.relaxation_time_s),
            friction=friction,
            actuator=replace(transmission.actuator, force_rate_max_N_per_s=self.force_rate_max_N_per_s),
        )


def _in_proportion(value: float, old: float, new: float) -> float:
    return value * new / old if old > 0 else new


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One compensator at the present position of the knobs, thinned for the screen.

    Parameters
    ----------
    time_s, force_N, output_N, error_N : ndarray, shape (n,)
    score : Score
        Of all rows.
    """

    time_s: FloatArray
    force_N: FloatArray
    output_N: FloatArray
    error_N: FloatArray
    score: Score


@dataclass(frozen=True, slots=True, kw_only=True)
class Exploration:
    """What the page shows.

    Parameters
    ----------
    reference : Reference
    curves : dict of Compensator to Curve
    notes : tuple of str
        What the reader should know, such as a slack tendon.
    """

    reference: Reference
    curves: dict[Compensator, Curve]
    notes: tuple[str, ...]


class Explorer:
    """A scenario to be explored: its reference is sampled once.

    Parameters
    ----------
    scenario : Scenario
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self.start = Knobs.of(scenario.transmission, scenario.run.level)

    def at(self, knobs: Knobs, *, design_knows: bool = True) -> Exploration:
        """Design and play with the knobs at a position.

        Parameters
        ----------
        knobs : Knobs
        design_knows : bool, optional
            The design is made for the changed tendon; else it is made for the scenario's own and played on the changed
            one, with the changed actuator.

        Raises
        ------
        TendonffError
            When the changed transmission cannot deliver the reference, or a value is out of bounds.
        """
        level = self._scenario.run.level
        plant = knobs.apply(self._scenario.transmission, level)
        model = plant if design_knows else replace(self._scenario.transmission, actuator=plant.actuator)
        reference = sample_reference(replace(self._scenario, transmission=model))
        inversion = exact_inverse(model, level, reference)
        notes = [] if inversion.status is InverseStatus.EXACT else [f"inverse: {inversion.message}"]
        forces = {
            Compensator.NONE: reference.tension_N,
            Compensator.CAPSTAN: capstan_force(model, reference),
            Compensator.INVERSE: ForceLimits.of(plant.actuator).apply(
                inversion.force_N, reference.step_s, reference.initial_tension_N
            ),
        }
        rows = slice(None, None, max(1, len(reference.time_s) // _MOST_POINTS))
        curves = {}
        for compensator in SHOWN:
            played = play_and_score(plant, Plant(level=level), compensator, forces[compensator], reference)
            if played.slack:
                notes.append(f"{compensator}: {played.slack}")
            curves[compensator] = Curve(
                time_s=reference.time_s[rows],
                force_N=forces[compensator][rows],
                output_N=played.output_N[rows],
                error_N=(played.output_N - reference.tension_N)[rows],
                score=played.score,
            )
        return Exploration(reference=reference, curves=curves, notes=tuple(notes))
