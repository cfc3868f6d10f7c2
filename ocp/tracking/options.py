"""Goals of the optimal profile: the table [optimal] of a scenario."""

import math
from dataclasses import dataclass
from enum import StrEnum

from tendonff.models.errors import ParameterError, require_whole


class Solver(StrEnum):
    """Method of the search.

    Attributes
    ----------
    SQP
        Single shooting, Gauss-Newton steps on knots; see `tracking.sqp`.
    IPOPT
        Direct collocation, an interior-point method on all intervals; see `ocp.opti`.
    """

    SQP = "sqp"
    IPOPT = "ipopt"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions:
    """Weights and bounds of the optimal profile, and how long to search.

    Parameters
    ----------
    minimum_tension_N : float
        Least tension anywhere along the tendon [N], >= 0. Default 0: no link may go slack.
    maximum_tension_N : float
        Largest tension anywhere along the tendon [N]. Default: none.
    stiffer_weight : float
        Weight of the mean squared error with stiffer bristles beside that of the design model [-], >= 0. It keeps the
        profile from shaking soft bristles, which a model rewards and no measurement supports; 0 allows it. Not used
        where an uncertainty is stated. Default 1.
    effort_weight : float
        Weight of the mean squared force beside the mean squared tension error [-], >= 0. Default 0.
    travel_weight : float
        Cost of doubling the travel of the force, as a mean squared error relative to the squared range of the
        reference [-], >= 0. Default 1e-4.
    max_iterations : int
        Largest number of quadratic programs for each window of the horizon, or of iterations of IPOPT, 3 to 10000.
        Default 60.
    solver : Solver
        "sqp", or "ipopt": direct collocation on intervals of 5 ms, slower. Default "sqp".
    """

    minimum_tension_N: float = 0.0
    maximum_tension_N: float = math.inf
    stiffer_weight: float = 1.0
    effort_weight: float = 0.0
    travel_weight: float = 1e-4
    max_iterations: int = 60
    solver: Solver = Solver.SQP

    def __post_init__(self) -> None:
        for name in ("stiffer_weight", "effort_weight", "travel_weight"):
            if not 0 <= (value := getattr(self, name)) < math.inf:
                raise ParameterError(f"{name} must be a finite number >= 0, got {value}; 0 for none")
        if not 0 <= self.minimum_tension_N < self.maximum_tension_N:
            raise ParameterError(
                f"minimum_tension_N must be >= 0 and below maximum_tension_N = {self.maximum_tension_N:g}, "
                f"got {self.minimum_tension_N}; 0 means no slack"
            )
        require_whole("max_iterations", self.max_iterations, least=3, most=10000, hint="60 is a good start")
