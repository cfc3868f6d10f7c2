"""The exact inverse of a joint between tendons: the motor angle whose response is a joint angle.

The wanted angle gives the torque, the torque the tensions (a pair), or one equation for them and the drum the other (a
loop); from tension and far end the recursion of each chain gives the drum. Simulated forwards with the same chains and
step, the motor angle gives the joint angle back to rounding.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.joint.by_casadi import CasadiJoint
from tendonff.ocp.joint.compiled import CompiledJoint
from tendonff.ocp.joint.protocol import Array, JointEngine, JointMemory, JointProblem
from tendonff.ocp.joint.start import start_memory

MOST_CYCLES = 40
STEADY = 1e-7
"""Two cycles are the same whose motor angles differ by less than this share of their range."""


class JointStatus(StrEnum):
    """Whether the motor angle that was found exists.

    Attributes
    ----------
    EXACT
        Every tendon stays taut: the joint follows the reference.
    SLACK
        A tendon of a loop hangs loose on the way, as it would: the other one carries the torque.
    WOULD_PUSH
        Somewhere a tendon would have to push.
    FAILED
        A step has no answer; the rows before it are good.
    """

    EXACT = "exact"
    SLACK = "slack"
    WOULD_PUSH = "would_push"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class JointInversion:
    """Motor angle whose response is a joint angle, before limits of the drive.

    Attributes
    ----------
    status : JointStatus
    message : str
        Why, for the user.
    time_s : ndarray, shape (n,)
        Rows at 0, h, 2 h ...
    motor_rad : ndarray, shape (n, motors)
        Angle of each motor since the start, ahead of its drum by what the gear gives way.
    motor_torque_N_m : ndarray, shape (n, motors)
        Torque that each gives, inertia and dry friction of the drive included.
    tension_N, drum_N : ndarray, shape (n, tendons)
        Tension at the joint, and at the drum.
    slack_m : ndarray, shape (n,)
        Length of tendon that hangs loose in a loop.
    lowest_N : ndarray, shape (n,)
        Smallest tension along any tendon.
    evaluations : int
        Of the recursions, all steps together.
    final : JointMemory
        State after the last row.
    """

    status: JointStatus
    message: str
    time_s: Array
    motor_rad: Array
    motor_torque_N_m: Array
    tension_N: Array
    drum_N: Array
    slack_m: Array
    lowest_N: Array
    evaluations: int
    final: JointMemory


def engine_of(problem: JointProblem, step_s: float, engine: Engine) -> JointEngine:
    """Engine of a problem; ParameterError for a step that is no time."""
    require_step(step_s)
    return CompiledJoint(problem, step_s) if resolve_engine(engine) is Engine.COMPILED else CasadiJoint(problem, step_s)


def require_step(step_s: float) -> None:
    """Refuse a step that is no time."""
    if not 0 < step_s < math.inf:
        raise ParameterError(f"step_s must be a finite number > 0, got {step_s}; 0.001 suits most rigs")


def as_rows(name: str, values: Array | float, rows: int | None, step_s: float) -> Array:
    """A vector of finite numbers, or one number for all rows."""
    given = np.asarray(values, dtype=np.float64)
    if rows is not None and given.ndim == 0:
        given = np.full(rows, float(given))
    if given.ndim != 1 or given.size < 1 or (rows is not None and len(given) != rows):
        wanted = "a vector with at least one row" if rows is None else f"one number or a vector of {rows} rows"
        raise ParameterError(f"{name} must be {wanted}, got shape {given.shape}")
    bad = np.flatnonzero(~np.isfinite(given))
    if bad.size:
        raise ParameterError(f"{name} must be finite, got {given[bad[0]]} at t = {bad[0] * step_s:g} s; repair it")
    return given


@in_turn
def invert_joint(
    problem: JointProblem,
    angle_rad: Array,
    step_s: float,
    *,
    contact_N_m: Array | float = 0.0,
    memory: JointMemory | None = None,
    engine: Engine = Engine.AUTO,
) -> JointInversion:
    """Find the motor angle whose response is a joint angle.

    Parameters
    ----------
    problem : JointProblem
    angle_rad : ndarray, shape (n,)
        Wanted angle at 0, h, 2 h ... [rad]; the first where the problem starts.
    step_s : float
        h [s], > 0.
    contact_N_m : ndarray, shape (n,), or float, optional
        Torque that the joint gives to what it touches [N m], positive towards positive angles.
    memory : JointMemory, optional
        Start from here instead; the first angle is then not used.
    engine : Engine, optional

    Raises
    ------
    ParameterError
        If angle, contact or step are not usable numbers, or the angle starts elsewhere.

    Examples
    --------
    >>> import numpy as np
    >>> import tendonff as tf
    >>> from tendonff.models.path import JointMotion
    >>> mechanism = tf.load_scenario("examples/hand_joint.toml").mechanism
    >>> time = 1e-3 * np.arange(501)
    >>> wanted = 0.2 * (1 - np.cos(2 * np.pi * time / 0.5))
    >>> motion = JointMotion(names=("knuckle",), time_s=time, angle_rad=wanted[:, None])
    >>> problem = tf.system_of(mechanism, tf.Level.PRESLIDING, motion)
    >>> motor = tf.invert(problem, wanted, 1e-3).motor_rad
    >>> run = tf.simulate(problem, motor, 1e-3)
    >>> bool(abs(run.angle_rad - wanted).max() < 1e-6)
    True
    """
    runner = engine_of(problem, step_s, engine)
    angle = as_rows("angle_rad", angle_rad, None, step_s)
    contact = as_rows("contact_N_m", contact_N_m, len(angle), step_s)
    if memory is None:
        memory = start_memory(problem, float(contact[0]))
        if abs(float(angle[0]) - problem.start_rad) > 1e-9:
            raise ParameterError(
                f"angle_rad starts at {angle[0]:g}, the problem at {problem.start_rad:g} rad; a run starts at "
                "rest there"
            )
    memory = memory.copy()
    first = memory.copy()
    angle = np.concatenate([first.z[1:2], angle[1:]])
    rows = runner.invert(memory, angle, contact, problem.mechanism.drive.least_tension_N or 0.0)
    travel = np.vstack([np.array([x[-2] for x in first.x]) - first.start_m, rows.travel_m])
    drum = np.vstack([first.tension_N, rows.drum_N])  # at rest the tension is the same along a tendon
    tension = np.vstack([first.tension_N, rows.tension_N])
    # A drum that holds a loose end holds nothing.
    slack = np.concatenate([[first.closure_rad * min(map(abs, problem.windings_m))], rows.slack_m])
    held = np.maximum(drum, 0.0)
    gives = held_torques(problem, held - first.rest_N) * problem.mechanism.drive.gives_rad_per_N_m
    lowest = np.concatenate([[float(first.tension_N.min())], rows.lowest_N])
    motor = motor_angles(problem, travel) + gives
    status, message = _status(problem, len(angle), lowest, slack, step_s)
    return JointInversion(
        status=status,
        message=message,
        time_s=np.arange(len(travel), dtype=np.float64) * step_s,
        motor_rad=motor,
        motor_torque_N_m=motor_torques(problem, motor, held, step_s),
        tension_N=tension,
        drum_N=held,
        slack_m=slack,
        lowest_N=lowest,
        evaluations=rows.evaluations,
        final=memory,
    )


def steady_joint_inverse(
    problem: JointProblem,
    cycle_rad: Array,
    step_s: float,
    *,
    contact_N_m: Array | float = 0.0,
    engine: Engine = Engine.AUTO,
) -> tuple[JointInversion, int, bool]:
    """Inverse of an angle that repeats, in its steady state; also the cycles that were run, and whether they repeat.

    The cycle, shape (n,) [rad], is one period, its last row the first of the next. So is what is returned; the motor's
    angle counts from the rest before the first cycle.
    """
    angle = as_rows("cycle_rad", cycle_rad, None, step_s)
    contact = as_rows("contact_N_m", contact_N_m, len(angle), step_s)
    found = invert_joint(problem, angle, step_s, contact_N_m=contact, engine=engine)
    for cycle in range(2, MOST_CYCLES + 1):
        before, memory = found, replace_time(found.final)
        found = invert_joint(problem, angle, step_s, contact_N_m=contact, memory=memory, engine=engine)
        if found.status is JointStatus.FAILED:
            return found, cycle, False
        change = float(np.abs(found.motor_rad[1:] - before.motor_rad[1:]).max())
        if change <= STEADY * max(float(np.ptp(found.motor_rad)), 1e-9):
            return found, cycle, True
    return found, MOST_CYCLES, False


def replace_time(memory: JointMemory) -> JointMemory:
    """The same state at time zero: the other joints of a cycle repeat."""
    again = memory.copy()
    again.time_s = 0.0
    return again


def motor_angles(problem: JointProblem, travel_m: Array) -> Array:
    """Angles of the motors for travels at the drums, shape (rows, tendons): one column for a loop [rad]."""
    each = problem.mechanism.motor_rad(travel_m, problem.start_rad)
    return each[:, :1] if problem.loop else each


def held_torques(problem: JointProblem, drum_N: Array) -> Array:
    """Torque that the tendons take at each motor's shaft for tensions at the drums, shape (rows, motors) [N m]."""
    each: Array = drum_N * np.array(problem.windings_m) / problem.mechanism.drive.gear_ratio
    return each.sum(axis=1, keepdims=True) if problem.loop else each


