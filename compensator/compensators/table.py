"""The compensation table as a compensator: looked up sample by sample, within the actuator's limits."""

from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.base import CModule, Compensator, Problem, Profile, Style
from tendonff.compensator.compensators.lookup_table import LookupTable, table_force, table_range_N
from tendonff.compensator.compensators.table_build import BuiltTable, build_table, usual_rate
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import GREEN
from tendonff.compensator.scenario.sampled.sampling import largest_tension

BOUND_SHARE = 0.005
"""Interpolation error that a table may have unless told otherwise, as a share of the reference's range."""


@dataclass(frozen=True)  # without slots: the class holds what all tables share
class CompensationTable(Compensator):
    """The compensation table."""

    name = "table"
    label = "compensation table"
    style = Style(color=GREEN, linestyle=":")
    is_fast = False
    c_module = CModule(name="table", content="compensation table", headers=("table_data",), knows_joints=False)

    table: LookupTable | None = None  # one that exists already; default: made for the problem

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:  # noqa: ARG002
        """Answer by looking up; see `Compensator.profile`."""
        table = self.table or table_of(problem).table
        reference = problem.reference
        start = reference.initial_tension_N
        force = problem.in_cycle(lambda rows: table_force(table, rows, start), reference.tension_N)
        return Profile(force_N=problem.limited(force))


def table_range(problem: Problem) -> tuple[float, float]:
    """Range of reference tension that a table for a problem covers [N]."""
    reference = problem.reference
    wanted = np.append(reference.tension_N, reference.initial_tension_N)
    return table_range_N(wanted, largest_tension(problem.transmission))


def table_of(
    problem: Problem,
    *,
    bound_N: float | None = None,
    rate_N_per_s: float | None = None,
    range_N: tuple[float, float] | None = None,
) -> BuiltTable:
    """The table for a problem; by default with an interpolation error of 0.5 % of the reference's range, at most.

    By default it is made for the median rate of the problem's reference [N/s], and covers the problem's range [N].
    """
    reference = problem.reference
    span = reference.range_N or 0.1 * float(reference.tension_N[0])
    return build_table(
        problem.chain,
        range_N or table_range(problem),
        bound_N=BOUND_SHARE * span if bound_N is None else bound_N,
        rate_N_per_s=usual_rate(reference.tension_N, reference.step_s) if rate_N_per_s is None else rate_N_per_s,
        step_s=reference.step_s,
    )
