"""Table [robust]: how well the parameters are known, for the robust optimal profile."""

from dataclasses import dataclass
from enum import StrEnum

from tendonff.compensator.scenario.checks import require_number, require_whole


class RobustObjective(StrEnum):
    """Which error over the parameter samples is made small.

    Attributes
    ----------
    WORST
        The largest.
    MEAN
        The mean.
    """

    WORST = "worst"
    MEAN = "mean"


@dataclass(frozen=True, slots=True, kw_only=True)
class Robust:
    """Relative uncertainty of the parameters; the default is certainty.

    Parameters
    ----------
    mu, stiffness, bristle_stiffness : float, optional
        Relative half-width of the uncertainty of the friction coefficients, of k1 and k2, and of sigma0 [-],
        >= 0 and < 1: 0.2 means within 20 % either way. Default 0.
    samples : int, optional
        Number of parameter samples, 1 to 1000. Default 8.
    objective : RobustObjective, optional
        Worst or mean error over the samples. Default worst.
    seed : int, optional
        Seed of the sampling, >= 0. Default 0.
    """

    mu: float = 0.0
    stiffness: float = 0.0
    bristle_stiffness: float = 0.0
    samples: int = 8
    objective: RobustObjective = RobustObjective.WORST
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value in (
            ("mu", self.mu),
            ("stiffness", self.stiffness),
            ("bristle_stiffness", self.bristle_stiffness),
        ):
            require_number(name, value, least=0, below=1, hint="0.2 means within 20 % either way")
        require_whole("samples", self.samples, least=1, most=1000, hint="8 is a good start")
        require_whole("seed", self.seed, least=0, most=2**32 - 1, hint="any number will do")

    @property
    def is_certain(self) -> bool:
        """No parameter is uncertain."""
        return self.mu == self.stiffness == self.bristle_stiffness == 0
