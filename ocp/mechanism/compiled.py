"""Bodies and tendons in compiled C."""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonff.models.joint.balance import Followed
from tendonff.models.layout import fields_of
from tendonff.models.mechanism import Arm, Tendon
from tendonff.models.path import TabulatedSection
from tendonff.models.path_table import MOST_AXES, PathTable
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import out_of_turn
from tendonff.ocp.joint.laws import JOINT_NUMBERS, joint_torque, link_back, path_mass_back, representative
from tendonff.ocp.mechanism.problem import Array, MechanismMemory, MechanismProblem, rest
from tendonff.ocp.step.blocks import in_blocks
from tendonff.ocp.step.c_engine import CORE, ReportStruct, chain_struct, host_source, library_of, pointer
from tendonff.ocp.step.laws import ElementLaws

MS = 1e-3
"""Time that `Sharing.change_weight` is for [s]."""


class _Effect(ctypes.Structure):
    _fields_ = (
        ("near_m", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("per", "knots", "cubics")),
        *((name, ctypes.c_int) for name in ("pieces", "mass", "masses", "link", "links")),
    )


class _Table(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("values", "share")),
        *((name, ctypes.c_double * MOST_AXES) for name in ("low", "step")),
        ("per_m", ctypes.c_double),
        *((name, ctypes.c_int * MOST_AXES) for name in ("body", "nodes")),
        *((name, ctypes.c_int) for name in ("axes", "first", "count")),
    )


class _Tendon(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("chain", "home", "effects")),
        ("start_m", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("x", "x_old", "memory", "tables")),
        ("tabled", ctypes.c_int),
    )


class _Body(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_double) for name in JOINT_NUMBERS)


