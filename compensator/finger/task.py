"""The task that a scenario of driven joints poses, whether they are one or several."""

from collections.abc import Mapping

from tendonff.compensator.finger.compensators import FingerTask
from tendonff.compensator.finger.scenario import FingerScenario
from tendonff.compensator.joint.compensators import JointTask
from tendonff.compensator.joint.scenario.scenario import JointScenario
from tendonff.compensator.joint.task import MotorTask
from tendonff.compensator.scenario.kind import Kind
from tendonff.models.fidelity import Level

_TASKS: Mapping[Kind, type[MotorTask]] = {Kind.JOINT: JointTask, Kind.FINGER: FingerTask}


def task_of(scenario: JointScenario | FingerScenario, level: Level | None = None) -> MotorTask:
    """The task of a scenario; the level by default its own."""
    return _TASKS[scenario.kind].of(scenario, level)
