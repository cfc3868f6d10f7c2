"""What an engine that advances the chain takes and gives; see `c_engine` and `casadi_engine`."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tendonff.models.layout import ChainInputs

Array = NDArray[np.float64]


@dataclass(slots=True, kw_only=True)
class StepperMemory:
    """What a multi-step scheme remembers between chunks; advanced in place.

    Parameters
    ----------
    x, x_old : ndarray, shape (size,)
        State now and one step earlier, in the order of `StateLayout`.
    inputs : ChainInputs
        Those at the present state: one row.
    time_s : float
        When that is [s].
    fresh : bool
        There is no earlier state; the next step is implicit Euler.
    """

    x: Array
    x_old: Array
    inputs: ChainInputs
    time_s: float
    fresh: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """What one chunk of steps gave.

    Parameters
    ----------
    tension_N : ndarray, shape (rows, N + 1)
    ends_m : ndarray, shape (rows, 2)
        Positions q_a, q_l.
    states : ndarray, shape (rows, size), or None
        Recorded on request.
    iterations, splits : int
        Linear solves, and steps that had to be split.
    residual_N : float
        Largest force balance of the last step tried [N].
    worst_mass : int
        Mass with that balance: 0 actuator, 1 .. N on the path, N + 1 load.
    """

    tension_N: Array
    ends_m: Array
    states: Array | None
    iterations: int
    splits: int
    residual_N: float
    worst_mass: int


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseRows:
    """What the exact inverse gave for references at the ends of successive steps.

    Parameters
    ----------
    force_N, least_tension_N : ndarray, shape (rows,)
        Motor force, and smallest tension along the path.
    states : ndarray, shape (rows, size), or None
        Recorded on request.
    """

    force_N: Array
    least_tension_N: Array
    states: Array | None


class Stepper(Protocol):
    """One engine, made for one chain and step."""

    def advance(self, memory: StepperMemory, inputs: ChainInputs, record: bool) -> Rows:
        """Advance `memory` over `inputs`; fewer rows come back where a step fails for good."""
        ...


class Inverse(Protocol):
    """One engine's exact inverse, made for one chain and step."""

    def invert(self, x: Array, time_s: float, reference: Array, record: bool) -> InverseRows:
        """Force, least tension and states for tensions [N] at the ends of the steps that follow the state x."""
        ...
