"""Problem of any scenario, and the compensators that answer it: design, compare, sweep and explore see no more."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.files.reading import InputError, suggestion
from tendonff.compensator.works import function_of
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level

if TYPE_CHECKING:
    from tendonff.compensator.compensators.motors.task import MotorCompensator
    from tendonff.compensator.scenario.driven.finger import FingerScenario
    from tendonff.compensator.scenario.driven.joint import JointScenario
    from tendonff.compensator.scenario.scenario import Scenario

    AnyScenario: TypeAlias = Scenario | JointScenario | FingerScenario
    AnyCompensator: TypeAlias = Compensator | MotorCompensator
else:  # those of driven joints are imported for their own scenarios alone
    AnyScenario = AnyCompensator = Any


def problem_of(scenario: AnyScenario, level: Level | None = None) -> Any:
    """The problem that a scenario poses, a `Problem` or a `MotorTask`; the level by default its own."""
    return function_of("problem", scenario)(scenario, level=level)


def known_to(posed: Any) -> tuple[Any, ...]:
    """Compensators that are for a scenario, or the problem that it poses, as shown; each states its kinds."""
    every = dict.fromkeys((*COMPENSATORS, *function_of("compensators", posed)()))
    return tuple(each for each in every if posed.kind in each.kinds)


def compensator_of(posed: Any, name: str) -> Any:
    """The compensator of a name for a scenario or its problem; InputError if there is none."""
    known = {each.name: each for each in known_to(posed)}
    if name not in known:
        raise InputError(f'this scenario has no compensator "{name}"{suggestion(name, list(known))}')
    return known[name]


def answering(problem: Any) -> tuple[Any, ...]:
    """Compensators that have a meaning for a problem."""
    return tuple(each for each in known_to(problem) if not each.refusal(problem))


def chosen(posed: Any, given: Sequence[AnyCompensator | str]) -> tuple[Any, ...]:
    """Compensators given by themselves or by name; InputError for those that are for another kind of scenario."""
    if isinstance(given, str):
        raise ParameterError(f'compensators must be a list, got "{given}"; write ["{given}"]')
    found = tuple(compensator_of(posed, each) if isinstance(each, str) else each for each in given)
    for each in found:
        if isinstance(each, type):
            raise ParameterError(f"{each.__name__} is a class; give an instance, {each.__name__}()")
        if posed.kind not in getattr(each, "kinds", ()):
            known = ", ".join(one.name for one in known_to(posed))
            raise InputError(f"{each} is no compensator of this scenario; {known} are")
        if not isinstance(getattr(each, "name", None), str):
            raise ParameterError(f'{type(each).__name__} has no name; write name = "mine" in the class')
    return found
