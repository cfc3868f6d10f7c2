"""Task of one driven joint: its reference, and the engine of its mechanism, which inverts and simulates it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.motors.drive import driven
from tendonff.compensator.compensators.motors.response import MotorResponse, Turned, finer
from tendonff.compensator.compensators.motors.task import ASSUMED_SPREAD, UNSETTLED, MotorTask
from tendonff.compensator.compensators.uncertain import Doubt
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.scenario.driven.finger import SampledFinger
from tendonff.compensator.scenario.driven.joint import JointScenario, SampledJoint, sample_joint
from tendonff.compensator.scenario.driven.reference import JointQuantity
from tendonff.compensator.scenario.goal import Given
from tendonff.models.cached import cached_property
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.description import MOTOR, describe
from tendonff.models.joint.parameters import DriveKind, JointDrive, Mechanism
from tendonff.models.joint.parameters.finger import Finger, Motor
from tendonff.models.joint.quasi_static import static_motor_rad
from tendonff.models.mechanism.sharing import Sharing
from tendonff.models.parameters.uncertainty import Spread, Uncertainty
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.joint.invert import JointInversion, JointStatus, invert_joint, steady_joint_inverse
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.simulate import JointSimulation, simulate_joint
from tendonff.ocp.joint.start import joint_problem, start_tensions
from tendonff.ocp.mechanism.problem import MechanismProblem
from tendonff.ocp.mechanism.response import MechanismRun, MechanismStatus, simulate_mechanism
from tendonff.ocp.mechanism.start import mechanism_problem

_SETTLING_CYCLES = 4
_STEADY = 1e-3  # of the motion's range, by which the last two cycles may differ


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

    refinement = 10
    is_stepwise = True
    given_as = Given(
        title="Motor beyond the ratio", label="motor beyond the ratio [deg]", loop="Lost motion", is_ordinate=True
    )

    @classmethod
    def of(cls, scenario: JointScenario, level: Level | None = None) -> "JointTask":
        """The task that a scenario poses; the level by default its own."""
        return cls(
            scenario=scenario,
            sampled=sample_joint(scenario),
            mechanism=scenario.mechanism,
            level=level or scenario.run.level,
        )

    @property
    def system(self) -> Mechanism:
        """The mechanism."""
        return self.mechanism

    def with_system(self, system: Mechanism) -> "JointTask":
        """The same for another mechanism."""
        return replace(self, mechanism=system)

    def given_of(self, command_rad: FloatArray) -> FloatArray:
        """Angle of the first motor beyond the ratio, shape (n,) [deg]."""
        found: FloatArray = np.rad2deg(command_rad[:, 0] - self.lengths_rad[:, 0])[self.lead :]
        return found

    @property
    def is_periodic(self) -> bool:
        """The reference is one period of a cycle."""
        return self.scenario.reference.periodic

    @property
    def lead(self) -> int:
        """Rows of the homing stroke."""
        return self.sampled.lead

    @property
    def target(self) -> FloatArray:
        """Wanted values, shape (rows, 1)."""
        return self.sampled.wanted[self.lead :, None]

    def by_motor(self) -> tuple[Finger, SampledFinger]:
        """A pair as a finger of one joint with a motor for each tendon, called like it; a loop is refused."""
        joint, found = self.mechanism, self.sampled
        drive = joint.drive
        if drive.kind is not DriveKind.PAIR:
            raise InputError(f"{self.scenario.source.name}: a loop has one motor; identify it as a joint")
        radii = drive.drum_radius_m * (len(joint.tendons) if len(drive.drum_radius_m) == 1 else 1)
        finger = Finger(
            joints=joint.joints,
            tendons=joint.tendons,
            motors=tuple(
                Motor(name=t.name, winds=(t.name,), radii_m=(r,), drive=replace(drive, drum_radius_m=(r,)))
                for t, r in zip(joint.tendons, radii, strict=True)
            ),
            sharing=Sharing(least_tension_N=drive.least_tension_N or 0.0),
        )
        angle = found.angle_rad[:, None]
        effort = np.zeros_like(angle)
        return finger, SampledFinger(time_s=found.time_s, angle_rad=angle, effort_N_m=effort, motion=found.motion)

    @property
    def motors(self) -> tuple[str, ...]:
        """Names of the motors: one of a loop, else by tendon."""
        return motor_names(self.mechanism)

    @property
    def drives(self) -> tuple[JointDrive, ...]:
        """Drive of each motor."""
        return (self.mechanism.drive,) * len(self.motors)

    @cached_property
    def problem(self) -> JointProblem:
        """The mechanism, cut into chains; InputError where it cannot follow."""
        try:
            return joint_problem(self.mechanism, self.level, self.sampled.motion)
        except ParameterError as error:
            raise InputError(f"{self.scenario.source.name}: {error}") from None

    @cached_property
    def inversion(self) -> MotorResponse:
        """The exact inverse; SolveError where there is none."""
        found, sampled = self._inverse[0], self.sampled
        if found.status is JointStatus.FAILED:
            raise SolveError(found.message)
        return MotorResponse(
            status=found.status,
            message=found.message,
            output=sampled.wanted[:, None],
            position_rad=sampled.motion.angle_rad,
            motor_rad=found.motor_rad,
            torque_N_m=found.motor_torque_N_m,
            tension_N=found.tension_N,
            drum_N=found.drum_N,
            lowest_N=found.lowest_N,
            work=found.evaluations,
        )

    @cached_property
    def _inverse(self) -> tuple[JointInversion, tuple[str, ...]]:
        try:
            return inverse_of(self.scenario, self.sampled, self.problem)
        except ParameterError as error:
            raise InputError(f"{self.scenario.source.name}: {error}") from None

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the inverse for the user."""
        _ = self.inversion  # whose errors name the file
        return self._inverse[1]

    @property
    def refusal(self) -> str:
        """A tendon of a pair would have to push."""
        pushes = self.inversion.would_push and self.mechanism.drive.kind is DriveKind.PAIR
        return self.inversion.message if pushes else ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Where the reference was changed."""
        return self.sampled.warnings

    @property
    def lengths_rad(self) -> FloatArray:
        """Angles of the motors by the ratio alone, shape (rows, motors)."""
        return linear_motor_rad(replace(self.scenario, mechanism=self.mechanism), self.sampled)

    @property
    def static_rad(self) -> FloatArray:
        """The law of full sliding, held by spring, gravity, dry friction and what the joint touches."""
        sampled, joint = self.sampled, self.mechanism.joint
        speed = np.gradient(sampled.angle_rad, self.step_s)
        held = joint.static_torque_N_m(sampled.angle_rad) + joint.coulomb_N_m * np.sign(speed) + sampled.contact_N_m
        return static_motor_rad(self.mechanism, sampled.angle_rad, held, sampled.others(joint.name))

    @cached_property
    def doubt(self) -> Doubt[Mechanism]:
        """Mechanisms that may be the real one, by [robust] or, where it states nothing, assumed."""
        return Doubt.of(self.mechanism, self.scenario.robust, assumed(self.mechanism))

    def respond(
        self,
        system: Mechanism,
        command_rad: FloatArray,
        *,
        level: Level | None = None,
        masses: int | None = None,
        refinement: int = 1,
        method: Method = Method.BDF2,
    ) -> MotorResponse:
        """Response of a mechanism behind its drive, of a cycle its last after some; see `MotorTask.respond`."""
        sampled, spec, step = self.sampled, self.scenario.reference, self.step_s
        repeats = 1 + _SETTLING_CYCLES if spec.periodic else 1
        time = sampled.time_s
        span = float(time[-1])
        motor = driven(system.drive, command_rad, step, refinement, periodic=repeats > 1)
        rows = (len(time) - 1) * refinement
        inner = np.arange(rows * repeats + 1) * (step / refinement)
        within = np.mod(inner, span) if repeats > 1 else inner
        motor[-1] = motor[0] if repeats > 1 else motor[-1]
        columns = [np.append(np.tile(column[:-1], repeats), column[-1]) for column in motor.T]
        if repeats > 1:  # from rest: the motor starts where it stands
            columns = [column * np.minimum(inner / (0.1 * span), 1.0) for column in columns]
        contact = np.interp(within, time, sampled.contact_N_m)
        keep = slice(rows * (repeats - 1), None, refinement)
        if system.drive.gear_stiffness_N_m_per_rad is not None:
            known = np.column_stack([np.interp(within, time, column) for column in sampled.motion.angle_rad.T])
            given = np.column_stack(columns)
            problem = self._on_drums(system, level, masses)
            turned = turned_through_gear(problem, given, step / refinement, known, contact, method)
            position = turned.position[keep]
            found = _of_gear(system, turned, position[:, :1], step, keep)
            said = _settled(turned.message, rows, rad=turned.position[:, 0])
            return replace(found, message=said) if repeats > 1 else found
        torque = spec.quantity is JointQuantity.TORQUE
        run = simulate_joint(
            joint_problem(system, level or self.level, sampled.motion, segments=masses),
            np.column_stack(columns),
            step / refinement,
            contact_N_m=contact[0] if torque else contact,
            led_rad=np.interp(within, time, sampled.angle_rad) if torque else None,
            method=method,
        ).require()
        angle = run.angle_rad[keep]
        output = run.torque_N_m[keep] - joint_load(system, sampled, step) if torque else angle
        position = np.column_stack([angle, sampled.motion.angle_rad[:, 1:]])
        found = _response(run, output, position, keep)
        said = _settled(run.message, rows, rad=run.angle_rad, N_m=run.torque_N_m)
        return replace(found, message=said) if repeats > 1 else found

    def _on_drums(self, system: Mechanism, level: Level | None, masses: int | None) -> MechanismProblem:
        """A mechanism whose drums are free behind gears that give way, at rest where the reference starts."""
        sampled = self.sampled
        start = dict(zip(sampled.motion.names, sampled.motion.angle_rad[0].tolist(), strict=True))
        contact = float(sampled.contact_N_m[0])
        found = mechanism_problem(
            describe(system, sampled.motion),
            level or self.level,
            start,
            effort={system.joint.name: contact},
            pretension_N={MOTOR: system.drive.pretension_N or 0.0},
            sharing=Sharing(least_tension_N=system.drive.least_tension_N or 0.0),
            segments=masses,
        )
        return found.starting(start_tensions(system, start[system.joint.name], contact)[0])

    @property
    def without(self) -> Mapping[str, str]:
        """Modules of exported C that it cannot have; see `MotorTask.without`."""
        found, sampled, mechanism = dict(super().without), self.sampled, self.mechanism
        others = sampled.others(mechanism.joint.name)
        moved = {name for name, angle in others.items() if np.ptp(angle) > 0}
        if self.scenario.reference.quantity is JointQuantity.TORQUE:
            found["table"] = "a table over the angle has no room for a torque"
        elif any(tendon.follows(name) for name in moved for tendon in mechanism.tendons):
            found["table"] = "no table can hold a path that other joints move"
        return found

    @property
    def without_homing(self) -> "JointTask":
        """The same without a homing stroke."""
        whole = replace(self.mechanism, drive=replace(self.mechanism.drive, homing_rad=0.0))
        return replace(self, sampled=sample_joint(replace(self.scenario, mechanism=whole)))

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the motors in columns: that of a loop has none."""
        return ("",) if self.mechanism.drive.kind is DriveKind.LOOP else self.motors

    def turned(self, drums_rad: FloatArray, *, parts: int = 1, method: Method = Method.BDF2) -> Turned:
        """Motion under drums; where a torque is wanted, the joint is led; see `MotorTask.turned`."""
        sampled, led = self.sampled, self.scenario.motion is not None
        time: FloatArray = np.arange((len(drums_rad) - 1) // parts + 1, dtype=np.float64) * self.step_s
        contact, angle = (np.interp(time, sampled.time_s, x) for x in (sampled.contact_N_m, sampled.angle_rad))
        if self.mechanism.drive.gear_stiffness_N_m_per_rad is not None:
            known, step = finer(sampled.motion.at(time), parts), self.step_s / parts
            problem = self._on_drums(self.mechanism, None, None)
            turned = turned_through_gear(problem, drums_rad, step, known, finer(contact, parts), method)
            return Turned(
                response=_of_gear(self.mechanism, turned, turned.position[:, :1], step),
                columns={"angle_rad": turned.position[:, 0]},
                judged=("angle_rad",),
            )
        run = simulate_joint(
            self.problem,
            drums_rad,
            self.step_s / parts,
            contact_N_m=float(contact[0]) if led else finer(contact, parts),
            led_rad=finer(angle, parts) if led else None,
            method=method,
        ).require()
        return Turned(
            response=_response(run, run.torque_N_m if led else run.angle_rad, run.angle_rad[:, None]),
            columns={"angle_rad": run.angle_rad, "torque_N_m": run.torque_N_m},
            judged=("torque_N_m" if led else "angle_rad",),
        )


def turned_through_gear(
    problem: MechanismProblem,
    motor_rad: FloatArray,
    step_s: float,
    known: FloatArray,
    contact: FloatArray,
    method: Method,
) -> MechanismRun:
    """Motion of a joint under motors whose gears give way; SolveError where it fails."""
    effort = np.zeros_like(known)
    effort[:, 0] = contact
    found = simulate_mechanism(problem, motor_rad, step_s, known=known, effort=effort, method=method)
    if found.status is MechanismStatus.FAILED:
        raise SolveError(found.message)
    return found


def _of_gear(
    system: Mechanism, run: MechanismRun, output: FloatArray, step_s: float, kept: slice = slice(None)
) -> MotorResponse:
    """A run of free drums at the rows that are kept, those of the output, `step_s` apart."""
    motor = run.motor[kept]
    speed = np.gradient(motor, step_s, axis=0)
    torque = system.drive.torque_N_m(run.effort[kept], np.gradient(speed, step_s, axis=0), np.sign(speed))
    return MotorResponse(
        status=run.status,
        message=run.message,
        output=output,
        position_rad=run.position[kept],
        motor_rad=motor,
        torque_N_m=torque,
        tension_N=run.tension_N[kept],
        drum_N=run.drum_N[kept],
        lowest_N=run.lowest_N[kept],
        work=run.work,
    )


def _response(
    run: JointSimulation, output: FloatArray, position_rad: FloatArray, kept: slice = slice(None)
) -> MotorResponse:
    """A run at the rows that are kept, those of output and position."""
    return MotorResponse(
        status=run.outcome,
        message=run.message,
        output=output[:, None],
        position_rad=position_rad,
        motor_rad=run.motor_rad[kept],
        torque_N_m=run.motor_torque_N_m[kept],
        tension_N=run.tension_N[kept],
        drum_N=run.drum_N[kept],
        lowest_N=run.lowest_N[kept],
        work=run.iterations,
    )


def motor_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of the motors: one of a loop, else by tendon."""
    return ("motor",) if mechanism.drive.kind is DriveKind.LOOP else tuple(t.name for t in mechanism.tendons)


def assumed(mechanism: Mechanism) -> Uncertainty:
    """Uncertainty of a mechanism that has not been identified."""
    loop = mechanism.drive.kind is DriveKind.LOOP and mechanism.drive.pretension_N
    pretension = (Spread(keys=("drive.pretension_N",), half_width=ASSUMED_SPREAD),) if loop else ()
    return Uncertainty(mu=ASSUMED_SPREAD, stiffness=ASSUMED_SPREAD, spread=pretension, samples=2)


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


def _settled(message: str, rows: int, **outputs: FloatArray) -> str:
    """The message of a run over cycles of so many rows, or by how much the last two differ, in the unit of the name."""
    apart = [
        (float(np.abs(each[-rows:] - each[-2 * rows : -rows]).max()), float(np.ptp(each[-rows:])), unit)
        for unit, each in outputs.items()
    ]
    change, whole, name = max(apart, key=lambda each: each[0] / max(each[1], 1e-12))
    if change <= _STEADY * whole:
        return message
    unit = name.replace("_", " ")
    share = 100 * change / max(whole, 1e-12)
    return f"{UNSETTLED} by {change:.2g} {unit} ({share:.2g} %) after {_SETTLING_CYCLES} periods"


def joint_load(mechanism: Mechanism, sampled: SampledJoint, step_s: float) -> FloatArray:
    """Torque that the joint itself takes while it moves as it does, its dry friction included [N m]."""
    joint, angle = mechanism.joint, sampled.angle_rad
    speed = np.gradient(angle, step_s)
    moving = joint.inertia_kg_m2 * np.gradient(speed, step_s) + joint.damping_N_m_s_per_rad * speed
    return moving + joint.coulomb_N_m * np.sign(speed) + joint.static_torque_N_m(angle)
