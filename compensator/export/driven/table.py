"""The quasi-static law of a joint, to be looked up over its angle and the way it turns."""

from dataclasses import dataclass
from typing import cast

import numpy as np

from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.table import BRANCHES, branch_rad, looked_up, tabulated
from tendonff.compensator.export.driven.module import SPEED_LIMITED, Content, Designed, Module, Port
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.files.reading import FloatArray
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.joint.target import ConstantData

_ROWS = 1000
"""Golden vectors of a table at most; a longer reference is thinned."""

_NO_LIMIT = 1e30


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveTable:
    """A table as a controller looks it up.

    Attributes
    ----------
    angle_rad : ndarray, shape (nodes,)
    branch_rad : tuple of ndarray, shape (nodes, motors)
        Motor angles while the joint turns down, at rest and while it turns up, relative to the start [rad].
    turning_rad : float
        Way back of the joint that counts as a reversal [rad].
    change_rad : float
        Largest change of a command in a sample [rad].
    """

    angle_rad: FloatArray
    branch_rad: tuple[FloatArray, FloatArray, FloatArray]
    turning_rad: float
    change_rad: float

    @classmethod
    def of(cls, task: JointTask) -> "LiveTable":
        """That of a joint, with the play of its gear on either side."""
        table, drive = tabulated(task), task.mechanism.drive
        still = branch_rad(task, table.angle_rad, 0.0, 0.0)
        turns = np.sign(still[-1] - still[0])  # of each motor, while the joint turns up
        down, up = (table.motor_rad[name][0] + BRANCHES[name] * turns * drive.play_rad / 2 for name in ("down", "up"))
        ratio = float(np.abs(still[-1] - still[0]).max()) / float(np.ptp(table.angle_rad))
        speed = drive.speed_max_rad_per_s
        return cls(
            angle_rad=table.angle_rad,
            branch_rad=(down, still, up),
            turning_rad=drive.turning_rad / ratio,
            change_rad=_NO_LIMIT if speed is None else speed * task.step_s,
        )

    def ways(self, angle_rad: FloatArray, precision: Precision) -> list[int]:
        """Way in each row, as it is known by then, in the arithmetic of the code."""
        real = np.float32 if precision is Precision.FLOAT else np.float64
        turning, angles = real(self.turning_rad), angle_rad.astype(real)
        way, furthest, found = 0, angles[0], []
        for angle in angles:
            on = angle - furthest
            if way <= 0 and on > turning:
                way = 1
            elif way >= 0 and on < -turning:
                way = -1
            if on * way > 0:
                furthest = angle
            found.append(way)
        return found

    def respond(self, angle_rad: FloatArray, precision: Precision) -> tuple[FloatArray, FloatArray]:
        """Commands from a start at rest at the first angle, shape (rows, motors) [rad], and whether the speed binds."""
        every = np.stack([looked_up(self.angle_rad, branch, angle_rad) for branch in self.branch_rad])
        wanted = every[np.array(self.ways(angle_rad, precision)) + 1, np.arange(len(angle_rad))] - every[1, 0]
        command, binds = np.zeros_like(wanted), np.zeros(len(wanted), dtype=bool)
        for row in range(1, len(wanted)):
            change = wanted[row] - command[row - 1]
            command[row] = command[row - 1] + np.clip(change, -self.change_rad, self.change_rad)
            binds[row] = bool((np.abs(change) > self.change_rad).any())
        return command, binds


def _content(designed: Designed, data: ConstantData) -> Content:
    return table_content(cast(JointTask, designed.task), data)  # others are refused


def table_content(task: JointTask, data: ConstantData) -> Content:
    """Content of the table of a joint."""
    live, angle = LiveTable.of(task), task.sampled.angle_rad
    angle = angle[:: max(1, -(-len(angle) // _ROWS))]
    angle = rounded(np.concatenate([angle, angle[-2::-1]]), data.precision)
    nodes = live.angle_rad
    per_rad = (len(nodes) - 1) / (nodes[-1] - nodes[0])
    numbers = (nodes[0], nodes[-1], per_rad, live.turning_rad, live.change_rad)
    branches = ", ".join(data.array(branch.ravel()) for branch in live.branch_rad)
    command, binds = live.respond(angle, data.precision)
    along = task.sampled.angle_rad
    if task.is_periodic:
        along = np.concatenate([along[:-1], along])  # the second cycle
    reference = live.respond(along, Precision.DOUBLE)[0][-len(task.sampled.angle_rad) :]
    return Content(
        record=[str(len(nodes)), str(len(task.motors)), *map(data.number, numbers), f"{{ {branches} }}"],
        given=angle[:, None],
        command_rad=command,
        status=np.where(binds, SPEED_LIMITED, 0),
        reference_rad=reference,
    )


TABLE = Module(
    name="table",
    content="quasi-static law, looked up over the joint's angle and the way it turns",
    about=(
        "Every tendon slides in full: at a reversal the command jumps over the lost motion, as fast as the motor's",
        "speed limit lets it. Slow motion alone; inertia, presliding, damping and the servo's lag are left out.",
    ),
    inputs=(Port(name="angle_rad", text="angle of the joint, within that of the design's reference", unit="rad"),),
    state=(
        "int32_t way;    /* 1 up, -1 down, 0 not moved yet */",
        "{prefix}_real furthest_rad; /* angle that it turned to on its way */",
        "{prefix}_real zero_rad[{guard}_TABLE_MOTORS]; /* motors on the branch at rest at init */",
    ),
    build=_content,
)
