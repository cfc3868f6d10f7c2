"""Compensators of driven joints: maps from what is wanted to the commands of the motors."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.motors.finger import without_friction
from tendonff.compensator.compensators.motors.response import MotorResponse
from tendonff.compensator.compensators.motors.task import MotorCompensator, MotorTask
from tendonff.compensator.files.progress import Parts
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.reporting.colours import BLUE, GREEN, GREY, ORANGE, PURPLE, Style
from tendonff.models.errors import TendonffError

NEEDED = ("linear", "inverse")
"""Compensators without which there is no design: what the others are compared with, and what sizes the drives."""


MOTOR_COMPENSATORS = (
    MotorCompensator(
        name="linear",
        label="ratio alone",
        style=Style(color=GREY, linestyle=":"),
        profile=lambda task: task.lengths_rad,
        knows_the_level=False,
        knows_the_drive=False,
    ),
    MotorCompensator(
        name="stretch",
        label="lengths and elasticity",
        style=Style(color=GREEN, linestyle="--"),
        profile=lambda task: task.inverse_of(without_friction(task.system)),
        refusal=lambda task: "" if task.goal.is_named else "it is for several joints",
    ),
    MotorCompensator(
        name="static",
        label="quasi-static law",
        style=Style(color=ORANGE, linestyle="-."),
        profile=lambda task: task.static_rad,
        knows_the_level=False,
        refusal=lambda task: "where joints without a reference go is not unique" if task.follows else "",
    ),
    MotorCompensator(
        name="inverse",
        label="exact inverse",
        style=Style(color=BLUE, linestyle="-"),
        profile=lambda task: task.inversion.motor_rad,
    ),
    MotorCompensator(
        name="robust",
        label="inverse, middle compliance",
        style=Style(color=PURPLE, linestyle="--"),
        profile=lambda task: task.inverse_of(task.middle or task.system),
        refusal=lambda task: "" if task.middle is not None else "[robust] states no doubt of a stiffness",
    ),
)
"""In the order in which they are shown; a further one is a further entry, for one joint and for several."""


def known() -> tuple[MotorCompensator, ...]:
    """All of them."""
    return MOTOR_COMPENSATORS


def require_needed(task: MotorTask, found: Sequence[MotorCompensator]) -> None:
    """Refuse compensators without meaning for a task, or without those that every design needs; InputError."""
    for each in found:
        if reason := each.refusal(task):
            raise InputError(f"{each} is no compensator of this scenario: {reason}")
    if missing := [name for name in NEEDED if name not in [each.name for each in found]]:
        raise InputError(f"compensators must include {' and '.join(NEEDED)}, {' and '.join(missing)} is missing")


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
            command = task.answer(each)
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
