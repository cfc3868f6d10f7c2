"""The compensation table: force over reference tension, branch and tension travelled since a reversal.

The reference alone decides. While it rises the tendon is pulled, while it falls it is released; after a reversal the
force goes over from one branch to the other along the tension that the reference has travelled since::

    force |        pull  ______...          share = (travelled tension)/(T + p): what a reversal looks like in this
          |      ___/                       measure hardly depends on where it happens, so few nodes do.
          |    _/
          |___/  <- a reversal out of full slip starts at share 0; one out of an unfinished transition starts at the
          |         share where the force goes on without a jump
          +---------------- tension travelled since the reversal

What is interpolated is the ratio (force + p)/(T + p), which hardly depends on T either. The C of the export does the
same operations in the same order.
"""

from bisect import bisect_right
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from tendonff.models.capstan import Branch
from tendonff.models.errors import ParameterError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class BranchTable:
    """Forces of one branch.

    Attributes
    ----------
    share : numpy.ndarray
        Shape (m,); nodes of (tension since the reversal)/(T + p) [-], from 0 up; beyond the last the transition is
        over.
    force_N : numpy.ndarray
        Shape (k, m); force at each reference node and share [N].
    """

    share: FloatArray
    force_N: FloatArray

    def __post_init__(self) -> None:
        if not (self.share.size >= 2 and self.share[0] == 0 and np.all(np.diff(self.share) > 0)):
            raise ParameterError(f"share must rise from 0 over at least two nodes, got {self.share}")
        if not np.all(np.isfinite(self.force_N)):
            raise ParameterError("force_N must be finite in every node of the table")


@dataclass(frozen=True, slots=True, kw_only=True)
class LookupTable:
    """Feedforward force over reference, branch and share of the transition.

    Attributes
    ----------
    reference_N : numpy.ndarray
        Shape (k,); nodes of the reference tension T [N], rising in equal steps: the cell is found by one
        multiplication.
    adhesion_N : float
        p [N].
    pull : BranchTable
        Forces while the reference rises.
    release : BranchTable
        Forces while it falls.
    """

    reference_N: FloatArray
    adhesion_N: float
    pull: BranchTable
    release: BranchTable

    def __post_init__(self) -> None:
        steps = np.diff(self.reference_N)
        if not (steps.size and np.all(steps > 0) and np.allclose(steps, steps.mean(), rtol=1e-9, atol=0)):
            raise ParameterError(
                f"reference_N must rise in equal steps over at least two nodes, got {self.reference_N}"
            )
        for name in Branch:
            branch = self.branch(name)
            if branch.force_N.shape != (self.reference_N.size, branch.share.size):
                raise ParameterError(f"{name}: force_N must have one row per reference node and one column per share")

    def branch(self, branch: Branch) -> BranchTable:
        """Forces of a branch."""
        return self.pull if branch is Branch.PULL else self.release

    @property
    def cells_per_N(self) -> float:
        """Cells of the reference axis per newton [1/N]."""
        return float((self.reference_N.size - 1) / (self.reference_N[-1] - self.reference_N[0]))

    @property
    def nodes(self) -> int:
        """Number of forces stored."""
        return self.pull.force_N.size + self.release.force_N.size

    def ratio(self, branch: Branch) -> FloatArray:
        """(force + p)/(T + p) at the nodes of a branch, shape (k, m) [-]."""
        p = self.adhesion_N
        return (self.branch(branch).force_N + p) / (self.reference_N[:, None] + p)

    def force_N(self, reference_N: FloatArray, branch: Branch, share: FloatArray) -> FloatArray:
        """Force by bilinear interpolation of the ratio at points inside the table's range, shape (n,) [N].

        A share beyond the last node means that the transition is over.
        """
        table = self.branch(branch)
        row, a = _locate(self.reference_N, reference_N)
        column, b = _locate(table.share, share)
        f = self.ratio(branch)
        near, far = ((1 - a) * f[row, c] + a * f[row + 1, c] for c in (column, column + 1))
        return (near + b * (far - near)) * (reference_N + self.adhesion_N) - self.adhesion_N


