"""Result of tracking."""

from dataclasses import dataclass
from enum import StrEnum

from tendonff.ocp.errors import SolveError
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.diagnosis import Departure
from tendonff.ocp.tracking.limits import Violation


class TrackStatus(StrEnum):
    """Status of a tracking profile.

    Attributes
    ----------
    EXACT
        No limit binds, and simulated the exact inverse leaves next to no error on its model.
    UNSTABLE
        No limit binds, but simulated the exact inverse leaves an error: the rig amplifies rounding (stick-slip).
    OPTIMAL
        Some limit binds; no small change of the profile improves it.
    BEST_ACHIEVABLE
        No force within the limits reaches the reference: what comes closest.
    ACCEPTABLE
        Better than the clipped inverse, but the search ended before it converged.
    CLIPPED
        The search found nothing better than the clipped inverse or the clipped capstan law, which is returned.
    INFEASIBLE
        No profile was found that keeps the bounds on the tension; the one that comes closest is returned.
    FAILED
        No profile could be simulated at all.
    """

    EXACT = "exact"
    UNSTABLE = "unstable"
    OPTIMAL = "optimal"
    BEST_ACHIEVABLE = "best_achievable"
    ACCEPTABLE = "acceptable"
    CLIPPED = "clipped"
    INFEASIBLE = "infeasible"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracking:
    """A force profile, what it achieves, and why not more.

    Parameters
    ----------
    status : TrackStatus
    message : str
        One sentence for the user.
    reasons : tuple of str
        Parts of the reference that the actuator cannot follow, by the user's keys; empty where no limit binds.
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
        Quadratic programs of the search that won, all windows together.
    gain : float
        Relative decrease of the squared error that the last iteration brought [-].
    windows : int
        Pieces the horizon was cut into.
    build_s, solve_s : float
        Time to pose the problem, and of the search [s].
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
    gain: float
    windows: int
    build_s: float
    solve_s: float

    def require(self) -> "Tracking":
        """Return itself, or raise `SolveError` with the diagnosis where no usable profile was found."""
        if self.status in (TrackStatus.FAILED, TrackStatus.INFEASIBLE):
            raise SolveError(" ".join([self.message, *self.reasons]))
        return self
