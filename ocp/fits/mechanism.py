"""Joints under measured angles of their motors: torques of the motors and angles of the joints, with slopes.

Motors lead all drums, joints are free and run into their stops. What a motor feels beyond its tendons, the dry friction
of its gear first of all, turns over within a short way of the motor at every reversal (Dahl's law).
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy.linalg import solve_banded

from tendonff.models.cached import cached_property
from tendonff.models.fidelity import Level
from tendonff.models.joint.description import describe
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.path import JointMotion
from tendonff.ocp.joint.simulate import JointOutcome, simulate_joint
from tendonff.ocp.joint.start import joint_problem, start_tensions
from tendonff.ocp.mechanism.problem import MechanismProblem
from tendonff.ocp.mechanism.response import MechanismStatus, simulate_mechanism
from tendonff.ocp.mechanism.slopes import Direction, Start, simulate_slopes
from tendonff.ocp.mechanism.start import mechanism_problem
from tendonff.ocp.step.protocol import Array

GEAR_SLIP_RAD = 3e-3
"""Usual way of a motor in which friction of its gear builds up [rad]."""

LEAST_COUNTS = 1e-4
"""Distance of readings from the smooth angle that counts, as a share of the range."""

ROOM_RAD = 0.1
"""By which a joint may go beyond what its encoder shows."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorRun:
    """Measured angles of motors.

    Parameters
    ----------
    motor_rad : ndarray, shape (rows, motors)
        Since the start, evenly sampled.
    step_s : float
    start_rad : ndarray, shape (joints,)
        Where the joints stand at the start.
    read_rad : ndarray, shape (rows, motors), optional
        The same angles as they were read, before any smoothing.
    joint_rad : ndarray, shape (rows, joints), optional
        Of the joints, NaN without an encoder: over what range.
    standing_rad : mapping of str to float, optional
        Angles of joints that no tendon drives and sections follow: at rest, such as the bend of a sheath.
    cells : bool, optional
        Torques are those of tension cells at the drums: what the motors feel beyond their tendons is not in them.
    """

    motor_rad: Array
    step_s: float
    start_rad: Array
    read_rad: Array | None = None
    joint_rad: Array | None = None
    standing_rad: Mapping[str, float] = field(default_factory=dict)
    cells: bool = False

    @classmethod
    def of_one(cls, motor_rad: Array, step_s: float, start_rad: float, read_rad: Array | None = None) -> "MotorRun":
        """Run of one motor and one joint: angles of shape (rows,)."""
        read = None if read_rad is None else read_rad[:, None]
        return cls(motor_rad=motor_rad[:, None], step_s=step_s, start_rad=np.array([start_rad]), read_rad=read)

    @property
    def in_counts(self) -> bool:
        """Whether readings go in steps that are worth a thought."""
        if self.read_rad is None:
            return False
        off = np.std(self.read_rad - self.motor_rad, axis=0)
        return bool((off > LEAST_COUNTS * np.ptp(self.motor_rad, axis=0)).any())

    @cached_property
    def acceleration_rad_per_s2(self) -> Array:
        """Second derivatives, shape (rows, motors)."""
        return np.gradient(np.gradient(self.motor_rad, self.step_s, axis=0), self.step_s, axis=0)

    def way(self, slip_rad: float | Array = GEAR_SLIP_RAD) -> Array:
        """Friction of gears over its value in full slip, built up within a way of each motor, shape (rows, motors)."""
        return self._ways(tuple(np.broadcast_to(slip_rad, self.motor_rad.shape[1]).tolist()))

    @cached_property
    def _ways(self) -> Callable[[tuple[float, ...]], Array]:
        """`way`, the last few remembered: a fit asks for the same again and again."""
        return functools.lru_cache(maxsize=8)(self._way)

    def _way(self, slip_rad: tuple[float, ...]) -> Array:
        columns = []
        for angle, slip in zip(self.motor_rad.T, slip_rad, strict=True):
            move = np.diff(angle, prepend=angle[:1]) / slip
            kept = np.exp(-np.abs(move))  # Dahl's law along a straight move: one lower band
            bands = np.array([np.ones_like(kept), np.append(-kept[1:], 0.0)])
            columns.append(solve_banded((1, 0), bands, (1 - kept) * np.sign(move)))
        return np.column_stack(columns)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorResponse:
    """Response of a mechanism to angles of its motors.

    Attributes
    ----------
    torque_N_m : ndarray, shape (rows, motors)
        Of the motors.
    angle_rad : ndarray, shape (rows, joints)
        Of the joints.
    held_N_m : ndarray, shape (rows, motors)
        Torque of each motor that its tendons take.
    slack : bool
        A tendon hangs loose somewhere.
    complete : bool
        All rows could be simulated; else the last good one is repeated.
    """

    torque_N_m: Array
    angle_rad: Array
    held_N_m: Array
    slack: bool
    complete: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Led:
    """Rows of a simulation: what tendons take of the motors, shape (rows, motors), angles, shape (rows, joints)."""

    held_N_m: Array
    angle_rad: Array
    slack: bool


