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

    def back(self, price: Array) -> Array:
        """Transpose of `at`."""
        k = len(self.gradient)
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
    """The minimiser, shape (k,), or None where the method does not converge.

    Parameters
    ----------
    program : KnotProgram
    """
    h, g = program.hessian, program.gradient
    scale = float(np.abs(g).max(initial=0.0))
    if scale == 0:
        return np.zeros(len(g))
    bands = program.bands()
    bands[0] += 1e-10 * bands[0].max()  # where the tendon sticks the Hessian is singular
    width = program.high - program.low
    least = 0.1 * np.median(width)  # of the slacks, to begin with
    below, above = np.maximum(-program.low, least), np.maximum(program.high, least)
    x = np.zeros(len(g))
    price = 0.1 * scale * float(np.median(width))
    up, down = price / below, price / above
    rounding = 1e-12 * price * len(width)
    for _ in range(_ITERATIONS):
        curved, at = h @ x, program.at(x)
        dual = curved + g - program.back(up - down)
        low_missed, high_missed = at - program.low - below, program.high - at - above
        gap, worth = float(up @ below + down @ above), -float(g @ x + 0.5 * x @ curved)
        missed = max(float(np.abs(low_missed).max()), float(np.abs(high_missed).max()))
        if (
            gap <= _GAP * worth + rounding
            and missed <= 1e-9 * float(width.max())
            and float(np.abs(dual).max()) <= 1e-6 * scale
        ):
            return x
        try:
            factor = cholesky_banded(
                program.weighed(bands, up / below + down / above), overwrite_ab=True, lower=True, check_finite=False
            )
        except LinAlgError:
            return None

        def newton(low_push: Array, high_push: Array) -> tuple[Array, Array, Array, Array, Array]:
            """The step whose prices times slacks change by the pushes, in first order."""
            low, high = low_push - up * low_missed, high_push - down * high_missed  # noqa: B023 - called here
            dx = cho_solve_banded((factor, True), program.back(low / below - high / above) - dual, check_finite=False)  # noqa: B023
            moved = program.at(dx)
            d_below, d_above = moved + low_missed, high_missed - moved  # noqa: B023
            return dx, d_below, d_above, (low_push - up * d_below) / below, (high_push - down * d_above) / above  # noqa: B023

        _, d_below, d_above, d_up, d_down = newton(-up * below, -down * above)
        primal, priced = _way(below, d_below, above, d_above), _way(up, d_up, down, d_down)
        left = float(
            (up + priced * d_up) @ (below + primal * d_below) + (down + priced * d_down) @ (above + primal * d_above)
        )
        aim = (left / gap) ** 3 * gap / (2 * len(width))
        dx, d_below, d_above, d_up, d_down = newton(
            aim - up * below - d_up * d_below, aim - down * above - d_down * d_above
        )
        primal, priced = _STEP * _way(below, d_below, above, d_above), _STEP * _way(up, d_up, down, d_down)
        x = x + primal * dx
        below, above = below + primal * d_below, above + primal * d_above
        up, down = up + priced * d_up, down + priced * d_down
    return None


def _way(first: Array, d_first: Array, second: Array, d_second: Array) -> float:
    """How much of a step keeps all of two arrays positive, at most 1."""
    most = max(float(np.max(-d_first / first)), float(np.max(-d_second / second)), 0.0)
    return min(1.0, 1 / most) if most > 0 else 1.0


def _lower(matrix: Array, count: int) -> Array:
    """The lowest `count` diagonals of a symmetric matrix from the main one down, shape (count, k)."""
    k = len(matrix)
    padded = np.zeros((k, k + count))
    padded[:, :k] = matrix
    down, right = padded.strides
    shifted = np.lib.stride_tricks.as_strided(padded, shape=(k, count), strides=(down + right, right))
    return np.ascontiguousarray(shifted.T)
