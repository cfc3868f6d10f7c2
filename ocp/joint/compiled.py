"""Engine COMPILED of a joint between tendons: the templated mechanism in C."""

import ctypes
from typing import Any

import numpy as np

from tendonff.models.joint.balance import Followed
from tendonff.models.layout import fields_of
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import out_of_turn
from tendonff.ocp.joint.laws import JOINT_NUMBERS, joint_torque, link_back, path_mass_back, representative
from tendonff.ocp.joint.protocol import Array, JointInverseRows, JointMemory, JointProblem, JointRows
from tendonff.ocp.step.blocks import in_blocks
from tendonff.ocp.step.c_engine import ReportStruct, chain_struct, host_source, library_of, pointer
from tendonff.ocp.step.laws import ElementLaws


class _TendonStruct(ctypes.Structure):
    """`tff_tendon` of sides.c.j2."""

    _fields_ = (
        ("chain", ctypes.c_void_p),
        *((name, ctypes.c_void_p) for name in ("places", "per_rad", "knots", "cubics")),
        ("pieces", ctypes.c_int),
        ("plain", ctypes.c_int),
        ("winding_m", ctypes.c_double),
        ("start_m", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("x", "x_old", "memory")),
    )


class _JointStruct(ctypes.Structure):
    """`tff_hinge` of sides.c.j2."""

    _fields_ = tuple((name, ctypes.c_double) for name in JOINT_NUMBERS)


def _joint_source(chain: Chain) -> str:
    laws = ElementLaws.of(chain, folded=True)
    own = (joint_torque(), link_back(laws), path_mass_back(laws))
    templates = ("kernel.c.j2", "weigh.c.j2", "mechanism.c.j2")
    return host_source(chain, (*laws.simulation(), *own), templates, joint_numbers=JOINT_NUMBERS)


def joint_places(chain: Chain, joint: str, time_s: Array) -> Array:
    """Where a chain's path is at instants with the driven joint at zero, shape (rows, 3 N + 3).

    Wrap angles, shares of the links in the length, gained lengths; the far end follows the driven joint alone.
    """
    joints = {} if chain.motion is None else dict(zip(chain.motion.names, chain.motion.at(time_s).T, strict=True))
    joints[joint] = np.zeros(len(time_s))
    rows = chain.elements.path.at(joints)
    return np.column_stack([rows.angle_rad, 1 / rows.ratio, rows.gained_m, np.zeros(len(time_s))])


def per_radian(chain: Chain, joint: str, arm_m: float) -> Array:
    """Change of what `joint_places` holds per radian of the driven joint, shape (3 N + 3,)."""
    followed = Followed.of(chain, joint)
    return np.concatenate([followed.angle_per_rad, followed.length_per_rad, followed.gained_per_rad_m, [arm_m]])


