"""Exact forward sensitivities of the simulation, differentiated step by step from CasADi's derivatives of the laws.

Two questions share one routine: how the tensions change with the force at the knots of a piecewise linear profile
(optimal control), and how they change with the parameters (identification).
"""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.models.errors import ParameterError
from tendonff.models.layout import ChainInputs, ChainState
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.elements import Whole
from tendonff.models.turns import out_of_turn
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.step.c_engine import ReportStruct, chain_struct, host_source, library_of, places_of, pointer
from tendonff.ocp.step.casadi_tangent import CasadiTangent
from tendonff.ocp.step.laws import ElementLaws
from tendonff.ocp.step.protocol import Array, Rows
from tendonff.ocp.tendon.simulate import describe_failure, tensions_of


class Parameter(StrEnum):
    """Parameters that a sensitivity may be taken over: the fields of `Whole`, the load exponent where it has one."""

    MASS = "mass_kg"
    VISCOUS = "viscous_N_s_per_m"
    BRISTLE_STIFFNESS = "bristle_stiffness_N_per_m"
    STIFFNESS = "stiffness_N_per_m"
    RELAXING_STIFFNESS = "relaxing_stiffness_N_per_m"
    DAMPING = "damping_N_s_per_m"
    RELAXATION_TIME = "relaxation_time_s"
    STRIBECK_VELOCITY = "stribeck_velocity_m_per_s"
    ADHESION = "adhesion_N"
    LOAD_EXPONENT = "load_exponent"
    MU_DYNAMIC_PULL = "mu_dynamic_pull"
    MU_STATIC_PULL = "mu_static_pull"
    MU_DYNAMIC_RELEASE = "mu_dynamic_release"
    MU_STATIC_RELEASE = "mu_static_release"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """A run and its derivatives, rows at 0, h, 2 h ..."""

    tension_N: Array  # shape (n, N + 1); as `simulate` gives
    ends_m: Array  # shape (n, 2); q_a, q_l
    tension_slopes: Array  # shape (n, links, directions); d tension/d direction; links is 1 (the output) or N + 1
    ends_slopes: Array | None  # shape (n, 2, directions); d (q_a, q_l)/d direction
    watched_slopes: Array  # shape (w, N + 1, directions); of all links, in the requested rows


@dataclass(frozen=True, slots=True, kw_only=True)
class _Directions:
    """Quantities that the directions change: numbers and start, or the knots of the force."""

    start: Array  # shape (state, directions)
    numbers: Array | None = None  # shape (numbers, directions): those of an element in C, of the whole in CasADi
    knot: NDArray[np.intc] | None = None
    weight: Array | None = None
    forgotten: NDArray[np.intc] | None = None
    watched: NDArray[np.int_] = field(default_factory=lambda: np.empty(0, dtype=np.int_))

    @property
    def width(self) -> int:
        """Number of directions."""
        return int(self.start.shape[1])

    def drive(self, rows: int) -> Array:
        """Change of f_c1 at the end of each step, shape (rows, width)."""
        change = np.zeros((rows, self.width))
        if self.knot is not None and self.weight is not None:
            at = np.arange(rows)
            change[at, self.knot] = 1 - self.weight
            change[at, self.knot + 1] += self.weight
        return change


def _source_of_any(chain: Chain) -> str:
    return _source(chain, ElementLaws.of(chain))


def _source_of_aliases(chain: Chain) -> str:
    """Without what the chain's numbers make superfluous: what equals another goes on to."""
    return _source(chain, ElementLaws.of(chain, folded=True))


def _keeps_aliases(chain: Chain, numbers: Array | None) -> bool:
    """Whether numbers that equal another change with it in all directions, shape (numbers, directions)."""
    if numbers is None:
        return True
    rows = dict(zip(chain.numbers(), numbers, strict=True))
    pairs = chain.friction.aliases().items()
    return all(np.array_equal(rows[f"friction_{name}"], rows[f"friction_{other}"]) for name, other in pairs)


def _source(chain: Chain, laws: ElementLaws) -> str:
    templates = ("kernel.c.j2", "pieces.c.j2", "weigh.c.j2", "tangent.h.j2", "tangent.c.j2", "tangent_run.c.j2")
    return host_source(chain, (*laws.simulation(), *laws.tangent()), templates)


