"""A primal-dual interior-point method for quadratic programs over a row of knots, each of which acts only for a while.

A change of the force at a knot is wiped out later, so the Hessian is banded, and the rate ties each knot to the next:
an iteration costs the number of knots times the square of the band. Predictor and corrector after Mehrotra (SIAM J.
Optim. 2, 1992).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs  # the checks of scipy.linalg cost as much as small systems do

from tendonff.ocp.step.protocol import Array

_ITERATIONS = 50
_GAP = 1e-5  # of the decrease: how far the answer may be from the optimum
_DUAL = 1e-6  # of the gradient
_STEP = 0.995  # of the way to the nearest bound


@dataclass(frozen=True, slots=True, kw_only=True)
class KnotProgram:
    """Minimise x' H x/2 + g' x subject to low <= (x, differences of x, rows x) <= high."""

    hessian: Array  # shape (k, k); positive semi-definite
    gradient: Array  # shape (k,)
    rows: Array  # shape (c, k)
    # low, high: shape (2 k - 1 + c,); finite, low <= 0 <= high, low < high: no change at all is allowed
    low: Array
    high: Array

    def at(self, x: Array) -> Array:
        """What is bounded."""
        k = len(x)
        found = np.empty(2 * k - 1 + len(self.rows))
        found[:k] = x
        np.subtract(x[1:], x[:-1], out=found[k : 2 * k - 1])
        if len(self.rows):
            np.dot(self.rows, x, out=found[2 * k - 1 :])
        return found

    def back(self, price: Array) -> Array:
        """Transpose of `at`, of prices of the lower bounds less those of the upper."""
        k = len(self.gradient)
        found = price[:k] + self.rows.T @ price[2 * k - 1 :] if len(self.rows) else price[:k].copy()
        found[1:] += price[k : 2 * k - 1]
        found[:-1] -= price[k : 2 * k - 1]
        return found

    def bands(self) -> Array:
        """Lower diagonals of the Hessian, as many as it or the rows fill, shape (b, k)."""
        k, filled, rows = len(self.gradient), self.hessian != 0, self.rows != 0
        reach = int(np.max(np.arange(k) - filled.argmax(axis=1), initial=1))
        if len(rows):
            spans = k - 1 - rows[:, ::-1].argmax(axis=1) - rows.argmax(axis=1)
            reach = max(reach, int(np.max(spans, where=rows.any(axis=1), initial=1)))
        return _lower(self.hessian, min(reach + 1, k))

    def weighed(self, bands: Array, weight: Array) -> Array:
        """The bands of the Hessian plus those of the bounded quantities' squares."""
        k, found = len(self.gradient), bands.copy(order="F")
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
    x, width, half = np.zeros(len(g)), program.high - program.low, len(program.low)
    if scale == 0:
        return x
    bands = program.bands()
    bands[0] += 1e-10 * bands[0].max()  # where the tendon sticks the Hessian is singular
    typical = float(np.median(width))
    slack = np.maximum(np.concatenate([-program.low, program.high]), 0.1 * typical)
    price = 0.1 * scale * typical / slack
    rounding, widest = 1e-12 * float(price @ slack), float(width.max())
    for _ in range(_ITERATIONS):
        curved, at = h @ x, program.at(x)
        dual = curved + g - program.back(price[:half] - price[half:])
        missed = np.concatenate([at - program.low, program.high - at]) - slack
        gap, worth = float(price @ slack), -float(g @ x + 0.5 * x @ curved)
        met = np.abs(missed).max() <= 1e-9 * widest and np.abs(dual).max() <= _DUAL * scale
        if met and gap <= _GAP * worth + rounding:
            return x
        step = _Newton.of(program, bands, slack, price, missed, dual)
        if step is None:
            return None
        _, d_slack, d_price = step.towards(-price * slack)
        left = float((price + _way(price, d_price) * d_price) @ (slack + _way(slack, d_slack) * d_slack))
        aim = (left / gap) ** 3 * gap / len(slack)
        dx, d_slack, d_price = step.towards(aim - price * slack - d_price * d_slack)
        by_slack, by_price = _STEP * _way(slack, d_slack), _STEP * _way(price, d_price)
        x = x + by_slack * dx
        slack, price = slack + by_slack * d_slack, price + by_price * d_price
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
    ) -> "_Newton | None":
        """None where the matrix is not positive definite by rounding."""
        weight, half = price / slack, len(program.low)
        factor, failed = dpbtrf(program.weighed(bands, weight[:half] + weight[half:]), lower=1, overwrite_ab=1)
        if failed:
            return None
        return cls(program=program, factor=factor, slack=slack, price=price, missed=missed, dual=dual)

    def towards(self, push: Array) -> tuple[Array, Array, Array]:
        """Changes of x, slacks and prices that change the slacks times prices by `push`, in first order."""
        half = len(self.program.low)
        pushed = (push - self.price * self.missed) / self.slack
        right = self.program.back(pushed[:half] - pushed[half:]) - self.dual
        dx = dpbtrs(self.factor, right, lower=1, overwrite_b=1)[0]
        moved = self.program.at(dx)
        d_slack = np.concatenate([moved, -moved]) + self.missed
        return dx, d_slack, (push - self.price * d_slack) / self.slack


def _way(values: Array, change: Array) -> float:
    """How much of a change keeps all values positive, at most 1."""
    most = -float((change / values).min())
    return min(1.0, 1 / most) if most > 0 else 1.0


def _lower(matrix: Array, count: int) -> Array:
    """The main diagonal of a symmetric matrix and those below it, `count` in all, shape (count, k)."""
    k = len(matrix)
    padded = np.zeros((k, k + count))
    padded[:, :k] = matrix
    down, right = padded.strides
    shifted = np.lib.stride_tricks.as_strided(padded, shape=(k, count), strides=(down + right, right))
    return np.ascontiguousarray(shifted.T)
