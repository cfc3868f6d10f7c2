"""Table of a joint's motor angles over its angle and the way it turns: the quasi-static law, to be looked up."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar, Self

from tendonff.compensator.compensators.motors.joint import JointTask, motor_names
from tendonff.compensator.compensators.motors.table import BRANCHES, JointTable, tabulated
from tendonff.compensator.compensators.motors.task import MotorCompensator
from tendonff.compensator.reporting.colours import GREEN, Style
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.studies.tables.result import Tables


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class MotorTables(Tables):
    """Motor angles of a joint over its angle and the way it turns; see `Tables`.

    Attributes
    ----------
    law : JointTable
        Its nodes.
    masses : int
        Of each tendon of the plants.
    """

    shown_by: ClassVar[str] = "studies.tables.motor_pages"
    beside: ClassVar[tuple[str, ...]] = ("linear", "table", "inverse")

    law: JointTable
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
        return partial(cls, law=found, masses=task.masses, warnings=()), table

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
        return len(BRANCHES) * len(self.law.speeds_rad_per_s) * len(self.law.angle_rad)

    @property
    def lines(self) -> tuple[str, ...]:
        """The finding in words."""
        return (self.headline,)


def channels(scenario: JointScenario) -> list[str]:
    """Names of the motors' columns."""
    names = motor_names(scenario.mechanism)
    return ["motor_rad"] if names == ("motor",) else [f"motor_{name}_rad" for name in names]
