"""Problem of any scenario, and the compensators that answer it: design, compare, sweep and explore see no more."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from tendonff.compensator.compensators.base import Compensator, Problem
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.registry import MOTOR_COMPENSATORS
from tendonff.compensator.compensators.motors.task import MotorCompensator
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.files.reading import InputError, suggestion
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.kind import Kind
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level

AnyScenario: TypeAlias = Scenario | JointScenario | FingerScenario
AnyCompensator: TypeAlias = Compensator | MotorCompensator

EVERY: tuple[AnyCompensator, ...] = (*COMPENSATORS, *MOTOR_COMPENSATORS)
"""Every compensator, in the order in which they are shown."""

_PROBLEM: Mapping[Kind, Callable[..., Any]] = {
    Kind.TENSION: Problem.of,
    Kind.JOINT: JointTask.of,
    Kind.FINGER: FingerTask.of,
}


def problem_of(scenario: AnyScenario, level: Level | None = None) -> Any:
    """The problem that a scenario poses, a `Problem` or a `MotorTask`; the level by default its own."""
    return _PROBLEM[scenario.kind](scenario, level=level)


def compensator_of(kind: Kind, name: str) -> Any:
    """The compensator of a name for scenarios of a kind; InputError if there is none."""
    known = {each.name: each for each in EVERY if kind in each.kinds}
    if name not in known:
        raise InputError(f'this scenario has no compensator "{name}"{suggestion(name, list(known))}')
    return known[name]


def answering(problem: Any) -> tuple[Any, ...]:
    """Compensators that have a meaning for a problem."""
    return tuple(each for each in EVERY if problem.kind in each.kinds and not each.refusal(problem))


def chosen(kind: Kind, given: Sequence[AnyCompensator | str]) -> tuple[Any, ...]:
    """Compensators given by themselves or by name; InputError for those of another kind of scenario."""
    if isinstance(given, str):
        raise ParameterError(f'compensators must be a list, got "{given}"; write ["{given}"]')
    found = tuple(compensator_of(kind, each) if isinstance(each, str) else each for each in given)
    for each in found:
        if isinstance(each, type):
            raise ParameterError(f"{each.__name__} is a class; give an instance, {each.__name__}()")
        if kind not in getattr(each, "kinds", ()):
            known = ", ".join(one.name for one in EVERY if kind in one.kinds)
            raise InputError(f"{each} is no compensator of this scenario; {known} are")
        if not isinstance(getattr(each, "name", None), str):
            raise ParameterError(f'{type(each).__name__} has no name; write name = "mine" in the class')
    return found