class _Sharing(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_double) for name in ("least", "smooth", "price")),
        *(
            (name, ctypes.c_void_p)
            for name in ("winding_m", "partner", "shares", "closure_rad", "compliance", "pretension")
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseRows:
    """Result of an inverse at the ends of successive steps; fewer rows where a step has no solution."""

    position: Array  # shape (rows, known)
    travel_m: Array  # shape (rows, tendons); at the drum, where the motors stand at zero before
    tension_N: Array  # shape (rows, tendons); at the far end
    drum_N: Array  # shape (rows, tendons)
    slack_m: Array  # shape (rows, tendons); length that hangs loose in a loop
    lowest_N: Array  # shape (rows,); along any tendon
    evaluations: int  # of the recursion through all tendons


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRows:
    """Result of a run of steps; fewer rows where a step fails for good."""

    position: Array  # shape (rows, bodies)
    torque: Array  # shape (rows, bodies); of the tendons on each body
    tension_N: Array  # shape (rows, tendons); at the far end
    drum_N: Array  # shape (rows, tendons)
    lowest_N: Array  # shape (rows,)
    iterations: int
    splits: int
    residual_N: float


def _source(chain: Chain) -> str:
    laws = ElementLaws.of(chain, folded=True)
    own = (joint_torque(), link_back(laws), path_mass_back(laws))
    templates = ("kernel.c.j2", "weigh.c.j2", "bodies_laws.c.j2", CORE, "bodies.c.j2")
    return host_source(chain, (*laws.simulation(), *own), templates, joint_numbers=JOINT_NUMBERS)


@dataclass(slots=True, kw_only=True, eq=False)
class InverseCall:
    """Call of the compiled inverse; the arrays of its memory, z and z_old advance with each call.

    Attributes are those of `InverseRows` and of `MechanismMemory`; `position` and `effort` are read anew by each call.
    """

    function: Any
    memory: MechanismMemory
    position: Array
    effort: Array
    z: Array
    z_old: Array
    out: Array
    travel_m: Array
    tension_N: Array
    drum_N: Array
    slack_m: Array
    lowest_N: Array
    fresh: ctypes.c_int
    evaluations: ctypes.c_long = field(default_factory=ctypes.c_long)
    arguments: tuple[Any, ...] = ()
    kept: list[Any] = field(default_factory=list)  # what must outlive the arguments

    def __call__(self) -> int:
        """Advance over the rows of `position`; the number that was found."""
        found: int = self.function(*self.arguments)
        if found:
            self.fresh.value = 0
        return found


class CompiledMechanism:
    """Invert and advance one mechanism in compiled C.

    Raises
    ------
    CodeError
        If no C compiler works here.
    """

    _make_source: Callable[[Chain], str] = staticmethod(_source)

    def __init__(self, problem: MechanismProblem, step_s: float) -> None:
        self._problem, self._step_s = problem, step_s
        chains = problem.chains()
        self._counts = [chain.count for chain in chains]
        self._library = library_of(representative(chains), self._make_source)
        self._library.tff_bodies_invert.restype = ctypes.c_long
        self._library.tff_bodies_run.restype = ctypes.c_long
        self._chains = [chain_struct(chain) for chain in chains]
        self._laws = (_Body * problem.bodies)(*(_Body(*fields_of(law).values()) for law in problem.laws()))
        self._scale = problem.scale_m()
        self._partner = np.array(problem.partner, dtype=np.intc)
        self._alone = np.array(problem.alone, dtype=np.intc)
        self._winding = problem.winding_m
        self._kept: list[Any] = []
        pairs = list(zip(problem.mechanism.tendons, chains, strict=True))
        self._effects = [self._effects_of(tendon, chain) for tendon, chain in pairs]
        self._tables = [self._tables_of(chain) for chain in chains]
        self._homes = [home_of(chain) for chain in chains]
        bodies = ctypes.c_int(problem.bodies)
        self._work = [np.empty(self._library.tff_strand_reals(ctypes.c_int(n), bodies)) for n in self._counts]

    def _effects_of(self, tendon: Tendon, chain: Chain) -> Any:
        records = (_Effect * self._problem.bodies)()
        near = {arm.body: arm for arm in tendon.near.arms}
        for b, name in enumerate(self._problem.names):
            part, drum = effect_parts(tendon, chain, name), near.get(name)
            self._kept.append(part)
            records[b] = _Effect(
                drum.metres_per_unit if isinstance(drum, Arm) else 0.0,
                *(pointer(each).value for each in (part.per, part.knots, part.cubics if part.pieces else None)),
                *(part.pieces, *part.masses, *part.links),
            )
        return records

    def _tables_of(self, chain: Chain) -> Any:
        """Records of the tables of a path."""
        parts = table_parts(chain, self._problem.names)
        self._kept += parts
        reals, whole = ctypes.c_double * MOST_AXES, ctypes.c_int * MOST_AXES
        return (_Table * len(parts))(
            *(
                _Table(
                    *(part.values.ctypes.data, part.share.ctypes.data, reals(*part.low), reals(*part.step), part.per_m),
                    *(whole(*part.bodies), whole(*part.nodes), len(part.nodes), part.first, len(part.share)),
                )
                for part in parts
            )
        )

    def _tendons(self, memory: MechanismMemory) -> Any:
        """Records of the tendons."""
        work = self._work
        return (_Tendon * len(work))(
            *(
                _Tendon(
                    ctypes.addressof(self._chains[k]),
                    self._homes[k].ctypes.data,
                    ctypes.addressof(self._effects[k]),
                    float(memory.start_m[k]),
                    *(each.ctypes.data for each in (memory.x[k], memory.x_old[k], work[k])),
                    *(ctypes.addressof(self._tables[k]), len(self._tables[k])),
                )
                for k in range(len(work))
            )
        )

    def path_at(self, position: Array) -> list[Array]:
        """Rows of each tendon's path where bodies stand, shape (rows, 3 N + 3).

        Wrap angles of the masses (N), whole length over that of each link (N + 1), gained lengths (N + 1), far end.

        Parameters
        ----------
        position : ndarray, shape (rows, bodies)
        """
        given = np.ascontiguousarray(position, dtype=np.float64)
        records, rows = self._tendons(rest(self._problem)), ctypes.c_long(len(given))
        found = [np.empty((len(given), 3 * n + 3)) for n in self._counts]
        for record, out in zip(records, found, strict=True):
            bodies = ctypes.c_int(self._problem.bodies)
            self._library.tff_bodies_place(ctypes.byref(record), bodies, rows, pointer(given), pointer(out))
        return found

    def invert(self, memory: MechanismMemory, position: Array, effort: Array) -> InverseRows:
        """Motors for positions of the bodies at the present instant and the ends of the steps that follow.

        Parameters
        ----------
        memory : MechanismMemory
            Advanced to the last row that was found.
        position, effort : ndarray, shape (rows + 1, known)
            Of all bodies but the motors: positions, and torques on what they touch.
        """
        call = self.inverse_call(memory, position, effort)
        with out_of_turn():
            done = call()
        known = self._problem.known
        memory.z[:known], memory.z_old[:known] = call.z, call.z_old
        self._moved(memory, done, call.tension_N)
        return InverseRows(
            position=call.out[:done],
            travel_m=call.travel_m[:done],
            tension_N=call.tension_N[:done],
            drum_N=call.drum_N[:done],
            slack_m=call.slack_m[:done],
            lowest_N=call.lowest_N[:done],
            evaluations=call.evaluations.value,
        )

    def inverse_call(self, memory: MechanismMemory, position: Array, effort: Array) -> "InverseCall":
        """The call of `invert` with its arrays, to be made once or, of a single row, again and again."""
        problem = self._problem
        rows, count, known = len(position) - 1, len(self._counts), problem.known
        call = InverseCall(
            function=self._library.tff_bodies_invert,
            memory=memory,
            position=np.ascontiguousarray(position, dtype=np.float64),
            effort=np.ascontiguousarray(effort, dtype=np.float64),
            z=np.array(memory.z[:known]),
            z_old=np.array(memory.z_old[:known]),
            out=np.empty((rows, known)),
            travel_m=np.empty((rows, count)),
            tension_N=np.empty((rows, count)),
            drum_N=np.empty((rows, count)),
            slack_m=np.empty((rows, count)),
            lowest_N=np.empty(rows),
            fresh=ctypes.c_int(memory.fresh),
        )
        call.tension_N[:1] = memory.tension_N
        sharing, closure = problem.sharing, np.zeros(count)
        how = _Sharing(
            *(sharing.least_tension_N, sharing.smooth_N, sharing.change_weight * MS / self._step_s),
            *(each.ctypes.data for each in (self._winding, self._partner, self._alone, closure)),
            *(None, None),  # at rest only
        )
        records = self._tendons(memory)
        call.kept = [self, how, closure, records]
        call.arguments = (
            *(self._laws, ctypes.c_int(known), ctypes.c_int(problem.driven), ctypes.c_int(problem.wanted)),
            *(records, ctypes.c_int(count), ctypes.c_double(self._step_s), ctypes.c_long(rows), call.fresh),
            *map(pointer, (call.position, call.effort, self._scale)),
            ctypes.byref(how),
            *map(pointer, (call.z, call.z_old, call.out, call.travel_m, call.tension_N, call.drum_N, call.slack_m)),
            *(pointer(call.lowest_N), pointer(memory.worth), ctypes.byref(call.evaluations)),
        )
        return call

    def run(self, memory: MechanismMemory, position: Array, effort: Array, led: Array | None = None) -> RunRows:
        """Advance over positions of bodies that are led and torques on what bodies touch, shape (rows + 1, bodies).

        `led`, shape (bodies,): which are led; default: those that a drive leads.
        """

        def advance(block: slice) -> RunRows:
            part = slice(block.start, block.stop + 1)
            return self._run(memory, position[part], effort[part], led)

        return joined(
            in_blocks(len(position) - 1, advance, lambda each: len(each.lowest_N), lambda each: each.iterations)
        )

    def _run(self, memory: MechanismMemory, position: Array, effort: Array, led: Array | None, *more: Any) -> RunRows:
        """A block of rows; `more`: further arguments of the function in C."""
        problem = self._problem
        rows, count, bodies = len(position) - 1, len(self._counts), problem.bodies
        given, efforts = (np.ascontiguousarray(each, dtype=np.float64) for each in (position, effort))
        leads = np.array(problem.leads if led is None else led, dtype=np.intc)
        out = np.empty((rows, bodies, 2))
        tension, drum, lowest = np.empty((rows, count)), np.empty((rows, count)), np.empty(rows)
        report = ReportStruct()
        records = self._tendons(memory)
        with out_of_turn():
            done = self._library.tff_bodies_run(
                *(self._laws, ctypes.c_int(bodies), pointer(leads), records, ctypes.c_int(count)),
                *(ctypes.c_double(self._step_s), ctypes.c_long(rows), ctypes.c_int(memory.fresh)),
                *map(pointer, (given, efforts, self._scale, memory.z, memory.z_old, out, tension, drum, lowest)),
                ctypes.byref(report),
                *more,
            )
        self._moved(memory, done, tension)
        return RunRows(
            position=out[:done, :, 0],
            torque=out[:done, :, 1],
            tension_N=tension[:done],
            drum_N=drum[:done],
            lowest_N=lowest[:done],
            iterations=report.iterations,
            splits=report.splits,
            residual_N=report.residual_N,
        )

    def _moved(self, memory: MechanismMemory, done: int, tension: Array) -> None:
        if done:
            memory.fresh = False
            memory.tension_N = tension[done - 1].copy()


def joined(blocks: Sequence[RunRows]) -> RunRows:
    """Rows of successive blocks."""
    rows: dict[str, Any] = {
        name: np.concatenate([getattr(each, name) for each in blocks])
        for name in ("position", "torque", "tension_N", "drum_N", "lowest_N")
    }
    return RunRows(
        **rows,
        iterations=sum(each.iterations for each in blocks),
        splits=sum(each.splits for each in blocks),
        residual_N=blocks[-1].residual_N,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectParts:
    """Effect of a body on a tendon's path, as the core takes it."""

    per: Array | None  # shape (3 N + 3,): change of a row of the path per unit; None for none
    # knots, cubics: of the far end's travel by a table, shape (pieces + 1,) and (pieces, 4)
    knots: Array | None
    cubics: Array
    pieces: int
    # masses, links: first and number of those whose angles and lengths it changes
    masses: tuple[int, int]
    links: tuple[int, int]


def effect_parts(tendon: Tendon, chain: Chain, body: str) -> EffectParts:
    """Effect of a body on a tendon's sections and far end."""
    followed, arm = Followed.of(chain, body), {each.body: each for each in tendon.far.arms}.get(body)
    straight = arm.metres_per_unit if isinstance(arm, Arm) else 0.0
    table = None if arm is None or isinstance(arm, Arm) else arm
    per = np.concatenate([followed.angle_per_rad, followed.length_per_rad, followed.gained_per_rad_m, [straight]])
    tabled = _tabled_links(chain, body)
    return EffectParts(
        per=per if arm is not None or followed.any or tabled.any() else None,
        knots=None if table is None else table.knots,
        cubics=np.empty(0) if table is None else np.ascontiguousarray(table.cubics).ravel(),
        pieces=0 if table is None else len(table.cubics),
        masses=_range(followed.angle_per_rad != 0),
        links=_range((followed.length_per_rad != 0) | (followed.gained_per_rad_m != 0) | tabled),
    )


def _tabled_links(chain: Chain, body: str) -> NDArray[np.bool_]:
    """Links whose lengths a table over a body changes, shape (N + 1,)."""
    path = chain.elements.path
    tables = [section.length if isinstance(section, TabulatedSection) else None for section in path.sections]
    follows = np.array([table is not None and body in table.joints for table in tables], dtype=bool)
    found: NDArray[np.bool_] = (path.parts[:, follows] != 0).any(axis=1)
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class TableParts:
    """A table of a path, as the core takes it."""

    values: Array  # coefficients
    share: Array  # of its value, for each mass or link that it changes
    low: tuple[float, ...]
    step: tuple[float, ...]
    per_m: float  # of a length: 1 over the length of the whole tendon; 0: a wrap angle
    bodies: tuple[int, ...]
    nodes: tuple[int, ...]
    first: int  # mass or link that it changes


def table_parts(chain: Chain, bodies: Sequence[str]) -> list[TableParts]:
    """Tables of a tendon's path, less what `home_of` has; bodies by their names in order."""
    path, found = chain.elements.path, list[TableParts]()

    def add(table: PathTable, less: float, rows: NDArray[np.int_], share: Array, per_m: float) -> None:
        found.append(
            TableParts(
                values=np.ascontiguousarray(table.coefficients - less),
                share=np.array(share, dtype=np.float64),
                low=tuple(table.low_rad.tolist()),
                step=tuple(table.step_rad.tolist()),
                per_m=per_m,
                bodies=tuple(bodies.index(joint) for joint in table.joints),
                nodes=table.nodes,
                first=int(rows[0]),
            )
        )

    for k, section in enumerate(path.sections):
        if isinstance(section, TabulatedSection):
            masses, links = np.flatnonzero(path.section_of == k), np.flatnonzero(path.parts[:, k])
            if section.angle is not None and len(masses):  # of a section that is never touched, nothing bends
                add(section.angle, float(section.angle_at({})), masses, 1 / path.pieces[masses], 0.0)
            if section.length is not None:
                per_m = 1 / (path.length_m or 1.0)
                add(section.length, float(section.length.at({})), links, path.parts[links, k], per_m)
    return found


def _range(touched: NDArray[np.bool_]) -> tuple[int, int]:
    """First and number of what is touched, with what lies between."""
    places = np.flatnonzero(touched)
    return (int(places[0]), int(np.ptp(places)) + 1) if len(places) else (0, 0)


def home_of(chain: Chain) -> Array:
    """The path with all bodies at zero, shape (3 N + 3,): angles, shares of the links, gained lengths, far end."""
    rows = chain.elements.path.at({})
    return np.concatenate([rows.angle_rad[0], 1 / rows.ratio[0], rows.gained_m[0], np.zeros(1)])
