"""Table of a joint's motor angles over its angle and the way it turns: the quasi-static law, to be looked up."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar, Self

import numpy as np

from tendonff.compensator.compensators.motors.joint import JointTask, motor_names
from tendonff.compensator.compensators.motors.task import MotorCompensator, MotorTask
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.reporting.colours import GREEN, Style
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.driven.reference import JointQuantity
from tendonff.compensator.studies.tables.result import Tables
from tendonff.models.errors import require
from tendonff.models.joint.quasi_static import directions, static_motor_rad

BOUND_SHARE = 1e-3
"""Largest interpolation error of a table, over the range of the reference [-]."""

BRANCHES = {"up": 1.0, "down": -1.0}
"""Way the joint turns, towards larger or smaller angles."""

_LEAST, _MOST = 5, 1025  # nodes on a branch


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class MotorTables(Tables):
    """Motor angles of a joint over its angle and the way it turns; see `Tables`.

    Attributes
    ----------
    angle_rad : ndarray, shape (nodes,)
    speeds_rad_per_s : tuple of float
        Of the joint, by which its damping acts; (0,) for slow motion alone.
    motor_rad : dict of str to ndarray, shape (speeds, nodes, motors)
        Of each branch, relative to the start.
    error_rad : float
        Largest interpolation error, as an angle of the joint.
    masses : int
        Of each tendon of the plants.
    """

    shown_by: ClassVar[str] = "studies.tables.motor_pages"
    beside: ClassVar[tuple[str, ...]] = ("linear", "table", "inverse")

    angle_rad: FloatArray
    speeds_rad_per_s: tuple[float, ...]
    motor_rad: dict[str, FloatArray]
    error_rad: float
    masses: int

    @classmethod
    def tabulated(
        cls, task: JointTask, bound: float | None, angles_rad: Sequence[float], rates: Sequence[float]
    ) -> tuple["partial[Self]", MotorCompensator]:
        """The law at nodes over the range of the reference; see `Tables.tabulated`."""
        file, speeds = task.scenario.source.name, tuple(sorted(rates)) or (0.0,)
        sampled, mechanism = task.sampled, task.mechanism
        if task.scenario.reference.quantity is JointQuantity.TORQUE:
            raise InputError(f"{file}: a table over the angle has no room for a torque; export the inverse by export-c")
        others = sampled.others(mechanism.joint.name)
        if any(np.ptp(angle) > 0 for name, angle in others.items() if any(t.follows(name) for t in mechanism.tendons)):
            raise InputError(
                f"{file}: no table can hold a path that other joints move; hold them by --pose, or export the inverse "
                "by export-c"
            )
        low, high = float(sampled.angle_rad.min()), float(sampled.angle_rad.max())
        given = _nodes(angles_rad, low, high)
        bound = BOUND_SHARE * sampled.range if bound is None else bound
        require("bound", bound, above=0, hint="it is an angle of the joint [rad]")
        arm, drum = abs(mechanism.arms_at(low)[0]), mechanism.drum_radius_m[0] / mechanism.drive.gear_ratio
        nodes = _LEAST
        while True:
            angle = given if given is not None else np.linspace(low, high, nodes)
            fine = np.sort(np.r_[angle, 0.5 * (angle[1:] + angle[:-1])])
            motor = {name: np.stack([_branch(task, angle, way, w) for w in speeds]) for name, way in BRANCHES.items()}
            between = [
                _branch(task, fine, way, speeds[0]) - _looked_up(angle, motor[name][0], fine)
                for name, way in BRANCHES.items()
            ]
            error = float(np.abs(between).max()) * drum / arm
            if error <= bound or nodes >= _MOST or given is not None:
                break
            nodes = 2 * nodes - 1
        table = MotorCompensator(
            name="table",
            label="table over angle and direction",
            style=Style(color=GREEN, linestyle="-"),
            profile=lambda own: _command(own, angle, speeds, motor),
        )
        build = partial(
            cls,
            angle_rad=angle,
            speeds_rad_per_s=speeds,
            motor_rad=motor,
            error_rad=error,
            masses=task.masses,
            warnings=(),
        )
        return build, table

    def judged(self, task: JointTask, table: MotorCompensator, profiles: Mapping[str, Any]) -> Self:  # noqa: ARG002
        """The same with the harm that it does: its worst error is above that of the ratio alone."""
        worst = self.expectation.worst_percent
        harm = (f"{self.headline}: worse than the ratio",) if worst["table"] > worst["linear"] else ()
        return replace(self, warnings=harm, harm=harm)

    @property
    def headline(self) -> str:
        """Nodes and worst errors."""
        worst = self.expectation.worst_percent
        return (
            f"{self.nodes} nodes. Worst RMS error, % of range: table {worst['table']:.2g}, "
            f"ratio alone {worst['linear']:.2g}, exact inverse {worst['inverse']:.2g}, for {self.expectation.doubt}"
        )

    @property
    def nodes(self) -> int:
        """Of both branches and all speeds."""
        return len(BRANCHES) * len(self.speeds_rad_per_s) * len(self.angle_rad)

    @property
    def lines(self) -> tuple[str, ...]:
        """The finding in words."""
        return (self.headline,)


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


def _branch(task: JointTask, angle_rad: FloatArray, way: float, speed_rad_per_s: float) -> FloatArray:
    """Motor angles relative to the start, shape (rows, motors), while the joint turns one way at a speed."""
    joint = task.mechanism.joint
    angle = np.concatenate([task.sampled.angle_rad[:1], angle_rad])  # a run counts from its start at rest
    ways = np.append(0.0, np.full(len(angle_rad), way))
    resisted = joint.coulomb_N_m + joint.damping_N_m_s_per_rad * speed_rad_per_s
    held = joint.static_torque_N_m(angle) + ways * resisted
    still = task.sampled.others(joint.name)
    others = {name: np.full(len(angle), rows[0]) for name, rows in still.items()}
    return static_motor_rad(task.mechanism, angle, held, others, ways)[1:]


def _looked_up(nodes_rad: FloatArray, motor_rad: FloatArray, angle_rad: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(angle_rad, nodes_rad, column) for column in motor_rad.T])


def _command(
    task: MotorTask, nodes_rad: FloatArray, speeds_rad_per_s: tuple[float, ...], motor_rad: dict[str, FloatArray]
) -> FloatArray:
    """Motor angles by the table, shape (rows, motors); at the start at rest none."""
    angle, rows = task.sampled.angle_rad, np.arange(len(task.sampled.angle_rad))
    ways = directions(angle)[:, None]
    speed = np.abs(np.gradient(angle, task.scenario.run.step_s))
    at = np.interp(speed, speeds_rad_per_s, np.arange(float(len(speeds_rad_per_s))))
    below = at.astype(int)
    above, share = np.minimum(below + 1, len(speeds_rad_per_s) - 1), (at - below)[:, None]

    def branch(name: str) -> FloatArray:
        each = np.stack([_looked_up(nodes_rad, values, angle) for values in motor_rad[name]])
        found: FloatArray = (1 - share) * each[below, rows] + share * each[above, rows]
        return found

    found: FloatArray = np.where(ways > 0, branch("up"), np.where(ways < 0, branch("down"), 0.0))
    found[0] = 0.0
    return found


def channels(scenario: JointScenario) -> list[str]:
    """Names of the motors' columns."""
    names = motor_names(scenario.mechanism)
    return ["motor_rad"] if names == ("motor",) else [f"motor_{name}_rad" for name in names]
