"""Bodies and tendons in compiled C."""

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonff.models.layout import fields_of
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.joint.laws import JOINT_NUMBERS, joint_torque, link_back, path_mass_back, representative
from tendonff.ocp.mechanism.problem import Array, MechanismMemory, MechanismProblem
from tendonff.ocp.step.c_engine import ReportStruct, chain_struct, host_source, library_of, pointer
from tendonff.ocp.step.laws import ElementLaws

MOST_EQUATIONS = 2 * 24 + 16  # of bodies.c.j2
_MS = 1e-3  # time that `Sharing.change_weight` is for [s]


class _Effect(ctypes.Structure):
    _fields_ = (
        ("near_m", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("per", "knots", "cubics")),
        ("pieces", ctypes.c_int),
        ("far_only", ctypes.c_int),
    )


class _Tendon(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("chain", "places", "effects")),
        ("start_m", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("x", "x_old", "memory")),
    )


class _Body(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_double) for name in JOINT_NUMBERS)


class _Sharing(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_double) for name in ("least", "smooth", "price")),
        *((name, ctypes.c_void_p) for name in ("winding_m", "partner", "shares", "closure_rad")),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseRows:
    """Result of an inverse at the ends of successive steps; fewer rows where a step has no solution."""

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
    templates = ("kernel.c.j2", "weigh.c.j2", "bodies.c.j2")
    return host_source(chain, (*laws.simulation(), *own), templates, joint_numbers=JOINT_NUMBERS)


