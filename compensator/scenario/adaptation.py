"""Table [adaptation]: what the controller measures, and what it may tune."""

from dataclasses import dataclass

from tendonff.models.errors import ParameterError, require, require_whole
from tendonff.ocp.adaptation.tuning import MAX_DELAY, Sensor, Tunable, check_parameters


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
