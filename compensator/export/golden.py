"""Golden vectors: what the exported C must answer, computed by the Python model."""

import math
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import FloatArray, Problem
from tendonff.compensator.compensators.lookup_table import LookupTable
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.compensators.table import CompensationTable
from tendonff.compensator.export.table_index import rounded
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.simulate import simulate

_ROWS = 1000
_REVERSAL_ROWS = 240
_LEGS = tuple(0.6**k for k in (0, 3, 1, 4, 2, 6, 3, 8, 1, 5, 2, 7))  # of the range: reversals at many depths


@dataclass(frozen=True, slots=True, kw_only=True)
class Golden:
    """Inputs and answers, one row per sample.

    Parameters
    ----------
    stride : int
        Samples of the scenario's reference per row.
    reference_N, plant_force_N : ndarray, shape (rows,)
        Inputs, exact in the real type of the export.
    columns : dict of str to ndarray, shape (rows,)
        Answers: inverse, capstan, table (force within limits) and plant (output tension) [N].
    """

    stride: int
    reference_N: FloatArray
    plant_force_N: FloatArray
    columns: dict[str, FloatArray]


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
    servo = problem.transmission.actuator.servo_stiffness_N_per_m
    if servo is not None and followed.inversion.states is not None:
        rest = problem.chain.rest_state(start).near_position_m
        columns["inverse"] = followed.inversion.states[:, -2] - rest + (columns["inverse"] - start) / servo
    columns["plant"] = simulate(problem.chain, force, step, initial_tension_N=start).require().output_tension_N
    return force, columns


def to_and_fro(course_N: FloatArray) -> FloatArray:
    """A way on from the end of a course that turns round at many depths of the transition, within the course's range.

    Parameters
    ----------
    course_N : ndarray, shape (n,)
        What comes before [N].

    Returns
    -------
    ndarray, shape (m,)
        Tension [N]; nothing where the course never moves.
    """
    low, high = float(course_N.min()), float(course_N.max())
    if not high > low:
        return np.empty(0)
    turns, sign = [float(course_N[-1])], 1.0 if course_N[-1] < 0.5 * (low + high) else -1.0
    for leg in _LEGS:
        turns.append(min(max(turns[-1] + sign * leg * (high - low), low), high))
        sign = -sign
    ways = np.abs(np.diff(turns))
    step = float(ways.sum()) / _REVERSAL_ROWS
    legs = [
        np.linspace(a, b, 1 + max(2, math.ceil(way / step)))[1:]
        for a, b, way in zip(turns[:-1], turns[1:], ways, strict=True)
        if way > 0
    ]
    return np.concatenate(legs)


def golden_vectors(problem: Problem, table: LookupTable, precision: Precision) -> Golden:
    """Golden vectors along the scenario's own reference, thinned so that its whole course fits, then over reversals.

    Parameters
    ----------
    problem : Problem
    table : LookupTable
    precision : Precision
    """
    tension = problem.reference.tension_N
    stride = max(1, -(-len(tension) // _ROWS))
    course = tension[::stride]
    course = rounded(np.concatenate([course, to_and_fro(course)]), precision)
    force, columns = answers(problem, table, course, precision)
    return Golden(stride=stride, reference_N=course, plant_force_N=force, columns=columns)
