"""A start for robust profiles: a dynamic programme over the static law of the two extreme plants.

By the static law each plant is a play of the logarithm of the force, so a state is the force and two outputs. The
programme steps forward over a coarse grid of time with a few moves of the force: steps within the rate limit, and
those that put one output on the reference. States that fall into one cell are one, the cheaper, and of all cells the
cheapest are kept. It sees what no descent sees: that moving the force over and back makes the plants' memories alike.
"""

import numpy as np

from tendonff.models.capstan import CapstanLaw
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.problem import TrackingProblem

_STEPS = 250  # of time at most
_LEAST_STEP_S = 0.016
_CELL = 0.02  # of the reference's range: outputs and forces this close are one state
_STATES = 3000  # kept from step to step
_MOVES = np.array([-1.0, -0.5, -0.25, -0.1, -0.03, 0.0, 0.03, 0.1, 0.25, 0.5, 1.0])  # of the largest


def programme(problem: TrackingProblem) -> Array:
    """The force that is best by the static law for the plants of least and most friction, shape (n,)."""
    laws = sorted((law_of(plant.chain) for plant in problem.plants), key=lambda law: law.pull_exponent)
    extremes = (laws[0], laws[-1])
    reference, limits = problem.goal.reference_N, problem.limits
    rows = len(reference)
    stride = max(round(_LEAST_STEP_S / problem.step_s), -(-rows // _STEPS), 1)
    at = np.unique(np.append(np.arange(0, rows - 1, stride), rows - 1))
    cell = _CELL * max(float(np.ptp(reference)), 1e-9)
    force, outputs, cost = np.array([problem.start_N]), np.full((2, 1), problem.start_N), np.zeros(1)
    forces, parents = [force], []
    for before, now in zip(at[:-1].tolist(), at[1:].tolist(), strict=True):
        span, wanted = (now - before) * problem.step_s, reference[now]
        reach = min(limits.rate_N_per_s * span, limits.maximum_N - limits.minimum_N)
        moved = np.add.outer(reach * _MOVES, force)
        aims = np.array([aim for law in extremes for aim in _aims(law, wanted)])
        aimed = np.clip(aims[:, None], force - reach, force + reach)
        tried = np.clip(np.vstack([moved, aimed]), limits.minimum_N, limits.maximum_N)
        parent = np.tile(np.arange(len(force)), len(tried))
        flat = tried.ravel()
        ends = np.array([_play(law, flat, outputs[k][parent]) for k, law in enumerate(extremes)])
        total = cost[parent] + (now - before) * ((ends - wanted) ** 2).sum(axis=0)
        kept = _cheapest(np.vstack([flat, ends]), total, cell)
        force, outputs, cost = flat[kept], ends[:, kept], total[kept]
        forces.append(force)
        parents.append(parent[kept])
    best, path = int(np.argmin(cost)), []
    for k in range(len(parents), 0, -1):
        path.append(forces[k][best])
        best = int(parents[k - 1][best])
    path.append(problem.start_N)
    found: Array = np.interp(np.arange(rows), at, np.array(path[::-1]))
    return found


def _aims(law: CapstanLaw, wanted_N: float) -> tuple[float, float]:
    """Forces that put the output on the reference, pulling and releasing."""
    lifted = wanted_N + law.adhesion_N
    return (
        lifted * float(np.exp(law.pull_exponent)) - law.adhesion_N,
        lifted * float(np.exp(-law.release_exponent)) - law.adhesion_N,
    )


def _play(law: CapstanLaw, force_N: Array, output_N: Array) -> Array:
    """One step of the static law."""
    low, high = law.output_bounds_N(force_N)
    output: Array = np.maximum(np.clip(output_N, low, high), 0.0)
    return output


def _cheapest(states: Array, cost: Array, cell: float) -> np.typing.NDArray[np.int_]:
    """The cheapest state of each cell, and of these the cheapest few."""
    order = np.argsort(cost, kind="stable")
    cells = np.round(states[:, order] / cell).astype(np.int64)
    key = (cells[0] << 40) ^ (cells[1] << 20) ^ cells[2]
    _, first = np.unique(key, return_index=True)
    kept: np.typing.NDArray[np.int_] = order[np.sort(first)[:_STATES]]
    return kept
