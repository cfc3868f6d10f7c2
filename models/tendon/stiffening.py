"""Stiffness of a tendon that grows with its tension: fibres and strands that bed down as they are loaded.

The stiffness is a straight line over the tension, k at a tension T_0, and stays where that has doubled:

    k(T) = k (1 + s (min(T, 2 T_0)/T_0 - 1)),      0 < s < 1

so that from dT/de = k(T) the tension over the elongation e is exponential up to 2 T_0 and a line beyond:

    T(e) = (k_0/r) (e^{r min(e, e_2)} - 1) + k (1 + s) (e - min(e, e_2)),      k_0 = k (1 - s), r = s k/T_0,
    e_2 = ln((1 + s)/(1 - s))/r

A link of it has a higher k and the same s and T_0. In an implicit step the part that is not k e is taken at the
elongation from which the step goes on: forces stay affine in the rate of elongation, simulation and inverse alike, and
the error is that of a damper (k(T) - k) H beside the link, which adds up nowhere. With s < 1 it is stable.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from tendonff.models.tendon.link import States, ZenerLink


@dataclass(frozen=True, slots=True, kw_only=True)
class StiffeningLink(ZenerLink):
    """Eqs. (6), (7) with a lasting stiffness that grows with the tension."""

    stiffening: ca.SX  # s [-]
    stiffening_tension_N: ca.SX  # T_0 [N]

    def shortened(self, ratio: ca.SX) -> "StiffeningLink":
        """The link of which `ratio` make the whole: its stiffnesses are that much higher."""
        higher = ZenerLink.shortened(self, ratio)
        return StiffeningLink(
            stiffness_N_per_m=higher.stiffness_N_per_m,
            relaxing_stiffness_N_per_m=higher.relaxing_stiffness_N_per_m,
            relaxation_time_s=self.relaxation_time_s,
            damping_N_s_per_m=higher.damping_N_s_per_m,
            stiffening=self.stiffening,
            stiffening_tension_N=self.stiffening_tension_N,
        )

    def explicit_force(self, e: ca.SX) -> ca.SX:
        """T(e) - k e [N]."""
        bent = _least(e, self._knee_m)
        growing = (
            (1 - self.stiffening) * self.stiffness_N_per_m / self._rate_per_m * (_exp(self._rate_per_m * bent) - 1)
        )
        return growing + (1 + self.stiffening) * self.stiffness_N_per_m * (e - bent) - self.stiffness_N_per_m * e

    def rest(self, tension_N: ca.SX) -> tuple[ca.SX, States]:
        """Every branch at the elongation whose tension this is [m]."""
        growing = _least(tension_N, 2 * self.stiffening_tension_N)
        low = (1 - self.stiffening) * self.stiffness_N_per_m
        stretch = _log(1 + growing * self._rate_per_m / low) / self._rate_per_m
        stretch = stretch + (tension_N - growing) / ((1 + self.stiffening) * self.stiffness_N_per_m)
        return stretch, (stretch,) * len(self.states)

    @property
    def _rate_per_m(self) -> ca.SX:
        return self.stiffening * self.stiffness_N_per_m / self.stiffening_tension_N

    @property
    def _knee_m(self) -> ca.SX:
        return _log((1 + self.stiffening) / (1 - self.stiffening)) / self._rate_per_m


def _is_casadi(*values: Any) -> bool:
    return any(isinstance(each, ca.SX | ca.MX | ca.DM) for each in values)


def _least(x: Any, bound: Any) -> Any:
    """min(x, bound), of numbers, arrays or symbols."""
    return ca.fmin(x, bound) if _is_casadi(x, bound) else np.minimum(x, bound)


def _exp(x: Any) -> Any:
    return ca.exp(x) if _is_casadi(x) else np.exp(x)


def _log(x: Any) -> Any:
    return ca.log(x) if _is_casadi(x) else np.log(x)
