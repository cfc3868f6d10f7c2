"""What the interactive page computes: one scenario with a few parameters changed, designed and simulated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.adapt.setup import tuned_chain, tuning_of
from tendonff.compensator.compensators.base import (
    Compensator,
    FloatArray,
    Problem,
    Profile,
    ProfileStatus,
    Style,
    with_motion,
)
from tendonff.compensator.compensators.optimal import Optimal
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.compensators.score import Score, SimulatedPlant, score, verify
from tendonff.compensator.explore.parameters import ExploreParameters
from tendonff.compensator.reporting.colours import PURPLE
from tendonff.compensator.scenario.sampled.joint_motion import moved
from tendonff.compensator.scenario.sampled.sampling import Reference, sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.settings import Adaptation
from tendonff.models.chain import Chain
from tendonff.models.errors import TendonffError
from tendonff.models.parameters import Transmission
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig
from tendonff.ocp.adaptation.tuning import Sensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """One compensator over time, thinned for the screen."""

    # time_s, force_N, output_N, error_N: shape (n,)
    time_s: FloatArray
    force_N: FloatArray
    output_N: FloatArray
    error_N: FloatArray
    score: Score  # of all rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Exploration:
    """One scenario with a few parameters changed."""

    reference: Reference
    courses: Mapping[str, Course]  # by name of the compensator
    notes: tuple[str, ...]  # what the reader should know, such as a slack tendon


_MOST_POINTS = 1500


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """What the page can show: a compensator, or the one that tunes itself."""

    name: str
    label: str
    style: Style
    compensator: Compensator | None  # None tunes itself to a measurement


FAST = tuple(Curve(name=c.name, label=c.label, style=c.style, compensator=c) for c in COMPENSATORS if c.is_fast)
"""Fast enough to follow a slider."""
SLOW = (
    *(Curve(name=c.name, label=c.label, style=c.style, compensator=c) for c in COMPENSATORS if isinstance(c, Optimal)),
    Curve(name="self_tuning", label="self-tuning inverse", style=Style(color=PURPLE, linestyle="-"), compensator=None),
)
"""These take a second or more, and come when they are asked for."""


class Explorer:
    """A scenario to be explored."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self.start = ExploreParameters.of(scenario)

    def scenario_at(self, parameters: ExploreParameters) -> Scenario:
        """The scenario with changed parameters."""
        return parameters.apply(self._scenario)

    def at(
        self, parameters: ExploreParameters, *, design_knows: bool = True, curves: Sequence[Curve] = FAST
    ) -> Exploration:
        """Design and simulate with changed parameters.

        The design is made for the changed transmission; else for the scenario's own, and tried on the changed one, with
        the changed actuator. TendonffError when the reference cannot be delivered, or a value is out of bounds.
        """
        changed = self.scenario_at(parameters)
        known = self._scenario.transmission
        model = (
            changed
            if design_knows
            else replace(self._scenario, transmission=replace(known, actuator=changed.transmission.actuator))
        )
        problem = replace(Problem.of(model, reference=sample_reference(model)), samples=())
        plant = moved(changed, float(problem.reference.time_s[-1]))
        notes: list[str] = []
        courses = {}
        for curve in curves:
            try:
                courses[curve.name] = _course(problem, plant, curve, self._scenario.adaptation, notes)
            except TendonffError as error:
                if curve in FAST:
                    raise
                notes.append(f"{curve.label}: {error}")
        return Exploration(reference=problem.reference, courses=courses, notes=tuple(notes))


def _course(
    problem: Problem, plant: Transmission, curve: Curve, settings: Adaptation | None, notes: list[str]
) -> Course:
    """One curve on the plant; what the reader should know goes to `notes`."""
    reference = problem.reference
    if curve.compensator is None:
        force, output = _tuned(problem, plant, settings or Adaptation(sensor=Sensor.ACTUATOR_POSITION))
        return _thinned(problem, force, output)
    profile: Profile = with_motion(problem, curve.name, curve.compensator.profile(problem))
    if profile.status is not ProfileStatus.GOOD:
        notes.append(f"{curve.label}: {profile.message}")
    found = verify(plant, SimulatedPlant(level=problem.level), curve.name, profile, reference)
    if found.slack:
        notes.append(f"{curve.label}: {found.slack.message}")
    return _thinned(problem, profile.force_N, found.output_N)


def _tuned(problem: Problem, plant: Transmission, settings: Adaptation) -> tuple[FloatArray, FloatArray]:
    """Force and output tension of the inverse that tunes itself, without noise."""
    reference, tuning = problem.reference, tuning_of(problem, settings)
    step, start = reference.step_s, reference.initial_tension_N
    tuner = SelfTuner(tuned_chain(problem, tuning), step, tuning, problem.limits, start)
    rig = SimulatedRig(Chain.of(plant, problem.level), step, 1, start)
    run = tuner.run(rig, reference.tension_N[1:], np.zeros(len(reference.tension_N) - 1))
    return np.concatenate([[start], run.force_N]), np.concatenate([[start], run.tension_N])


def _thinned(problem: Problem, force_N: FloatArray, output_N: FloatArray) -> Course:
    reference = problem.reference
    rows = slice(None, None, max(1, len(reference.time_s) // _MOST_POINTS))
    return Course(
        time_s=reference.time_s[rows],
        force_N=force_N[rows],
        output_N=output_N[rows],
        error_N=(output_N - reference.tension_N)[rows],
        score=score(reference.tension_N, output_N),
    )
