"""The steady cycle of a mechanism: its exact inverse, and its response, repeated until they repeat themselves."""

from dataclasses import dataclass

import numpy as np

from tendonff.ocp.integrate.method import Method
from tendonff.ocp.joint.invert import MOST_CYCLES, STEADY
from tendonff.ocp.mechanism.problem import Array, MechanismMemory, MechanismProblem
from tendonff.ocp.mechanism.response import MechanismRun, MechanismStatus, invert_mechanism, simulate_mechanism

_SETTLED = 1e-4
"""Change of a response from one cycle to the next, over its largest range, below which it repeats [-]."""
_RAMP = 0.1  # of the first cycle: the motors come to the cycle from rest


@dataclass(frozen=True, slots=True, kw_only=True)
class SteadyCycle:
    """The last cycle of a repeated motion.

    Attributes
    ----------
    run : MechanismRun
    cycles : int
        Number that was run.
    is_steady : bool
        The last one repeats the one before.
    """

    run: MechanismRun
    cycles: int
    is_steady: bool


def steady_inverse(
    problem: MechanismProblem, cycle: Array, step_s: float, *, effort: Array | float = 0.0
) -> SteadyCycle:
    """Inverse of a motion that repeats, shape (n, known), its last row the first of the next period.

    Motors count from the rest before the first cycle. Arguments and errors as those of `invert_mechanism`.
    """
    found = invert_mechanism(problem, cycle, step_s, effort=effort)
    for count in range(2, MOST_CYCLES + 1):
        if found.status is MechanismStatus.FAILED:
            return SteadyCycle(run=found, cycles=count - 1, is_steady=False)
        before = found
        found = invert_mechanism(problem, cycle, step_s, effort=effort, memory=before.final)
        if _repeats(before.motor, found.motor, STEADY):
            return SteadyCycle(run=found, cycles=count, is_steady=True)
    return SteadyCycle(run=found, cycles=MOST_CYCLES, is_steady=False)


def steady_response(
    problem: MechanismProblem,
    cycle: Array,
    step_s: float,
    *,
    known: Array,
    effort: Array | float = 0.0,
    method: Method = Method.BDF2,
) -> SteadyCycle:
    """Response to motors that repeat, shape (n, motors), from rest.

    Arguments and errors as those of `simulate_mechanism`.
    """
    rise = np.minimum(np.linspace(0.0, 1.0, len(cycle)) / _RAMP, 1.0)[:, None]
    memory: MechanismMemory | None = None
    before: MechanismRun | None = None
    for count in range(1, MOST_CYCLES + 1):
        command = cycle * rise if memory is None else cycle
        found = simulate_mechanism(problem, command, step_s, known=known, effort=effort, memory=memory, method=method)
        if found.status is MechanismStatus.FAILED:
            return SteadyCycle(run=found, cycles=count, is_steady=False)
        if before is not None and _repeats(before.position, found.position, _SETTLED):
            return SteadyCycle(run=found, cycles=count, is_steady=True)
        before, memory = found, found.final
    return SteadyCycle(run=found, cycles=MOST_CYCLES, is_steady=False)


def _repeats(before: Array, now: Array, share: float) -> bool:
    if before.shape != now.shape:
        return False
    return float(np.abs(now[1:] - before[1:]).max()) <= share * max(float(np.ptp(now, axis=0).max()), 1e-9)
