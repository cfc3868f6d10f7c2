"""Table of a joint's motor angles over its angle and the way it turns: the quasi-static law, to be looked up."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar, Self

from tendonff.compensator.compensators.motors.joint import JointTask, motor_names
from tendonff.compensator.compensators.motors.table import BRANCHES, tabulated
from tendonff.compensator.compensators.motors.task import MotorCompensator
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.reporting.colours import GREEN, Style
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.studies.tables.result import Tables


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
        found = tabulated(task, bound, angles_rad, rates)
        table = MotorCompensator(
            name="table",
            label="table over angle and direction",
            style=Style(color=GREEN, linestyle="-"),
            profile=found.command,
        )
        build = partial(
            cls,
            angle_rad=found.angle_rad,
            speeds_rad_per_s=found.speeds_rad_per_s,
            motor_rad=found.motor_rad,
            error_rad=found.error_rad,
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


def channels(scenario: JointScenario) -> list[str]:
    """Names of the motors' columns."""
    names = motor_names(scenario.mechanism)
    return ["motor_rad"] if names == ("motor",) else [f"motor_{name}_rad" for name in names]
