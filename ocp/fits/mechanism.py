"""A joint between tendons under a measured motor angle: torque of the motor and angle of the joint, with slopes.

The motor leads both drums, the joint is free and runs into its stops. What the motor feels beyond its tendons, the dry
friction of its gear first of all, turns over within a short way of the motor at every reversal (Dahl's law).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.models.cached import cached_property
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.path import JointMotion
from tendonff.ocp.joint.simulate import JointOutcome, simulate_joint
from tendonff.ocp.joint.start import joint_problem
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


def respond(
    mechanism: Mechanism,
    run: MotorRun,
    *,
    segments: int,
    slip_rad: float = GEAR_SLIP_RAD,
    backlash_held_N_m: Array | None = None,
    refinement: int = 1,
    as_read: bool = False,
) -> MotorResponse:
    """Simulate a loop under a motor angle.

    Parameters
    ----------
    mechanism : Mechanism
        Of a loop.
    run : MotorRun
    segments : int
        Masses of each tendon.
    slip_rad : float, optional
        Way of the motor in which friction of its gear builds up, > 0.
    backlash_held_N_m : ndarray, shape (rows,), optional
        Measured torque that the tendons take: its sign says at which side of its play the gear is, half of which the
        drum stays behind.
    refinement : int, optional
        Steps of the simulation in one of the run.
    as_read : bool, optional
        The drum goes from reading to reading, in straight lines: of a motor that moves in counts.
    """
    drive, rows = mechanism.drive, len(run.motor_rad)
    drum = run.motor_rad if run.read_rad is None or not as_read else run.read_rad
    if backlash_held_N_m is not None and drive.backlash_rad > 0:
        scale = max(0.02 * float(np.ptp(backlash_held_N_m)), 1e-9)
        drum = drum - 0.5 * drive.backlash_rad * np.clip(backlash_held_N_m / scale, -1, 1)
        drum = drum - drum[0]
    fine = np.arange((rows - 1) * refinement + 1) / refinement
    led = np.interp(fine, np.arange(rows), drum) if refinement > 1 else drum
    reach = drum * mechanism.drum_radius_m[0] / (drive.gear_ratio * abs(mechanism.arms_at(run.start_rad)[0]))
    motion = JointMotion(
        names=(mechanism.joint.name,),
        time_s=np.arange(3.0),
        angle_rad=run.start_rad + np.array([[0.0], [float(reach.min())], [float(reach.max())]]),
    )
    problem = joint_problem(mechanism, Level.PRESLIDING, motion, segments=segments)
    answer = simulate_joint(problem, led, run.step_s / refinement)
    held = answer.drum_N @ np.array(problem.windings_m) / drive.gear_ratio
    good = len(held)
    held, angle = (_whole(each, len(led))[::refinement] for each in (held, answer.angle_rad))
    return MotorResponse(
        torque_N_m=drive.torque_N_m(held, run.acceleration_rad_per_s2, run.way(slip_rad)),
        angle_rad=angle,
        held_N_m=held,
        slack=answer.outcome is JointOutcome.SLACK,
        complete=good == len(led),
    )


def _whole(values: Array, rows: int) -> Array:
    return np.concatenate([values, np.full(rows - len(values), values[-1])])


def differences(predict: Callable[[Array], Array], at: Array, steps: Sequence[float]) -> tuple[Array, Array]:
    """A prediction, shape (m,), and its slopes by forward differences, shape (m, k)."""
    middle = predict(at)
    columns = []
    for k, step in enumerate(steps):
        moved = at.copy()
        moved[k] += step
        columns.append((predict(moved) - middle) / step)
    return middle, np.column_stack(columns) if columns else np.empty((len(middle), 0))
