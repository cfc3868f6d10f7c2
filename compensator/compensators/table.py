"""The compensation table as a compensator, and how a table is made from the chain itself.

Reversals out of full slip are simulated by the exact inverse: the reference rises (or falls) far enough
that everything slips, turns, and the force that the chain then needs is what the table stores. Masses are left out, so
that a table holds no inertia; friction, creep and viscous drag are those at the sweep's rate.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import CModule, Compensator, Problem
from tendonff.compensator.compensators.lookup_table import BranchTable, FloatArray, LookupTable, table_force
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.reporting.colours import GREEN, Style
from tendonff.compensator.scenario.doubts import largest_tension
from tendonff.models.capstan import Branch
from tendonff.models.errors import ParameterError
from tendonff.models.layout import ChainState
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.tendon.inverse import invert

BOUND_SHARE = 0.005
"""Default bound of the interpolation error of a table, as a share of the reference's range."""

_TINY_MASS_KG = 1e-9
SLOWEST_N_PER_S, FASTEST_N_PER_S = 1e-6, 1e9
"""Rates that the sweeps were tried at; far beyond them step times lose their meaning in the arithmetic."""

_TURNS = 13  # reversal tensions swept per branch
_APPROACH = 3000  # reference samples on the way to a reversal
_SAMPLES = 3000  # reference samples after it
_LARGEST_SHARE = {Branch.PULL: 0.9, Branch.RELEASE: 4.0}  # pulling cannot have turned below zero tension
_LEAST_SHARE = 1e-4  # a transition shorter than this is a jump to any controller
_CHECKED_REFERENCES = 25  # equal steps; 1, 2, 3, 4 or 6 of the 24 are gathered into one
_CHECKED_SHARES = 500


@dataclass(frozen=True)  # without slots: the class holds what all tables share
class CompensationTable(Compensator):
    """The compensation table."""

    name = "table"
    label = "compensation table"
    style = Style(color=GREEN, linestyle=":")
    is_fast = False
    is_swept = False
    c_module = CModule(name="table", content="compensation table", headers=("table_data",), knows_joints=False)

    table: LookupTable | None = None  # one that exists already; default: made for the problem

    def refusal(self, problem: Problem) -> str:
        """No table holds a path that moves."""
        motion = problem.transmission.motion
        if motion is None or not motion.moves:
            return ""
        return (
            "no table can hold a path that moves: the distribution of wrap angle along the path matters, not only its "
            "sum, and the length changes too; `tendonff export-c` gives an inverse that takes joint angles, and "
            "`tendonff table --pose NAME=ANGLE` (for each joint) the table of one pose"
        )

    def profile(self, problem: Problem, *, progress: Progress = silent) -> Profile:  # noqa: ARG002
        """Answer by looking up; see `Compensator.profile`."""
        return Profile(force_N=problem.limited(self.wanted_N(problem)))

    def wanted_N(self, problem: Problem) -> FloatArray:
        """Force before the actuator's limits, shape (n,) [N]."""
        table, start = self.table or table_of(problem).table, problem.reference.initial_tension_N
        return problem.in_cycle(lambda rows: table_force(table, rows, start), problem.reference.tension_N)


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltTable:
    """A table and how good it is.

    Attributes
    ----------
    table : LookupTable
        Force over reference, branch and share of the transition.
    bound_N : float
        Largest interpolation error that was allowed [N].
    error_N : float
        Largest interpolation error found on the swept points [N].
    resolution_N : float
        Tension travel within which a point counts as met [N]: steep steps need be no sharper than the samples.
    rate_N_per_s : float
        Rate of the reference in the sweeps [N/s].
    checked : int
        Points that the error was found on.
    """

    table: LookupTable
    bound_N: float
    error_N: float
    resolution_N: float
    rate_N_per_s: float
    checked: int


def table_range(problem: Problem) -> tuple[float, float]:
    """Range of reference tension that a table for a problem covers: the reference's own and a margin at each end [N].

    It does not exceed the largest deliverable tension where the reference does not.
    """
    wanted = np.append(problem.reference.tension_N, problem.reference.initial_tension_N)
    low, high = float(np.min(wanted)), float(np.max(wanted))
    margin, largest = 0.05 * max(high - low, 0.1 * high), largest_tension(problem.transmission)
    return max(low - margin, 0.5 * low), max(min(high + margin, largest), math.nextafter(high, math.inf))


def accepted_range(problem: Problem) -> tuple[float, float]:
    """References that the exported modules accept, as stated or up to what the actuator reaches [N]."""
    if problem.reference.live_N is not None:
        low, high = problem.reference.live_N
        return low, high
    tension = problem.reference.tension_N
    low, _ = table_range(problem)
    high = max(largest_tension(problem.transmission), float(np.max(tension)))
    return min(low, 0.01 * float(np.min(tension))), high


