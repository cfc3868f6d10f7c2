"""Forward simulation of the whole mechanism: motors led, the joint free, or led where a torque is what matters."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Accuracy, Method
from tendonff.ocp.joint.integrated import IntegratedJoint
from tendonff.ocp.joint.invert import as_rows, engine_of, motor_torques, require_step
from tendonff.ocp.joint.protocol import Array, JointMemory, JointProblem, JointRows, JointRunner
from tendonff.ocp.joint.start import start_memory
from tendonff.ocp.short import rows_in_short


class JointOutcome(StrEnum):
    """Outcome of a simulation.

    Attributes
    ----------
    DONE
        All rows computed, every link in tension.
    SLACK
        All rows computed; some link went slack on the way.
    FAILED
        A step could not be solved; the rows before it are good.
    """

    DONE = "done"
    SLACK = "slack"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSimulation:
    """Response of a mechanism, rows at 0, h, 2 h ...

    Attributes
    ----------
    outcome : JointOutcome
    message : str
        What happened, for the user.
    time_s : ndarray, shape (n,)
    motor_rad, motor_torque_N_m : ndarray, shape (n, motors)
    angle_rad : ndarray, shape (n,)
        Of the joint.
    torque_N_m : ndarray, shape (n,)
        Sum of the tendons' torques on the joint.
    tension_N, drum_N : ndarray, shape (n, tendons)
        Tension at the joint, and at the drum.
    lowest_N : ndarray, shape (n,)
        Smallest tension along any tendon.
    iterations, splits : int
        Linear solves, and steps that had to be split.
    final : JointMemory
        State after the last good row.
    method : Method
        That advanced it.
    """

    outcome: JointOutcome
    message: str
    time_s: Array
    motor_rad: Array
    motor_torque_N_m: Array
    angle_rad: Array
    torque_N_m: Array
    tension_N: Array
    drum_N: Array
    lowest_N: Array
    iterations: int
    splits: int
    final: JointMemory
    method: Method = Method.BDF2

    def __repr__(self) -> str:
        return rows_in_short(self, self.outcome, self.time_s)

    def require(self) -> "JointSimulation":
        """Return itself, or raise `SolveError` with the message if it failed."""
        if self.outcome is JointOutcome.FAILED:
            raise SolveError(self.message)
        return self


@in_turn
def simulate_joint(
    problem: JointProblem,
    motor_rad: Array,
    step_s: float,
    *,
    contact_N_m: Array | float = 0.0,
    led_rad: Array | None = None,
    memory: JointMemory | None = None,
    engine: Engine = Engine.AUTO,
    method: Method = Method.BDF2,
    rtol: float = 1e-6,
    atol: float = 1e-9,
) -> JointSimulation:
    """Turn the motors, and see what the joint does.

    Parameters
    ----------
    problem : JointProblem
    motor_rad : ndarray, shape (n,) or (n, motors)
        Angle of each motor since the start, at 0, h, 2 h ... [rad].
    step_s : float
        h [s], > 0.
    contact_N_m : ndarray, shape (n,), or float, optional
        Torque that the joint gives to what it touches [N m].
    led_rad : ndarray, shape (n,), optional
        The joint's motion where something else decides it; then the torque of the tendons is what is found.
    memory : JointMemory, optional
        Start from here instead of from rest.
    engine : Engine, optional
        Of the method "bdf2"; all give the same results to 1e-5 of range.
    method : {"bdf2", "cvodes", "idas", "collocation"}, optional
        How it advances: by the step of this package, or by an integrator of CasADi on `mechanism_equations`, a hundred
        times slower or more.
    rtol, atol : float, optional
        Relative and absolute tolerance of an integrator, for every state in its SI unit.

    Raises
    ------
    ParameterError
        If an argument is not usable.

    Examples
    --------
    >>> import numpy as np
    >>> import tendonff as tf
    >>> from tendonff.models.path import JointMotion
    >>> mechanism = tf.load_scenario("examples/hand_joint.toml").mechanism
    >>> still = JointMotion(names=("knuckle",), time_s=np.zeros(1), angle_rad=np.zeros((1, 1)))
    >>> problem = tf.system_of(mechanism, tf.Level.PRESLIDING, still)
    >>> run = tf.simulate(problem, np.zeros(100), 1e-3)
    >>> bool(abs(run.angle_rad).max() < 1e-3)
    True
    """
    require_step(step_s)
    if problem.mechanism.drive.gear_stiffness_N_m_per_rad is not None:
        raise ParameterError(
            "the motor's gear gives way: simulate the scenario, or describe(mechanism, motion), whose drums are free"
        )
    accuracy = Accuracy(rtol=rtol, atol=atol)
    runner: JointRunner = (
        engine_of(problem, step_s, engine)
        if method is Method.BDF2
        else IntegratedJoint(problem, step_s, Method(method), accuracy)
    )
    motor = np.asarray(motor_rad, dtype=np.float64)
    motor = motor[:, None] if motor.ndim == 1 else motor
    motors = 1 if problem.loop else len(problem.chains)
    if motor.ndim != 2 or motor.shape[1] != motors or not len(motor):
        raise ParameterError(f"motor_rad must have a column for each of {motors} motors, got shape {motor.shape}")
    if not np.isfinite(motor).all():
        row = int(np.argmax(~np.isfinite(motor).all(axis=1)))
        raise ParameterError(
            f"motor_rad must be finite, got {motor[row]} at t = {row * step_s:g} s; repair the profile"
        )
    contact = as_rows("contact_N_m", contact_N_m, len(motor), step_s)
    led = None if led_rad is None else as_rows("led_rad", led_rad, len(motor), step_s)
    memory = start_memory(problem, float(contact[0]), hanging=True) if memory is None else memory.copy()
    first = memory.copy()
    travel = motor * np.array(problem.windings_m) / problem.mechanism.drive.gear_ratio
    rows = runner.run(memory, travel, contact, led)
    good = len(rows.angle_rad) + 1
    drum = np.vstack([first.tension_N, rows.drum_N])
    torque = float(problem.mechanism.joint.static_torque_N_m(first.z[1])) + float(contact[0])
    lowest = np.concatenate([[float(first.tension_N.min())], rows.lowest_N])
    outcome, message = _outcome(len(motor), lowest, rows, step_s)
    return JointSimulation(
        outcome=outcome,
        message=message,
        time_s=np.arange(good, dtype=np.float64) * step_s,
        motor_rad=motor[:good],
        motor_torque_N_m=motor_torques(problem, motor[:good], drum, step_s),
        angle_rad=np.concatenate([first.z[1:2], rows.angle_rad]),
        torque_N_m=np.concatenate([[torque], rows.torque_N_m]),
        tension_N=np.vstack([first.tension_N, rows.tension_N]),
        drum_N=drum,
        lowest_N=lowest,
        iterations=rows.iterations,
        splits=rows.splits,
        final=memory,
        method=Method(method),
    )


def _outcome(rows: int, lowest: Array, last: JointRows, step_s: float) -> tuple[JointOutcome, str]:
    if len(lowest) < rows and last.reason is not None:
        return JointOutcome.FAILED, f"simulation stopped before t = {len(lowest) * step_s:.6g} s: {last.reason}"
    if len(lowest) < rows:
        each = last.iterations / max(len(lowest), 1)
        return JointOutcome.FAILED, (
            f"simulation stopped at t = {len(lowest) * step_s:.6g} s: the step did not converge although it was split, "
            f"or the run takes too long, {each:.3g} solves a step where ten are usual; worst balance "
            f"{last.residual_N:.3g} N; check the motor angle there for jumps and the units of moment arms and masses, "
            f"or use a step below {step_s:g} s"
        )
    slack = lowest <= 0
    if slack.any():
        share = 100 * float(slack.mean())
        at = int(np.argmax(slack)) * step_s
        return JointOutcome.SLACK, f"a tendon went slack at t = {at:.6g} s; one is in {share:.2g} % of the rows"
    return JointOutcome.DONE, f"{rows} rows"
