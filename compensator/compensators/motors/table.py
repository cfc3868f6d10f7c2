"""The quasi-static law of a joint over its angle and the way it turns, as nodes to be looked up."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.task import MotorTask
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.models.errors import require
from tendonff.models.joint.quasi_static import directions, static_motor_rad

BOUND_SHARE = 1e-3
"""Largest interpolation error of a table, over the range of the reference [-]."""

BRANCHES = {"up": 1.0, "down": -1.0}
"""Way the joint turns, towards larger or smaller angles."""

_LEAST, _MOST = 5, 1025  # nodes on a branch


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointTable:
    """Motor angles of a joint over its angle and the way it turns.

    Attributes
    ----------
    angle_rad : ndarray, shape (nodes,)
    speeds_rad_per_s : tuple of float
        Of the joint, by which its damping acts; (0,) for slow motion alone.
    motor_rad : dict of str to ndarray, shape (speeds, nodes, motors)
        Of each branch, relative to the start.
    error_rad : float
        Largest interpolation error, as an angle of the joint.
    """

    angle_rad: FloatArray
    speeds_rad_per_s: tuple[float, ...]
    motor_rad: dict[str, FloatArray]
    error_rad: float

    def command(self, task: MotorTask) -> FloatArray:
        """Motor angles along a reference, shape (rows, motors); at the start at rest none."""
        angle, rows = task.sampled.angle_rad, np.arange(len(task.sampled.angle_rad))
        ways = directions(angle)[:, None]
        speed = np.abs(np.gradient(angle, task.scenario.run.step_s))
        at = np.interp(speed, self.speeds_rad_per_s, np.arange(float(len(self.speeds_rad_per_s))))
        below = at.astype(int)
        above, share = np.minimum(below + 1, len(self.speeds_rad_per_s) - 1), (at - below)[:, None]

        def branch(name: str) -> FloatArray:
            each = np.stack([looked_up(self.angle_rad, values, angle) for values in self.motor_rad[name]])
            found: FloatArray = (1 - share) * each[below, rows] + share * each[above, rows]
            return found

        found: FloatArray = np.where(ways > 0, branch("up"), np.where(ways < 0, branch("down"), 0.0))
        found[0] = 0.0
        return found


def tabulated(
    task: JointTask, bound_rad: float | None = None, angles_rad: Sequence[float] = (), rates: Sequence[float] = ()
) -> JointTable:
    """The law at as many nodes as an interpolation error needs, or at nodes that are given; InputError without a table.

    Parameters
    ----------
    task : JointTask
    bound_rad : float, optional
        Largest interpolation error, as an angle of the joint [rad]; default `BOUND_SHARE` of the range.
    angles_rad, rates : sequence of float
        Nodes [rad], and speeds by which damping acts [rad/s]; empty for those that are needed, and for slow motion.
    """
    if reason := task.without.get("table"):
        held = "hold them by --pose, or " if "joints" in reason else ""
        raise InputError(f"{task.scenario.source.name}: {reason}; {held}export the inverse by export-c")
    sampled, mechanism, speeds = task.sampled, task.mechanism, tuple(sorted(rates)) or (0.0,)
    low, high = float(sampled.angle_rad.min()), float(sampled.angle_rad.max())
    given = _nodes(angles_rad, low, high)
    bound = BOUND_SHARE * sampled.range if bound_rad is None else bound_rad
    require("bound", bound, above=0, hint="it is an angle of the joint [rad]")
    arm, drum = abs(mechanism.arms_at(low)[0]), mechanism.drum_radius_m[0] / mechanism.drive.gear_ratio
    nodes = _LEAST
    while True:
        angle = given if given is not None else np.linspace(low, high, nodes)
        fine = np.sort(np.r_[angle, 0.5 * (angle[1:] + angle[:-1])])
        motor = {name: np.stack([branch_rad(task, angle, way, w) for w in speeds]) for name, way in BRANCHES.items()}
        between = [
            branch_rad(task, fine, way, speeds[0]) - looked_up(angle, motor[name][0], fine)
            for name, way in BRANCHES.items()
        ]
        error = float(np.abs(between).max()) * drum / arm
        if error <= bound or nodes >= _MOST or given is not None:
            return JointTable(angle_rad=angle, speeds_rad_per_s=speeds, motor_rad=motor, error_rad=error)
        nodes = 2 * nodes - 1


def branch_rad(task: JointTask, angle_rad: FloatArray, way: float, speed_rad_per_s: float) -> FloatArray:
    """Motor angles relative to the start, shape (rows, motors), while the joint turns one way at a speed.

    Of the way 0 those at rest without friction.
    """
    joint = task.mechanism.joint
    angle = np.concatenate([task.sampled.angle_rad[:1], angle_rad])  # a run counts from its start at rest
    ways = np.append(0.0, np.full(len(angle_rad), way))
    resisted = joint.coulomb_N_m + joint.damping_N_m_s_per_rad * speed_rad_per_s
    held = joint.static_torque_N_m(angle) + ways * resisted
    still = task.sampled.others(joint.name)
    others = {name: np.full(len(angle), rows[0]) for name, rows in still.items()}
    return static_motor_rad(task.mechanism, angle, held, others, ways)[1:]


def looked_up(nodes_rad: FloatArray, motor_rad: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Motor angles between nodes, shape (rows, motors) [rad]."""
    return np.column_stack([np.interp(angle_rad, nodes_rad, column) for column in motor_rad.T])


def _nodes(angles_rad: Sequence[float], low_rad: float, high_rad: float) -> FloatArray | None:
    """Nodes that were asked for; None for none."""
    if not len(angles_rad):
        return None
    nodes: FloatArray = np.unique(np.asarray(angles_rad, dtype=np.float64))
    if len(nodes) < 2 or not (nodes[0] <= low_rad and high_rad <= nodes[-1]):
        raise InputError(
            f"--angles: the nodes must reach over the reference, from {low_rad:.4g} to {high_rad:.4g} rad, got "
            f"{', '.join(f'{node:g}' for node in nodes)}"
        )
    return nodes
