"""What an engine that advances the chain takes and gives; see `compiled_stepper` and `casadi_stepper`."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(slots=True, kw_only=True)
class StepperMemory:
    """What a multi-step scheme remembers between chunks; advanced in place.

    Parameters
    ----------
    x, x_old : ndarray, shape (4 N + 6,)
        State now and one step earlier, in the order of `ChainState.vector`.
    inputs : ndarray, shape (4,)
        Inputs at the present state: f_c1 [N], x_c1 [m], f_c2 [N], x_c2 [m].
    fresh : bool
        There is no earlier state; the next step is implicit Euler.
    """

    x: Array
    x_old: Array
    inputs: Array
    fresh: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """What one chunk of steps gave.

    Parameters
    ----------
    tension_N : ndarray, shape (rows, N + 1)
    ends_m : ndarray, shape (rows, 2)
        Positions q_a, q_l.
    states : ndarray, shape (rows, 4 N + 6), or None
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
    states : ndarray, shape (rows, 4 N + 6), or None
        Recorded on request.
    """

    force_N: Array
    least_tension_N: Array
    states: Array | None


class Stepper(Protocol):
    """One engine, made for one chain and step."""

    def advance(self, memory: StepperMemory, inputs: Array, record: bool) -> Rows:
        """Advance `memory` over `inputs`, shape (rows, 4); fewer rows come back where a step fails for good."""
        ...
