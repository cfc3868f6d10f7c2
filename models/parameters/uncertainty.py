"""How well the parameters of a transmission are known, and which error over what is possible counts."""

import math
from dataclasses import dataclass
from enum import StrEnum

from tendonff.models.errors import ParameterError, require_whole


class Objective(StrEnum):
    """Which error over the parameter samples a robust profile makes small."""

    WORST = "worst"  # the largest
    MEAN = "mean"  # the root of the mean square


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """Relative uncertainty of the parameters; the default is certainty.

    Parameters
    ----------
    mu, stiffness, bristle_stiffness : float, optional
        Relative half-width of the uncertainty of the friction coefficients, of k1 and k2, and of the bristle
        stiffnesses [-], >= 0 and < 1: 0.2 means within 20 % either way. Default 0.
    samples : int, optional
        Number of parameter samples, the nominal ones among them, 1 to 1000. Default 8.
    objective : Objective, optional
        Worst or mean error over the samples. Default worst.
    seed : int, optional
        Seed of the sampling, >= 0. Default 0.
    """

    mu: float = 0.0
    stiffness: float = 0.0
    bristle_stiffness: float = 0.0
    samples: int = 8
    objective: Objective = Objective.WORST
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("mu", "stiffness", "bristle_stiffness"):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0 <= value < 1):
                raise ParameterError(
                    f"{name} must be a finite number >= 0 and < 1, got {value}; 0.2 means within 20 % either way"
                )
        require_whole("samples", self.samples, least=1, most=1000, hint="8 is a good start")
        require_whole("seed", self.seed, least=0, most=2**32 - 1, hint="any number will do")

    @property
    def is_certain(self) -> bool:
        """No parameter is uncertain."""
        return self.mu == self.stiffness == self.bristle_stiffness == 0
