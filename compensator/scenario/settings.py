"""Tables [run], [stream], [adaptation] and [feedback], and messages for removed keys of [optimal]."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

from tendonff.compensator.files.text import InputError
from tendonff.models.errors import ParameterError, require, require_given, require_whole
from tendonff.models.fidelity import Level
from tendonff.ocp.adaptation.tuning import MAX_DELAY, Sensor, Tunable, check_parameters
from tendonff.ocp.feedback.requirement import Requirement


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """Numerical settings of the scenario.

    Parameters
    ----------
    step_s : float
        Time step of reference, force profile and simulation [s], > 0.
    level : Level
        Fidelity level for the design: elastic, viscoelastic or presliding.
    accept : tuple of str, optional
        Keys whose values look like another unit and are right, such as "path.total_angle_rad".
    """

    step_s: float
    level: Level
    accept: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require("step_s", self.step_s, above=0, hint="0.001 is a good start")


_FOLLOW = "the optimal profile follows the reference that it is given"

REMOVED_OPTIMAL: Mapping[str, str] = MappingProxyType(
    {
        "tolerance_N": f"{_FOLLOW}; for less travel of the force raise travel_weight",
        "least_time": f"{_FOLLOW}; draw the transition as a waypoints reference as short as the limits allow",
        "preview_s": f"{_FOLLOW} as a whole; preview on a controller is preview_s of [stream]",
        "static_weight": "stiffer_weight does its work: stiffer bristles instead of the capstan law",
        "restarts": "the search has no random part any more",
    }
)
"""Keys of [optimal] in earlier versions, and what to do without them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """A reference that arrives sample by sample.

    Attributes
    ----------
    lag_max_s : float
        Largest delay of the output tension behind the reference that the filter may cause [s], >= 0.
    preview_s : float
        Time by which the caller knows the reference ahead [s], >= 0; with preview there is no lag.
    resolution_N : float
        Step of the converter that measures the reference [N]; changes up to this size are ignored.
    """

    lag_max_s: float = 0.015
    preview_s: float = 0.0
    resolution_N: float = 0.0

    def __post_init__(self) -> None:
        require("lag_max_s", self.lag_max_s, least=0, hint="0.015 is a good start; 0 for no filter")
        require("preview_s", self.preview_s, least=0, hint="0 where nothing is known ahead")
        require("resolution_N", self.resolution_N, least=0, hint="0 where the reference is exact")