def force_sensitivity(
    chain: Chain,
    force_N: Array,
    step_s: float,
    knot_rows: NDArray[np.int_],
    *,
    state: ChainState,
    all_links: bool = False,
    ends: bool = False,
    wiped_rows: NDArray[np.int_] | None = None,
    watched_rows: NDArray[np.int_] | None = None,
    engine: Engine = Engine.AUTO,
) -> Sensitivity:
    """Sensitivity of the tensions to the force at the knots of a piecewise linear profile, in N per N.

    Parameters
    ----------
    force_N : ndarray, shape (n,)
        f_c1 at 0, h, 2 h ... [N].
    knot_rows : ndarray of int, shape (k,)
        Rows of the knots: strictly increasing from 0 to n - 1.
    all_links, ends : bool, optional
        Report all tensions instead of the output alone, and the positions of the ends too.
    wiped_rows : ndarray of int, shape (k,), optional
        Never falling: from this row on a knot's influence is forgotten; default: it is followed to the end.
    watched_rows : ndarray of int, shape (w,), optional
        Different rows > 0 in which all links are reported in any case.
    """
    rows = np.asarray(knot_rows, dtype=np.int64)
    if rows[0] != 0 or rows[-1] != len(force_N) - 1 or np.any(np.diff(rows) <= 0):
        raise ParameterError(f"knot_rows must rise strictly from 0 to {len(force_N) - 1}, got {rows}")
    at = np.arange(1, len(force_N))
    left = np.clip(np.searchsorted(rows, at, side="right") - 1, 0, len(rows) - 2)
    weight = (at - rows[left]) / (rows[left + 1] - rows[left])
    directions = _Directions(
        start=np.zeros((chain.layout.size, len(rows))),
        knot=np.ascontiguousarray(left, dtype=np.intc),
        weight=np.ascontiguousarray(weight),
        forgotten=None
        if wiped_rows is None
        else np.minimum(np.searchsorted(wiped_rows, at, side="right"), left).astype(np.intc),
        watched=np.empty(0, dtype=np.int_) if watched_rows is None else watched_rows,
    )
    if resolve_engine(engine) is Engine.CASADI:
        tangent = CasadiTangent(chain, chain, ca.SX(0, 1), np.empty(0), step_s)
        return _run_casadi(tangent, chain, force_N, step_s, state, directions, all_links=all_links)
    return _run(chain, force_N, step_s, state, directions, all_links=all_links, with_ends=ends)


def parameter_sensitivity(
    whole: Whole,
    chain: Chain,
    force_N: Array,
    step_s: float,
    over: Sequence[Mapping[Parameter, float]],
    *,
    initial_tension_N: float,
    all_links: bool = False,
    engine: Engine = Engine.AUTO,
) -> Sensitivity:
    """Sensitivity of tensions and end positions along directions, each a change of parameters in their SI units.

    The chain is that of `whole`; what the ends are made of does not change. The force is f_c1 at 0, h, 2 h ..., shape
    (n,), and the start is at rest under `initial_tension_N`.
    """
    parameters = tuple(name for name in Parameter if any(name in direction for direction in over))
    shares = np.array([[direction.get(name, 0.0) for direction in over] for name in parameters])
    symbols: dict[str, ca.SX] = {name: ca.SX.sym(name) for name in parameters}
    symbolic = replace(chain, elements=whole.changed(symbols).divided(chain.count, chain.motion))
    unknowns = ca.vertcat(*symbols.values())
    at = [whole.value(name) for name in parameters]
    numbers = ca.vertcat(*symbolic.numbers().values())
    stretch, own = symbolic.link.shortened(ca.DM(chain.path_at(np.zeros(1)).ratio[0])).rest(initial_tension_N)
    by_link = [ca.densify(state) for state in (stretch, *own)]
    masses = ca.SX.zeros(len(chain.friction.states) * chain.count)
    ends = ca.vertcat(ca.sum1(by_link[0]), 0)  # q_a - q_l; the load's spring does not depend on the tendon
    near = ca.SX.zeros(len(chain.near.states))
    start = ca.vertcat(ca.SX.zeros(chain.count + 2), near, *by_link, masses, ends)
    slopes = ca.Function("slopes", [unknowns], [ca.jacobian(numbers, unknowns), ca.jacobian(start, unknowns)])
    by_number, by_start = (np.asarray(m.full()) @ shares for m in slopes(at))
    state = chain.rest_state(initial_tension_N)
    if resolve_engine(engine) is Engine.CASADI or chain.moving:  # C knows the parameters of pieces, not of the whole
        tangent = CasadiTangent(chain, symbolic, unknowns, np.array(at), step_s)
        directions = _Directions(start=by_start, numbers=shares)
        return _run_casadi(tangent, chain, force_N, step_s, state, directions, all_links=all_links)
    count, more = len(over), ((0, 0), (0, -len(over) % _LANES))
    directions = _Directions(start=np.pad(by_start, more), numbers=np.pad(by_number, more))
    found = _run(chain, force_N, step_s, state, directions, all_links=all_links, with_ends=True)
    return replace(
        found,
        tension_slopes=found.tension_slopes[..., :count],
        ends_slopes=None if found.ends_slopes is None else found.ends_slopes[..., :count],
        watched_slopes=found.watched_slopes[..., :count],
    )