class Rig(Protocol):
    """A mechanism, and what its motors feel beyond its tendons."""

    def drums_rad(self, run: MotorRun, *, as_read: bool) -> Array:
        """Angles of the drums at the motors' shafts, shape (rows, motors)."""

    def start(self, run: MotorRun, drum_rad: Array, segments: int) -> Start:
        """The mechanism at rest where a run begins, its motors last."""

    def simulate(self, run: MotorRun, drum_rad: Array, led_rad: Array, step_s: float, segments: int) -> Led:
        """Response to drums that are led, shape (steps, motors), in a run whose drums cover `drum_rad`."""

    def torque_N_m(self, run: MotorRun, held_N_m: Array) -> Array:
        """Torques of the motors where their tendons take so much, shape (rows, motors)."""

    @property
    def moving(self) -> object:
        """Everything that decides how joints and tendons move with the drums."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """A loop, and what its motor feels beyond its tendons.

    Parameters
    ----------
    mechanism : Mechanism
    slip_rad : float, optional
        Way of the motor in which friction of its gear builds up, > 0.
    offset_N_m : float, optional
        Of the measured torque.
    backlash_held_N_m : ndarray, shape (rows,), optional
        Measured torque that the tendons take: its sign says at which side of its play the gear is, half of which the
        drum stays behind.
    """

    mechanism: Mechanism
    slip_rad: float = GEAR_SLIP_RAD
    offset_N_m: float = 0.0
    backlash_held_N_m: Array | None = None

    def drums_rad(self, run: MotorRun, *, as_read: bool) -> Array:
        """See `Rig`."""
        drum = run.motor_rad if run.read_rad is None or not as_read else run.read_rad
        held, play = self.backlash_held_N_m, self.mechanism.drive.backlash_rad
        if held is None or play == 0:
            return drum
        scale = max(0.02 * float(np.ptp(held)), 1e-9)
        drum = drum - 0.5 * play * np.clip(held / scale, -1, 1)[:, None]
        return np.asarray(drum - drum[0])

    def torque_N_m(self, run: MotorRun, held_N_m: Array) -> Array:
        """See `Rig`."""
        drive = self.mechanism.drive
        return drive.torque_N_m(held_N_m, run.acceleration_rad_per_s2, run.way(self.slip_rad)) + self.offset_N_m

    @property
    def moving(self) -> object:
        """See `Rig`."""
        mechanism, drive = self.mechanism, self.mechanism.drive
        return mechanism.joint, mechanism.tendons, drive.drum_radius_m, drive.gear_ratio, drive.pretension_N

    def _motion(self, run: MotorRun, drum_rad: Array) -> JointMotion:
        """Angles of the joint that decide which sections get masses."""
        mechanism, start = self.mechanism, float(run.start_rad[0])
        per_rad = mechanism.drum_radius_m[0] / (mechanism.drive.gear_ratio * abs(mechanism.arms_at(start)[0]))
        reach = [0.0, float(drum_rad.min()) * per_rad, float(drum_rad.max()) * per_rad]
        return JointMotion(names=(mechanism.joint.name,), time_s=np.arange(3.0), angle_rad=start + np.array([reach]).T)

    def simulate(self, run: MotorRun, drum_rad: Array, led_rad: Array, step_s: float, segments: int) -> Led:
        """See `Rig`."""
        problem = joint_problem(self.mechanism, Level.PRESLIDING, self._motion(run, drum_rad), segments=segments)
        answer = simulate_joint(problem, led_rad, step_s)
        held = answer.drum_N @ np.array(problem.windings_m) / self.mechanism.drive.gear_ratio
        slack = answer.outcome is JointOutcome.SLACK
        return Led(held_N_m=held[:, None], angle_rad=answer.angle_rad[:, None], slack=slack)

    def start(self, run: MotorRun, drum_rad: Array, segments: int) -> Start:
        """See `Rig`."""
        at, drive = float(run.start_rad[0]), self.mechanism.drive
        tension, slack_rad = start_tensions(self.mechanism, at)
        problem = MechanismProblem(
            mechanism=describe(self.mechanism, self._motion(run, drum_rad)),
            level=Level.PRESLIDING,
            segments=segments,
            driven=1,
            wanted=1,
            motors=1,
            start=np.array([at, 0.0]),
            tension_N=tension,
        )
        return Start.at_rest(problem, slack_rad * drive.gear_ratio)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Several:
    """Joints with several motors, and what these feel beyond their tendons.

    Parameters
    ----------
    mechanism : Finger
    tension_N : mapping of str to float, optional
        Of tendons at the start of the run; default: as `Finger.sharing` shares them.
    """

    mechanism: Finger
    tension_N: Mapping[str, float] = field(default_factory=dict)

    def drums_rad(self, run: MotorRun, *, as_read: bool) -> Array:
        """See `Rig`."""
        return run.motor_rad if run.read_rad is None or not as_read else run.read_rad

    def torque_N_m(self, run: MotorRun, held_N_m: Array) -> Array:
        """See `Rig`."""
        if run.cells:
            return held_N_m
        drives = [motor.drive for motor in self.mechanism.motors]
        columns = zip(drives, held_N_m.T, run.acceleration_rad_per_s2.T, run.way().T, strict=True)
        return np.column_stack([drive.torque_N_m(*column) for drive, *column in columns])

    def joints_rad(self, run: MotorRun, torque_N_m: Array, *, segments: int, refinement: int = 1) -> Array:
        """Angles of the joints where measured torques act on the drums, shape (rows, joints).

        The motors' angles say only which way gears rub and how motors speed up. NaN where no spring holds a joint, for
        torques then do not tell where it stands, and after a row without an answer.
        """
        joints = self.mechanism.joints
        if not all(joint.stiffness_N_m_per_rad > 0 for joint in joints):
            return np.full((len(torque_N_m), len(joints)), np.nan)
        held = torque_N_m + (torque_N_m - self.torque_N_m(run, torque_N_m))
        forced = self.start(run, run.motor_rad, segments).problem.forced()
        answer = simulate_mechanism(forced, _refined(held, refinement), run.step_s / refinement)
        found = np.full(((len(held) - 1) * refinement + 1, len(joints)), np.nan)
        found[: len(answer.position)] = answer.position[:, : len(joints)]
        return found[::refinement]

    @property
    def moving(self) -> object:
        """See `Rig`."""
        finger = self.mechanism
        motors = [(m.winds, m.winding_m, m.drive.pretension_N) for m in finger.motors]
        return finger.joints, finger.tendons, motors, dict(self.tension_N)

    def simulate(self, run: MotorRun, drum_rad: Array, led_rad: Array, step_s: float, segments: int) -> Led:
        """See `Rig`."""
        answer = simulate_mechanism(self.start(run, drum_rad, segments).problem, led_rad, step_s)
        angle = answer.position[:, : len(self.mechanism.joints)]
        return Led(held_N_m=answer.effort, angle_rad=angle, slack=answer.status is MechanismStatus.SLACK)

    def start(self, run: MotorRun, drum_rad: Array, segments: int) -> Start:  # noqa: ARG002
        """See `Rig`."""
        finger, seen = self.mechanism, run.start_rad[None]
        if run.joint_rad is not None:
            seen = np.where(np.isfinite(run.joint_rad), run.joint_rad, run.start_rad)
        spans = np.vstack([run.start_rad, seen.min(axis=0) - ROOM_RAD, seen.max(axis=0) + ROOM_RAD])
        motion = JointMotion(names=finger.names, time_s=np.arange(3.0), angle_rad=spans).beside(run.standing_rad)
        problem = mechanism_problem(
            finger.mechanism(motion),
            Level.PRESLIDING,
            {name: float(angle[0]) for name, angle in motion.by_joint.items()},
            pretension_N=finger.pretension_N,
            sharing=finger.sharing,
            segments=segments,
        )
        own = [
            self.tension_N.get(tendon.name, float(tension))
            for tendon, tension in zip(finger.tendons, problem.tension_N, strict=True)
        ]
        return Start.at_rest(problem.starting(np.array(own)))


def respond(rig: Rig, run: MotorRun, *, segments: int, refinement: int = 1, as_read: bool = False) -> MotorResponse:
    """Simulate a mechanism under angles of its motors.

    Parameters
    ----------
    rig : Rig
    run : MotorRun
    segments : int
        Masses of each tendon.
    refinement : int, optional
        Steps of the simulation in one of the run.
    as_read : bool, optional
        Drums go from reading to reading, in straight lines: of motors that move in counts.
    """
    drum = rig.drums_rad(run, as_read=as_read)
    led = _refined(drum, refinement)
    answer = rig.simulate(run, drum, led, run.step_s / refinement, segments)
    held, angle = (_whole(each, len(led))[::refinement] for each in (answer.held_N_m, answer.angle_rad))
    return MotorResponse(
        torque_N_m=rig.torque_N_m(run, held),
        angle_rad=angle,
        held_N_m=held,
        slack=answer.slack,
        complete=len(answer.held_N_m) == len(led),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A change of a rig, by those on either side of it.

    Parameters
    ----------
    above, below : Rig
    apart : float
        How far apart they are, in the unit that slopes are wanted over.
    """

    above: Rig
    below: Rig
    apart: float

    def touches(self, run: MotorRun, *, as_read: bool) -> bool:
        """Whether joints and tendons notice, and not only what the motors feel beyond them."""
        drums = [each.drums_rad(run, as_read=as_read) for each in (self.above, self.below)]
        return self.above.moving != self.below.moving or not np.array_equal(drums[0], drums[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorSlopes:
    """Derivatives of a `MotorResponse` over changes.

    Attributes
    ----------
    torque_N_m : ndarray, shape (rows, motors, changes)
    angle_rad : ndarray, shape (rows, joints, changes)
    """

    torque_N_m: Array
    angle_rad: Array


def respond_with_slopes(
    rig: Rig, run: MotorRun, changes: Sequence[Change], *, segments: int, refinement: int = 1, as_read: bool = False
) -> tuple[MotorResponse, MotorSlopes]:
    """As `respond`, with exact derivatives over changes.

    Raises
    ------
    CodeError
        If no C compiler works here.
    """
    drum = rig.drums_rad(run, as_read=as_read)
    touching = [k for k, change in enumerate(changes) if change.touches(run, as_read=as_read)]
    begun = rig.start(run, drum, segments)

    def direction(change: Change) -> Direction:
        sides = change.above, change.below
        above, below = (begun if each is rig else each.start(run, drum, segments) for each in sides)
        drums = [_refined(each.drums_rad(run, as_read=as_read), refinement) for each in sides]
        command = None if np.array_equal(drums[0], drums[1]) else (drums[0] - drums[1]) / change.apart
        return Direction(above=above, below=below, apart=change.apart, command=command)

    directions = [direction(changes[k]) for k in touching]
    led, joints = _refined(drum, refinement), len(run.start_rad)
    answer, slopes = simulate_slopes(begun, led, run.step_s / refinement, directions)
    good = len(answer.position)
    held, angle = (_whole(each, len(led))[::refinement] for each in (answer.effort, answer.position[:, :joints]))
    by_held, by_angle = (np.zeros((*each.shape, len(changes))) for each in (held, angle))
    for found, each in ((by_held, slopes.effort), (by_angle, slopes.position[:, :joints])):
        found[..., touching] = _whole(each, len(led))[::refinement]
    columns = [
        (change.above.torque_N_m(run, held + by) - change.below.torque_N_m(run, held - by)) / change.apart
        for k, change in enumerate(changes)
        for by in [by_held[..., k] * change.apart / 2]
    ]
    response = MotorResponse(
        torque_N_m=rig.torque_N_m(run, held),
        angle_rad=angle,
        held_N_m=held,
        slack=answer.status is MechanismStatus.SLACK,
        complete=good == len(led),
    )
    torque = np.stack(columns, axis=-1) if columns else np.empty((*held.shape, 0))
    return response, MotorSlopes(torque_N_m=torque, angle_rad=by_angle)


def _refined(drum_rad: Array, refinement: int) -> Array:
    if refinement == 1:
        return drum_rad
    rows = np.arange(len(drum_rad))
    fine = np.arange((len(rows) - 1) * refinement + 1) / refinement
    return np.column_stack([np.interp(fine, rows, column) for column in drum_rad.T])


def _whole(values: Array, rows: int) -> Array:
    """The rows, the last good one repeated."""
    return np.concatenate([values, np.repeat(values[-1:], rows - len(values), axis=0)])


def differences(predict: Callable[[Array], Array], at: Array, steps: Sequence[float]) -> tuple[Array, Array]:
    """A prediction, shape (m,), and its slopes by forward differences, shape (m, k)."""
    middle = predict(at)
    columns = []
    for k, step in enumerate(steps):
        moved = at.copy()
        moved[k] += step
        columns.append((predict(moved) - middle) / step)
    return middle, np.column_stack(columns) if columns else np.empty((len(middle), 0))
