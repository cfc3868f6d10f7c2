"""What tracking is asked for, and what it answers."""

import math
from dataclasses import dataclass
from enum import StrEnum

from tendonff.models.errors import ParameterError
from tendonff.ocp.errors import SolveError
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.diagnosis import Departure
from tendonff.ocp.tracking.limits import Violation


class TrackStatus(StrEnum):
    """What a tracking profile is.

    Attributes
    ----------
    EXACT
        No limit binds: the exact inverse, which leaves no error on its model.
    OPTIMAL
        Some limit binds; no small change of the profile improves it.
    ACCEPTABLE
        Better than the clipped inverse, but the search ended before it converged.
    CLIPPED
        The search found nothing better than the clipped inverse or the clipped static law, which is returned.
    INFEASIBLE
        No profile was found that keeps the bounds on the tension; the one that comes closest is returned.
    FAILED
        No profile could be simulated at all.
    """

    EXACT = "exact"
    OPTIMAL = "optimal"
    ACCEPTABLE = "acceptable"
    CLIPPED = "clipped"
    INFEASIBLE = "infeasible"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions:
    """What the profile is optimised for, and how hard.

    Parameters
    ----------
    effort_weight : float
        Weight of the mean squared force beside the mean squared tension error [-]; 0 for tracking alone.
    minimum_tension_N : float
        Least tension anywhere along the tendon [N]; 0 means no link may go slack.
    maximum_tension_N : float
        Largest tension anywhere along the tendon [N]; infinite for none.
    max_iterations : int
        Quadratic programs per window.
    tolerance : float
        Relative decrease of the mean squared error that is not worth another iteration [-].
    window_s : float or None
        Length of the pieces a long horizon is cut into [s]; None: chosen from the reference.
    """

    effort_weight: float = 0.0
    minimum_tension_N: float = 0.0
    maximum_tension_N: float = math.inf
    max_iterations: int = 60
    tolerance: float = 3e-3
    window_s: float | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.effort_weight < math.inf:
            raise ParameterError(f"effort_weight must be a finite number >= 0, got {self.effort_weight}; 0 for none")
        if not 0 <= self.minimum_tension_N < self.maximum_tension_N:
            raise ParameterError(
                f"minimum_tension_N must be >= 0 and below maximum_tension_N = {self.maximum_tension_N:g}, "
                f"got {self.minimum_tension_N}; 0 means no slack"
            )
        if self.max_iterations < 3:
            raise ParameterError(f"max_iterations must be >= 3, got {self.max_iterations}; 60 is a good start")
        if not 0 < self.tolerance < 1:
            raise ParameterError(f"tolerance must lie between 0 and 1, got {self.tolerance}; 0.003 is a good start")
        if self.window_s is not None and not self.window_s > 0:
            raise ParameterError(f"window_s must be > 0, got {self.window_s}; leave it out to have it chosen")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracking:
    """A force profile, what it achieves, and why not more.

    Parameters
    ----------
    status : TrackStatus
    message : str
        One sentence for the user.
    reasons : tuple of str
        Which wishes the actuator cannot fulfil, in the user's terms; empty where no limit binds.
    departures : tuple of Departure
        Where the predicted output leaves the reference.
    time_s, force_N, predicted_output_N : ndarray, shape (n,)
        Rows at 0, h, 2 h ...; the output as the design model predicts it.
    rms_error_N, peak_error_N : float
        Of the predicted output [N].
    clipped_rms_error_N : float
        Of the clipped inverse on the same model [N]: what the optimisation had to beat.
    least_tension_N, largest_tension_N : float
        Anywhere along the tendon after t = 0 [N].
    worst : Violation
        The bound that is met most closely, or broken.
    iterations : int
        Quadratic programs solved, all windows together.
    promise : float
        Relative decrease of the squared error that the last quadratic program promised [-].
    windows : int
        Pieces the horizon was cut into.
    build_s, solve_s : float
        Time for the inverse and the set-up, and for the search [s].
    """

    status: TrackStatus
    message: str
    reasons: tuple[str, ...]
    departures: tuple[Departure, ...]
    time_s: Array
    force_N: Array
    predicted_output_N: Array
    rms_error_N: float
    peak_error_N: float
    clipped_rms_error_N: float
    least_tension_N: float
    largest_tension_N: float
    worst: Violation
    iterations: int
    promise: float
    windows: int
    build_s: float
    solve_s: float

    def require(self) -> "Tracking":
        """Return itself, or raise `SolveError` with the diagnosis where no usable profile was found."""
        if self.status in (TrackStatus.FAILED, TrackStatus.INFEASIBLE):
            raise SolveError(" ".join([self.message, *self.reasons]))
        return self