_LANES = 4
"""Directions come in so many, zeros to the last: registers hold four numbers, and a rest costs as much as four."""


def _run(
    chain: Chain,
    force_N: Array,
    step_s: float,
    state: ChainState,
    directions: _Directions,
    *,
    all_links: bool,
    with_ends: bool,
) -> Sensitivity:
    source = _source_of_aliases if _keeps_aliases(chain, directions.numbers) else _source_of_any
    library, n, width = library_of(chain, source), chain.count, directions.width
    library.tff_tangent_run.restype = ctypes.c_long
    inputs = ChainInputs.of_force(force_N).table()
    rows = len(inputs) - 1
    first_link = 0 if all_links else n
    x = state.vector()
    x_old = x.copy()
    dx = np.ascontiguousarray(directions.start)
    dx_old = dx.copy()
    work = np.empty(library.tff_work_reals(ctypes.c_int(n)) + chain.layout.size)
    tangent_work = np.empty(library.tff_tangent_reals(ctypes.c_int(n), ctypes.c_int(width)))
    tension, ends = np.empty((rows + 1, n + 1)), np.empty((rows + 1, 2))
    slopes = np.zeros((rows + 1, n + 1 - first_link, width))
    ends_slopes = np.zeros((rows + 1, 2, width)) if with_ends else None
    tension[0], ends[0] = tensions_of(chain, x, state.time_s)[0], x[-2:]
    if ends_slopes is not None:
        ends_slopes[0] = dx[-2:]
    watched_slopes = np.zeros((len(directions.watched), n + 1, width))
    slot = np.full(rows, -1, dtype=np.intc)
    slot[directions.watched - 1] = np.arange(len(directions.watched))
    report, worst = ReportStruct(), ctypes.c_int()
    record, places = chain_struct(chain), places_of(chain, state.time_s, step_s, rows)
    with out_of_turn():
        done = library.tff_tangent_run(
            ctypes.byref(record),
            ctypes.c_double(step_s),
            pointer(inputs),
            ctypes.c_long(rows),
            ctypes.c_int(1),
            *map(pointer, (x, x_old, work, tension[1:], ends[1:])),
            ctypes.byref(report),
            ctypes.byref(worst),
            *map(pointer, places),
            ctypes.c_int(width),
            pointer(directions.numbers),
            *map(pointer, (directions.knot, directions.weight, directions.forgotten, dx, dx_old, tangent_work)),
            ctypes.c_int(first_link),
            pointer(slopes[1:]),
            pointer(None if ends_slopes is None else ends_slopes[1:]),
            pointer(slot),
            pointer(watched_slopes),
        )
    if done < rows:
        failed = Rows(
            tension_N=tension[1 : done + 1],
            ends_m=ends[1 : done + 1],
            states=None,
            iterations=report.iterations,
            splits=report.splits,
            residual_N=report.residual_N,
            worst_mass=worst.value,
        )
        raise SolveError(describe_failure(chain, failed, (done + 1) * step_s, step_s))
    return Sensitivity(
        tension_N=tension, ends_m=ends, tension_slopes=slopes, ends_slopes=ends_slopes, watched_slopes=watched_slopes
    )


def _run_casadi(
    tangent: CasadiTangent,
    chain: Chain,
    force_N: Array,
    step_s: float,
    state: ChainState,
    directions: _Directions,
    *,
    all_links: bool,
) -> Sensitivity:
    inputs, x = ChainInputs.of_force(force_N), state.vector()
    steps = len(inputs) - 1
    rows, slopes, ends_slopes = tangent.run(
        x,
        state.time_s,
        inputs,
        directions.start,
        directions.drive(steps),
        np.zeros((0, directions.width)) if directions.numbers is None else directions.numbers,
        np.zeros(steps, dtype=np.intc) if directions.forgotten is None else directions.forgotten,
    )
    if len(rows.tension_N) < steps:
        raise SolveError(describe_failure(chain, rows, (len(rows.tension_N) + 1) * step_s, step_s))
    first_link = 0 if all_links else chain.count
    start = np.zeros((1, chain.count + 1, directions.width))
    return Sensitivity(
        tension_N=np.vstack([tensions_of(chain, x, state.time_s), rows.tension_N]),
        ends_m=np.vstack([x[-2:], rows.ends_m]),
        tension_slopes=np.concatenate([start, slopes])[:, first_link:],
        ends_slopes=np.concatenate([directions.start[None, -2:], ends_slopes]),
        watched_slopes=slopes[directions.watched - 1],
    )
