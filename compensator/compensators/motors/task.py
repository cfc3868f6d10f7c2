"""A reference of driven joints and the mechanism that designs know, as compensators and studies see them."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self, TypeVar, cast

import numpy as np

from tendonff.compensator.compensators.expectation import (
    Behind,
    ErrorBand,
    Expectation,
    bands_of,
    behind_drives,
    expectation_of,
)
from tendonff.compensator.compensators.motors.drive import commanded, known_by_ratio
from tendonff.compensator.compensators.motors.response import MotorResponse, Turned
from tendonff.compensator.compensators.score import Score, score
from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.reporting.colours import Style
from tendonff.compensator.scenario.driven.finger import SampledFinger
from tendonff.compensator.scenario.goal import Given, Goal
from tendonff.compensator.scenario.kind import Kind
from tendonff.compensator.scenario.unit import Unit
from tendonff.models.cached import cached_property
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import JointDrive, Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.parameters.uncertainty import Objective, Uncertainty
from tendonff.models.path import JointMotion
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method

K = TypeVar("K", bound=Hashable)
S = TypeVar("S", Mechanism, Finger)

ASSUMED_SPREAD = 0.2
"""Relative half-width of what is unknown where [robust] says nothing: friction, stiffness and pre-tension."""

VERIFYING_MASSES = 40
"""Masses of each tendon of the mechanism that commands are judged on, at least."""

_WAVE_STEP = 0.14
"""Largest step that follows waves, as an angle of the slowest wave between the ends of a tendon [rad]."""

UNSETTLED = "the cycle still changes"
"""Begin of the message of a run whose last two cycles differ."""


class MotorTask(ABC):
    """A reference of driven joints, and the mechanism and level that designs know.

    Joints and fingers differ in the engine that inverts and simulates them, and in what their files can say.

    Attributes
    ----------
    scenario : JointScenario or FingerScenario
    sampled : SampledJoint or SampledFinger
        Its reference.
    level : Level
    """

    scenario: Any
    sampled: Any
    level: Level

    given_as: ClassVar[Given | None] = None  # of several motors there is no one
    plain: ClassVar[str] = "linear"  # compensator that others are compared with
    is_stepwise: ClassVar[bool] = False  # live, the rate of a motor is known from the samples so far alone
    tunes_itself: ClassVar[bool] = False  # `adapt` runs its tuner

    refinement: int
    """Steps of the verifying mechanism in one of the design."""

    @classmethod
    @abstractmethod
    def of(cls, scenario: Any, level: Level | None = None) -> Self:
        """The task that a scenario poses; the level by default its own."""

    @property
    @abstractmethod
    def system(self) -> Any:
        """The mechanism."""

    @abstractmethod
    def with_system(self, system: Any) -> Self:
        """The same for another mechanism."""

    def on_rig(self, scenario: Any) -> Self:
        """The same reference on what another scenario describes, with its uncertainty."""
        return self if scenario is self.scenario else self.of(scenario, self.level)

    @property
    def nominal(self) -> Self:
        """The same: no answer of it depends on the uncertainty but by name."""
        return self

    def given_of(self, command_rad: FloatArray) -> FloatArray | None:  # noqa: ARG002
        """Given to the drive, at the rows of `wanted`, as `given_as` says, shape (n,); None for several."""
        return None

    @property
    def kind(self) -> Kind:
        """Kind of its scenario."""
        found: Kind = self.scenario.kind
        return found

    def answer(self, compensator: "MotorCompensator") -> FloatArray:
        """Commands of a compensator, shape (rows, motors) [rad]; SolveError or InputError where it has none."""
        return self.commanded(compensator.profile(self), by_ratio=not compensator.knows_the_drive)

    def inverse_of(self, system: Any) -> FloatArray:
        """Angles by the exact inverse of another mechanism, shape (rows, motors) [rad]."""
        found: FloatArray = self.with_system(system).inversion.motor_rad
        return found

    def tried(self, compensator: "MotorCompensator", progress: Progress = silent) -> FloatArray:  # noqa: ARG002
        """Commands of a compensator; see `answer`."""
        return self.answer(compensator)

    @property
    def plants(self) -> tuple[str, ...]:
        """Names of what commands are compared on: the levels."""
        return tuple(level.value for level in Level)

    def given(self, command_rad: FloatArray) -> bytes:
        """Identity of commands."""
        return command_rad.tobytes()

    def fault(self, command_rad: FloatArray) -> str:  # noqa: ARG002
        """Empty: commands have no status."""
        return ""

    def is_usable(self, command_rad: FloatArray) -> bool:
        """Whether commands are finite."""
        return bool(np.isfinite(command_rad).all())

    def output_on(
        self, plant: str, command_rad: FloatArray, *, refinement: int = 1, factor: float = 1.0
    ) -> tuple[FloatArray, str]:
        """Output on a level, shape (n,), and which tendon goes slack; commands times a factor; errors of `respond`."""
        found = self.respond(self.system, factor * command_rad, level=Level(plant), refinement=refinement)
        return self.values_of(found), found.slack

    def slack_notes(self, slack: Mapping[tuple[str, str], str], recommended: str) -> list[str]:  # noqa: ARG002
        """Messages on slack by compensator and plant."""
        return [f"{name} on {plant}: {text}" for (name, plant), text in slack.items()]

    def score(self, command_rad: FloatArray) -> Score:
        """Error of commands, shape (rows, motors), on the verifying mechanism; SolveError if the simulation fails."""
        response = self.respond(self.system, command_rad, masses=self.masses)
        return score(self.wanted, self.values_of(response))

    @property
    def goal(self) -> Goal:
        """Goal: quantity, unit, and names of the joints."""
        found: Goal = self.scenario.goal
        return found

    @property
    def unit(self) -> Unit:
        """Unit of what is wanted."""
        return self.goal.unit

    @property
    def share_of(self) -> str:
        """The range, in words, that relative errors are a share of."""
        return self.goal.range

    @property
    def step_s(self) -> float:
        """Step of the run [s]."""
        return float(self.scenario.run.step_s)

    @property
    def lead(self) -> int:
        """Rows of a homing stroke, which come first."""
        return 0

    @property
    @abstractmethod
    def is_periodic(self) -> bool:
        """The reference is one period of a cycle."""

    @property
    @abstractmethod
    def target(self) -> FloatArray:
        """Wanted values after the homing stroke, shape (rows, goals)."""

    @property
    def target_time_s(self) -> FloatArray:
        """Its instants, shape (rows,) [s]."""
        time: FloatArray = self.sampled.time_s
        found: FloatArray = time[self.lead :] - time[self.lead]
        return found

    @cached_property
    def _middle(self) -> FloatArray | float:
        """Values that the goals are counted from, so that the largest range is that of all."""
        return 0.5 * (self.target.max(axis=0) + self.target.min(axis=0)) if self.goal.is_named else 0.0

    @cached_property
    def wanted(self) -> FloatArray:
        """Target, shape (n,); of several goals one after the other, each about the middle of its range."""
        return (self.target - self._middle).T.ravel()

    def values_of(self, response: MotorResponse) -> FloatArray:
        """Output of a response after the homing stroke, to compare with `wanted`, shape (n,)."""
        return (response.output[self.lead :] - self._middle).T.ravel()

    @property
    def time_s(self) -> FloatArray:
        """Instants of `wanted`, shape (n,) [s]; those of several goals follow one another."""
        rows = self.target_time_s
        return np.concatenate([rows + k * (rows[-1] + self.step_s) for k in range(self.target.shape[1])])

    @abstractmethod
    def by_motor(self) -> tuple[Finger, SampledFinger]:
        """The mechanism with every motor by itself, and the reference so; InputError where one motor drives it all."""

    @property
    @abstractmethod
    def motors(self) -> tuple[str, ...]:
        """Names of the motors."""

    @property
    @abstractmethod
    def drives(self) -> tuple[JointDrive, ...]:
        """Drive of each motor."""

    @property
    @abstractmethod
    def inversion(self) -> MotorResponse:
        """The exact inverse before the drives; SolveError or InputError where there is none."""

    @property
    @abstractmethod
    def lengths_rad(self) -> FloatArray:
        """Angles of the motors by the lengths of the tendons alone, shape (rows, motors)."""

    @property
    @abstractmethod
    def static_rad(self) -> FloatArray:
        """Angles of the motors by the quasi-static law, shape (rows, motors)."""

    @property
    def follows(self) -> bool:
        """Some joints have no reference and follow from their balances."""
        return False

    @abstractmethod
    def respond(
        self,
        system: Any,
        command_rad: FloatArray,
        *,
        level: Level | None = None,
        masses: int | None = None,
        refinement: int = 1,
        method: Method = Method.BDF2,
    ) -> MotorResponse:
        """Response of a mechanism behind its drives to commands, shape (rows, motors); of a cycle in its steady state.

        `masses` of each tendon, by default the paths' own; `refinement` steps to one of the run. SolveError or
        ParameterError where it fails.
        """

    @abstractmethod
    def turned(self, drums_rad: FloatArray, *, parts: int = 1, method: Method = Method.BDF2) -> Turned:
        """Motion from where the reference starts, under drums whose rows are so many parts of a step apart.

        `drums_rad` has the shape (rows, motors). SolveError where it fails.
        """

    @property
    def without(self) -> Mapping[str, str]:
        """Modules of exported C that it cannot have, and the physical reason."""
        return {
            "capstan": "the capstan law gives the ratio of two tensions, and a motor's angle needs their stretch too",
            "bounds": "friction bounds a tension by that of the near end; the angle of a joint hangs on its load too",
        }

    @property
    def without_homing(self) -> Self:
        """The same without a homing stroke: a file says what is turned."""
        return self

    def with_motion(self, motion: JointMotion) -> Self:
        """The same while the joints that no tendon drives move otherwise."""
        found: Self = replace(cast(Any, self), sampled=replace(self.sampled, motion=motion))
        return found

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the motors in columns: the only one of a loop has none."""
        return self.motors

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the exact inverse for the user."""
        return ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Where the reference was changed."""
        return ()

    @property
    def refusal(self) -> str:
        """Why a strict design refuses the reference; empty where it does not."""
        return ""

    def check_reach(self) -> None:
        """Refuse a motion whose torques no tensions give."""
        return

    @property
    @abstractmethod
    def doubt(self) -> Doubt[Any]:
        """Mechanisms that may be the real one, by [robust] or, where it states nothing, assumed."""

    @cached_property
    def middle(self) -> Any:
        """The mechanism of the middle compliances; None where [robust] states no doubt of a stiffness."""
        return middle_compliance(self.system, self.scenario.robust)

    @property
    def masses(self) -> int:
        """Masses of each tendon of the mechanism that commands are judged on."""
        return verifying_masses(self.system)

    def doubt_masses(self, system: Any) -> int:
        """Masses of each tendon of a mechanism that may be the real one."""
        return verifying_masses(system)

    def commanded(self, motor_rad: FloatArray, *, by_ratio: bool = False, live: bool = False) -> FloatArray:
        """Commands whose answer are these angles, shape (rows, motors); by ratio, nothing else is known of the drives.

        Live, the rate of a motor is known from the samples so far alone, as on a controller.
        """
        columns = [
            commanded(known_by_ratio(drive) if by_ratio else drive, column[:, None], self.step_s, live=live)[:, 0]
            for drive, column in zip(self.drives, motor_rad.T, strict=True)
        ]
        return np.column_stack(columns)

    def answer_live(self, compensator: "MotorCompensator") -> FloatArray:
        """Commands of a compensator where the reference arrives live, shape (rows, motors) [rad]."""
        return self.commanded(compensator.profile(self), live=self.is_stepwise)

    @property
    def change(self) -> str:
        """Change with which a reference comes into reach: none is known before motors are simulated."""
        return ""

    def expect(self, commands: Mapping[str, FloatArray], recommended: str | None = None) -> Expectation:
        """Try commands, by name of the compensator, on all mechanisms that may be the real one."""
        bands = self.bands(commands)
        found = expectation_of(self.doubt, self.level, bands, self.share_of, self.unit, recommended)
        return replace(found, behind=self.behind(found.best))

    def behind(self, band: ErrorBand) -> tuple[Behind, ...]:
        """Errors of commands behind drives of each class, where lag and delay are not stated."""
        return behind_drives(
            self.doubt, self.wanted, band, self.step_s, self.target.shape[1], periodic=self.is_periodic
        )

    def bands(self, commands: Mapping[K, FloatArray]) -> dict[K, ErrorBand]:
        """Errors of commands on all mechanisms that may be the real one."""
        given = np.ndarray.tobytes
        jumps = any(drive.servo.jumps(self.step_s) for drive in self.drives)
        shaken = self._shaken if jumps else None
        return bands_of(self.doubt, self.wanted, commands, self._judged, given, self._known_bands, shaken)

    def _shaken(self, system: Any, command_rad: FloatArray) -> FloatArray:
        """Output of commands in steps that follow the waves of the tendons; NaN where it cannot be simulated."""
        fastest = max(math.pi * math.sqrt(t.tendon.stiffness_N_per_m / t.tendon.mass_kg) for t in system.tendons)
        refinement = math.ceil(self.step_s * fastest / _WAVE_STEP)
        try:
            return self.values_of(self.respond(system, command_rad, refinement=refinement))
        except (SolveError, ParameterError, InputError):
            return np.full_like(self.wanted, np.nan)

    def _judged(self, system: Any, command_rad: FloatArray) -> tuple[FloatArray, bool]:
        """Output of commands on a mechanism that may be the real one, and whether a tendon went slack."""
        try:
            found = self.respond(system, command_rad, masses=self.doubt_masses(system))
        except (SolveError, ParameterError, InputError):
            return np.full_like(self.wanted, np.nan), False
        return self.values_of(found), not found.is_taut

    @cached_property
    def _known_bands(self) -> dict[bytes, ErrorBand]:
        return {}


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorCompensator:
    """Map from what is wanted of driven joints to the commands of their motors.

    Attributes
    ----------
    kinds : tuple of Kind
        Kinds of scenario that it is for.
    name, label : str
        Key in files and on the command line, and name for people.
    style : Style
    profile : callable
        Angles of the motors behind their drives for a task, shape (rows, motors) [rad].
    knows_the_level : bool
        They depend on the fidelity level of the design model.
    knows_the_drive : bool
        Servo lag and gear backlash are taken back.
    refusal : callable
        Why it has no meaning for a task; empty where it has one.
    """

    kinds: ClassVar[tuple[Kind, ...]] = (Kind.JOINT, Kind.FINGER)
    is_fast: ClassVar[bool] = True
    is_swept: ClassVar[bool] = True
    is_compared: ClassVar[bool] = True
    is_refusal_stated: ClassVar[bool] = False
    name: str
    label: str
    style: Style
    profile: Callable[[MotorTask], FloatArray]
    knows_the_level: bool = True
    knows_the_drive: bool = True
    refusal: Callable[[MotorTask], str] = lambda _: ""

    def __str__(self) -> str:
        return self.name


def verifying_masses(mechanism: Mechanism | Finger) -> int:
    """Masses of each tendon of the mechanism that commands are judged on."""
    return max(VERIFYING_MASSES, *(2 * tendon.path.segments for tendon in mechanism.tendons))


def middle_compliance(mechanism: S, robust: Uncertainty) -> S | None:
    """The mechanism whose tendons have the middle of the compliances that [robust] admits.

    The lost motion is proportional to 1/k, so the design for the harmonic middle has the same error at both ends, which
    is the least that a design can have at the worse one. None where no stiffness of a tendon is in doubt, or the mean
    error counts.
    """
    if robust.objective is Objective.MEAN:
        return None
    found: dict[str, float] = {}
    for spread in robust.spreads:
        keys = [key for key in spread.keys if key == "stiffness" or key.endswith("tendon.stiffness_N_per_m")]
        low, high = (spread.values(mechanism, place) for place in (-1.0, 1.0))
        found |= {key: 2 / (1 / low[key] + 1 / high[key]) for key in keys}
    return with_numbers(mechanism, found) if found else None
