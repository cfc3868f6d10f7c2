"""Exact sensitivities of a mechanism's response: each solved step is differentiated by CasADi's slopes of its laws.

A direction is any change of what a run is made of, given by the two mechanisms on either side of it: numbers of tendons
and loads, tensions and places at the start, and the motors' motion. Those numbers are closed forms of the parameters,
so their difference over the direction is exact but for rounding; the step itself is never differenced.
"""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.layout import fields_of
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import in_turn
from tendonff.ocp.joint.laws import (
    JOINT_NUMBERS,
    joint_torque,
    joint_torque_tangent,
    link_back,
    path_mass_back,
)
from tendonff.ocp.mechanism.compiled import CompiledMechanism, RunRows, joined
from tendonff.ocp.mechanism.problem import Array, MechanismMemory, MechanismProblem, rest
from tendonff.ocp.mechanism.response import MechanismRun, response_of
from tendonff.ocp.step.blocks import in_blocks
from tendonff.ocp.step.c_engine import CORE, host_source, pointer
from tendonff.ocp.step.laws import ElementLaws, twins_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """A mechanism and the state that its run begins with.

    Attributes
    ----------
    problem : MechanismProblem
    memory : MechanismMemory
    """

    problem: MechanismProblem
    memory: MechanismMemory

    @classmethod
    def at_rest(cls, problem: MechanismProblem, loose_rad: float = 0.0) -> "Start":
        """A mechanism at rest at its start; see `rest`."""
        return cls(problem=problem, memory=rest(problem, loose_rad))


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """A change of a run.

    Attributes
    ----------
    above, below : Start
        Mechanisms on either side, of the same tendons and paths.
    apart : float
        How far apart they are, in the unit that slopes are wanted over.
    command : ndarray, shape (n, motors), or None
        Change of the motors' motion over the direction; None: none.
    """

    above: Start
    below: Start
    apart: float
    command: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanismSlopes:
    """Derivatives of a `MechanismRun` over directions, at its rows.

    Attributes
    ----------
    position : ndarray, shape (n, known, directions)
    effort : ndarray, shape (n, motors, directions)
    tension_N : ndarray, shape (n, tendons, directions)
        At the far ends.
    """

    position: Array
    effort: Array
    tension_N: Array


@in_turn
def simulate_slopes(
    start: Start, command: Array, step_s: float, directions: Sequence[Direction]
) -> tuple[MechanismRun, MechanismSlopes]:
    """Response of a mechanism to motors that are led, with its derivatives over directions.

    Parameters
    ----------
    start : Start
        With bodies that are led standing still.
    command : ndarray, shape (n, motors)
        Coordinates of the motors since the start [rad or m].
    step_s : float
        h [s], > 0.
    directions : sequence of Direction

    Raises
    ------
    ParameterError
        If a direction is one between mechanisms of other paths or laws, or a motor is not led.
    CodeError
        If no C compiler works here.
    """
    problem, given = start.problem, np.ascontiguousarray(command, dtype=np.float64)
    if not all(problem.leads[problem.known :]):
        raise ParameterError("slopes are those of motors that are led; a motor is driven by a force")
    memory = start.memory.copy()
    first = memory.copy()
    engine = _SlopedMechanism(problem, step_s, directions, first)
    at = np.broadcast_to(first.z[: problem.known, 1], (len(given), problem.known))
    rows, position, tension, drum = engine.run_slopes(memory, np.hstack([at, given]))
    run = response_of(problem, first, rows, memory, len(given), step_s)
    effort = np.zeros((len(drum), problem.motors, len(directions)))
    for t, motor in enumerate(problem.motor_of):
        holds = np.concatenate([first.tension_N[None], rows.drum_N])[:, t] > 0
        effort[:, motor] += problem.winding_m[t] * np.where(holds[:, None], drum[:, t], 0.0)
    return run, MechanismSlopes(position=position[:, : problem.known], effort=effort, tension_N=tension)


def _slopes_source(chain: Chain) -> str:
    laws, elements = ElementLaws.of(chain, folded=True), ElementLaws.of(chain, folded=True)
    tangents = (
        elements.link_tangent(of_length=True),
        elements.path_mass_tangent(),
        elements.contact_tangent(twins_of(chain)),
        joint_torque_tangent(),
    )
    own = (joint_torque(), link_back(laws), path_mass_back(laws), *(law.without_zeros() for law in tangents))
    templates = ("kernel.c.j2", "weigh.c.j2", "bodies_laws.c.j2", CORE, "bodies.c.j2")
    return host_source(chain, (*laws.simulation(), *own), templates, joint_numbers=JOINT_NUMBERS)


class _TendonChange(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_void_p) for name in ("numbers", "of_masses", "start_m", "memory"))


