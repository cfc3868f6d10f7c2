"""Errors over uncertain numbers from those at the ends of their intervals: linear between, additive over several."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonff.compensator.compensators.uncertain import (
    TWO_SIDED,
    Doubt,
    FloatArray,
    correlation_root,
    drawn_places,
)
from tendonff.models.parameters.uncertainty import Uncertainty

_LEAST_SHARE = 0.03  # of the root of a correlation, below which a direction is rounding
_POWER_STEPS = 20
_DRAWS = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class Superposition:
    """Errors of a profile over time, by what is uncertain.

    Attributes
    ----------
    uncertainty : Uncertainty
    nominal : ndarray, shape (n,)
    low, high : ndarray, shape (intervals, n)
        At the ends of each interval, all else nominal but for what is correlated with it.
    """

    uncertainty: Uncertainty
    nominal: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, doubt: Doubt[Any], error: FloatArray) -> "Superposition":
        """Of errors on the samples of a doubt, shape (samples, n); what could not be simulated counts as none."""
        known = np.nan_to_num(error)
        low, high = (known[[doubt.ends(k)[side] for k in range(len(doubt.spreads))]] for side in (0, 1))
        return cls(uncertainty=doubt.uncertainty, nominal=known[0], low=low, high=high)

    def worst_corner(self, more: FloatArray | float = 0.0) -> list[float]:
        """The corner of all intervals where the error is largest, a place in each: −1 (low) or 1 (high).

        `more`, shape (n,), is an error that comes on top everywhere. From three starts ends are exchanged while the
        mean square grows. Numbers that are correlated are together at one point of their normal distribution: the
        direction in which the error grows most, as far out as the error of 95 % of what may be drawn is.
        """
        slope = 0.5 * (self.high - self.low)
        middle = self.nominal + (0.5 * (self.high + self.low) - self.nominal).sum(axis=0) + more
        together = list(self.uncertainty.correlated)
        alone = [k for k in range(len(slope)) if k not in together]
        root = correlation_root(self.uncertainty.correlations[np.ix_(together, together)])
        # Along an end that is correlated the others move as well: the slopes over independent coordinates.
        slope[together] = np.linalg.pinv(root, rcond=_LEAST_SHARE, hermitian=True) @ slope[together]
        gram, linear = slope @ slope.T, slope @ middle
        reach = _reach(gram[np.ix_(together, together)])

        def size(places: FloatArray) -> float:
            return float(places @ gram @ places + 2 * linear @ places)

        worse = np.where((self.high**2).sum(axis=1) >= (self.low**2).sum(axis=1), 1.0, -1.0)
        found = []
        for start in (worse, np.ones(len(worse)), -np.ones(len(worse))):
            places = start.copy()
            places[together] *= reach / max(math.sqrt(len(together)), 1.0)
            largest = size(places)
            grew = True
            while grew:
                grew = False
                for k in alone:
                    places[k] *= -1
                    if (changed := size(places)) > largest * (1 + 1e-12) + 1e-300:
                        largest, grew = changed, True
                    else:
                        places[k] *= -1
                for _ in range(_POWER_STEPS if together else 0):  # uphill on a sphere ends at its highest point
                    uphill = (gram @ places + linear)[together]
                    places[together] = reach * uphill / max(float(np.linalg.norm(uphill)), 1e-300)
                if (changed := size(places)) > largest * (1 + 1e-6) + 1e-300:
                    grew = True
                largest = changed
            found.append((largest, places.tolist()))
        corner = np.array(max(found)[1])
        corner[together] = np.clip(root @ corner[together], -1, 1)
        places_of_all: list[float] = corner.tolist()
        return places_of_all

    def rmse_quantiles(self, shares: Sequence[float]) -> list[float]:
        """RMS errors that such shares of all draws of the uncertain numbers stay below, in the unit of the error.

        The error goes straight from the nominal one to those at both ends; of correlated numbers it is linear, and what
        they are drawn by is noise alone: the law by which they were found is taken for the right one.
        """
        points = np.random.default_rng(self.uncertainty.seed).random((_DRAWS, len(self.low)))
        weights, parts = self._weights(drawn_places(self.uncertainty, points, noise_alone=True)), self._parts
        squares = np.einsum("di,ij,dj->d", weights, parts @ parts.T / parts.shape[1], weights)
        found: list[float] = np.sqrt(np.maximum(np.quantile(squares, shares), 0.0)).tolist()
        return found

    def at(self, places: Sequence[float]) -> FloatArray:
        """Error at a place in each interval, from −1 (low) to 1 (high), shape (n,)."""
        found: FloatArray = self._weights(np.array([places], dtype=float))[0] @ self._parts
        return found

    @property
    def _parts(self) -> FloatArray:
        return np.vstack([self.nominal[None], self.high - self.nominal, self.low - self.nominal])

    def _weights(self, places: FloatArray) -> FloatArray:
        """Shares of the parts at places, shape (draws, intervals): straight to both ends; linear where correlated."""
        up, down = np.clip(places, 0, None), np.clip(-places, 0, None)
        if together := list(self.uncertainty.correlated):
            matrix = self.uncertainty.correlations[np.ix_(together, together)]
            along = places[:, together] @ np.linalg.pinv(matrix, rcond=_LEAST_SHARE**2, hermitian=True)
            up[:, together], down[:, together] = 0.5 * along, -0.5 * along
        return np.column_stack([np.ones(len(places)), up, down])


def _reach(gram: FloatArray) -> float:
    """Length in half-widths along the worst direction at which the error is that of 95 % of all draws.

    The mean square error of normal numbers is a sum of squares, taken as one gamma distribution of the same mean and
    variance (Satterthwaite 1946). `gram` is that of the slopes over independent numbers.
    """
    sizes = np.linalg.eigvalsh(gram)
    if not len(sizes) or sizes[-1] <= 0:
        return 1.0
    from scipy.special import gammaincinv  # a fifth of a second to import, for numbers that were fitted together

    mean, square = float(sizes.sum()), float((sizes**2).sum())
    most = square / mean * 2 * float(gammaincinv(mean**2 / square / 2, 0.95))
    return math.sqrt(max(most / (TWO_SIDED**2 * float(sizes[-1])), 1.0))
