"""Golden vectors: what the exported C must answer, computed by the Python model."""

import math
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.scenario.sampling import Reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.tables.table import FloatArray, Table, table_force
from tendonff.models.capstan import CapstanLaw
from tendonff.models.chain import Chain
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.inverse import invert
from tendonff.ocp.simulate import simulate
from tendonff.ocp.tracking.limits import ForceLimits

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


def rounded(values: FloatArray, precision: Precision) -> FloatArray:
    """The nearest numbers of the real type.

    Parameters
    ----------
    values : ndarray
    precision : Precision
    """
    if precision is Precision.DOUBLE:
        return values
    return values.astype(np.float32).astype(np.float64)


def answers(
    scenario: Scenario, chain: Chain, table: Table, reference_N: FloatArray, precision: Precision
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Force for the plant, and the answer of each module to a reference that starts at rest at its first row.

    Parameters
    ----------
    scenario : Scenario
    chain : Chain
    table : Table
    reference_N : ndarray, shape (rows,)
        Exact in the real type.
    precision : Precision
    """
    step, start = scenario.run.step_s, float(reference_N[0])
    limits = ForceLimits.of(scenario.transmission.actuator)
    wanted = {
        "inverse": invert(chain, reference_N, step).force_N,
        "capstan": CapstanLaw.of(scenario.transmission).input_history_N(reference_N, start),
        "table": table_force(table, reference_N, start),
    }
    columns = {name: limits.apply(force, step, start) for name, force in wanted.items()}
    force = rounded(columns["inverse"], precision)
    columns["plant"] = simulate(chain, force, step, initial_tension_N=start).require().output_tension_N
    return force, columns


def reversals(course_N: FloatArray) -> FloatArray:
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


def golden_vectors(
    scenario: Scenario, chain: Chain, table: Table, reference: Reference, precision: Precision
) -> Golden:
    """Golden vectors along the scenario's own reference, thinned so that its whole course fits, then over reversals.

    Parameters
    ----------
    scenario : Scenario
    chain : Chain
    table : Table
    reference : Reference
    precision : Precision
    """
    stride = max(1, -(-len(reference.tension_N) // _ROWS))
    course = reference.tension_N[::stride]
    course = rounded(np.concatenate([course, reversals(course)]), precision)
    force, columns = answers(scenario, chain, table, course, precision)
    return Golden(stride=stride, reference_N=course, plant_force_N=force, columns=columns)
