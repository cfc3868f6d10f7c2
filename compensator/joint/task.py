"""A reference of driven joints and the mechanism that designs know, as compensators and studies see them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from tendonff.compensator.compensators.expectation import ErrorBand, Expectation, bands_of, expectation_of
from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.files.progress import Parts
from tendonff.compensator.files.reading import FloatArray, InputError, suggestion
from tendonff.compensator.joint.plant import verifying_masses
from tendonff.compensator.reporting.colours import Style
from tendonff.compensator.scenario.unit import Unit
from tendonff.models.errors import ParameterError, TendonffError
from tendonff.models.fidelity import Level
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method

K = TypeVar("K", bound=Hashable)
R = TypeVar("R")

NEEDED = ("linear", "inverse")
"""Compensators without which there is no design: what the others are compared with, and what sizes the drives."""

ASSUMED_SPREAD = 0.2
"""Relative half-width of what is unknown where [robust] says nothing: friction, stiffness and pre-tension."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reached:
    """Response to commands of the motors.

    Attributes
    ----------
    values : ndarray, shape (n,)
        To compare with the task's `wanted`, in its unit.
    slack : str
        Which tendon goes slack, and when; empty where none does.
    """

    values: FloatArray
    slack: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried(Generic[R]):
    """Compensators that were tried on the verifying mechanism.

    Attributes
    ----------
    commands : dict of str to ndarray, shape (rows, motors)
        By name of the compensator [rad].
    responses : dict of str to object
        Response to each.
    failed : dict of str to str
        Why others have none, by name.
    """

    commands: dict[str, FloatArray]
    responses: dict[str, R]
    failed: dict[str, str]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Failures in words."""
        return tuple(f"{name}: failed: {reason}" for name, reason in self.failed.items())


class MotorCompensator(ABC):
    """Map from a reference of driven joints to the commands of their motors.

    Attributes
    ----------
    name, label : str
        Key in files and on the command line, and name for people.
    style : Style
    knows_the_level : bool
        The commands depend on the fidelity level of the design model.
    """

    name: str
    label: str
    style: Style
    knows_the_level: bool

    @abstractmethod
    def command_rad(self, task: Any) -> FloatArray:
        """Commands of the motors for a task, shape (rows, motors) [rad]."""


class MotorTask(ABC):
    """A reference of driven joints, and the mechanism and level that designs know.

    Attributes
    ----------
    level : Level
    """

    level: Level

    @classmethod
    @abstractmethod
    def of(cls, scenario: Any, level: Level | None = None) -> "MotorTask":
        """The task that a scenario poses; the level by default its own."""

    @property
    @abstractmethod
    def system(self) -> Any:
        """The mechanism."""

    @property
    @abstractmethod
    def compensators(self) -> tuple[MotorCompensator, ...]:
        """Those that have a meaning here, in the order in which they are shown."""

    @property
    @abstractmethod
    def wanted(self) -> FloatArray:
        """Reference, shape (n,); of several joints one after the other, each about the middle of its range."""

    @property
    @abstractmethod
    def time_s(self) -> FloatArray:
        """Instants of `wanted`, shape (n,) [s]; those of several joints follow one another."""

    @property
    @abstractmethod
    def unit(self) -> Unit:
        """Unit of `wanted`."""

    @property
    @abstractmethod
    def share_of(self) -> str:
        """The range, in words, that relative errors are a share of."""

    @property
    @abstractmethod
    def notes(self) -> tuple[str, ...]:
        """Notes on the exact inverse for the user."""

    @property
    @abstractmethod
    def warnings(self) -> tuple[str, ...]:
        """Where the reference was changed."""

    @property
    @abstractmethod
    def doubt(self) -> Doubt[Any]:
        """Mechanisms that may be the real one, by [robust] or, where it states nothing, assumed."""

    @abstractmethod
    def reached(
        self,
        system: Any,
        command_rad: FloatArray,
        *,
        level: Level | None = None,
        masses: int | None = None,
        refinement: int = 1,
        method: Method = Method.BDF2,
    ) -> Reached:
        """Response of a mechanism behind its drives by a method; SolveError or ParameterError where there is none.

        `masses` of each tendon, by default the paths' own, and `refinement` steps to one of the run.
        """

    def doubt_masses(self, system: Any) -> int:
        """Masses of each tendon of a mechanism that may be the real one."""
        return verifying_masses(system)

    def compensator(self, name: str) -> MotorCompensator:
        """The compensator of a name; InputError if there is none."""
        known = [each.name for each in self.compensators]
        if name not in known:
            raise InputError(
                f'driven joints have no compensator "{name}"{suggestion(name, known)}; they have {", ".join(known)}'
            )
        return self.compensators[known.index(name)]

    def tried(self, respond: Callable[[FloatArray], R], parts: Parts) -> "Tried[R]":
        """Commands of all compensators and what `respond` finds for them; one that fails does not end the others.

        SolveError or InputError where one that every design needs has no answer.
        """
        found: Tried[R] = Tried(commands={}, responses={}, failed={})
        for each in self.compensators:
            try:
                command = each.command_rad(self)
                response = respond(command)
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

    def expect(self, commands: Mapping[str, FloatArray]) -> Expectation:
        """Try commands, by name of the compensator, on all mechanisms that may be the real one."""
        bands = self.bands(commands)
        return expectation_of(self.doubt, self.level, bands, share_of=self.share_of, unit=self.unit)

    @property
    def live_command_rad(self) -> FloatArray:
        """Commands of the exact inverse where the reference arrives live, shape (rows, motors)."""
        return self.compensator("inverse").command_rad(self)

    def expect_live(self) -> Expectation:
        """Errors of the exact inverse over all mechanisms that may be the real one, the reference being known live."""
        plain = self.compensator("linear").command_rad(self)
        bands = self.bands({"inverse": self.live_command_rad, "linear": plain})
        return expectation_of(
            self.doubt, self.level, bands, share_of=self.share_of, unit=self.unit, recommended="inverse"
        )

    def bands(self, commands: Mapping[K, FloatArray]) -> dict[K, ErrorBand]:
        """Errors of commands on all mechanisms that may be the real one."""

        def respond(system: Any, command: FloatArray) -> tuple[FloatArray, bool]:
            try:
                found = self.reached(system, command, masses=self.doubt_masses(system))
            except (SolveError, ParameterError, InputError):
                return np.full_like(self.wanted, np.nan), False
            return found.values, bool(found.slack)

        return bands_of(self.doubt, self.wanted, commands, respond, np.ndarray.tobytes)
