"""Tables [run], [optimal], [stream] and [adaptation]."""

from dataclasses import dataclass, fields
from typing import ClassVar

from tendonff.models.errors import ParameterError, require, require_given, require_whole
from tendonff.models.fidelity import Level
from tendonff.ocp.adaptation.tuning import MAX_DELAY, Sensor, Tunable, check_parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """How the scenario is computed.

    Parameters
    ----------
    step_s : float
        Time step of reference, force profile and simulation [s], > 0.
    level : Level
        Fidelity level for the design: elastic, viscoelastic or presliding.
    """

    step_s: float
    level: Level

    def __post_init__(self) -> None:
        require("step_s", self.step_s, above=0, hint="0.001 is a good start")


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimalSettings:
    """What the optimal profile is asked for; a key that is left out keeps its default."""

    minimum_tension_N: float | None = None  # least anywhere along the tendon, >= 0; default 0: no link may go slack
    maximum_tension_N: float | None = None  # largest anywhere along the tendon, > 0; default: none
    effort_weight: float | None = None  # of the mean squared force beside the mean squared tension error; default 0
    # what doubling the force's travel costs, as a mean squared error relative to the squared range of the reference,
    # >= 0; default 1e-6
    travel_weight: float | None = None
    # weight of the error by the static law beside that of the model, >= 0: soft bristles can be pumped by a force that
    # shakes, that law cannot; default 0.003
    static_weight: float | None = None
    max_iterations: int | None = None  # quadratic programs for each window of the horizon, 3 to 10000; default 400
    # searches from the profile that was found, moved or changed between two reversals, that may be in vain before it is
    # left as it is there, 0 to 100; default 6, on long horizons 0
    restarts: int | None = None
    # least effort: the output may be so far off the reference, > 0, and the force travels as little as can be; with
    # `least_time`, how near the output has to stay at the end, default there 1 % of the change
    tolerance_N: float | None = None
    # bring the output from the first to the last tension of the reference in the least time, and keep it there; what
    # the reference does in between does not count
    least_time: bool | None = None
    # the reference is known only so far ahead, > 0, and taken to stand still beyond: planned anew as time goes
    preview_s: float | None = None

    _GOALS: ClassVar = ("tolerance_N", "least_time", "preview_s")

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
            require_whole("restarts", self.restarts, least=0, most=100, hint="6 is a good start")
        require_given("tolerance_N", self.tolerance_N, above=0, hint="leave it out to follow the reference")
        require_given("preview_s", self.preview_s, above=0, hint="leave it out where all is known ahead")
        if self.preview_s is not None and (self.least_time or self.tolerance_N is not None):
            raise ParameterError(
                f"preview_s = {self.preview_s:g} does not go with least_time or tolerance_N: with preview the "
                "reference itself is followed; leave one of them out"
            )

    @property
    def given(self) -> dict[str, float | int]:
        """The options of the search that are set."""
        names = (f.name for f in fields(self) if f.name not in self._GOALS)
        return {name: value for name in names if (value := getattr(self, name)) is not None}

    @property
    def goal(self) -> str:
        """The key that asks for something else than the least error with all known ahead; empty where none does."""
        asked = (("least_time", self.least_time), ("tolerance_N", self.tolerance_N), ("preview_s", self.preview_s))
        return next((name for name, value in asked if value), "")

    @property
    def is_followed(self) -> bool:
        """The optimal profile is meant to have the least error against the reference."""
        return self.goal in ("", "preview_s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """A reference that arrives sample by sample."""

    lag_max_s: float = 0.015  # of the output tension behind the reference, as the filter may cause it, >= 0
    preview_s: float = 0.0  # time by which the caller knows the reference ahead, >= 0; with preview there is no lag
    resolution_N: float = 0.0  # step of the converter that measures the reference; changes up to this size are ignored

    def __post_init__(self) -> None:
        require("lag_max_s", self.lag_max_s, least=0, hint="0.015 is a good start; 0 for no filter")
        require("preview_s", self.preview_s, least=0, hint="0 where nothing is known ahead")
        require("resolution_N", self.resolution_N, least=0, hint="0 where the reference is exact")


@dataclass(frozen=True, slots=True, kw_only=True)
class Adaptation:
    """Self-tuning on the controller.

    Parameters
    ----------
    sensor : Sensor
        "output_tension", or "actuator_position" relative to the start.
    noise : float, optional
        Standard deviation of the sensor [N or m], >= 0. Default 0.
    delay_samples : int, optional
        Age of a measurement when it arrives, in steps, 0 to 63. Default 0.
    parameters : tuple of Tunable, optional
        What is tuned: "mu", or "mu_pull" and "mu_release"; with "load_stiffness" or "tendon_stiffness". Default mu.
    range : tuple of float, optional
        Bounds of each estimate relative to the scenario's value [-]. Default 0.5 to 2.
    integral_gain_per_s : float, optional
        Integral action on the logarithm of the measured output tension [1/s], >= 0. Default 0: none.
    """

    sensor: Sensor
    noise: float = 0.0
    delay_samples: int = 0
    parameters: tuple[Tunable, ...] = (Tunable.MU,)
    range: tuple[float, ...] = (0.5, 2.0)
    integral_gain_per_s: float = 0.0

    def __post_init__(self) -> None:
        require("noise", self.noise, least=0, hint="the standard deviation of the sensor in N or m")
        require_whole("delay_samples", self.delay_samples, least=0, most=MAX_DELAY - 1, hint="the delay over step_s")
        check_parameters(self.parameters)
        if len(self.range) != 2 or not 0 < self.range[0] < 1 < self.range[1] <= 10:
            raise ParameterError(
                f"range must be two numbers around 1, > 0 and <= 10, got {list(self.range)}; try [0.5, 2.0]"
            )
        require("integral_gain_per_s", self.integral_gain_per_s, least=0, hint="use 0 for none")
        if self.integral_gain_per_s > 0 and self.sensor is Sensor.ACTUATOR_POSITION:
            raise ParameterError(
                f"integral_gain_per_s must be 0 for actuator_position, got {self.integral_gain_per_s}; "
                "integral action needs the output tension"
            )
