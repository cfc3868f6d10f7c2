"""A module of exported C as one record: what goes in and out, its fixed text, its numbers, and what it must answer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.compensators.motors.task import MotorTask
from tendonff.compensator.files.reading import FloatArray
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.joint.target import ConstantData

ENDED, SPEED_LIMITED = 64, 4
"""Status bits of modules: the end of the commands was reached, the speed of a motor binds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """A number that goes into a module.

    Attributes
    ----------
    name : str
        In C, with its unit.
    text : str
        Meaning.
    unit : str
    """

    name: str
    text: str
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Designed:
    """A joint or finger that is exported, and what its design gives.

    Attributes
    ----------
    task : JointTask or FingerTask
    motor_rad : ndarray, shape (rows, motors)
        Angles of the motors along the reference by the exact inverse [rad]; of a cycle, those of its steady state.
    """

    task: MotorTask
    motor_rad: FloatArray

    @property
    def motors(self) -> int:
        """Number of motors."""
        return len(self.task.motors)


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """Numbers of a module for one joint or finger, and golden vectors.

    Attributes
    ----------
    record : list of str
        Fields of its record in C.
    given : ndarray, shape (rows, inputs)
        The first row is for `init`.
    command_rad : ndarray, shape (rows, motors)
        Answers [rad]; the first row is where `init` leaves it.
    status : ndarray, shape (rows,)
        Bits of each answer.
    reference_rad : ndarray, shape (rows, motors), optional
        Commands along the reference, to be judged beside the ratio; default: they are those of the inverse.
    """

    record: list[str]
    given: FloatArray
    command_rad: FloatArray
    status: NDArray[np.int64]
    reference_rad: FloatArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Module:
    """A module whose output is a command of every motor; `MotorTask.without` says who has none.

    Header, README, build files and the unit for co-simulation are made from this record; the fixed text of its
    functions is `core/tff_NAME.c`, that of its record `core/tff_NAME_record.h`.

    Attributes
    ----------
    name : str
    content : str
        What it is, for lists.
    about : tuple of str
        Lines for the header.
    inputs : tuple of Port
    state : tuple of str
        Private members of its state in C, with {prefix} and {guard}.
    build : callable
        Its content for a joint or finger; arrays go into the constant data.
    """

    name: str
    content: str
    about: tuple[str, ...]
    inputs: tuple[Port, ...] = ()
    state: tuple[str, ...]
    build: Callable[[Designed, ConstantData], Content]

    @property
    def call(self) -> str:
        """Arguments of a step beside its state."""
        return "".join(f", {port.name}" for port in self.inputs)


@dataclass(frozen=True, slots=True, kw_only=True)
class Exports:
    """Modules that an export has beside the inverse.

    Attributes
    ----------
    files : dict of str to str
        Text by file name.
    modules : tuple of Module
    refused : dict of str to str
        Why others are left out, by name.
    errors : dict of str to str
        RMS errors of those that are judged, by name.
    harmful : tuple of str
        Those that are left out since the ratio alone is better.
    """

    files: dict[str, str]
    modules: tuple[Module, ...]
    refused: dict[str, str]
    errors: dict[str, str]
    harmful: tuple[str, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Modules that are left out since they do harm."""
        return tuple(f"the module {name} is left out: {self.refused[name]}" for name in self.harmful)

    def into(self, context: dict[str, Any]) -> dict[str, Any]:
        """Values for the templates of an export with these modules too."""
        names = [module.name for module in self.modules]
        return context | {
            "modules": [*context["modules"], *names],
            "headers": [*context["headers"], *(name for name in self.files if name.endswith(".h"))],
            "further": [
                {"name": m.name, "content": m.content, "call": m.call, "error": self.errors.get(m.name, "")}
                for m in self.modules
            ],
            "refused": self.refused,
        }


def tolerance_rad(content: Content, precision: Precision) -> float:
    """Largest difference of a command from its golden vector: 1e-10 of its range, in float 5e-6."""
    share = 1e-10 if precision is Precision.DOUBLE else 5e-6
    return share * max(float(np.ptp(content.command_rad)), 1e-3)