class CompiledJoint:
    """Invert and advance one mechanism in compiled C.

    Raises
    ------
    CodeError
        If no C compiler works here.
    """

    def __init__(self, problem: JointProblem, step_s: float) -> None:
        self._problem, self._step_s = problem, step_s
        self._library = library_of(representative(problem.chains), _joint_source)
        self._library.tff_joint_invert.restype = ctypes.c_long
        self._library.tff_joint_run.restype = ctypes.c_long
        self._chains = [chain_struct(chain) for chain in problem.chains]
        self._joint = _JointStruct(*fields_of(problem.law).values())

    def _tendons(self, memory: JointMemory, rows: int) -> tuple[Any, list[Any]]:
        """Records of the tendons, and what must outlive them."""
        problem, kept = self._problem, []
        records = (_TendonStruct * len(problem.chains))()
        times = memory.time_s + self._step_s * np.arange(-1.0, rows + 1)
        name = problem.mechanism.joint.name
        for k, (chain, tendon) in enumerate(zip(problem.chains, problem.mechanism.tendons, strict=True)):
            lengths = tendon.arm.lengths
            places = np.ascontiguousarray(joint_places(chain, name, times))
            per_rad = per_radian(chain, name, tendon.arm.moment_arm_m or 0.0)
            knots = cubics = None
            if lengths is not None:
                knots, cubics = lengths.angle_rad, lengths.travel_pieces
            work = np.empty(self._library.tff_side_reals(ctypes.c_int(chain.count)))
            kept += [places, per_rad, knots, cubics, work]
            records[k] = _TendonStruct(
                ctypes.addressof(self._chains[k]),
                *(pointer(each).value for each in (places, per_rad, knots, cubics)),
                0 if lengths is None else len(lengths.angle_rad) - 1,
                not Followed.of(chain, name).any,
                problem.windings_m[k],
                float(memory.start_m[k]),
                *(pointer(each).value for each in (memory.x[k], memory.x_old[k], work)),
            )
        return records, kept

    def invert(
        self, memory: JointMemory, angle_rad: Array, contact_N_m: Array, least_tension_N: float
    ) -> JointInverseRows:
        """See `protocol.JointEngine`."""
        rows, count = len(angle_rad) - 1, len(self._problem.chains)
        angle = np.concatenate([memory.z_old[1:2], np.asarray(angle_rad, dtype=np.float64)])
        contact = np.ascontiguousarray(contact_N_m, dtype=np.float64)
        travel, tension, drum = (np.empty((rows, count)) for _ in range(3))
        slack, lowest = np.empty(rows), np.empty(rows)
        tension[:1] = memory.tension_N
        records, kept = self._tendons(memory, rows)
        evaluations = ctypes.c_long()
        with out_of_turn():
            done = self._library.tff_joint_invert(
                *(ctypes.byref(self._joint), records, ctypes.c_int(count), ctypes.c_double(self._step_s)),
                *(ctypes.c_long(rows), ctypes.c_int(memory.fresh), pointer(angle), pointer(contact)),
                *(
                    ctypes.c_int(self._problem.loop),
                    ctypes.c_double(memory.closure_rad),
                    ctypes.c_double(least_tension_N),
                ),
                *map(pointer, (memory.z, memory.z_old, travel, tension, drum, slack, lowest)),
                *(ctypes.c_void_p(None), ctypes.byref(evaluations)),
            )
        del kept
        self._moved(memory, done, tension)
        return JointInverseRows(
            travel_m=travel[:done],
            tension_N=tension[:done],
            drum_N=drum[:done],
            slack_m=slack[:done],
            lowest_N=lowest[:done],
            evaluations=evaluations.value,
        )

    def run(self, memory: JointMemory, travel_m: Array, contact_N_m: Array, angle_rad: Array | None) -> JointRows:
        """See `protocol.JointEngine`."""

        def advance(block: slice) -> JointRows:
            part = slice(block.start, block.stop + 1)
            return self._run(memory, travel_m[part], contact_N_m[part], None if angle_rad is None else angle_rad[part])

        found = in_blocks(len(travel_m) - 1, advance, lambda each: len(each.angle_rad), lambda each: each.iterations)
        rows: dict[str, Any] = {
            name: np.concatenate([getattr(each, name) for each in found])
            for name in ("angle_rad", "torque_N_m", "lowest_N", "tension_N", "drum_N")
        }
        return JointRows(
            **rows,
            iterations=sum(each.iterations for each in found),
            splits=sum(each.splits for each in found),
            residual_N=found[-1].residual_N,
        )

    def _run(self, memory: JointMemory, travel_m: Array, contact_N_m: Array, angle_rad: Array | None) -> JointRows:
        rows, count = len(travel_m) - 1, len(self._problem.chains)
        travel, contact = (np.ascontiguousarray(each, dtype=np.float64) for each in (travel_m, contact_N_m))
        angle = None if angle_rad is None else np.ascontiguousarray(angle_rad, dtype=np.float64)
        out, tension, drum, lowest = (
            np.empty((rows, 2)),
            np.empty((rows, count)),
            np.empty((rows, count)),
            np.empty(rows),
        )
        report = ReportStruct()
        records, kept = self._tendons(memory, rows)
        with out_of_turn():
            done = self._library.tff_joint_run(
                *(ctypes.byref(self._joint), records, ctypes.c_int(count), ctypes.c_double(self._step_s)),
                *(ctypes.c_long(rows), ctypes.c_int(memory.fresh), pointer(travel), pointer(contact), pointer(angle)),
                ctypes.c_double(self._problem.scale_m),
                *map(pointer, (memory.z, memory.z_old, out, tension, drum, lowest)),
                *(ctypes.c_void_p(None), ctypes.byref(report)),
            )
        del kept
        self._moved(memory, done, tension)
        return JointRows(
            angle_rad=out[:done, 0],
            torque_N_m=out[:done, 1],
            lowest_N=lowest[:done],
            tension_N=tension[:done],
            drum_N=drum[:done],
            iterations=report.iterations,
            splits=report.splits,
            residual_N=report.residual_N,
        )

    def _moved(self, memory: JointMemory, done: int, tension: Array) -> None:
        if done:
            memory.fresh = False
            memory.time_s += done * self._step_s
            memory.tension_N = tension[done - 1].copy()
