"""Task of several driven joints: references, and the engine of their mechanism, which inverts and simulates it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.motors.drive import driven
from tendonff.compensator.compensators.motors.response import MotorResponse, Turned, finer
from tendonff.compensator.compensators.motors.task import ASSUMED_SPREAD, MotorTask
from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.scenario.driven.finger import NO_FEEDBACK, FingerScenario, SampledFinger, sample_finger
from tendonff.models.cached import cached_property
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import JointDrive
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.parameters.uncertainty import Spread, Uncertainty
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.mechanism.periodic import steady_inverse, steady_response
from tendonff.ocp.mechanism.problem import MechanismProblem
from tendonff.ocp.mechanism.response import MechanismRun, MechanismStatus, invert_mechanism, simulate_mechanism
from tendonff.ocp.mechanism.start import held_at, mechanism_problem, unreachable

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

    refinement = 4

    @classmethod
    def of(cls, scenario: FingerScenario, level: Level | None = None) -> "FingerTask":
        """The task that a scenario poses; the level by default its own."""
        sampled = sample_finger(scenario)
        return cls(scenario=scenario, sampled=sampled, finger=scenario.mechanism, level=level or scenario.run.level)

    @property
    def system(self) -> Finger:
        """The finger."""
        return self.finger

    def with_system(self, system: Finger) -> "FingerTask":
        """The same for another finger."""
        return replace(self, finger=system)

    @property
    def target(self) -> FloatArray:
        """Angles of the joints that have a reference, shape (rows, wanted)."""
        return self.wanted_rad

    @property
    def without(self) -> Mapping[str, str]:
        """Modules of exported C that it does not have; see `MotorTask.without`."""
        return {
            **super().without,
            "table": "the angle of each motor hangs on all joints and the way of each",
            "feedback": NO_FEEDBACK,
            "adaptive": "joints share tendons, so that the torque of one motor tells of many",
        }

    def by_motor(self) -> tuple[Finger, SampledFinger]:
        """The finger and its reference."""
        return self.finger, self.sampled

    @property
    def motors(self) -> tuple[str, ...]:
        """Names of the motors."""
        return tuple(motor.name for motor in self.finger.motors)

    @property
    def drives(self) -> tuple[JointDrive, ...]:
        """Drive of each motor."""
        return tuple(motor.drive for motor in self.finger.motors)

    @property
    def follows(self) -> bool:
        """Some joints have no reference and follow from their balances."""
        return self.scenario.wanted < len(self.finger.joints)

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

    @cached_property
    def inversion(self) -> MotorResponse:
        """The exact inverse, of a cycle in its steady state; SolveError where there is none."""
        problem, angle = self.problem(self.finger), self.sampled.motion.angle_rad
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
        return self._response(found)

    def _response(self, found: MechanismRun, refinement: int = 1) -> MotorResponse:
        """A run at the rows of the reference; SolveError where it failed."""
        if found.status is MechanismStatus.FAILED:
            raise SolveError(found.message)
        kept = slice(None, None, refinement)
        motor, position = found.motor[kept], found.position[kept]
        speed = np.gradient(motor, self.step_s, axis=0)
        acceleration = np.gradient(speed, self.step_s, axis=0)
        torque = [
            drive.torque_N_m(found.effort[kept][:, k], acceleration[:, k], np.sign(speed[:, k]))
            for k, drive in enumerate(self.drives)
        ]
        return MotorResponse(
            status=found.status,
            message=found.message,
            output=position[:, : self.scenario.wanted],
            position_rad=position,
            motor_rad=motor,
            torque_N_m=np.column_stack(torque),
            tension_N=found.tension_N[kept],
            drum_N=found.drum_N[kept],
            lowest_N=found.lowest_N[kept],
            work=found.work,
        )

    @property
    def is_periodic(self) -> bool:
        """The reference is one period of a cycle."""
        return self.scenario.periodic

    @property
    def wanted_rad(self) -> FloatArray:
        """Angles of the joints that have a reference, shape (rows, wanted)."""
        return self.sampled.angle_rad[:, : self.scenario.wanted]

    @cached_property
    def lengths_rad(self) -> FloatArray:
        """Motors by the lengths of the tendons alone; of several tendons on one motor the mean.

        Joints without a reference are where they go without friction.
        """
        finger, joints = self.finger, self.sampled.angle_rad
        if self.follows:
            joints = self.with_system(without_friction(finger)).inversion.position_rad[:, : len(finger.joints)]
        length, names = finger.geometry().length_m(joints), [tendon.name for tendon in finger.tendons]
        columns = []
        for motor in finger.motors:
            travels = [-(length[:, names.index(name)] - length[0, names.index(name)]) for name in motor.winds]
            columns.append(np.mean([x / w for x, w in zip(travels, motor.winding_m, strict=True)], axis=0))
        return np.column_stack(columns)

    @property
    def static_rad(self) -> FloatArray:
        """The limit of slow motion, elastic."""
        return replace(self, finger=slow(self.finger), level=Level.ELASTIC).inversion.motor_rad

    def check_reach(self) -> None:
        """Refuse a motion whose torques no tensions give, naming joint, pose and torque."""
        problem, sampled = self.problem(self.finger), self.sampled
        if self.follows:
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
        system: Finger,
        command_rad: FloatArray,
        *,
        level: Level | None = None,
        masses: int | None = None,
        refinement: int = 1,
        method: Method = Method.BDF2,
    ) -> MotorResponse:
        """Response of a mechanism behind its drives, of a cycle in its steady state; see `MotorTask.respond`."""
        sampled, step = self.sampled, self.step_s / refinement
        periodic = self.scenario.periodic
        drums = np.column_stack(
            [
                driven(motor.drive, column[:, None], self.step_s, refinement, periodic=periodic)[:, 0]
                for motor, column in zip(system.motors, command_rad.T, strict=True)
            ]
        )
        inner = np.arange(len(drums)) * step

        def fine(rows: FloatArray) -> FloatArray:
            return np.column_stack([np.interp(inner, sampled.time_s, column) for column in rows.T])

        problem = self.problem(system, level, masses)
        known, effort = fine(sampled.motion.angle_rad), fine(self.efforts)
        if periodic:
            cycle = steady_response(problem, drums, step, known=known, effort=effort, method=method)
            found = cycle.run
            if not cycle.is_steady and found.status is not MechanismStatus.FAILED:
                raise SolveError(f"after {cycle.cycles} cycles the joints still change from one to the next")
        else:
            found = simulate_mechanism(problem, drums, step, known=known, effort=effort, method=method)
        return self._response(found, refinement)

    def turned(self, drums_rad: FloatArray, *, parts: int = 1, method: Method = Method.BDF2) -> Turned:
        """Motion under drums; see `MotorTask.turned`."""
        sampled, step = self.sampled, self.step_s
        time: FloatArray = np.arange((len(drums_rad) - 1) // parts + 1, dtype=np.float64) * step
        effort = np.column_stack([np.interp(time, sampled.time_s, column) for column in self.efforts.T])
        run = simulate_mechanism(
            self.problem(self.finger),
            drums_rad,
            step / parts,
            known=finer(sampled.motion.at(time), parts),
            effort=finer(effort, parts),
            method=method,
        )
        columns = {f"joint_{name}_rad": run.position[:, k] for k, name in enumerate(self.finger.names)}
        return Turned(response=self._response(run), columns=columns, judged=tuple(columns))

    @cached_property
    def doubt(self) -> Doubt[Finger]:
        """Mechanisms that may be the real one, by [robust] or, where it states nothing, assumed."""
        loops = tuple(f"motors.{m.name}.drive.pretension_N" for m in self.finger.motors if len(m.winds) > 1)
        pretension = (Spread(keys=loops, half_width=ASSUMED_SPREAD),) if loops else ()
        assumed = Uncertainty(mu=ASSUMED_SPREAD, stiffness=ASSUMED_SPREAD, spread=pretension, samples=2)
        return Doubt.of(self.finger, self.scenario.robust, assumed)

    @property
    def notes(self) -> tuple[str, ...]:
        """Where sections leave their tables."""
        return self.finger.beyond_tables(self.sampled.motion)

    @property
    def refusal(self) -> str:
        """A tendon goes slack, or a section leaves its table."""
        return self.inversion.slack or "; ".join(self.notes)

    def doubt_masses(self, system: Finger) -> int:
        """Masses of each tendon of a mechanism that may be the real one."""
        return max(DOUBT_MASSES, *(tendon.path.segments for tendon in system.tendons))


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
