"""Dry friction of motor and gear: what a drive loses on the way to its tendon.

    motor --[ coulomb + (1 - efficiency) load ]--> load        against the motion, whichever side drives

In slip a force F moves a tension T by F = T +- (coulomb + (1 - efficiency) T): T (2 - efficiency) pulling, T efficiency
where the tendon drives the gear back. Newtons at a tendon, or newton metres at a shaft.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tendonff.models.errors import ParameterError, require
from tendonff.models.layout import Array


def slip_friction(coulomb: Any, lost_share: Any, load: Any) -> Any:
    """Friction in slip under a load >= 0, in its unit: what does not depend on it, and a share of it.

    CasADi expressions, numbers or arrays.
    """
    return coulomb + lost_share * load


def require_efficiency(gear_efficiency: float) -> None:
    """Refuse a share of the torque that no gear passes on."""
    require("gear_efficiency", gear_efficiency, above=0, hint="0.9 for a good gear")
    if gear_efficiency > 1:
        raise ParameterError(f"gear_efficiency must be at most 1, got {gear_efficiency}; 0.9 for a good gear")


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveLaw:
    """Static law of a drive: its force over the tension behind it.

    Attributes
    ----------
    coulomb_N : float
        Friction that does not depend on the load [N], >= 0.
    lost_share : float
        1 - efficiency of the gear [-], 0 to 1.
    """

    coulomb_N: float = 0.0
    lost_share: float = 0.0

    @property
    def is_ideal(self) -> bool:
        """The tension is the force."""
        return self.coulomb_N == 0 and self.lost_share == 0

    def force_N(self, tension_N: ArrayLike, way: ArrayLike) -> Array:
        """Force that holds a tension in slip [N]; `way` is 1 pulling, -1 releasing, 0 at rest without friction."""
        held = np.asarray(tension_N, dtype=np.float64)
        force: Array = held + np.asarray(way) * self.slip_N(held)
        return force

    def slip_N(self, tension_N: ArrayLike) -> Array:
        """Its friction in slip against a tension [N]."""
        friction: Array = slip_friction(self.coulomb_N, self.lost_share, np.maximum(tension_N, 0.0))
        return friction

    def pulled_N(self, force_N: ArrayLike) -> Array:
        """Tension that a force reaches by pulling [N]."""
        reached: Array = (np.asarray(force_N, dtype=np.float64) - self.coulomb_N) / (1 + self.lost_share)
        return reached

    def released_N(self, force_N: ArrayLike) -> Array:
        """Tension that is left where the drive is let back down to a force [N]."""
        left: Array = (np.asarray(force_N, dtype=np.float64) + self.coulomb_N) / (1 - self.lost_share)
        return left