class _Change(ctypes.Structure):
    _fields_ = (
        ("width", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("tendons", "laws", "position", "z", "z_old", "memory")),
        *((name, ctypes.c_void_p) for name in ("out", "tension", "drum")),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Numbers:
    """All numbers that a run reads, of each tendon and of the bodies, in the order of C."""

    numbers: list[Array]  # shape (numbers,)
    of_masses: list[Array]  # shape (numbers x masses,)
    x: list[Array]  # shape (states,)
    start_m: Array  # shape (tendons,)
    laws: Array  # shape (bodies x numbers,)
    z: Array  # shape (bodies x 3,)
    tension_N: Array  # shape (tendons,)

    def of_tendon(self, *, name: str, tendon: int) -> Array:
        """Those of `_OF_TENDONS` of one tendon."""
        found: Array = getattr(self, name)[tendon]
        return found

    @classmethod
    def of(cls, start: Start) -> "_Numbers":
        chains, memory = start.problem.chains(), start.memory
        return cls(
            numbers=[np.array(list(chain.numbers().values()), dtype=np.float64) for chain in chains],
            of_masses=[np.concatenate(list(chain.of_masses().values())) for chain in chains],
            x=memory.x,
            start_m=memory.start_m,
            laws=np.concatenate([list(fields_of(law).values()) for law in start.problem.laws()]).astype(np.float64),
            z=memory.z.ravel(),
            tension_N=memory.tension_N,
        )


_OF_TENDONS = ("numbers", "of_masses", "x")


class _SlopedMechanism(CompiledMechanism):
    """Advances one mechanism with its derivatives."""

    _make_source: Callable[[Chain], str] = staticmethod(_slopes_source)

    def __init__(
        self, problem: MechanismProblem, step_s: float, directions: Sequence[Direction], memory: MechanismMemory
    ) -> None:
        super().__init__(problem, step_s)
        self._width = width = len(directions)
        _require_alike(problem, directions)
        own = _Numbers.of(Start(problem=problem, memory=memory))
        numbers_of = {id(side): _Numbers.of(side) for side in _sides(directions)}
        both = [(numbers_of[id(each.above)], numbers_of[id(each.below)], each.apart) for each in directions]

        def change(of: Callable[[_Numbers], Array]) -> Array:
            found = [(of(above) - of(below)) / apart for above, below, apart in both]
            return np.array(found).T.copy() if found else np.zeros((len(of(own)), 0))

        bodies, lanes = problem.bodies, problem.bodies - sum(problem.leads) + width
        reals = self._library.tff_change_reals
        self._seeds, self._start = [], change(lambda each: each.tension_N)
        starts = change(lambda each: each.start_m)
        for k, n in enumerate(self._counts):
            numbers, masses, state = (change(partial(_Numbers.of_tendon, name=name, tendon=k)) for name in _OF_TENDONS)
            room = np.zeros(reals(ctypes.c_int(n), ctypes.c_int(bodies), ctypes.c_int(width)))
            for first in (0, state.shape[0] * lanes):
                room[first : first + state.shape[0] * lanes].reshape(-1, lanes)[:, :width] = state
            self._seeds.append([numbers, masses, starts[k].copy(), room])
        self._changed_laws, self._changed_z = change(lambda each: each.laws), change(lambda each: each.z)
        self._changed_z_old = self._changed_z.copy()
        room = self._library.tff_body_change_reals(ctypes.c_int(bodies), ctypes.c_int(width))
        self._body_room = np.zeros(room)
        self._commands = [each.command for each in directions]

    def run_slopes(self, memory: MechanismMemory, position: Array) -> tuple[RunRows, Array, Array, Array]:
        """As `run`, with slopes of positions, tensions and drums from the start on, shape (n, each, directions)."""
        problem, width, rows = self._problem, self._width, len(position)
        led = np.zeros((rows, problem.bodies, width))
        for k, command in enumerate(self._commands):
            if command is not None:
                led[:, problem.known :, k] = command
        out = np.zeros((rows, problem.bodies, width))
        tension, drum = (np.zeros((rows, len(self._counts), width)) for _ in range(2))
        out[0], tension[0], drum[0] = self._changed_z.reshape(-1, 3, width)[:, 1], self._start, self._start
        tendons = (_TendonChange * len(self._seeds))(*(_TendonChange(*map(_at, own)) for own in self._seeds))
        effort = np.zeros_like(position)

        def advance(block: slice) -> RunRows:
            part = slice(block.start, block.stop + 1)
            behind = slice(block.start + 1, block.stop + 1)
            given = np.ascontiguousarray(led[part])
            own = [np.empty((block.stop - block.start, *each.shape[1:])) for each in (out, tension, drum)]
            bodies = (self._changed_laws, given, self._changed_z, self._changed_z_old, self._body_room)
            change = _Change(width, ctypes.addressof(tendons), *map(_at, (*bodies, *own)))
            found = self._run(memory, position[part], effort[part], None, ctypes.byref(change))
            for whole, each in zip((out, tension, drum), own, strict=True):
                whole[behind] = each
            return found

        blocks = in_blocks(rows - 1, advance, lambda each: len(each.lowest_N), lambda each: each.iterations)
        found = joined(blocks)
        good = len(found.lowest_N) + 1
        return found, out[:good], tension[:good], drum[:good]


def _at(values: Array) -> Any:
    return pointer(values).value


def _require_alike(problem: MechanismProblem, directions: Sequence[Direction]) -> None:
    """Refuse directions between mechanisms whose tendons have other sizes or laws."""
    known = _kind(problem)
    others = {id(side) for side in _sides(directions) if side.problem is not problem and _kind(side.problem) != known}
    for k, direction in enumerate(directions):
        if {id(direction.above), id(direction.below)} & others:
            raise ParameterError(
                f"direction {k} leads to a mechanism of other laws: what is alike here differs there, such as friction "
                "of the two directions or static and dynamic friction; let both sides differ alike"
            )


def _sides(directions: Sequence[Direction]) -> list[Start]:
    """Mechanisms on either side, each once."""
    return list({id(side): side for each in directions for side in (each.above, each.below)}.values())


def _kind(problem: MechanismProblem) -> Any:
    chains = problem.chains()
    laws = [(chain.friction.aliases(), twins_of(chain)) for chain in chains]
    return [chain.count for chain in chains], laws[0] if all(each == laws[0] for each in laws) else None
