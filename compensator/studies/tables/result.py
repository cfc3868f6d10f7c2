"""Tables of a scenario: how any is made and judged; `force` and `motor` say what it holds.

That differs by physics. The force for a tension depends on the way since the last reversal, some newtons long, over
which the path turns from sticking to sliding: an axis of its own, swept through the exact inverse. A joint's motor
crosses its lost motion there, which a table of the quasi-static law has as the distance of two branches; damping adds
the speed of the joint.
"""

import math
import os
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Self

from tendonff.compensator.compensators.every import AnyScenario, compensator_of, problem_of
from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.reporting.results import Result
from tendonff.compensator.scenario.sampled.joint_motion import posed
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Tables(Result):
    """Tables of a scenario: the first for its own numbers, or for the requested axes.

    Attributes
    ----------
    scenario : Scenario or JointScenario
        The scenario it was made for.
    level : Level
        Fidelity level that it was made and judged on.
    expectation : Expectation
        Of "table" beside others, over what may be the real plant.
    options : str
        Options of the command that would make the same, for the report.
    warnings : tuple of str
        What the user should know.
    harm : tuple of str
        Why the table must not be used as it is: its error is above that of no compensation.
    """

    beside: ClassVar[tuple[str, ...]]
    """Compensators that it is judged with, in their order; "table" is its own."""
    recommended: ClassVar[str | None] = None
    """The one that the expectation is stated of; None for the best."""

    scenario: Any
    level: Level
    expectation: Expectation
    options: str
    warnings: tuple[str, ...]
    harm: tuple[str, ...] = ()

    @classmethod
    @in_turn
    def made(
        cls,
        scenario: AnyScenario,
        *,
        level: Level | None = None,
        bound: float | None = None,
        angles_rad: Sequence[float] = (),
        rates: Sequence[float] = (),
        pose_rad: Mapping[str, float] = MappingProxyType({}),
    ) -> Self:
        """Tables of a scenario, and how good they are; arguments and errors as of `tendonff.make_table`."""
        scenario = posed(scenario, pose_rad) if pose_rad else scenario
        for rate in rates:
            if not 0 < rate < math.inf:
                raise InputError(f"--rates: every value must be a finite number > 0, got {rate}")
        problem = problem_of(scenario, level)
        build, table = cls.tabulated(problem, bound, angles_rad, rates)
        each = [table if name == "table" else compensator_of(problem, name) for name in cls.beside]
        profiles = {one.name: problem.answer(one) for one in each}
        options = {"level": level, "bound": bound, "angles": _listed(angles_rad), "rates": _listed(rates)}
        options["pose"] = " --pose ".join(f"{name}={angle}" for name, angle in pose_rad.items())
        return build(
            scenario=scenario,
            level=problem.level,
            expectation=problem.expect(profiles, cls.recommended),
            options=" ".join(f"--{name} {value}" for name, value in options.items() if value),
        ).judged(problem, table, profiles)

    @classmethod
    @abstractmethod
    def tabulated(
        cls, problem: Any, bound: float | None, angles_rad: Sequence[float], rates: Sequence[float]
    ) -> tuple[Callable[..., Self], Any]:
        """The tables, and the one for the problem itself as a compensator."""

    @abstractmethod
    def judged(self, problem: Any, table: Any, profiles: Mapping[str, Any]) -> Self:
        """The same with its scores, warnings and harm."""

    @property
    @abstractmethod
    def nodes(self) -> int:
        """Of the largest table."""

    @property
    @abstractmethod
    def lines(self) -> tuple[str, ...]:
        """The finding in words, and the size of the table."""

    def write(self, folder: str | os.PathLike[str], *, prefix: str = "tff", pdf: bool = False) -> None:
        """Write `table.csv`, `table.h`, the numbers, a figure and `report.html`, all or nothing; makes the folder.

        The names in `table.h` begin with `prefix`.
        """
        self._views.write(self, folder, prefix=prefix, pdf=pdf)


def _listed(values: Sequence[float]) -> str:
    """Numbers as the command line takes them."""
    return ",".join(str(float(value)) for value in values)
