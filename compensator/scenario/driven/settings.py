"""Table [adaptation] of a joint."""

from dataclasses import dataclass
from enum import StrEnum

from tendonff.models.errors import ParameterError, require, require_whole
from tendonff.ocp.adaptation.joint import JointTunable
from tendonff.ocp.adaptation.tuning import MAX_DELAY


class JointSensor(StrEnum):
    """Measured quantity of a joint that tunes itself."""

    JOINT_ANGLE = "joint_angle"


@dataclass(frozen=True, slots=True, kw_only=True)
class JointAdaptation:
    """Self-tuning of a loop on the controller.

    Parameters
    ----------
    sensor : JointSensor
        "joint_angle": an encoder at the joint.
    noise : float, optional
        Standard deviation of the sensor [rad], >= 0: a step of its resolution over 3.5. Default 0.
    delay_samples : int, optional
        Age of a measurement when it arrives, in steps, 0 to 63. Default 0.
    parameters : tuple of JointTunable, optional
        What is tuned, by one factor: "mu", "pretension", or both. The joint's angle identifies the lost motion alone,
        so that two factors could not be separated. Default both.
    range : tuple of float, optional
        Bounds of the factor on the scenario's values [-]. Default 0.5 to 2.
    """

    sensor: JointSensor
    noise: float = 0.0
    delay_samples: int = 0
    parameters: tuple[JointTunable, ...] = (JointTunable.MU, JointTunable.PRETENSION)
    range: tuple[float, ...] = (0.5, 2.0)

    def __post_init__(self) -> None:
        require("noise", self.noise, least=0, hint="the standard deviation of the sensor in rad")
        require_whole("delay_samples", self.delay_samples, least=0, most=MAX_DELAY - 1, hint="the delay over step_s")
        if not self.parameters or len(set(self.parameters)) != len(self.parameters):
            raise ParameterError(
                f'parameters must be "mu", "pretension" or both, got {[str(p) for p in self.parameters]}'
            )
        if len(self.range) != 2 or not 0 < self.range[0] < 1 < self.range[1] <= 3:
            raise ParameterError(
                f"range must be two numbers around 1, > 0 and <= 3, got {list(self.range)}; try [0.5, 2.0]"
            )
