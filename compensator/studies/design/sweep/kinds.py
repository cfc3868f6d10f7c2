"""The two kinds of scenario that are swept: the tension of one tendon, and joints between tendons."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from tendonff.compensator.compensators.base import Compensator, Problem, with_motion
from tendonff.compensator.compensators.expectation import Expectation, expect
from tendonff.compensator.compensators.motors.registry import (
    MotorCompensator,
    motor_compensator,
    motor_compensators,
    task_of,
)
from tendonff.compensator.compensators.motors.task import MotorTask
from tendonff.compensator.compensators.plant import FINE_SEGMENTS, Plant
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.compensators.registry import COMPENSATORS, compensator
from tendonff.compensator.compensators.score import Score, score, verify
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.kind import Kind as OfScenario
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.compensator.scenario.unit import Unit
from tendonff.ocp.errors import SolveError

MotorScenario = JointScenario | FingerScenario
AnyScenario = Scenario | MotorScenario


class Kind(ABC):
    """Operations of a sweep on a kind of scenario."""

    @abstractmethod
    def default(self, scenario: Any) -> tuple[str, ...]:
        """Names of the compensators that are scored by default."""

    @abstractmethod
    def compensator(self, scenario: Any, name: str) -> Compensator | MotorCompensator:
        """The compensator of a name; InputError if there is none."""

    @abstractmethod
    def system(self, scenario: Any) -> Any:
        """The transmission or the mechanism."""

    @abstractmethod
    def with_system(self, scenario: Any, system: Any, numbers: Mapping[str, float]) -> Any:
        """The scenario with another one, in which these numbers differ."""

    @abstractmethod
    def digest(self, scenario: Any) -> str:
        """Digits that change with the scenario."""

    @abstractmethod
    def unit(self, scenario: Any) -> Unit:
        """Unit of the reference."""

    @abstractmethod
    def problem(self, scenario: Any) -> Any:
        """The problem that a scenario poses."""

    @abstractmethod
    def profile(self, name: str, problem: Any) -> Any:
        """Profile of a compensator; SolveError where it has none."""

    @abstractmethod
    def score(self, name: str, problem: Any, profile: Any) -> Score:
        """Error of a profile on the plant of a problem; SolveError if the simulation fails."""

    @abstractmethod
    def expect(self, problem: Any, profiles: Mapping[str, Any]) -> Expectation:
        """Errors of profiles, by name, over the scenario's uncertainty."""


class _Tension(Kind):
    def default(self, scenario: Scenario) -> tuple[str, ...]:  # noqa: ARG002
        return tuple(c.name for c in COMPENSATORS if c.name != "table")

    def compensator(self, scenario: Scenario, name: str) -> Compensator:  # noqa: ARG002
        return compensator(name)

    def system(self, scenario: Scenario) -> object:
        return scenario.transmission

    def with_system(self, scenario: Scenario, system: Any, numbers: Mapping[str, float]) -> Scenario:  # noqa: ARG002
        return replace(scenario, transmission=system)

    def digest(self, scenario: Scenario) -> str:
        return scenario_hash(scenario)

    def unit(self, scenario: Scenario) -> Unit:
        return scenario.reference.unit

    def problem(self, scenario: Scenario) -> Problem:
        return Problem.of(scenario, reference=sample_reference(scenario, strict=False))

    def profile(self, name: str, problem: Problem) -> Profile:
        each = compensator(name)
        if reason := each.refusal(problem):
            raise SolveError(f"{name}: {reason}")
        return with_motion(problem, name, each.profile(problem)).require()

    def score(self, name: str, problem: Problem, profile: Profile) -> Score:
        plant = Plant(problem.transmission, problem.level, FINE_SEGMENTS)
        return verify(plant, name, profile, problem.reference).score

    def expect(self, problem: Problem, profiles: Mapping[str, Profile]) -> Expectation:
        return expect(problem.doubt, problem.level, profiles, problem.reference)


class _Motors(Kind):
    def default(self, scenario: MotorScenario) -> tuple[str, ...]:
        return tuple(each.name for each in motor_compensators(task_of(scenario)))

    def compensator(self, scenario: MotorScenario, name: str) -> MotorCompensator:
        return motor_compensator(task_of(scenario), name)

    def system(self, scenario: MotorScenario) -> object:
        return scenario.mechanism

    def with_system(self, scenario: MotorScenario, system: Any, numbers: Mapping[str, float]) -> MotorScenario:
        return replace(scenario, mechanism=system, changed={**scenario.changed, **numbers})

    def digest(self, scenario: MotorScenario) -> str:
        return scenario.digest()

    def unit(self, scenario: MotorScenario) -> Unit:
        return scenario.goal.unit

    def problem(self, scenario: MotorScenario) -> MotorTask:
        return task_of(scenario)

    def profile(self, name: str, problem: MotorTask) -> FloatArray:
        return motor_compensator(problem, name).command_rad(problem)

    def score(self, name: str, problem: MotorTask, profile: FloatArray) -> Score:  # noqa: ARG002
        response = problem.respond(problem.system, profile, masses=problem.masses)
        return score(problem.wanted, problem.values_of(response))

    def expect(self, problem: MotorTask, profiles: Mapping[str, FloatArray]) -> Expectation:
        return problem.expect(profiles)


_MOTORS = _Motors()
_KINDS: Mapping[OfScenario, Kind] = {
    OfScenario.TENSION: _Tension(),
    OfScenario.JOINT: _MOTORS,
    OfScenario.FINGER: _MOTORS,
}


def kind_of(scenario: AnyScenario) -> Kind:
    """Kind of a scenario."""
    return _KINDS[scenario.kind]


def named(scenario: AnyScenario, names: Sequence[str]) -> dict[str, Compensator | MotorCompensator]:
    """Compensators by their names."""
    return {name: kind_of(scenario).compensator(scenario, name) for name in names}