class CompiledMechanism:
    """Invert and advance one mechanism in compiled C.

    Raises
    ------
    CodeError
        If no C compiler works here.
    """

    def __init__(self, problem: MechanismProblem, step_s: float) -> None:
        self._problem, self._step_s = problem, step_s
        self._library = library_of(representative(tuple(strand.chain for strand in problem.strands)), _source)
        self._library.tff_bodies_invert.restype = ctypes.c_long
        self._library.tff_bodies_run.restype = ctypes.c_long
        self._chains = [chain_struct(strand.chain) for strand in problem.strands]
        self._laws = (_Body * problem.bodies)(*(_Body(*fields_of(law).values()) for law in problem.laws))
        self._scale = np.array(problem.scale, dtype=np.float64)
        self._partner = np.array(problem.partner, dtype=np.intc)
        self._alone = np.array(problem.alone, dtype=np.intc)
        self._winding = np.array(problem.winding_m, dtype=np.float64)
        self._kept: list[Any] = []
        self._effects = [self._effects_of(k) for k in range(len(problem.strands))]

    def _effects_of(self, k: int) -> Any:
        strand = self._problem.strands[k]
        records = (_Effect * self._problem.bodies)()
        for b, effect in enumerate(strand.effects):
            per = None if effect.per is None else np.ascontiguousarray(effect.per, dtype=np.float64)
            lengths = effect.lengths
            knots = None if lengths is None else lengths.angle_rad
            cubics = None if lengths is None else lengths.travel_pieces
            self._kept += [per, knots, cubics]
            records[b] = _Effect(
                effect.near_m,
                *(pointer(each).value for each in (per, knots, cubics)),
                0 if lengths is None else len(lengths.angle_rad) - 1,
                per is not None and not per[:-1].any(),
            )
        return records

    def _tendons(self, memory: MechanismMemory, rows: int) -> tuple[Any, list[Any]]:
        """Records of the tendons, and what must outlive them."""
        kept: list[Any] = []
        strands, bodies = self._problem.strands, self._problem.bodies
        records = (_Tendon * len(strands))()
        times = memory.time_s + self._step_s * np.arange(-1.0, rows + 1)
        for k, strand in enumerate(strands):
            chain, motion = strand.chain, strand.chain.motion
            joints = {} if motion is None else dict(zip(motion.names, motion.at(times).T, strict=True))
            path = chain.elements.path.at(joints)
            places = np.column_stack([path.angle_rad, 1 / path.ratio, path.gained_m, np.zeros(len(path.ratio))])
            places = np.ascontiguousarray(np.broadcast_to(places, (len(times), places.shape[1])))
            work = np.empty(self._library.tff_strand_reals(ctypes.c_int(chain.count), ctypes.c_int(bodies)))
            kept += [places, work]
            records[k] = _Tendon(
                ctypes.addressof(self._chains[k]),
                places.ctypes.data,
                ctypes.addressof(self._effects[k]),
                float(memory.start_m[k]),
                *(each.ctypes.data for each in (memory.x[k], memory.x_old[k], work)),
            )
        return records, kept

    def invert(self, memory: MechanismMemory, position: Array, effort: Array) -> InverseRows:
        """Motors for positions of the joints at the present instant and the ends of the steps that follow.

        Parameters
        ----------
        memory : MechanismMemory
            Advanced to the last row that was found.
        position, effort : ndarray, shape (rows + 1, joints)
            Positions, and torques on what the joints touch.
        """
        problem = self._problem
        rows, count, joints = len(position) - 1, len(problem.strands), problem.joints
        z, z_old = (np.ascontiguousarray(each[:joints]) for each in (memory.z, memory.z_old))
        given = np.ascontiguousarray(np.vstack([z_old[:, 1], position]))
        efforts = np.ascontiguousarray(effort, dtype=np.float64)
        travel, tension, drum, slack = (np.empty((rows, count)) for _ in range(4))
        lowest, evaluations = np.empty(rows), ctypes.c_long()
        tension[:1] = memory.tension_N
        sharing, closure = problem.sharing, np.zeros(count)
        how = _Sharing(
            *(sharing.least_tension_N, sharing.smooth_N, sharing.change_weight * _MS / self._step_s),
            *(each.ctypes.data for each in (self._winding, self._partner, self._alone, closure)),
        )
        records, kept = self._tendons(memory, rows)
        done = self._library.tff_bodies_invert(
            *(self._laws, ctypes.c_int(joints), records, ctypes.c_int(count), ctypes.c_double(self._step_s)),
            *(ctypes.c_long(rows), ctypes.c_int(memory.fresh), *map(pointer, (given, efforts, self._scale))),
            ctypes.byref(how),
            *map(pointer, (z, z_old, travel, tension, drum, slack, lowest, memory.worth)),
            ctypes.byref(evaluations),
        )
        del kept
        memory.z[:joints], memory.z_old[:joints] = z, z_old
        self._moved(memory, done, tension)
        return InverseRows(
            travel_m=travel[:done],
            tension_N=tension[:done],
            drum_N=drum[:done],
            slack_m=slack[:done],
            lowest_N=lowest[:done],
            evaluations=evaluations.value,
        )

    def run(self, memory: MechanismMemory, position: Array, effort: Array, led: Array) -> RunRows:
        """Advance over positions of the bodies that are led and torques of all, shape (rows + 1, bodies)."""
        problem = self._problem
        rows, count, bodies = len(position) - 1, len(problem.strands), problem.bodies
        given, efforts = (np.ascontiguousarray(each, dtype=np.float64) for each in (position, effort))
        leads = np.ascontiguousarray(led, dtype=np.intc)
        out = np.empty((rows, bodies, 2))
        tension, drum, lowest = np.empty((rows, count)), np.empty((rows, count)), np.empty(rows)
        report = ReportStruct()
        records, kept = self._tendons(memory, rows)
        done = self._library.tff_bodies_run(
            *(self._laws, ctypes.c_int(bodies), pointer(leads), records, ctypes.c_int(count)),
            *(ctypes.c_double(self._step_s), ctypes.c_long(rows), ctypes.c_int(memory.fresh)),
            *map(pointer, (given, efforts, self._scale, memory.z, memory.z_old, out, tension, drum, lowest)),
            ctypes.byref(report),
        )
        del kept
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
            memory.time_s += done * self._step_s
            memory.tension_N = tension[done - 1].copy()
