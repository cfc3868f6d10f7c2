"""Golden vectors: what the exported C must answer, computed by the Python model."""

import math
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import FloatArray, Problem
from tendonff.compensator.compensators.lookup_table import LookupTable
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.compensators.score import scale_N
from tendonff.compensator.compensators.stream.model import StreamDesign, smoothed, stream_force
from tendonff.compensator.compensators.stream.run import quantised
from tendonff.compensator.compensators.table import CompensationTable
from tendonff.compensator.export.table_index import rounded
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.inverse import InverseStatus, Inversion, invert
from tendonff.ocp.simulate import simulate

_ROWS = 1000
_REVERSAL_ROWS = 240
_GENTLE_ROWS = 900
_LIVE_ROWS = 500
_LOST = slice(200, 240)
_LEGS = tuple(0.6**k for k in (0, 3, 1, 4, 2, 6, 3, 8, 1, 5, 2, 7))  # of the range: reversals at many depths
_JUMPS = (0.0, 1.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.2, 0.2, 0.9, 0.0, 0.0)  # places in the range, a sample each


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """Inputs and answers, one row per sample.

    Parameters
    ----------
    reference_N, plant_force_N : ndarray, shape (rows,)
        Inputs, exact in the real type of the export.
    columns : dict of str to ndarray, shape (rows,)
        Answers: inverse, capstan, table (force within limits) and plant (output tension) [N].
    scale_N : float
        Largest force that the course asks for before the limits: what rounding is relative to [N].
    """

    reference_N: FloatArray
    plant_force_N: FloatArray
    columns: dict[str, FloatArray]
    scale_N: float

    @property
    def inputs_N(self) -> dict[str, FloatArray]:
        """What each module with answers is given, by name [N]."""
        return {name: self.plant_force_N if name == "plant" else self.reference_N for name in self.columns}


@dataclass(frozen=True, slots=True, kw_only=True)
class Golden:
    """All courses of the self test.

    Parameters
    ----------
    stride : int
        Samples of the scenario's reference per row.
    course : Course
        The scenario's reference, then reversals.
    jumps : Course
        Jumps over the range of the reference, in which forces and rates meet their limits.
    live : Course or None
        The course as it arrives live: rough, and lost for a while; None where there is no stream module.
    """

    stride: int
    course: Course
    jumps: Course
    live: Course | None = None


def answers(
    problem: Problem, table: LookupTable, reference_N: FloatArray, precision: Precision
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Force for the plant, and the answer of each module to a reference that starts at rest at its first row.

    Parameters
    ----------
    problem : Problem
    table : LookupTable
        The one that is exported.
    reference_N : ndarray, shape (rows,)
        Exact in the real type.
    precision : Precision
    """
    course = _course(problem, table, reference_N, precision, with_plant=True)
    return course.plant_force_N, course.columns


def _course(
    problem: Problem, table: LookupTable, reference_N: FloatArray, precision: Precision, *, with_plant: bool
) -> Course:
    step, start = problem.reference.step_s, float(reference_N[0])
    time = np.arange(len(reference_N), dtype=np.float64) * step
    course = replace(
        problem.reference, time_s=time, tension_N=reference_N, initial_tension_N=start, periodic=False, position_m=None
    )
    followed = replace(problem, reference=course, live=True)
    columns = {}
    for compensator in COMPENSATORS:
        module = compensator.c_module
        if module is not None and not module.plays_back:
            exported = CompensationTable(table) if isinstance(compensator, CompensationTable) else compensator
            columns[module.name] = exported.profile(followed).force_N
    force = rounded(columns["inverse"], precision)
    if with_plant:
        columns["plant"] = simulate(problem.chain, force, step, initial_tension_N=start).require().output_tension_N
    scale = float(np.abs(followed.inversion.force_N).max())
    return Course(reference_N=reference_N, plant_force_N=force, columns=columns, scale_N=scale)


def to_and_fro(course_N: FloatArray, *, step_N: float | None = None, rows: int = _REVERSAL_ROWS) -> FloatArray:
    """A way on from the end of a course that turns round at many depths of the transition, within the course's range.

    Parameters
    ----------
    course_N : ndarray, shape (n,)
        What comes before [N].
    step_N : float, optional
        Largest change from row to row; legs that would need more rows are shortened [N]. Default: what the rows need.
    rows : int, optional

    Returns
    -------
    ndarray, shape (m,)
        Tension [N]; nothing where the course never moves.
    """
    low, high = float(course_N.min()), float(course_N.max())
    if not high > low:
        return np.empty(0)
    way = (high - low) * sum(_LEGS)
    size = 1.0 if step_N is None else min(1.0, rows * step_N / way)
    turns, sign = [float(course_N[-1])], 1.0 if course_N[-1] < 0.5 * (low + high) else -1.0
    for leg in _LEGS:
        turns.append(min(max(turns[-1] + sign * size * leg * (high - low), low), high))
        sign = -sign
    ways = np.abs(np.diff(turns))
    step = float(ways.sum()) / rows
    legs = [
        np.linspace(a, b, 1 + max(2, math.ceil(way / step)))[1:]
        for a, b, way in zip(turns[:-1], turns[1:], ways, strict=True)
        if way > 0
    ]
    return np.concatenate(legs)


def golden_vectors(
    problem: Problem, table: LookupTable, precision: Precision, *, stream: StreamDesign | None = None
) -> Golden:
    """Golden vectors along the scenario's own reference, then over reversals, then over jumps.

    The reference is thinned so that its whole course fits, and the reversals are quick. Where the tendon cannot follow
    that, the course is the beginning of the reference as it is, with reversals no faster than its own motion.

    Parameters
    ----------
    problem : Problem
    table : LookupTable
    precision : Precision
    stream : StreamDesign, optional
        Of the stream module, where there is one.
    """
    tension = problem.reference.tension_N
    stride = max(1, -(-len(tension) // _ROWS))
    reference = rounded(np.concatenate([tension[::stride], to_and_fro(tension[::stride])]), precision)
    if _invert(problem, reference).status is not InverseStatus.EXACT:
        stride, course = 1, tension[:_ROWS]
        usual = float(np.abs(np.diff(tension)).max())
        reversals = to_and_fro(course, step_N=usual, rows=_GENTLE_ROWS)
        reference = rounded(np.concatenate([course, reversals]), precision)
    low, high = float(reference.min()), float(reference.max())
    jumps = rounded(low + np.array(_JUMPS) * (high - low), precision)
    return Golden(
        stride=stride,
        course=_course(problem, table, reference, precision, with_plant=True),
        jumps=_course(problem, table, jumps, precision, with_plant=False),
        live=None if stream is None else _live(problem, stream, reference, precision),
    )


def _live(problem: Problem, stream: StreamDesign, course_N: FloatArray, precision: Precision) -> Course:
    """The course with the noise of a converter, lost for a time in which the reference moves on."""
    step = max(2 * stream.band_N, 1e-3 * scale_N(course_N))
    rough = rounded(quantised(course_N[:_LIVE_ROWS], step), precision)
    rough[0] = course_N[0]
    rough[_LOST] = np.nan
    start = float(rough[0])
    force = stream_force(stream, problem, rough)
    exact = invert(problem.chain, smoothed(stream, rough, start), problem.reference.step_s, initial_tension_N=start)
    scale = float(np.abs(exact.force_N).max())
    return Course(reference_N=rough, plant_force_N=force, columns={"stream": force}, scale_N=scale)


def _invert(problem: Problem, reference_N: FloatArray) -> Inversion:
    start = float(reference_N[0])
    return invert(problem.chain, reference_N, problem.reference.step_s, initial_tension_N=start)
