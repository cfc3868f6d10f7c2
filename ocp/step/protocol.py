"""Interface of an engine that advances the chain; see `c_engine` and `casadi_engine`."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tendonff.models.errors import ParameterError
from tendonff.models.layout import ChainInputs

Array = NDArray[np.float64]


@dataclass(slots=True, kw_only=True)
class StepperMemory:
    """Memory of a multi-step scheme between chunks; advanced in place."""

    # x, x_old: shape (size,); state now and one step earlier, in the order of `StateLayout`
    x: Array
    x_old: Array
    inputs: ChainInputs  # those at the present state: one row
    time_s: float  # when that is [s]
    fresh: bool  # there is no earlier state; the next step is implicit Euler


def require_recorded(states: Array | None) -> Array:
    """Refuse to go on without states that were not kept."""
    if states is None:
        raise ParameterError("the states were not kept; ask for them with record=True")
    return states


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Result of a chunk of steps."""

    tension_N: Array  # shape (rows, N + 1)
    ends_m: Array  # shape (rows, 2); positions q_a, q_l
    states: Array | None  # shape (rows, size); recorded on request
    # iterations, splits: linear solves, and steps that had to be split
    iterations: int
    splits: int
    residual_N: float  # largest force balance of the last step tried [N]
    worst_mass: int  # mass with that balance: 0 actuator, 1 .. N on the path, N + 1 load
    evaluations: int = 0  # of the balances, tries of the line search among them; CasADi does not count
    reason: str | None = None  # why an integrator gave up

    @property
    def recorded(self) -> Array:
        """The states, shape (rows, size); ParameterError where they were not requested."""
        return require_recorded(self.states)


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseRows:
    """Result of the exact inverse for references at the ends of successive steps."""

    # force_N, least_tension_N: shape (rows,); motor force, and smallest tension along the path
    force_N: Array
    least_tension_N: Array
    states: Array | None  # shape (rows, size); recorded on request
    x: Array  # shape (size,); state after the last of them


class Stepper(Protocol):
    """Engine for a given chain and step."""

    def advance(self, memory: StepperMemory, inputs: ChainInputs, record: bool) -> Rows:
        """Advance `memory` over `inputs`; fewer rows come back where a step fails for good."""


class Inverse(Protocol):
    """Exact inverse of an engine, for a given chain and step."""

    def invert(self, x: Array, time_s: float, reference: Array, record: bool) -> InverseRows:
        """Force, least tension and states for tensions [N] at the ends of the steps that follow the state x."""
