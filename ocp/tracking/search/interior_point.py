"""A primal-dual interior-point method for quadratic programs over a row of knots, each of which acts only for a while.

A change of the force at a knot is wiped out later, so the Hessian is banded, and the rate ties each knot to the next:
an iteration costs the number of knots times the square of the band. Predictor and corrector after Mehrotra (SIAM J.
Optim. 2, 1992).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

from tendonff.ocp.step.protocol import Array

_ITERATIONS = 50
_GAP = 1e-5  # of the decrease: how far the answer may be from the optimum
_STEP = 0.995  # of the way to the nearest bound


@dataclass(frozen=True, slots=True, kw_only=True)
class KnotProgram:
    """Minimise x' H x/2 + g' x subject to low <= (x, differences of x, rows x) <= high.

    Parameters
    ----------
    hessian : ndarray, shape (k, k)
        Positive semi-definite.
    gradient : ndarray, shape (k,)
    rows : ndarray, shape (c, k)
    low, high : ndarray, shape (2 k - 1 + c,)
        Finite, low <= 0 <= high, low < high: no change at all is allowed.
    """

    hessian: Array
    gradient: Array
    rows: Array
    low: Array
    high: Array

    def at(self, x: Array) -> Array:
        """What is bounded."""
        return np.concatenate([x, np.diff(x), self.rows @ x])

    def back(self, low: Array, high: Array) -> Array:
        """Transpose of `at`, of prices of the lower bounds less those of the upper."""
        k, price = len(self.gradient), low - high
        found = price[:k] + self.rows.T @ price[2 * k - 1 :]
        found[1:] += price[k : 2 * k - 1]
        found[:-1] -= price[k : 2 * k - 1]
        return found

    def bands(self) -> Array:
        """Lower diagonals of the Hessian, as many as it or the rows fill, shape (b, k)."""
        k = len(self.gradient)
        right, left = np.nonzero(self.hessian)
        reach = max(int((right - left).max(initial=1)), 1)
        for row in self.rows:
            filled = np.flatnonzero(row)
            reach = max(reach, int(np.ptp(filled))) if filled.size else reach
        return _lower(self.hessian, min(reach + 1, k))

    def weighed(self, bands: Array, weight: Array) -> Array:
        """The bands of the Hessian plus those of the bounded quantities' squares."""
        k, found = len(self.gradient), bands.copy()
        slopes = weight[k : 2 * k - 1]
        found[0] += weight[:k]
        found[0, 1:] += slopes
        found[0, :-1] += slopes
        if k > 1:
            found[1, :-1] -= slopes
        if len(self.rows):
            found += _lower((self.rows.T * weight[2 * k - 1 :]) @ self.rows, len(bands))
        return found


def solve_knots(program: KnotProgram) -> Array | None:
    """The minimiser, shape (k,), or None where the method does not converge."""
    h, g = program.hessian, program.gradient
    scale = float(np.abs(g).max(initial=0.0))
    x, width = np.zeros(len(g)), program.high - program.low
    if scale == 0:
        return x
    bands = program.bands()
    bands[0] += 1e-10 * bands[0].max()  # where the tendon sticks the Hessian is singular
    typical = float(np.median(width))
    slack = np.maximum(np.concatenate([-program.low, program.high]), 0.1 * typical)
    price = 0.1 * scale * typical / slack
    rounding = 1e-12 * float(price @ slack)
    for _ in range(_ITERATIONS):
        curved, at = h @ x, program.at(x)
        dual = curved + g - program.back(*np.split(price, 2))
        missed = np.concatenate([at - program.low, program.high - at]) - slack
        gap, worth = float(price @ slack), -float(g @ x + 0.5 * x @ curved)
        met = np.abs(missed).max() <= 1e-9 * width.max() and np.abs(dual).max() <= 1e-6 * scale
        if met and gap <= _GAP * worth + rounding:
            return x
        try:
            step = _Newton.of(program, bands, slack, price, missed, dual)
        except LinAlgError:
            return None
        _, d_slack, d_price = step.towards(-price * slack)
        left = float((price + _way(price, d_price) * d_price) @ (slack + _way(slack, d_slack) * d_slack))
        aim = (left / gap) ** 3 * gap / len(slack)
        dx, d_slack, d_price = step.towards(aim - price * slack - d_price * d_slack)
        x = x + _STEP * _way(slack, d_slack) * dx
        slack, price = (
            slack + _STEP * _way(slack, d_slack) * d_slack,
            price + _STEP * _way(price, d_price) * d_price,
        )
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Newton:
    """The linear equations of one iteration, factored; slacks and prices of the lower bounds, then of the upper."""

    program: KnotProgram
    factor: Array
    slack: Array
    price: Array
    missed: Array
    dual: Array

    @classmethod
    def of(
        cls, program: KnotProgram, bands: Array, slack: Array, price: Array, missed: Array, dual: Array
    ) -> "_Newton":
        matrix = program.weighed(bands, np.add(*np.split(price / slack, 2)))
        factor = cholesky_banded(matrix, overwrite_ab=True, lower=True, check_finite=False)
        return cls(program=program, factor=factor, slack=slack, price=price, missed=missed, dual=dual)

    def towards(self, push: Array) -> tuple[Array, Array, Array]:
        """Changes of x, slacks and prices that change the slacks times prices by `push`, in first order."""
        pushed = (push - self.price * self.missed) / self.slack
        right = self.program.back(*np.split(pushed, 2)) - self.dual
        dx = cho_solve_banded((self.factor, True), right, check_finite=False)
        moved = self.program.at(dx)
        d_slack = np.concatenate([moved, -moved]) + self.missed
        return dx, d_slack, (push - self.price * d_slack) / self.slack


def _way(values: Array, change: Array) -> float:
    """How much of a change keeps all values positive, at most 1."""
    most = float(np.max(-change / values))
    return min(1.0, 1 / most) if most > 0 else 1.0


def _lower(matrix: Array, count: int) -> Array:
    """The main diagonal of a symmetric matrix and those below it, `count` in all, shape (count, k)."""
    k = len(matrix)
    padded = np.zeros((k, k + count))
    padded[:, :k] = matrix
    down, right = padded.strides
    shifted = np.lib.stride_tricks.as_strided(padded, shape=(k, count), strides=(down + right, right))
    return np.ascontiguousarray(shifted.T)
