"""A joint between tendons under a measured motor angle: torque of the motor and angle of the joint, with slopes.

The motor leads both drums, the joint is free and runs into its stops. What the motor feels beyond its tendons, the dry
friction of its gear first of all, turns over within a short way of the motor at every reversal (Dahl's law).
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.models.cached import cached_property
from tendonff.models.fidelity import Level
from tendonff.models.joint.description import describe
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.path import JointMotion
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.simulate import JointOutcome, simulate_joint
from tendonff.ocp.joint.start import joint_problem, start_memory
from tendonff.ocp.mechanism.problem import MechanismMemory, MechanismProblem
from tendonff.ocp.mechanism.response import MechanismStatus
from tendonff.ocp.mechanism.slopes import Direction, Start, simulate_slopes
from tendonff.ocp.step.protocol import Array

GEAR_SLIP_RAD = 3e-3
"""Usual way of a motor in which friction of its gear builds up [rad]."""

LEAST_COUNTS = 1e-4
"""Distance of readings from the smooth angle that counts, as a share of the range."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorRun:
    """A measured motor angle.

    Parameters
    ----------
    motor_rad : ndarray, shape (rows,)
        Since the start, evenly sampled.
    step_s : float
    start_rad : float
        Where the joint stands at the start.
    read_rad : ndarray, shape (rows,), optional
        The same angle as it was read, before any smoothing.
    """

    motor_rad: Array
    step_s: float
    start_rad: float
    read_rad: Array | None = None

    @property
    def in_counts(self) -> bool:
        """Whether the readings go in steps that are worth a thought."""
        if self.read_rad is None:
            return False
        return float(np.std(self.read_rad - self.motor_rad)) > LEAST_COUNTS * float(np.ptp(self.motor_rad))

    @cached_property
    def acceleration_rad_per_s2(self) -> Array:
        """Second derivative, shape (rows,)."""
        return np.gradient(np.gradient(self.motor_rad, self.step_s), self.step_s)

    def way(self, slip_rad: float = GEAR_SLIP_RAD) -> Array:
        """Friction of the gear over its value in full slip, built up within a way of the motor, shape (rows,)."""
        return self._ways(slip_rad)

    @cached_property
    def _ways(self) -> Callable[[float], Array]:
        """`way`, the last few remembered: a fit asks for the same again and again."""
        return functools.lru_cache(maxsize=8)(self._way)

    def _way(self, slip_rad: float) -> Array:
        found, state = np.zeros(len(self.motor_rad)), 0.0
        for row, move in enumerate((np.diff(self.motor_rad) / slip_rad).tolist(), start=1):
            state = found[row] = (state + move) / (1 + abs(move))
        return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorResponse:
    """Response of a mechanism to a motor angle.

    Attributes
    ----------
    torque_N_m : ndarray, shape (rows,)
        Of the motor.
    angle_rad : ndarray, shape (rows,)
        Of the joint.
    held_N_m : ndarray, shape (rows,)
        Torque of the motor that its tendons take.
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

    def drum_rad(self, run: MotorRun, *, as_read: bool) -> Array:
        """Angle of the drum at the motor's shaft, shape (rows,)."""
        drum = run.motor_rad if run.read_rad is None or not as_read else run.read_rad
        held, play = self.backlash_held_N_m, self.mechanism.drive.backlash_rad
        if held is None or play == 0:
            return drum
        scale = max(0.02 * float(np.ptp(held)), 1e-9)
        drum = drum - 0.5 * play * np.clip(held / scale, -1, 1)
        return np.asarray(drum - drum[0])

    def torque_N_m(self, run: MotorRun, held_N_m: Array) -> Array:
        """Torque of the motor where its tendons take so much, shape (rows,)."""
        drive = self.mechanism.drive
        return drive.torque_N_m(held_N_m, run.acceleration_rad_per_s2, run.way(self.slip_rad)) + self.offset_N_m

    def problem(self, motion: JointMotion, segments: int) -> JointProblem:
        """The mechanism cut into chains, with masses where the motion touches the path."""
        return joint_problem(self.mechanism, Level.PRESLIDING, motion, segments=segments)

    def motion(self, run: MotorRun, drum_rad: Array) -> JointMotion:
        """Angles of the joint that decide which sections get masses."""
        mechanism = self.mechanism
        per_rad = mechanism.drum_radius_m[0] / (mechanism.drive.gear_ratio * abs(mechanism.arms_at(run.start_rad)[0]))
        reach = [0.0, float(drum_rad.min()) * per_rad, float(drum_rad.max()) * per_rad]
        return JointMotion(
            names=(mechanism.joint.name,), time_s=np.arange(3.0), angle_rad=run.start_rad + np.array([reach]).T
        )


