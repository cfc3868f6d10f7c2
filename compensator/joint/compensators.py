"""Compensators of a joint: maps from a reference to the commands of its motors."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.files.reading import FloatArray, InputError, suggestion
from tendonff.compensator.joint.drive import commanded, known_by_ratio
from tendonff.compensator.joint.plant import JointPlant, joint_load
from tendonff.compensator.joint.scenario.reference import JointQuantity
from tendonff.compensator.joint.scenario.scenario import JointScenario, SampledJoint, sample_joint
from tendonff.compensator.joint.task import ASSUMED_SPREAD, MotorCompensator, MotorTask, Reached
from tendonff.compensator.reporting.colours import BLUE, GREEN, GREY, ORANGE, Style
from tendonff.compensator.scenario.unit import Unit
from tendonff.models.cached import cached_property
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.joint.quasi_static import static_motor_rad
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.parameters.uncertainty import Objective, Spread, Uncertainty
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.joint.invert import JointInversion, JointStatus, invert_joint, steady_joint_inverse
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.simulate import JointOutcome
from tendonff.ocp.joint.start import joint_problem

S = TypeVar("S", Mechanism, Finger)


@dataclass(frozen=True, kw_only=True)  # without slots: what is computed once is kept in the instance
class JointTask(MotorTask):
    """Reference of a joint, and the mechanism and level that designs know.

    Parameters
    ----------
    scenario : JointScenario
    sampled : SampledJoint
    mechanism : Mechanism
    level : Level
    """

    scenario: JointScenario
    sampled: SampledJoint
    mechanism: Mechanism
    level: Level

    @classmethod
    def of(cls, scenario: JointScenario, level: Level | None = None) -> "JointTask":
        """The task that a scenario poses; the level by default its own."""
        return cls(
            scenario=scenario,
            sampled=sample_joint(scenario),
            mechanism=scenario.mechanism,
            level=level or scenario.run.level,
        )

    share_of = "range"

    @property
    def system(self) -> Mechanism:
        """The mechanism."""
        return self.mechanism

    @property
    def wanted(self) -> FloatArray:
        """Reference after the homing stroke, shape (rows,)."""
        return self.sampled.wanted[self.sampled.lead :]

    @property
    def time_s(self) -> FloatArray:
        """Time after the homing stroke [s]."""
        return self.sampled.run_time_s

    @property
    def unit(self) -> Unit:
        """Unit of the reference."""
        return self.scenario.reference.shown

    @property
    def compensators(self) -> tuple["JointCompensator", ...]:
        """Those that have a meaning here."""
        return compensators_of(self)

    @cached_property
    def problem(self) -> JointProblem:
        """The mechanism, cut into chains; InputError where it cannot follow."""
        try:
            return joint_problem(self.mechanism, self.level, self.sampled.motion)
        except ParameterError as error:
            raise InputError(f"{self.scenario.source.name}: {error}") from None

    @cached_property
    def inversion(self) -> JointInversion:
        """The exact inverse; SolveError where there is none."""
        try:
            found, _ = self._inverse
        except ParameterError as error:
            raise InputError(f"{self.scenario.source.name}: {error}") from None
        if found.status is JointStatus.FAILED:
            raise SolveError(found.message)
        return found

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the inverse for the user."""
        _ = self.inversion  # whose errors name the file
        return self._inverse[1]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Where the reference was changed."""
        return self.sampled.warnings

    @cached_property
    def _inverse(self) -> tuple[JointInversion, tuple[str, ...]]:
        return inverse_of(self.scenario, self.sampled, self.problem)

    @cached_property
    def middle(self) -> Mechanism | None:
        """The mechanism of the middle compliances; None where [robust] states no doubt of a stiffness."""
        return middle_compliance(self.mechanism, self.scenario.robust)

    @cached_property
    def doubt(self) -> Doubt[Mechanism]:
        """Mechanisms that may be the real one, by [robust] or, where it states nothing, assumed."""
        return Doubt.of(self.mechanism, self.scenario.robust, assumed(self.mechanism))

    @property
    def live_command_rad(self) -> FloatArray:
        """Commands of the exact inverse step by step; see `MotorTask.live_command_rad`."""
        return commanded(self.mechanism.drive, self.inversion.motor_rad, self.scenario.run.step_s, live=True)

    def plant(self, mechanism: Mechanism, level: Level, refinement: int = 1, masses: int | None = None) -> JointPlant:
        """A plant for its reference."""
        return JointPlant(
            mechanism=mechanism,
            scenario=self.scenario,
            sampled=self.sampled,
            level=level,
            masses=masses,
            refinement=refinement,
        )

    def reached(
        self,
        system: Mechanism,
        command_rad: FloatArray,
        *,
        level: Level | None = None,
        masses: int | None = None,
        refinement: int = 1,
        method: Method = Method.BDF2,
    ) -> Reached:
        """Response of a mechanism behind its drive; see `MotorTask.reached`."""
        plant = replace(self.plant(system, level or self.level, refinement, masses), method=method)
        run = plant.respond(command_rad)
        slack = run.message if run.outcome is JointOutcome.SLACK else ""
        return Reached(values=plant.reached(run)[self.sampled.lead :], slack=slack)


def assumed(mechanism: Mechanism) -> Uncertainty:
    """Uncertainty of a mechanism that has not been identified."""
    loop = mechanism.drive.kind is DriveKind.LOOP and mechanism.drive.pretension_N
    pretension = (Spread(keys=("drive.pretension_N",), half_width=ASSUMED_SPREAD),) if loop else ()
    return Uncertainty(mu=ASSUMED_SPREAD, stiffness=ASSUMED_SPREAD, spread=pretension, samples=2)


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


def inverse_of(
    scenario: JointScenario, sampled: SampledJoint, problem: JointProblem
) -> tuple[JointInversion, tuple[str, ...]]:
    """The exact inverse, of a cycle in its steady state, and what the user should know."""
    step = scenario.run.step_s
    if not scenario.reference.periodic:
        return invert_joint(problem, sampled.angle_rad, step, contact_N_m=sampled.contact_N_m), ()
    found, cycles, steady = steady_joint_inverse(problem, sampled.angle_rad, step, contact_N_m=sampled.contact_N_m)
    if steady:
        return found, ()
    return found, (f"after {cycles} cycles the motor angle still changes; the profile is that of the last one",)


def linear_motor_rad(scenario: JointScenario, sampled: SampledJoint) -> FloatArray:
    """The ratio alone: what the path leaves to the drum; with a wanted torque, what springs without friction take."""
    mechanism, joint = scenario.mechanism, scenario.mechanism.joint.name
    if scenario.reference.quantity is JointQuantity.TORQUE:
        still = np.zeros(len(sampled.time_s))
        load = joint_load(mechanism, sampled, scenario.run.step_s) + sampled.contact_N_m
        return static_motor_rad(mechanism, sampled.angle_rad, load, sampled.others(joint), still)
    travel = [
        t.path_travel_m(sampled.angle_rad, sampled.others(joint))
        - t.path_travel_m(sampled.angle_rad, sampled.others(joint))[0]
        for t in mechanism.tendons
    ]
    motor = mechanism.motor_rad(np.column_stack(travel), float(sampled.angle_rad[0]))
    return motor.mean(axis=1, keepdims=True) if mechanism.drive.kind is DriveKind.LOOP else motor


def _static(task: JointTask) -> FloatArray:
    """The law of full sliding, held by spring, gravity, dry friction and what the joint touches."""
    sampled, mechanism = task.sampled, task.mechanism
    joint = mechanism.joint
    speed = np.gradient(sampled.angle_rad, task.scenario.run.step_s)
    held = joint.static_torque_N_m(sampled.angle_rad) + joint.coulomb_N_m * np.sign(speed) + sampled.contact_N_m
    return static_motor_rad(mechanism, sampled.angle_rad, held, sampled.others(joint.name))


def _robust(task: JointTask) -> FloatArray:
    """The exact inverse of the mechanism with the middle compliances."""
    return replace(task, mechanism=task.middle or task.mechanism).inversion.motor_rad


@dataclass(frozen=True, slots=True, kw_only=True)
class JointCompensator(MotorCompensator):
    """Map from a reference of a joint to the commands of its motors.

    Attributes
    ----------
    name, label : str
        Key in files and on the command line, and name for people.
    style : Style
    motor_rad : callable
        Angles of the drums at the commanded shafts for a task, shape (rows, motors) [rad].
    knows_the_level : bool
        They depend on the fidelity level of the design model.
    knows_the_drive : bool
        Servo lag and gear backlash are taken back.
    needs_doubt : bool
        It has a meaning only where [robust] states a doubt of the stiffness.
    """

    name: str
    label: str
    style: Style
    motor_rad: Callable[[JointTask], FloatArray]
    knows_the_level: bool = False
    knows_the_drive: bool = True
    needs_doubt: bool = False

    def command_rad(self, task: JointTask) -> FloatArray:
        """Commands of the motors, shape (rows, motors) [rad]."""
        drive = task.mechanism.drive
        known = drive if self.knows_the_drive else known_by_ratio(drive)
        return commanded(known, self.motor_rad(task), task.scenario.run.step_s)

    def __str__(self) -> str:
        return self.name


JOINT_COMPENSATORS = (
    JointCompensator(
        name="linear",
        label="ratio alone",
        style=Style(color=GREY, linestyle=":"),
        motor_rad=lambda task: linear_motor_rad(task.scenario, task.sampled),
        knows_the_drive=False,
    ),
    JointCompensator(
        name="static", label="quasi-static law", style=Style(color=ORANGE, linestyle="-."), motor_rad=_static
    ),
    JointCompensator(
        name="inverse",
        label="exact inverse",
        style=Style(color=BLUE, linestyle="-"),
        motor_rad=lambda task: task.inversion.motor_rad,
        knows_the_level=True,
    ),
    JointCompensator(
        name="robust",
        label="inverse, middle compliance",
        style=Style(color=GREEN, linestyle="--"),
        motor_rad=_robust,
        knows_the_level=True,
        needs_doubt=True,
    ),
)
"""In the order in which they are shown."""


def compensators_of(task: JointTask) -> tuple[JointCompensator, ...]:
    """Those that have a meaning for a task."""
    return tuple(each for each in JOINT_COMPENSATORS if task.middle is not None or not each.needs_doubt)


def joint_compensator(name: str) -> JointCompensator:
    """The compensator of a joint of a name; InputError if there is none."""
    for each in JOINT_COMPENSATORS:
        if each.name == name:
            return each
    known = [each.name for each in JOINT_COMPENSATORS]
    raise InputError(f'a joint has no compensator "{name}"{suggestion(name, known)}; it has {", ".join(known)}')
