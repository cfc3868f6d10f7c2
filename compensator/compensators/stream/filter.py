"""The filter of a live reference: symmetric, so that its lag is the same for all frequencies.

Of all symmetric filters of a length that leave a constant (and, where asked, a parabola) as it is, the one that passes
the least noise to the force: white noise in the reference reaches the force through the inertia of the moving masses,
with the gain 1 + (w/w_m)^2, w_m^2 = 1/(m (1/k_load + 1/k_1)).
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tendonff.models.parameters import Transmission

FloatArray = NDArray[np.float64]
_FREQUENCIES = 1024


@dataclass(frozen=True, kw_only=True)  # without slots: the taps are computed once
class StreamFilter:
    """A symmetric filter, and the samples by which the caller hands the reference over ahead."""

    half: int  # taps on either side of the middle: the delay in samples
    is_flat: bool  # parabolas pass unchanged too: less error, more noise
    corner_per_sample: float  # w_m h: above this the force follows the second derivative of the reference [-]
    ahead: int  # samples of preview, >= half; 0 where there is none
    step_s: float  # h [s]

    @property
    def delay(self) -> int:
        """Samples between a reference and its effect."""
        return max(self.half, self.ahead)

    @property
    def lag_s(self) -> float:
        """Lag of the output behind what was passed; negative: what was passed is ahead by so much [s]."""
        return (-self.ahead if self.ahead else self.half) * self.step_s

    @cached_property
    def taps(self) -> FloatArray:
        """Weights, shape (2 half + 1,), sum 1."""
        if self.half == 0:
            return np.ones(1)
        place = np.arange(-self.half, self.half + 1, dtype=np.float64)
        angle = (np.arange(_FREQUENCIES) + 0.5) * math.pi / _FREQUENCIES
        gain = 1 + (angle / self.corner_per_sample) ** 2
        waves = np.cos(np.outer(angle, place)) * gain[:, None]
        cost = waves.T @ waves
        sines = np.sin(np.outer(angle, place)) * gain[:, None]
        cost += sines.T @ sines
        moments = [np.ones_like(place)]
        if self.is_flat and self.half > 1:
            moments.append((place / self.half) ** 2)
        rows = np.array(moments)
        wanted = np.zeros(len(rows))
        wanted[0] = 1.0
        solved = np.linalg.solve(cost, rows.T)
        taps = solved @ np.linalg.solve(rows @ solved, wanted)
        taps = 0.5 * (taps + taps[::-1])
        symmetric: FloatArray = taps / taps.sum()
        return symmetric


def corner_per_sample(transmission: Transmission, step_s: float) -> float:
    """Frequency above which inertia decides the force, times the step [-]."""
    t = transmission
    mass = t.actuator.mass_kg + t.tendon.mass_kg + t.load.mass_kg
    compliance = 1 / t.load.stiffness_N_per_m + 1 / t.tendon.stiffness_N_per_m
    return step_s / math.sqrt(max(mass * compliance, (1e-3 * step_s) ** 2))