def motor_torques(problem: JointProblem, motor_rad: Array, drum_N: Array, step_s: float) -> Array:
    """Torque of each motor, shape (rows, motors) [N m]: tendons, inertia and dry friction of the drive."""
    drive, held = problem.mechanism.drive, held_torques(problem, drum_N)
    if len(motor_rad) < 3:
        return held
    speed = np.gradient(motor_rad, step_s, axis=0)
    return drive.torque_N_m(held, np.gradient(speed, step_s, axis=0), np.sign(speed))


def _status(problem: JointProblem, rows: int, lowest: Array, slack: Array, step_s: float) -> tuple[JointStatus, str]:
    if len(lowest) < rows:
        return JointStatus.FAILED, (
            f"the inverse stopped at t = {len(lowest) * step_s:.6g} s: no tension closes the loop there; check the "
            "reference for jumps, and moment arms that change their sign"
        )
    hanging = slack > 0
    if hanging.any():
        share = 100 * float(hanging.mean())
        return JointStatus.SLACK, (
            f"a tendon hangs loose from t = {int(np.argmax(hanging)) * step_s:.6g} s, in {share:.2g} % of the rows; "
            "the other one carries the torque, and the joint can be pushed by hand; more pretension_N keeps both taut"
        )
    floor = -1e-6 if problem.loop else 0.0
    pushed = np.flatnonzero(lowest < floor)
    if pushed.size:
        return JointStatus.WOULD_PUSH, (
            f"a tendon would have to push at t = {int(pushed[0]) * step_s:.6g} s ({pushed.size} of {rows} rows); keep "
            "more tension, or let the reference change more slowly"
        )
    return JointStatus.EXACT, f"{rows} rows, least tension {lowest.min():.4g} N"
