"""Choices of a direct collocation; light, because the command line imports them."""

from dataclasses import dataclass

from tendonff.models.errors import require, require_whole


@dataclass(frozen=True, slots=True, kw_only=True)
class Collocation:
    """Choices by which equations become constraints.

    Parameters
    ----------
    interval_s : float, optional
        Length of an interval, over which inputs are linear [s], > 0. Default 0.005.
    degree : int, optional
        Of the polynomials on it, 1 to 9; 1 is implicit Euler. Default 1.
    smoothing : float, optional
        Width of friction's rounded switch over the largest sliding speed of the first guess [-], > 0. Default 3e-4.
    """

    interval_s: float = 0.005
    degree: int = 1
    smoothing: float = 3e-4

    def __post_init__(self) -> None:
        require("interval_s", self.interval_s, above=0, hint="0.005 suits most rigs")
        require_whole("degree", self.degree, least=1, most=9, hint="1 is implicit Euler")
        require("smoothing", self.smoothing, above=0, hint="3e-4 is a good start; larger values solve more easily")