def _locate(nodes: FloatArray, values: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Cell of each value and its place in the cell, 0 to 1."""
    cell = np.clip(np.searchsorted(nodes, values, side="right") - 1, 0, len(nodes) - 2)
    return cell, np.clip((values - nodes[cell]) / (nodes[cell + 1] - nodes[cell]), 0.0, 1.0)


class TableLookup:
    """The table at work: feed it the reference sample by sample, from rest under an initial tension on [N].

    ParameterError where a reference lies outside the table.
    """

    def __init__(self, table: LookupTable, initial_tension_N: float) -> None:
        self._low, self._high = float(table.reference_N[0]), float(table.reference_N[-1])
        self._cells_per_N, self._last_row = table.cells_per_N, table.reference_N.size - 2
        self._branches = {b: (table.branch(b).share.tolist(), table.ratio(b).tolist()) for b in Branch}
        self._adhesion = table.adhesion_N
        self._branch: Branch | None = None
        self._last = self._force = initial_tension_N
        self._ratio = 1.0
        self._turn = initial_tension_N  # where the reference turned, or would have to have turned

    def step(self, reference_N: float) -> float:
        """Force for the next sample [N]."""
        if not self._low <= reference_N <= self._high:
            raise ParameterError(
                f"the reference must stay from {self._low:.6g} to {self._high:.6g} N, got {reference_N}"
            )
        if reference_N == self._last:
            return self._force
        branch = Branch.PULL if reference_N > self._last else Branch.RELEASE
        sign = 1.0 if branch is Branch.PULL else -1.0
        shares, ratios = self._branches[branch]
        cells = (reference_N - self._low) * self._cells_per_N
        row = min(int(cells), self._last_row)
        a = cells - row
        if branch is not self._branch:
            share = self._share_of(shares, ratios[row], ratios[row + 1], a, sign)
            self._turn = self._last - sign * (share * (self._last + self._adhesion))
            self._branch = branch
        share = sign * (reference_N - self._turn) / (reference_N + self._adhesion)
        share = min(share, shares[-1])  # beyond it the transition is over
        column = min(bisect_right(shares, share) - 1, len(shares) - 2)
        b = (share - shares[column]) / (shares[column + 1] - shares[column])
        near, far = (_between(ratios[row][c], ratios[row + 1][c], a) for c in (column, column + 1))
        self._last, self._ratio = reference_N, near + b * (far - near)
        self._force = self._ratio * (reference_N + self._adhesion) - self._adhesion
        return self._force

    def _share_of(self, shares: list[float], below: list[float], above: list[float], a: float, sign: float) -> float:
        """Share at which a branch has the present ratio at this reference: bisection over its nodes."""
        low = 0
        for half in halves(len(shares)):
            if sign * (self._ratio - _between(below[low + half], above[low + half], a)) >= 0:
                low += half
        near, far = (_between(below[c], above[c], a) for c in (low, low + 1))
        way, swing = sign * (self._ratio - near), sign * (far - near)
        if way >= swing:
            return shares[low + 1]
        if way > 0:
            return shares[low] + (way / swing) * (shares[low + 1] - shares[low])
        return shares[low]


def _between(near: float, far: float, place: float) -> float:
    return near + place * (far - near)


@cache
def halves(nodes: int) -> tuple[int, ...]:
    """Steps of a bisection over the cells between nodes: each is taken or not, and none leads beyond the last cell."""
    cells, steps = nodes - 1, []
    while cells > 1:
        steps.append(cells // 2)
        cells -= cells // 2
    return tuple(steps)


def table_force(table: LookupTable, reference_N: FloatArray, initial_tension_N: float) -> FloatArray:
    """Force of the table for a reference course, from rest on, before actuator limits, shape (n,) [N]."""
    lookup = TableLookup(table, initial_tension_N)
    return np.array([lookup.step(float(t)) for t in reference_N])