def table_of(
    problem: Problem,
    *,
    bound_N: float | None = None,
    rate_N_per_s: float | None = None,
    range_N: tuple[float, float] | None = None,
) -> BuiltTable:
    """Sweep reversals and store the fewest nodes that keep the interpolation error under the bound [N].

    By default the bound is 0.5 % of the reference's range, the sweeps have the median rate of the problem's reference
    [N/s], and the table covers the problem's range [N]. It resolves a quarter of a sample's travel at that rate.
    ParameterError if a number is out of bounds.
    """
    reference = problem.reference
    span = reference.range_N or 0.1 * float(reference.tension_N[0])
    bound = BOUND_SHARE * span if bound_N is None else bound_N
    rate = usual_rate(reference.tension_N, reference.step_s) if rate_N_per_s is None else rate_N_per_s
    low, high = range_N or table_range(problem)
    if not 0 < low < high < math.inf:
        raise ParameterError(f"range_N must be two finite numbers, 0 < least < largest, got {low} and {high}")
    if not 0 < bound < math.inf:
        raise ParameterError(f"bound_N must be a finite number > 0, got {bound}")
    if not SLOWEST_N_PER_S <= rate <= FASTEST_N_PER_S:
        raise ParameterError(
            f"rate_N_per_s must be from {SLOWEST_N_PER_S:g} to {FASTEST_N_PER_S:g}, got {rate:g}; leave it out for the "
            "usual rate of the reference"
        )
    light = _without_masses(problem.chain)
    references = np.linspace(low, high, _CHECKED_REFERENCES)
    resolution = 0.25 * rate * reference.step_s
    dense = {b: _sample_branch(light, b, references, rate, bound, resolution) for b in Branch}
    p = light.elements.piece.adhesion_N
    tables = [_choose_nodes(references, dense, p, bound, split) for split in (0.97, 0.9, 0.75, 0.5)]
    table = min(tables, key=lambda t: t.nodes)
    return BuiltTable(
        table=table,
        bound_N=bound,
        error_N=max(float(np.abs(_errors(table, references, dense[b], b)).max()) for b in Branch),
        resolution_N=resolution,
        rate_N_per_s=rate,
        checked=sum(d.force_N.size for d in dense.values()),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Samples:
    """Force of one branch on a dense grid."""

    share: FloatArray  # (m,)
    force_N: FloatArray  # (references, m)
    low_N: FloatArray  # least and largest force within the resolution
    high_N: FloatArray


def usual_rate(reference_N: FloatArray, step_s: float) -> float:
    """Median rate of a reference, shape (n,), while it moves [N/s]: the default rate of a table."""
    rates = np.abs(np.diff(reference_N)) / step_s
    moving = rates[rates > 1e-6 * max(float(rates.max(initial=0.0)), 1e-12)]
    usual = float(np.median(moving)) if moving.size else 1.0
    return min(max(usual, SLOWEST_N_PER_S), FASTEST_N_PER_S)


def _without_masses(chain: Chain) -> Chain:
    return replace(
        chain,
        elements=replace(chain.elements, piece=replace(chain.elements.piece, mass_kg=_TINY_MASS_KG)),
        near=replace(chain.near, mass_kg=_TINY_MASS_KG),
        far=replace(chain.far, mass_kg=_TINY_MASS_KG),
    )


def sweep(
    chain: Chain, branch: Branch, turn_N: float, end_N: float, rate_N_per_s: float
) -> tuple[FloatArray, FloatArray]:
    """Reference and force from a reversal out of full slip at `turn_N` to `end_N`, samples at equal steps [N].

    `branch` is the one that begins at the reversal.
    """
    p = chain.elements.piece.adhesion_N
    # Long enough a way to the reversal: four fifths of the lifted tension below it, or as much above.
    start = max(0.2 * (turn_N + p) - p, 0.02 * turn_N) if branch is Branch.RELEASE else turn_N + 4.0 * (turn_N + p)
    approach = np.linspace(start, turn_N, _APPROACH + 1)
    arrived = invert(chain, approach, abs(turn_N - start) / _APPROACH / rate_N_per_s, record=True)
    if arrived.states is None:
        raise SolveError("the sweep to the reversal kept no states")
    way = np.linspace(turn_N, end_N, _SAMPLES + 1)
    state = ChainState.from_vector(arrived.states[-1], chain.layout)
    return way, invert(chain, way, abs(end_N - turn_N) / _SAMPLES / rate_N_per_s, state=state).force_N


def _sample_branch(
    chain: Chain, branch: Branch, references: FloatArray, rate: float, bound: float, resolution: float
) -> _Samples:
    """Force over share for every reference, cut where the transition is over everywhere.

    Sweeps are repeated over the shorter way, and so in finer steps, as long as the transition fills little of them.
    """
    most = _LARGEST_SHARE[branch]
    while True:
        samples = _sample_shares(chain, branch, references, rate, most, resolution)
        if not np.isfinite(samples.force_N).all():
            raise SolveError(
                f"no table: the sweeps of the {branch} branch give forces that are not finite; check the stiffness of "
                "load and tendon with tendonff simulate"
            )
        over = np.all(np.abs(samples.force_N - samples.force_N[:, -1:]) <= 0.25 * bound, axis=0)
        last = int(np.flatnonzero(~over)[-1]) + 2 if not over.all() else 2
        if samples.share[last - 1] > 0.6 * most or most < _LEAST_SHARE:
            kept = slice(max(2, min(last, samples.share.size)))
            force, low, high = (each[:, kept] for each in (samples.force_N, samples.low_N, samples.high_N))
            return _Samples(share=samples.share[kept], force_N=force, low_N=low, high_N=high)
        most = max(1.5 * float(samples.share[last - 1]), 0.5 * _LEAST_SHARE)


def _sample_shares(
    chain: Chain, branch: Branch, references: FloatArray, rate: float, most: float, resolution: float
) -> _Samples:
    """Force over share, up to `most`, for every reference."""
    p = chain.elements.piece.adhesion_N
    sign = 1.0 if branch is Branch.RELEASE else -1.0
    shares = np.concatenate([[0.0], np.geomspace(2e-4, 1.0, _CHECKED_SHARES - 1)]) * most
    turned = references[:, None] + sign * shares * (references[:, None] + p)  # where it had to turn
    floor = 0.05 * float(references[0])
    turns = np.geomspace(max(float(turned.min()), floor), float(turned.max()), _TURNS)
    travel = np.empty((_TURNS, shares.size))
    for k, turn in enumerate(turns):  # lifted force over share, per lifted tension: nearly the same for every turn
        end = (turn - most * p) / (1 + most) if branch is Branch.RELEASE else (turn + most * p) / (1 - most)
        way, force = sweep(chain, branch, float(turn), max(end, 0.02 * float(turn)), rate)
        lifted = way + p
        travel[k] = np.interp(shares, np.abs(way - turn) / lifted, (force + p) / lifted)
    force_N = np.empty_like(turned)
    for j in range(shares.size):
        force_N[:, j] = np.interp(np.maximum(turned[:, j], floor), turns, travel[:, j]) * (references + p) - p
    low, high = np.empty_like(force_N), np.empty_like(force_N)
    for k, reference in enumerate(references):
        near = resolution / (float(reference) + p)
        around = [np.interp(shares + shift, shares, force_N[k]) for shift in (-near, -0.5 * near, 0.5 * near, near)]
        low[k], high[k] = np.min([force_N[k], *around], axis=0), np.max([force_N[k], *around], axis=0)
    return _Samples(share=shares, force_N=force_N, low_N=low, high_N=high)


def _choose_nodes(
    references: FloatArray, dense: dict[Branch, _Samples], adhesion_N: float, bound: float, split: float
) -> LookupTable:
    """Fewest shares for a part of the bound, by the longest reach, then fewest equal steps of the reference for all."""
    columns = {b: _longest_reach(d, split * bound) for b, d in dense.items()}
    steps = len(references) - 1
    for gathered in (6, 4, 3, 2, 1):  # five references at least
        table = _table(references, dense, list(range(0, steps + 1, gathered)), columns, adhesion_N)
        if all(np.abs(_errors(table, references, d, b)).max() <= bound for b, d in dense.items()):
            break
    return table


def _table(
    references: FloatArray, dense: dict[Branch, _Samples], rows: list[int], columns: dict[Branch, list[int]], p: float
) -> LookupTable:
    pull, release = (
        BranchTable(share=dense[b].share[columns[b]], force_N=dense[b].force_N[np.ix_(rows, columns[b])])
        for b in (Branch.PULL, Branch.RELEASE)
    )
    return LookupTable(reference_N=references[rows], adhesion_N=p, pull=pull, release=release)


def _errors(table: LookupTable, references: FloatArray, samples: _Samples, branch: Branch) -> FloatArray:
    """Largest difference of interpolated and swept force, within the resolution [N]."""
    shape = samples.force_N.shape
    grid_t = np.broadcast_to(references[:, None], shape).ravel()
    grid_s = np.broadcast_to(samples.share, shape).ravel()
    return _outside(table.force_N(grid_t, branch, grid_s).reshape(shape), samples.low_N, samples.high_N)


def _outside(value: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    return np.maximum(np.maximum(low - value, value - high), 0.0)


def _longest_reach(samples: _Samples, bound: float) -> list[int]:
    """Nodes such that straight lines between them stay within the bound: each reaches as far as it can.

    Longest reach gives the fewest nodes of all choices that take their forces from the samples. A line from a node
    passes between two samples where its slope does, so each sample narrows the slopes that are left.
    """
    share, force_N, nodes = samples.share, samples.force_N, [0]
    while (first := nodes[-1]) < share.size - 1:
        run, start, beyond = share[first + 1 :] - share[first], force_N[:, [first]], slice(first + 1, None)
        least = np.maximum.accumulate((samples.low_N[:, beyond] - bound - start) / run, axis=1)
        most = np.minimum.accumulate((samples.high_N[:, beyond] + bound - start) / run, axis=1)
        slope = (force_N[:, beyond] - start) / run
        passes = np.all((least <= slope) & (slope <= most), axis=0)
        passes[0] = True
        nodes.append(first + 1 + int(np.flatnonzero(passes)[-1]))
    return nodes
