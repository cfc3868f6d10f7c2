"""What the interactive page computes: one scenario with a few parameters changed, designed and simulated."""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import Problem, ProfileStatus
from tendonff.compensator.compensators.motion import with_motion
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.compensators.score import SimulatedPlant, verify
from tendonff.compensator.explore.result import Course, Exploration
from tendonff.compensator.scenario.sampling import sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission

SHOWN = tuple(c for c in COMPENSATORS if c.is_fast)
"""Fast enough to follow a slider; the optimal profile takes seconds: `tendonff design`."""

_MOST_POINTS = 1500


@dataclass(frozen=True, slots=True, kw_only=True)
class ExploreParameters:
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
    def of(cls, transmission: Transmission, level: Level) -> "ExploreParameters":
        """The parameters of a transmission.

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


class Explorer:
    """A scenario to be explored: its reference is sampled once.

    Parameters
    ----------
    scenario : Scenario
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self.start = ExploreParameters.of(scenario.transmission, scenario.run.level)

    def at(self, parameters: ExploreParameters, *, design_knows: bool = True) -> Exploration:
        """Design and simulate with changed parameters.

        Parameters
        ----------
        parameters : ExploreParameters
        design_knows : bool, optional
            The design is made for the changed tendon; else it is made for the scenario's own and tried on the changed
            one, with the changed actuator.

        Raises
        ------
        TendonffError
            When the changed transmission cannot deliver the reference, or a value is out of bounds.
        """
        level = self._scenario.run.level
        plant = parameters.apply(self._scenario.transmission, level)
        model = plant if design_knows else replace(self._scenario.transmission, actuator=plant.actuator)
        problem = Problem(
            transmission=model,
            level=level,
            reference=sample_reference(replace(self._scenario, transmission=model)),
        )
        reference = problem.reference
        rows = slice(None, None, max(1, len(reference.time_s) // _MOST_POINTS))
        notes, slack, courses = [], [], {}
        for compensator in SHOWN:
            profile = with_motion(problem, compensator.name, compensator.profile(problem))
            if profile.status is not ProfileStatus.GOOD:
                notes.append(f"{compensator}: {profile.message}")
            found = verify(plant, SimulatedPlant(level=level), compensator.name, profile, reference)
            if found.slack:
                slack.append(f"{compensator}: {found.slack}")
            courses[compensator.name] = Course(
                time_s=reference.time_s[rows],
                force_N=profile.force_N[rows],
                output_N=found.output_N[rows],
                error_N=(found.output_N - reference.tension_N)[rows],
                score=found.score,
            )
        return Exploration(reference=reference, courses=courses, notes=(*notes, *slack))
