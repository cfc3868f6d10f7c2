"""Compensators of driven joints: maps from what is wanted to the commands of the motors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.motors.finger import FingerTask, without_friction
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.response import MotorResponse
from tendonff.compensator.compensators.motors.task import MotorTask
from tendonff.compensator.files.progress import Parts
from tendonff.compensator.files.reading import FloatArray, InputError, suggestion
from tendonff.compensator.reporting.colours import BLUE, GREEN, GREY, ORANGE, PURPLE, Style
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.kind import Kind
from tendonff.models.errors import TendonffError
from tendonff.models.fidelity import Level

NEEDED = ("linear", "inverse")
"""Compensators without which there is no design: what the others are compared with, and what sizes the drives."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorCompensator:
    """Map from what is wanted of driven joints to the commands of their motors.

    Attributes
    ----------
    name, label : str
        Key in files and on the command line, and name for people.
    style : Style
    motor_rad : callable
        Angles of the motors behind their drives for a task, shape (rows, motors) [rad].
    knows_the_level : bool
        They depend on the fidelity level of the design model.
    knows_the_drive : bool
        Servo lag and gear backlash are taken back.
    refusal : callable
        Why it has no meaning for a task; empty where it has one.
    """

    name: str
    label: str
    style: Style
    motor_rad: Callable[[MotorTask], FloatArray]
    knows_the_level: bool = True
    knows_the_drive: bool = True
    refusal: Callable[[MotorTask], str] = lambda _: ""

    def command_rad(self, task: MotorTask) -> FloatArray:
        """Commands of the motors, shape (rows, motors) [rad]."""
        return task.commanded(self.motor_rad(task), by_ratio=not self.knows_the_drive)

    def __str__(self) -> str:
        return self.name


MOTOR_COMPENSATORS = (
    MotorCompensator(
        name="linear",
        label="ratio alone",
        style=Style(color=GREY, linestyle=":"),
        motor_rad=lambda task: task.lengths_rad,
        knows_the_level=False,
        knows_the_drive=False,
    ),
    MotorCompensator(
        name="stretch",
        label="lengths and elasticity",
        style=Style(color=GREEN, linestyle="--"),
        motor_rad=lambda task: task.with_system(without_friction(task.system)).inversion.motor_rad,
        refusal=lambda task: "" if task.goal.is_named else "it is for several joints",
    ),
    MotorCompensator(
        name="static",
        label="quasi-static law",
        style=Style(color=ORANGE, linestyle="-."),
        motor_rad=lambda task: task.static_rad,
        knows_the_level=False,
        refusal=lambda task: "where joints without a reference go is not unique" if task.follows else "",
    ),
    MotorCompensator(
        name="inverse",
        label="exact inverse",
        style=Style(color=BLUE, linestyle="-"),
        motor_rad=lambda task: task.inversion.motor_rad,
    ),
    MotorCompensator(
        name="robust",
        label="inverse, middle compliance",
        style=Style(color=PURPLE, linestyle="--"),
        motor_rad=lambda task: task.with_system(task.middle or task.system).inversion.motor_rad,
        refusal=lambda task: "" if task.middle is not None else "[robust] states no doubt of a stiffness",
    ),
)
"""In the order in which they are shown; a further one is a further entry, for one joint and for several."""


def task_of(scenario: JointScenario | FingerScenario, level: Level | None = None) -> MotorTask:
    """The task of a scenario; the level by default its own."""
    kinds: dict[Kind, type[MotorTask]] = {Kind.JOINT: JointTask, Kind.FINGER: FingerTask}
    return kinds[scenario.kind].of(scenario, level)


def motor_compensators(task: MotorTask) -> tuple[MotorCompensator, ...]:
    """Those that have a meaning for a task."""
    return tuple(each for each in MOTOR_COMPENSATORS if not each.refusal(task))


def motor_compensator(task: MotorTask, name: str) -> MotorCompensator:
    """The compensator of a name; InputError if a task has none."""
    known = {each.name: each for each in motor_compensators(task)}
    if name not in known:
        raise InputError(
            f'driven joints have no compensator "{name}"{suggestion(name, list(known))}; they have {", ".join(known)}'
        )
    return known[name]


def chosen(task: MotorTask, given: Sequence[MotorCompensator | str] | None) -> tuple[MotorCompensator, ...]:
    """Compensators given by themselves or by name, all by default; InputError for those without meaning for a task."""
    if given is None:
        return motor_compensators(task)
    found = tuple(motor_compensator(task, each) if isinstance(each, str) else each for each in given)
    for each in found:
        if not isinstance(each, MotorCompensator) or each.refusal(task):
            known = ", ".join(one.name for one in motor_compensators(task))
            raise InputError(f"{each} is no compensator of these joints; {known} are")
    if missing := [name for name in NEEDED if name not in [each.name for each in found]]:
        raise InputError(f"compensators must include {' and '.join(NEEDED)}, {' and '.join(missing)} is missing")
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """Compensators that were tried on the verifying mechanism.

    Attributes
    ----------
    commands : dict of str to ndarray, shape (rows, motors)
        By name of the compensator [rad].
    responses : dict of str to MotorResponse
        Response to each.
    failed : dict of str to str
        Why others have none, by name.
    """

    commands: dict[str, FloatArray]
    responses: dict[str, MotorResponse]
    failed: dict[str, str]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Failures in words."""
        return tuple(f"{name}: failed: {reason}" for name, reason in self.failed.items())


def tried(task: MotorTask, compensators: Sequence[MotorCompensator], parts: Parts) -> Tried:
    """Commands of compensators and what the verifying mechanism makes of them; one that fails does not end the others.

    SolveError or InputError where one that every design needs has no answer.
    """
    found = Tried(commands={}, responses={}, failed={})
    for each in compensators:
        try:
            command = each.command_rad(task)
            response = task.respond(task.system, command, masses=task.masses, refinement=task.refinement)
        except (TendonffError, ArithmeticError, np.linalg.LinAlgError) as error:
            if each.name in NEEDED:
                raise
            found.failed[each.name] = (
                str(error) if isinstance(error, TendonffError) else f"{type(error).__name__}: {error}"
            )
        else:
            found.commands[each.name], found.responses[each.name] = command, response
        parts.done()
    return found