@dataclass(frozen=True, slots=True, kw_only=True)
class Compare:
    """A force of the user's own, compared with the compensators.

    Parameters
    ----------
    force : str
        CSV file with the columns time_s and force_N over the whole reference, relative to the scenario.
    column : str, optional
        Column of the force, where the file has several.
    """

    force: str
    column: str | None = None

    def __post_init__(self) -> None:
        if not self.force.strip() or "\0" in self.force:
            raise ParameterError(f"force must name a CSV file, got {self.force!r}; it is relative to the scenario file")


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
    joint_delay_samples : int, optional
        Age of the joint angles when they arrive, in steps, 0 to 63: the tuner takes them on at the rate of so many
        steps. Default 0.
    parameters : tuple of Tunable, optional
        What is tuned, one or two: "mu", "mu_pull", "mu_release", "load_stiffness", "tendon_stiffness", "load_exponent".
        Default mu_pull and mu_release from the output tension; mu from the position, from which the directions are
        separately identifiable only where load stiffness and start tension are known.
    range : tuple of float, optional
        Bounds of each estimate relative to the scenario's value [-]; 1 more of load_exponent adds 1 to it. Default 0.5
        to 2.
    integral_gain_per_s : float, optional
        Integral action on the logarithm of the measured output tension [1/s], >= 0; 0 for none. It acts in full where
        the model leaves something unexplained, with a third elsewhere. Default: three eighths of what is certified
        where the output tension is measured, else none.
    """

    sensor: Sensor
    noise: float = 0.0
    delay_samples: int = 0
    joint_delay_samples: int = 0
    parameters: tuple[Tunable, ...] = ()
    range: tuple[float, ...] = (0.5, 2.0)
    integral_gain_per_s: float | None = None

    def __post_init__(self) -> None:
        require("noise", self.noise, least=0, hint="the standard deviation of the sensor in N or m")
        for name in ("delay_samples", "joint_delay_samples"):
            require_whole(name, getattr(self, name), least=0, most=MAX_DELAY - 1, hint="the delay over step_s")
        if not self.parameters:
            pair = (Tunable.MU_PULL, Tunable.MU_RELEASE)
            default = (Tunable.MU,) if self.sensor is Sensor.ACTUATOR_POSITION else pair
            object.__setattr__(self, "parameters", default)
        check_parameters(self.parameters)
        if len(self.range) != 2 or not 0 < self.range[0] < 1 < self.range[1] <= 10:
            raise ParameterError(
                f"range must be two numbers around 1, > 0 and <= 10, got {list(self.range)}; try [0.5, 2.0]"
            )
        require("integral_gain_per_s", self.integral_gain_per_s or 0.0, least=0, hint="use 0 for none")
        if (self.integral_gain_per_s or 0.0) > 0 and self.sensor is Sensor.ACTUATOR_POSITION:
            raise ParameterError(
                f"integral_gain_per_s must be 0 for actuator_position, got {self.integral_gain_per_s}; "
                "integral action needs the output tension"
            )


class FeedbackSensor(StrEnum):
    """Measured quantity of a feedback.

    Attributes
    ----------
    JOINT_ANGLE
        Angle of each driven joint that has a reference, by encoders at the joints.
    OUTPUT_TENSION
        Tension at the far end of the tendon.
    MOTOR_ANGLE_AND_TORQUE
        Angle and torque of the motor, from which an observer estimates the joint.
    """

    JOINT_ANGLE = "joint_angle"
    OUTPUT_TENSION = "output_tension"
    MOTOR_ANGLE_AND_TORQUE = "motor_angle_and_torque"


@dataclass(frozen=True, slots=True, kw_only=True)
class Feedback:
    """Feedback beside the feedforward.

    Parameters
    ----------
    sensor : FeedbackSensor
        "joint_angle" of driven joints, "output_tension" of one tendon.
    delay_s : float, optional
        Age of a measurement when the controller has it [s], >= 0. Default 0.
    sample_s : float, optional
        Time between two calls of the controller [s], > 0, a multiple of step_s. Default step_s.
    resolution : float, optional
        Step of the measurement [rad or N], >= 0: 2 pi/4096 for 12 bits a turn. Default 0.
    gain_margin : float, optional
        Factor on the gain up to instability that every linearisation must have [-], > 1. Default 2.
    phase_margin_deg : float, optional
        Angle to −180° that it must have where the gain of the loop is 1 [deg], > 0 and < 90. Default 45.
    limit : float, optional
        Largest correction of a command [rad, N or m], > 0. Default: what four times the errors of [robust] need.
    """

    sensor: FeedbackSensor
    delay_s: float = 0.0
    sample_s: float | None = None
    resolution: float = 0.0
    gain_margin: float = 2.0
    phase_margin_deg: float = 45.0
    limit: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "sensor", FeedbackSensor(self.sensor))
        require("delay_s", self.delay_s, least=0, hint="the age of a measurement when it arrives, 0.01 for 10 ms")
        require_given("sample_s", self.sample_s, above=0, hint="the time between two calls, 0.005 for 200 Hz")
        require("resolution", self.resolution, least=0, hint="leave it out for none")
        require_given("limit", self.limit, above=0, hint="leave it out for what the design finds necessary")
        Requirement(gain_margin=self.gain_margin, phase_margin_deg=self.phase_margin_deg)

    def require_tension(self, file: str) -> None:
        """Refuse a sensor that the tension of one tendon has no feedback from; InputError."""
        if self.sensor is not FeedbackSensor.OUTPUT_TENSION:
            raise InputError(
                f'{file} [feedback]: the tension of one tendon needs sensor = "output_tension", got "{self.sensor}"'
            )

    def require_joint(self, file: str) -> None:
        """Refuse a sensor that driven joints have no feedback from; InputError with the reason."""
        if self.sensor is FeedbackSensor.MOTOR_ANGLE_AND_TORQUE:
            raise InputError(
                f'{file} [feedback]: sensor = "motor_angle_and_torque" is not possible: an observer estimates the '
                "joint by the model that the feedforward inverts, so its estimate hides the errors that feedback "
                'should correct; measure "joint_angle"'
            )
        if self.sensor is not FeedbackSensor.JOINT_ANGLE:
            raise InputError(f'{file} [feedback]: driven joints need sensor = "joint_angle", got "{self.sensor}"')
