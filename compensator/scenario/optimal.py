"""Table [optimal]: what the optimal profile is asked for beside following the reference."""

from dataclasses import dataclass, fields

from tendonff.models.errors import ParameterError, require, require_given, require_whole


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimalSettings:
    """What the optimal profile is asked for; a key that is left out keeps its default.

    Parameters
    ----------
    minimum_tension_N : float, optional
        Least tension anywhere along the tendon [N], >= 0. Default 0: no link may go slack.
    maximum_tension_N : float, optional
        Largest tension anywhere along the tendon [N], > 0. Default: none.
    effort_weight : float, optional
        Weight of the mean squared force beside the mean squared tension error [-], >= 0. Default 0.
    travel_weight : float, optional
        What doubling the force's travel costs, as a mean squared error relative to the squared range of the reference
        [-], >= 0. Default 1e-6.
    static_weight : float, optional
        Weight of the error by the static law beside that of the model, >= 0: soft bristles can be pumped by a force
        that shakes, that law cannot. Default 0.003.
    max_iterations : int, optional
        Quadratic programs for each window of the horizon, 3 to 10000. Default 400.
    restarts : int, optional
        Searches from the profile that was found, moved in time, that may be in vain before the search ends, 0 to 100.
        Default 5, on long horizons 0.
    """

    minimum_tension_N: float | None = None
    maximum_tension_N: float | None = None
    effort_weight: float | None = None
    travel_weight: float | None = None
    static_weight: float | None = None
    max_iterations: int | None = None
    restarts: int | None = None

    def __post_init__(self) -> None:
        for name in ("minimum_tension_N", "effort_weight", "travel_weight", "static_weight"):
            require_given(name, getattr(self, name), least=0, hint="leave it out for the default")
        if self.maximum_tension_N is not None:
            require("maximum_tension_N", self.maximum_tension_N, above=0, hint="leave it out for none")
            if self.maximum_tension_N <= (self.minimum_tension_N or 0.0):
                raise ParameterError(
                    f"maximum_tension_N must be above minimum_tension_N = {self.minimum_tension_N:g}, "
                    f"got {self.maximum_tension_N:g}; leave it out for none"
                )
        if self.max_iterations is not None:
            require_whole("max_iterations", self.max_iterations, least=3, most=10000, hint="400 is a good start")
        if self.restarts is not None:
            require_whole("restarts", self.restarts, least=0, most=100, hint="5 is a good start")

    @property
    def given(self) -> dict[str, float | int]:
        """The keys that are set."""
        return {f.name: value for f in fields(self) if (value := getattr(self, f.name)) is not None}