def respond(loop: Loop, run: MotorRun, *, segments: int, refinement: int = 1, as_read: bool = False) -> MotorResponse:
    """Simulate a loop under a motor angle.

    Parameters
    ----------
    loop : Loop
    run : MotorRun
    segments : int
        Masses of each tendon.
    refinement : int, optional
        Steps of the simulation in one of the run.
    as_read : bool, optional
        The drum goes from reading to reading, in straight lines: of a motor that moves in counts.
    """
    drum = loop.drum_rad(run, as_read=as_read)
    problem, led = loop.problem(loop.motion(run, drum), segments), _refined(drum, refinement)
    answer = simulate_joint(problem, led, run.step_s / refinement)
    held = answer.drum_N @ np.array(problem.windings_m) / loop.mechanism.drive.gear_ratio
    good = len(held)
    held, angle = (_whole(each, len(led))[::refinement] for each in (held, answer.angle_rad))
    return MotorResponse(
        torque_N_m=loop.torque_N_m(run, held),
        angle_rad=angle,
        held_N_m=held,
        slack=answer.outcome is JointOutcome.SLACK,
        complete=good == len(led),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A change of a loop, by those on either side of it.

    Parameters
    ----------
    above, below : Loop
    apart : float
        How far apart they are, in the unit that slopes are wanted over.
    """

    above: Loop
    below: Loop
    apart: float

    def touches(self, run: MotorRun, *, as_read: bool) -> bool:
        """Whether joint and tendons notice, and not only what the motor feels beyond them."""
        one, other = (_moving(each.mechanism) for each in (self.above, self.below))
        drums = [each.drum_rad(run, as_read=as_read) for each in (self.above, self.below)]
        return one != other or not np.array_equal(drums[0], drums[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorSlopes:
    """Derivatives of a `MotorResponse` over changes, shape (rows, changes)."""

    torque_N_m: Array
    angle_rad: Array


def respond_with_slopes(
    loop: Loop, run: MotorRun, changes: Sequence[Change], *, segments: int, refinement: int = 1, as_read: bool = False
) -> tuple[MotorResponse, MotorSlopes]:
    """As `respond`, with exact derivatives over changes.

    Raises
    ------
    CodeError
        If no C compiler works here.
    """
    drum = loop.drum_rad(run, as_read=as_read)
    motion, rows = loop.motion(run, drum), len(drum)
    touching = [k for k, change in enumerate(changes) if change.touches(run, as_read=as_read)]
    directions = [_direction(changes[k], run, motion, segments, refinement, as_read=as_read) for k in touching]
    led = _refined(drum, refinement)
    answer, slopes = simulate_slopes(_start(loop, motion, segments), led[:, None], run.step_s / refinement, directions)
    good = len(answer.position)
    held, angle = (_whole(each, len(led))[::refinement] for each in (answer.effort[:, 0], answer.position[:, 0]))
    by_held, by_angle = np.zeros((2, rows, len(changes)))
    for found, each in ((by_held, slopes.effort), (by_angle, slopes.position)):
        found[:, touching] = _whole(each[:, 0], len(led))[::refinement]
    columns = [
        (change.above.torque_N_m(run, held + by) - change.below.torque_N_m(run, held - by)) / change.apart
        for change, by in zip(changes, (by_held * [change.apart / 2 for change in changes]).T, strict=True)
    ]
    response = MotorResponse(
        torque_N_m=loop.torque_N_m(run, held),
        angle_rad=angle,
        held_N_m=held,
        slack=answer.status is MechanismStatus.SLACK,
        complete=good == len(led),
    )
    return response, MotorSlopes(torque_N_m=np.array(columns).reshape(len(changes), rows).T, angle_rad=by_angle)


def _moving(mechanism: Mechanism) -> tuple[object, ...]:
    """Parameters that decide how joint and tendons move with the drum."""
    drive = mechanism.drive
    return mechanism.joint, mechanism.tendons, drive.drum_radius_m, drive.gear_ratio, drive.pretension_N


def _direction(
    change: Change, run: MotorRun, motion: JointMotion, segments: int, refinement: int, *, as_read: bool
) -> Direction:
    sides = change.above, change.below
    above, below = (_start(each, motion, segments) for each in sides)
    drums = [_refined(each.drum_rad(run, as_read=as_read), refinement) for each in sides]
    command = None if np.array_equal(drums[0], drums[1]) else (drums[0] - drums[1])[:, None] / change.apart
    return Direction(above=above, below=below, apart=change.apart, command=command)


def _start(loop: Loop, motion: JointMotion, segments: int) -> Start:
    """A loop as bodies in the order of their engine: the joint, its motor."""
    problem = loop.problem(motion, segments)
    memory = start_memory(problem, hanging=True)
    whole = MechanismProblem(
        mechanism=describe(loop.mechanism, motion),
        level=Level.PRESLIDING,
        segments=segments,
        driven=1,
        wanted=1,
        motors=1,
        start=np.array([problem.start_rad, 0.0]),
        tension_N=memory.tension_N,
    )
    z = np.array([memory.z, np.zeros(3)])
    return Start(
        problem=whole,
        memory=MechanismMemory(
            x=memory.x, x_old=memory.x_old, z=z, z_old=z.copy(), start_m=memory.start_m, tension_N=memory.tension_N
        ),
    )


def _refined(drum_rad: Array, refinement: int) -> Array:
    if refinement == 1:
        return drum_rad
    rows = len(drum_rad)
    return np.interp(np.arange((rows - 1) * refinement + 1) / refinement, np.arange(rows), drum_rad)


def _whole(values: Array, rows: int) -> Array:
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
