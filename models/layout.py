"""Layout of the chain's state and inputs, defined in this place only.

Python takes slices and names from `StateLayout`, generated C its offsets; a law with states of its own changes both.
"""

import functools
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class StateLayout:
    """Order of the states: v, the near end's own, e, the links' own, the friction's own, q_a, q_l."""

    count: int  # number N of masses on the path
    # link_states, friction_states: names of the states that each link and each mass brings along, such as ("z",) and
    # ("f_s",)
    link_states: tuple[str, ...]
    friction_states: tuple[str, ...]
    end_states: tuple[str, ...] = ()  # names of those that the near end brings along, such as ("f_d",)

    @property
    def blocks(self) -> tuple[tuple[str, int, int], ...]:
        """Name of each block and its length as (a, b): a N + b."""
        return (
            ("v", 1, 2),
            *((name, 0, 1) for name in self.end_states),
            ("e", 1, 1),
            *((name, 1, 1) for name in self.link_states),
            *((name, 1, 0) for name in self.friction_states),
            ("q_a", 0, 1),
            ("q_l", 0, 1),
        )

    def offset(self, name: str) -> tuple[int, int]:
        """Where a block begins, as (a, b): a N + b; the total length for the name "end"."""
        a = b = 0
        for block, per_mass, more in self.blocks:
            if block == name:
                return a, b
            a, b = a + per_mass, b + more
        if name != "end":
            raise KeyError(name)
        return a, b

    @property
    def size(self) -> int:
        """Number of states; 4 N + 6 with the paper's laws."""
        a, b = self.offset("end")
        return a * self.count + b

    def part(self, name: str) -> slice:
        """Slice of a block."""
        return _parts(self)[name]

    @property
    def cuts(self) -> tuple[int, ...]:
        """Borders of all blocks, 0 and the size included: what `ca.vertsplit` takes."""
        return (*(self.part(name).start for name, _, _ in self.blocks), self.size)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every state."""
        n = self.count
        v = ("v_a", *(f"v_{k}" for k in range(1, n + 1)), "v_l")
        links = (f"{name}_{k}" for name in ("e", *self.link_states) for k in range(1, n + 2))
        masses = (f"{name}_{k}" for name in self.friction_states for k in range(1, n + 1))
        return (*v, *self.end_states, *links, *masses, "q_a", "q_l")


@functools.lru_cache(maxsize=64)
def _parts(layout: StateLayout) -> dict[str, slice]:
    stops = np.cumsum([per_mass * layout.count + more for _, per_mass, more in layout.blocks]).tolist()
    starts = [0, *stops[:-1]]
    return {block[0]: slice(*each) for block, *each in zip(layout.blocks, starts, stops, strict=True)}


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainState:
    """State of the chain at one instant.

    Attributes
    ----------
    velocity_m_per_s : numpy.ndarray
        Shape (N + 2,); v_a, v_1 .. v_N, v_l: sliding speeds.
    elongation_m : numpy.ndarray
        Shape (N + 1,); e of each link.
    link : numpy.ndarray
        Shape (states, N + 1); the links' own states; the relaxed elongation z [m] with the paper's law.
    friction : numpy.ndarray
        Shape (states, N); the friction's own states; the bristle force f_s [N] with the paper's law.
    near_position_m, far_position_m : float
        q_a, q_l. The positions between them follow from the elongations, whose differences keep full precision.
    time_s : float
        When: the joints of a moving path stand where they are then.
    near : numpy.ndarray
        Shape (states,); the near end's own states; f_d [N] where the drive has dry friction.
    """

    velocity_m_per_s: Array
    elongation_m: Array
    link: Array
    friction: Array
    near_position_m: float
    far_position_m: float
    time_s: float = 0.0
    near: Array = field(default_factory=lambda: np.empty(0))

    def vector(self) -> Array:
        """All states in one array, in the order of `StateLayout`."""
        ends = [self.near_position_m, self.far_position_m]
        links, masses = (self.elongation_m, self.link.ravel()), self.friction.ravel()
        parts = (self.velocity_m_per_s, self.near, *links, masses, ends)
        return np.concatenate(parts)

    def hanging(self, slack_m: float) -> "ChainState":
        """The same at rest with so much of the tendon loose, a like share in every link, shortened at its near end."""
        each = np.full(len(self.elongation_m), -slack_m / len(self.elongation_m))
        return replace(
            self,
            elongation_m=self.elongation_m + each,
            link=self.link + each,
            near_position_m=self.near_position_m - slack_m,
        )

    @classmethod
    def from_vector(cls, x: Array, layout: StateLayout, time_s: float = 0.0) -> "ChainState":
        """Inverse of `vector`."""
        n, x = layout.count, np.array(x, dtype=np.float64)
        middle = x[layout.part("e").stop : -2]
        border = len(layout.link_states) * (n + 1)
        return cls(
            velocity_m_per_s=x[layout.part("v")],
            elongation_m=x[layout.part("e")],
            link=middle[:border].reshape(-1, n + 1),
            friction=middle[border:].reshape(-1, n),
            near_position_m=float(x[-2]),
            far_position_m=float(x[-1]),
            time_s=time_s,
            near=x[layout.part("v").stop : layout.part("e").start],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainInputs:
    """External inputs of the chain at successive instants, each array of shape (rows,)."""

    # near_force_N, far_force_N: f_c1, f_c2, motor forces away from the tendon
    # near_rest_m, far_rest_m: x_c1, x_c2, rest positions of the ends' springs
    near_force_N: Array
    near_rest_m: Array
    far_force_N: Array
    far_rest_m: Array

    def __len__(self) -> int:
        return len(self.near_force_N)

    def __getitem__(self, rows: slice) -> "ChainInputs":
        return ChainInputs(
            near_force_N=self.near_force_N[rows],
            near_rest_m=self.near_rest_m[rows],
            far_force_N=self.far_force_N[rows],
            far_rest_m=self.far_rest_m[rows],
        )

    @classmethod
    def of(cls, rows: int, **values: "Array | float") -> "ChainInputs":
        """Inputs of which only some differ from zero: arrays or numbers, by name of the field."""
        filled = {f.name: np.broadcast_to(np.asarray(values.pop(f.name, 0.0), float), (rows,)) for f in fields(cls)}
        if values:
            raise TypeError(f"ChainInputs has no field {', '.join(values)}")
        return cls(**filled)

    @classmethod
    def of_force(cls, force_N: Array) -> "ChainInputs":
        """The actuator's force alone: x_c1 = f_c2 = x_c2 = 0."""
        force = np.asarray(force_N, dtype=np.float64)
        still = np.zeros(len(force))
        return cls(near_force_N=force, near_rest_m=still, far_force_N=still, far_rest_m=still)

    def table(self, before: "ChainInputs | None" = None) -> Array:
        """All of it in one array, a row an instant, a column a field; instants `before` these come first."""
        first = 0 if before is None else len(before)
        found = np.empty((first + len(self), len(INPUT_NAMES)))
        for column, name in enumerate(INPUT_NAMES):
            if before is not None:
                found[:first, column] = getattr(before, name)
            found[first:, column] = getattr(self, name)
        return found


INPUT_NAMES: tuple[str, ...] = tuple(f.name for f in fields(ChainInputs))
"""Columns of `ChainInputs.table`: f_c1, x_c1, f_c2, x_c2."""


def fields_of(record: Any, prefix: str = "") -> dict[str, Any]:
    """Fields of a record by name, with a prefix such as "link_"."""
    return {prefix + name: getattr(record, name) for name in _names_of(record.__class__)}


@functools.cache
def _names_of(kind: type) -> tuple[str, ...]:
    """Names of the fields of a kind of record."""
    return tuple(f.name for f in fields(kind))
