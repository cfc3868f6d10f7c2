"""A start for the search: a dynamic programme over the static law of the plant, or of the two extreme ones.

By the static law each plant is a play of the logarithm of the force, so a state is the force and the outputs. The
programme steps forward over a coarse grid of time with a few moves of the force: steps within the rate limit, and
those that put one output on the reference. States that fall into one cell are one, the cheaper, and of all cells the
cheapest are kept. It sees what no descent sees: how early to leave, which reversals to pass over, and that moving the
force over and back makes several plants' memories alike.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.search.knots import coarse_spacing

_STEPS = 250  # of time at most
_LEAST_STEP_S = 0.016
_CELL = 0.02  # of the reference's range: outputs and forces this close are one state
_STATES = 3000  # kept from step to step
_CELL_OF_ONE, _CELLS_OF_BAND, _STATES_OF_ONE = 0.03, 20, 400  # one plant: for the output, for the force, and kept
_MOVES = np.array([-1.0, -0.5, -0.25, -0.1, -0.03, 0.0, 0.03, 0.1, 0.25, 0.5, 1.0])  # of the largest


def programme(problem: TrackingProblem) -> Array:
    """The force that is best by the static law for the plant, or those of least and most friction, shape (n,)."""
    laws = sorted((law_of(plant.chain) for plant in problem.plants), key=lambda law: law.pull_exponent)
    extremes = (laws[0], laws[-1]) if len(laws) > 1 else (laws[0],)
    reference, limits = problem.goal.reference_N, problem.limits
    at, grid = _times(problem), _Grid.of(problem, extremes)
    force, outputs = np.array([problem.start_N]), np.full((len(extremes), 1), problem.start_N)
    cost, forces, parents = np.zeros(1), [force], []
    for before, now in zip(at[:-1].tolist(), at[1:].tolist(), strict=True):
        span, wanted = (now - before) * problem.step_s, reference[now]
        reach = min(limits.rate_N_per_s * span, limits.maximum_N - limits.minimum_N)
        moved = np.add.outer(reach * _MOVES, force)
        aims = np.array([law.input_for_N(wanted, branch) for law in extremes for branch in Branch])
        aimed = np.clip(aims[:, None], force - reach, force + reach)
        tried = np.clip(np.vstack([moved, aimed]), limits.minimum_N, limits.maximum_N)
        parent = np.tile(np.arange(len(force)), len(tried))
        flat = tried.ravel()
        ends = np.array([_play(law, flat, outputs[k][parent]) for k, law in enumerate(extremes)])
        total = cost[parent] + (now - before) * ((ends - wanted) ** 2).sum(axis=0)
        kept = grid.cheapest(flat, ends, total)
        force, outputs, cost = flat[kept], ends[:, kept], total[kept]
        forces.append(force)
        parents.append(parent[kept])
    best, path = int(np.argmin(cost)), []
    for k in range(len(parents), 0, -1):
        path.append(forces[k][best])
        best = int(parents[k - 1][best])
    path.append(problem.start_N)
    found: Array = np.interp(np.arange(len(reference)), at, np.array(path[::-1]))
    return found


def _times(problem: TrackingProblem) -> NDArray[np.int_]:
    """Rows of the steps."""
    reference = problem.goal.reference_N
    rows = len(reference)
    if len(problem.plants) > 1:
        stride = max(round(_LEAST_STEP_S / problem.step_s), -(-rows // _STEPS), 1)
    else:
        stride = coarse_spacing(reference)
    return np.unique(np.append(np.arange(0, rows - 1, stride), rows - 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Grid:
    """Cells of states, and how many are kept.

    One plant's force lies on a logarithmic scale, where the dead band is of the same width everywhere.
    """

    cell_N: float
    cell: float
    lift_N: float
    most: int

    @classmethod
    def of(cls, problem: TrackingProblem, laws: tuple[CapstanLaw, ...]) -> "_Grid":
        span = max(float(np.ptp(problem.goal.reference_N)), 1e-9)
        if len(laws) > 1:
            return cls(cell_N=_CELL * span, cell=0.0, lift_N=0.0, most=_STATES)
        law = laws[0]
        least_N = float(problem.goal.reference_N.min()) * np.exp(-law.release_exponent)
        return cls(
            cell_N=_CELL_OF_ONE * span,
            cell=(law.pull_exponent + law.release_exponent) / _CELLS_OF_BAND,
            lift_N=law.adhesion_N + max(0.1 * least_N, 1e-3 * span),
            most=_STATES_OF_ONE,
        )

    def cheapest(self, force_N: Array, outputs_N: Array, cost: Array) -> NDArray[np.int_]:
        """The cheapest state of each cell, and of these the cheapest few."""
        at = np.log(np.maximum(force_N, 0.0) + self.lift_N) / self.cell if self.cell > 0 else force_N / self.cell_N
        key = np.round(at).astype(np.int64)
        for output in outputs_N:
            key = (key << 20) ^ np.round(output / self.cell_N).astype(np.int64)
        order = np.argsort(cost, kind="stable")
        _, first = np.unique(key[order], return_index=True)
        kept: NDArray[np.int_] = order[np.sort(first)[: self.most]]
        return kept


def _play(law: CapstanLaw, force_N: Array, output_N: Array) -> Array:
    """One step of the static law."""
    low, high = law.output_bounds_N(force_N)
    output: Array = np.maximum(np.clip(output_N, low, high), 0.0)
    return output
