"""Compensators of a finger: maps from wanted joint angles to the angles of its motors."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.finger.scenario import FingerScenario, SampledFinger, sample_finger
from tendonff.compensator.joint.compensators import middle_compliance
from tendonff.compensator.joint.drive import commanded, driven, known_by_ratio
from tendonff.compensator.joint.task import ASSUMED_SPREAD, MotorCompensator, MotorTask, Reached
from tendonff.compensator.reporting.colours import BLUE, GREEN, GREY, ORANGE, PURPLE, Style
from tendonff.compensator.scenario.unit import RADIAN
from tendonff.models.cached import cached_property
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.parameters.uncertainty import Spread, Uncertainty
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.mechanism.periodic import steady_inverse, steady_response
from tendonff.ocp.mechanism.problem import MechanismProblem
from tendonff.ocp.mechanism.response import MechanismRun, MechanismStatus, invert_mechanism, simulate_mechanism
from tendonff.ocp.mechanism.start import held_at, mechanism_problem, unreachable

REFINEMENT = 4
"""The verifying mechanism has smaller steps than the design, so many in one."""
DOUBT_MASSES = 20
"""Masses of each tendon of mechanisms that may be the real one: what they differ by is ten times what masses leave."""
_SLOW = 1e-3  # of its mass and damping, a tendon has in the quasi-static law


@dataclass(frozen=True, kw_only=True)  # without slots: what is computed once is kept in the instance
class FingerTask(MotorTask):
    """Reference of several joints, and the mechanism and level that designs know.

    Parameters
    ----------
    scenario : FingerScenario
    sampled : SampledFinger
    finger : Finger
    level : Level
    """

    scenario: FingerScenario
    sampled: SampledFinger
    finger: Finger
    level: Level

    @classmethod
    def of(cls, scenario: FingerScenario, level: Level | None = None) -> "FingerTask":
        """The task that a scenario poses; the level by default its own."""
        sampled = sample_finger(scenario)
        return cls(scenario=scenario, sampled=sampled, finger=scenario.mechanism, level=level or scenario.run.level)

    @property
    def step_s(self) -> float:
        """Step of the run [s]."""
        return self.scenario.run.step_s

    def problem(self, finger: Finger, level: Level | None = None, masses: int | None = None) -> MechanismProblem:
        """A mechanism at rest where the reference starts; InputError where it cannot be."""
        sampled = self.sampled
        start = dict(zip(sampled.motion.names, sampled.motion.angle_rad[0].tolist(), strict=True))
        effort = dict(zip(finger.names, sampled.effort_N_m[0].tolist(), strict=True))
        try:
            return mechanism_problem(
                finger.mechanism(sampled.motion),
                level or self.level,
                start,
                effort=effort,
                pretension_N=finger.pretension_N,
                sharing=finger.sharing,
                following=finger.names[self.scenario.wanted :],
                segments=masses,
            )
        except ParameterError as error:
            raise InputError(f"{self.scenario.source.name}: {error}") from None

    @property
    def efforts(self) -> FloatArray:
        """Torques that all bodies but the motors give to what they touch, shape (rows, known) [N m]."""
        others = self.sampled.motion.angle_rad.shape[1] - self.sampled.angle_rad.shape[1]
        return np.hstack([self.sampled.effort_N_m, np.zeros((len(self.sampled.time_s), others))])

    def inverse(self, finger: Finger, level: Level | None = None) -> MechanismRun:
        """The exact inverse of a mechanism, of a cycle in its steady state; SolveError where there is none."""
        problem, angle = self.problem(finger, level), self.sampled.motion.angle_rad
        if not self.scenario.periodic:
            found = invert_mechanism(problem, angle, self.step_s, effort=self.efforts)
        else:
            cycle = steady_inverse(problem, angle, self.step_s, effort=self.efforts)
            found = cycle.run
            if not cycle.is_steady:
                raise SolveError(
                    f"after {cycle.cycles} cycles the motor angles still change; {found.message}; a cycle that ends "
                    "where it starts with the same speed settles sooner"
                )
        if found.status is MechanismStatus.FAILED:
            raise SolveError(found.message)
        return found

    @property
    def wanted_rad(self) -> FloatArray:
        """Angles of the joints that have a reference, shape (rows, wanted)."""
        return self.sampled.angle_rad[:, : self.scenario.wanted]

    @cached_property
    def joints_rad(self) -> FloatArray:
        """Angles of all joints, shape (rows, joints); of those that follow, where they go without friction."""
        if self.scenario.wanted == len(self.finger.joints):
            return self.sampled.angle_rad
        return self.inverse(without_friction(self.finger)).position[:, : len(self.finger.joints)]

    @cached_property
    def inversion(self) -> MechanismRun:
        """The exact inverse of the scenario's mechanism."""
        return self.inverse(self.finger)

    def check_reach(self) -> None:
        """Refuse a motion whose torques no tensions give, naming joint, pose and torque."""
        problem, sampled = self.problem(self.finger), self.sampled
        if self.scenario.wanted < len(self.finger.joints):
            return  # the joints that follow take what the tendons give
        speed = np.gradient(sampled.angle_rad, self.step_s, axis=0)
        inertia = np.array([joint.inertia_kg_m2 for joint in self.finger.joints])
        damping = np.array([joint.damping_N_m_s_per_rad for joint in self.finger.joints])
        torque = inertia * np.gradient(speed, self.step_s, axis=0) + damping * speed + sampled.effort_N_m
        torque += held_at(problem, sampled.angle_rad)
        found = unreachable(problem, sampled.motion.angle_rad, torque)
        if found is not None:
            pose = ", ".join(
                f"{name} {np.degrees(q):.3g} deg"
                for name, q in zip(self.finger.names, sampled.angle_rad[found.row], strict=True)
            )
            raise InputError(
                f"{self.scenario.source.name}: no tensions of at least {problem.sharing.least_tension_N:g} N give "
                f"{found.body} its torque of {torque[found.row][self.finger.names.index(found.body)]:.3g} N m at "
                f"t = {sampled.time_s[found.row]:g} s ({pose}): {found.missing:.3g} N m are missing, friction counted; "
                "change moment arms or routing there, add a spring, or keep out of that pose"
            )

    def respond(
        self,
        finger: Finger,
        command_rad: FloatArray,
        masses: int | None = None,
        refinement: int = 1,
        level: Level | None = None,
        method: Method = Method.BDF2,
    ) -> MechanismRun:
        """Response of a mechanism behind its drives, rows as those of the reference; SolveError where it fails.

        Of a reference that repeats, its cycle after as many as it takes to repeat.
        """
        sampled, step = self.sampled, self.step_s / refinement
        repeats = 2 if self.scenario.periodic else 1  # the drive, too, is in its steady cycle
        commands = np.vstack([*[command_rad[:-1]] * (repeats - 1), command_rad])
        drums = np.column_stack(
            [
                driven(motor.drive, column[:, None], self.step_s)[-len(command_rad) :, 0]
                for motor, column in zip(finger.motors, commands.T, strict=True)
            ]
        )
        inner = np.arange((len(drums) - 1) * refinement + 1) * step

        def fine(rows: FloatArray) -> FloatArray:
            return np.column_stack([np.interp(inner, sampled.time_s, column) for column in rows.T])

        problem = self.problem(finger, level, masses)
        known, effort = fine(sampled.motion.angle_rad), fine(self.efforts)
        if self.scenario.periodic:
            cycle = steady_response(problem, fine(drums), step, known=known, effort=effort, method=method)
            found = cycle.run
            if not cycle.is_steady and found.status is not MechanismStatus.FAILED:
                raise SolveError(f"after {cycle.cycles} cycles the joints still change from one to the next")
        else:
            found = simulate_mechanism(problem, fine(drums), step, known=known, effort=effort, method=method)
        if found.status is MechanismStatus.FAILED:
            raise SolveError(found.message)
        kept = slice(None, None, refinement)
        return replace(
            found,
            position=found.position[kept],
            tension_N=found.tension_N[kept],
            effort=found.effort[kept],
            lowest_N=found.lowest_N[kept],
        )

    @property
    def system(self) -> Finger:
        """The finger."""
        return self.finger

    @cached_property
    def doubt(self) -> Doubt[Finger]:
        """Mechanisms that may be the real one, by [robust] or, where it states nothing, assumed."""
        loops = tuple(f"motors.{m.name}.drive.pretension_N" for m in self.finger.motors if len(m.winds) > 1)
        pretension = (Spread(keys=loops, half_width=ASSUMED_SPREAD),) if loops else ()
        assumed = Uncertainty(mu=ASSUMED_SPREAD, stiffness=ASSUMED_SPREAD, spread=pretension, samples=2)
        return Doubt.of(self.finger, self.scenario.robust, assumed)

    @property
    def _middle_rad(self) -> FloatArray:
        middle: FloatArray = 0.5 * (self.wanted_rad.max(axis=0) + self.wanted_rad.min(axis=0))
        return middle

    @cached_property
    def wanted(self) -> FloatArray:
        """Angles about the middle of each range, joint after joint, so that the largest range is that of all."""
        return (self.wanted_rad - self._middle_rad).T.ravel()

    @property
    def time_s(self) -> FloatArray:
        """Instants, joint after joint [s]."""
        rows = self.sampled.time_s
        return np.concatenate([rows + k * (rows[-1] + self.step_s) for k in range(self.scenario.wanted)])

    unit = RADIAN
    share_of = "the largest joint range"
    warnings = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the inverse for the user."""
        slack = (self.inversion.message,) if self.inversion.status is MechanismStatus.SLACK else ()
        return (*slack, *self.finger.beyond_tables(self.sampled.motion))

    @cached_property
    def middle(self) -> Finger | None:
        """The finger of the middle compliances; None where [robust] states no doubt of a stiffness."""
        return middle_compliance(self.finger, self.scenario.robust)

    @property
    def compensators(self) -> tuple["FingerCompensator", ...]:
        """Those that have a meaning here."""
        follows = self.scenario.wanted < len(self.finger.joints)
        return tuple(
            each
            for each in FINGER_COMPENSATORS
            if not (each.needs_doubt and self.middle is None) and not (each.needs_references and follows)
        )

    def doubt_masses(self, system: Finger) -> int:
        """Masses of each tendon of a mechanism that may be the real one."""
        return max(DOUBT_MASSES, *(tendon.path.segments for tendon in system.tendons))

    def reached(
        self,
        system: Finger,
        command_rad: FloatArray,
        *,
        level: Level | None = None,
        masses: int | None = None,
        refinement: int = 1,
        method: Method = Method.BDF2,
    ) -> Reached:
        """Response of a mechanism behind its drives; see `MotorTask.reached`."""
        run = self.respond(system, command_rad, masses, refinement, level, method)
        values = (run.position[:, : self.scenario.wanted] - self._middle_rad).T.ravel()
        return Reached(values=values, slack=run.message if run.status is MechanismStatus.SLACK else "")


def linear_motor_rad(task: FingerTask) -> FloatArray:
    """Motors by the lengths of the tendons alone; of several tendons on one motor the mean."""
    length = task.finger.geometry().length_m(task.joints_rad)
    names = [tendon.name for tendon in task.finger.tendons]
    columns = []
    for motor in task.finger.motors:
        travels = [-(length[:, names.index(name)] - length[0, names.index(name)]) for name in motor.winds]
        columns.append(np.mean([x / w for x, w in zip(travels, motor.winding_m, strict=True)], axis=0))
    return np.column_stack(columns)


def without_friction(finger: Finger) -> Finger:
    """The same with paths that do not rub."""
    bare = with_numbers(finger, {"mu": 0.0})
    tendons = tuple(
        replace(t, friction=replace(t.friction, adhesion_N=0.0, viscous_N_s_per_m=0.0)) for t in bare.tendons
    )
    return replace(bare, tendons=tendons)


def slow(finger: Finger) -> Finger:
    """The same without inertia and damping to speak of: the limit of slow motion."""
    tendons = tuple(
        replace(
            t,
            tendon=replace(t.tendon, mass_kg=_SLOW * t.tendon.mass_kg, damping_N_s_per_m=0.0),
            friction=replace(t.friction, viscous_N_s_per_m=0.0),
        )
        for t in finger.tendons
    )
    joints = tuple(replace(j, inertia_kg_m2=_SLOW * j.inertia_kg_m2, damping_N_m_s_per_rad=0.0) for j in finger.joints)
    return replace(finger, tendons=tendons, joints=joints)


@dataclass(frozen=True, slots=True, kw_only=True)
class FingerCompensator(MotorCompensator):
    """Map from wanted joint angles to motor angles.

    Attributes
    ----------
    name, label : str
        Key in files and on the command line, and name for people.
    style : Style
    motor_rad : callable
        Angles of the motors for a task, shape (rows, motors) [rad].
    knows_the_level : bool
        They depend on the fidelity level of the design model.
    knows_the_drive : bool
        Servo lag and gear backlash are taken back.
    needs_doubt : bool
        It has a meaning only where [robust] states a doubt of the stiffness.
    needs_references : bool
        It has a meaning only where every joint has a reference: without inertia, where the others go is not unique.
    """

    name: str
    label: str
    style: Style
    motor_rad: Callable[[FingerTask], FloatArray]
    knows_the_level: bool = False
    knows_the_drive: bool = True
    needs_doubt: bool = False
    needs_references: bool = False

    def command_rad(self, task: FingerTask) -> FloatArray:
        """Commands of the motors, shape (rows, motors) [rad]."""
        wanted = self.motor_rad(task)
        columns = []
        for motor, column in zip(task.finger.motors, wanted.T, strict=True):
            drive = motor.drive if self.knows_the_drive else known_by_ratio(motor.drive)
            columns.append(commanded(drive, column[:, None], task.step_s)[:, 0])
        return np.column_stack(columns)


FINGER_COMPENSATORS = (
    FingerCompensator(
        name="linear",
        label="tendon lengths alone",
        style=Style(color=GREY, linestyle=":"),
        motor_rad=linear_motor_rad,
        knows_the_drive=False,
    ),
    FingerCompensator(
        name="stretch",
        label="lengths and elasticity",
        style=Style(color=GREEN, linestyle="--"),
        motor_rad=lambda task: task.inverse(without_friction(task.finger)).motor,
        knows_the_level=True,
    ),
    FingerCompensator(
        name="static",
        label="quasi-static law",
        style=Style(color=ORANGE, linestyle="-."),
        motor_rad=lambda task: task.inverse(slow(task.finger), Level.ELASTIC).motor,
        needs_references=True,
    ),
    FingerCompensator(
        name="inverse",
        label="exact inverse",
        style=Style(color=BLUE, linestyle="-"),
        motor_rad=lambda task: task.inversion.motor,
        knows_the_level=True,
    ),
    FingerCompensator(
        name="robust",
        label="inverse, middle compliance",
        style=Style(color=PURPLE, linestyle="--"),
        motor_rad=lambda task: task.inverse(task.middle or task.finger).motor,
        knows_the_level=True,
        needs_doubt=True,
    ),
)
"""In the order in which they are shown."""
