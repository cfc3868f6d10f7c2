"""Quasi-static law whose slip sets in gradually: several plays with spread bounds.

The mean of plays whose bounds lie evenly around those of the capstan law is a generalised Prandtl-Ishlinskii operator.
Where the single play holds the output over the whole deadband and then lets it slip, its plays slip one after the
other, as a tendon does on a path that it does not touch evenly. In gross sliding, all plays slipping, the tensions have
the ratio e^{mu theta} of the single play. Bounds are multiples of u = T_in + p::

    w_k <- min(max(w_k, u low_k), u high_k),      T_out + p = mean of w_k

The plays stay in order (the play with the wider band is the play of the narrower), so that the operator is inverted in
closed form: the first ones slip, the others hold, and one linear equation gives u.
"""

import math
from dataclasses import dataclass

import numpy as np

from tendonff.models.layout import Array

PLAYS = 8
PLACES = tuple((2 * k + 1) / PLAYS - 1 for k in range(PLAYS))
"""Of the plays' bounds in their spread, evenly from -1 to 1."""


def sliding_exponent(middle: float, spread: float) -> float:
    """Exponent of gross sliding where the plays' exponents are `middle` (1 + `spread` places), signed."""
    return math.log(math.fsum(math.exp(middle * (1 + spread * place)) for place in PLACES) / PLAYS)


def middle_exponent(exponent: float, spread: float) -> float:
    """Middle of the plays' exponents that gives `exponent` in gross sliding, signed: -mu theta when pulling."""
    middle, reach = exponent, 1 + spread * np.array(PLACES)
    for _ in range(50):  # Newton: the sliding exponent rises with the middle, and is convex
        weights = np.exp(middle * reach)
        slope = float(np.sum(weights * reach) / weights.sum())
        change = (exponent - sliding_exponent(middle, spread)) / slope
        middle += change
        if abs(change) <= 1e-15 * max(abs(exponent), 1.0):
            break
    return middle


def play_exponents(exponent: float, spread: float) -> Array:
    """Exponents of the plays that give `exponent` in gross sliding, shape (PLAYS,), signed as it is."""
    return np.asarray(middle_exponent(exponent, spread) * (1 + spread * np.array(PLACES)))


@dataclass(frozen=True, slots=True, kw_only=True)
class SpreadPlays:
    """The plays of one law."""

    # low, high: shape (PLAYS,); bounds of the plays as multiples of T_in + p; falling and rising
    low: Array
    high: Array

    @classmethod
    def of(
        cls, pull_exponent: float, release_exponent: float, pull_spread: float, release_spread: float
    ) -> "SpreadPlays":
        """Plays with mu theta in gross sliding, whose bounds reach over (1 -+ spread) of their middle."""
        return cls(
            low=np.exp(play_exponents(-pull_exponent, pull_spread)),
            high=np.exp(play_exponents(release_exponent, release_spread)),
        )

    def inputs(self, outputs: Array, start: float, held: float) -> Array:
        """Least travelling input whose mean play is the output, shape (n,): the exact inverse.

        All tensions with p added: `start` is that of all plays before, `held` the input before the first change.
        """
        w, u, last, answer = np.full(PLAYS, start), held, start, np.empty(len(outputs))
        w = np.clip(w, u * self.low, u * self.high)
        for row, wanted in enumerate(outputs):
            if wanted != last:
                bounds = self.low if wanted > last else self.high
                u = _input_for(wanted, w, bounds, rising=bool(wanted > last))
                w = np.clip(w, u * self.low, u * self.high)
                last = wanted
            answer[row] = u
        return answer


def _input_for(wanted: float, w: Array, bounds: Array, *, rising: bool) -> float:
    """Input at which the first plays slip on their bounds, and the others hold, with the given mean."""
    holding, slipping, u = float(w.sum()), 0.0, 0.0
    for k in range(PLAYS):
        holding -= w[k]
        slipping += bounds[k]
        u = (PLAYS * wanted - holding) / slipping
        if k + 1 < PLAYS:
            next_slips = w[k + 1] / bounds[k + 1]
            if (u <= next_slips) if rising else (u >= next_slips):
                break
    return u
