"""Measurements and tuned parameters of a self-tuning inverse, and the numbers of its recursion."""

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from tendonff.models.errors import ParameterError

MAX_PARAMETERS = 2
MAX_DELAY = 64

# Found by the study in docs/adaptation.md; shares are of the range that the measured quantity covers.
MODEL_ERROR_SHARE = 0.005
WATCH_SHARE = 0.035
LOST_SHARE = 0.07
FULL_SPEED_PER_S = 0.3
CORRELATION_S = 0.2
DRIFT_PER_S = 1.2e-3
START_DEVIATION = 0.3
SLEW_PER_S = 2.0
QUICK_S = 0.02
SLOW_S = 0.5
LONG_S = 0.1
HOLD_SPANS = 2.0
REST_S = 0.3
SIGNIFICANT = 4.0  # standard deviations of a mean over `LONG_S` that noise alone hardly ever makes
GATE = 0.01
"""Share of full speed below which nothing is learnt."""

DOUBTED = 1.44
"""Mean square of what is unexplained, in squares of what a good model leaves, from which on it is said."""

EXPLAINED = 1 / 3
"""Share of its gain with which the integral acts where nothing is unexplained: there it adds noise and delay only."""

PEAK = 1.5
"""Ratio of the residual over `QUICK_S` to its mean over `SLOW_S` from which the former counts."""


UNKNOWN_EXPONENT = 0.2
"""Standard deviation of the load exponent at the start where none is stated; polymers have 0.1 to 0.33."""

STATED_EXPONENT = 0.06
"""Where one is stated."""


class Sensor(StrEnum):
    """Measured quantity."""

    OUTPUT_TENSION = "output_tension"  # f_{N+1} [N]
    ACTUATOR_POSITION = "actuator_position"  # q_a relative to the start [m]

    @property
    def unit(self) -> str:
        """Unit of the measurement."""
        return "N" if self is Sensor.OUTPUT_TENSION else "m"

    @property
    def words(self) -> str:
        """Name in a sentence."""
        return "the output tension" if self is Sensor.OUTPUT_TENSION else "the actuator's position"


class Tunable(StrEnum):
    """Tuned parameters, each as a factor on the scenario's value."""

    MU = "mu"  # all friction coefficients
    # MU_PULL, MU_RELEASE: those of one direction
    MU_PULL = "mu_pull"
    MU_RELEASE = "mu_release"
    LOAD_STIFFNESS = "load_stiffness"  # k_l, with the load's spring anchored at the tension of the start
    TENDON_STIFFNESS = "tendon_stiffness"  # k1 and k2
    LOAD_EXPONENT = "load_exponent"  # n of friction that falls with the load: 1 more of the factor is 1 more of n


class Nuisance(StrEnum):
    """Nuisance parameters of the position: estimated beside the factors, and used for nothing else.

    Each has a slope of the predicted position that needs no tangent, in quasi-static motion.
    """

    OFFSET = "offset"  # of the zero, in spans: start tension, creep, a stretched tendon
    LOAD = "load"  # relative change of the load's travel
    TENDON = "tendon"  # relative change of the tendon's elongation


SPREADS = {Nuisance.OFFSET: 0.05, Nuisance.LOAD: 0.2, Nuisance.TENDON: 0.2}
"""Standard deviation of each at the start."""


def check_parameters(parameters: tuple[Tunable, ...]) -> None:
    """Refuse a set of parameters that the recursion cannot separate or has no room for."""
    names = ", ".join(parameters)
    if not 1 <= len(parameters) <= MAX_PARAMETERS or len(set(parameters)) != len(parameters):
        raise ParameterError(
            f"parameters must be one name or two different ones, got {len(parameters)}, [{names}]: the recursion tunes "
            'no more than two; ["mu"] suits most rigs, ["mu", "load_stiffness"] those whose load is not well known'
        )
    friction = {Tunable.MU, Tunable.MU_PULL, Tunable.MU_RELEASE} & set(parameters)
    if not friction:
        raise ParameterError(f'parameters must tune the friction, got [{names}]; add "mu"')
    if Tunable.MU in friction and len(friction) > 1:
        raise ParameterError(
            f'parameters must not tune "mu" and a part of it, got [{names}]; use mu_pull and mu_release'
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """The numbers of the recursion, per sample of the controller.

    Attributes
    ----------
    sensor : Sensor
        Sensor that the recursion learns from.
    parameters : tuple of Tunable
        One or two.
    delay_samples : int
        Age of a measurement when it arrives, 0 to 63.
    joint_delay_samples : int
        Age of the joint angles when they arrive, 0 to 63.
    lowest, highest : float
        Bounds of every factor [-].
    variance : float
        R: variance that one sample at full speed counts for, unit of the sensor squared.
    deviation : float
        Residual that noise and a good model leave, unit of the sensor.
    full_speed : float
        Change of the predicted measurement per sample from which on a sample counts in full, unit of the sensor.
    drift_variance : float
        Random walk of a factor per sample at full speed [-].
    start_deviation : float
        Standard deviation of a factor at the start, and the largest later on [-].
    slew : float
        Largest change of the inverse's factors per sample [-].
    quick, slow : float
        Shares by which the mean of the error, and that of what is unexplained of it, follow a sample at full speed
        [-].
    long_share : float
        Share by which a mean follows a sample at any speed [-].
    watch_level : float
        Mean square of what is unexplained at which the model counts as wrong, in squares of `deviation` [-].
    lost_level : float
        Where it says nothing any more.
    hold_travel : float
        Path of the prediction over which an estimate must hold before it counts as safe, unit of the sensor.
    rest_samples : int
        Samples of a rest that allows a new start.
    integral_gain : float
        Share of the logarithmic error that is integrated per sample [-]; 0 for none.
    drift_level : float
        Mean of the error that noise alone may make, unit of the sensor.
    noise, span, step_s : float
        What the others were computed from: noise and range of the measurement, unit of the sensor, and h [s].
    """

    sensor: Sensor
    parameters: tuple[Tunable, ...]
    delay_samples: int
    joint_delay_samples: int
    lowest: float
    highest: float
    variance: float
    deviation: float
    full_speed: float
    drift_variance: float
    start_deviation: float
    slew: float
    quick: float
    slow: float
    long_share: float
    watch_level: float
    lost_level: float
    hold_travel: float
    rest_samples: int
    integral_gain: float
    drift_level: float
    noise: float
    span: float
    step_s: float

    def __post_init__(self) -> None:
        check_parameters(self.parameters)
        if not 0 <= self.delay_samples < MAX_DELAY:
            raise ParameterError(
                f"delay_samples must be a whole number from 0 to {MAX_DELAY - 1}, got {self.delay_samples}; "
                "a longer delay leaves too little to learn from"
            )
        if not 0 < self.lowest < 1 < self.highest < math.inf:
            raise ParameterError(
                f"range must hold 1 between two numbers > 0, got [{self.lowest}, {self.highest}]; try [0.5, 2.0]"
            )

    @classmethod
    def of(
        cls,
        *,
        sensor: Sensor,
        parameters: tuple[Tunable, ...],
        delay_samples: int,
        noise: float,
        span: float,
        step_s: float,
        lowest: float = 0.5,
        highest: float = 2.0,
        integral_gain_per_s: float = 0.0,
        joint_delay_samples: int = 0,
    ) -> "Tuning":
        """Numbers from what is known about the sensor and the reference.

        Parameters
        ----------
        noise : float
            Standard deviation of the sensor, its unit.
        span : float
            Range that the measured quantity covers along the reference, unit of the sensor, > 0.
        integral_gain_per_s : float, optional
            Needs the output tension.
        """
        if not 0 < span < math.inf:
            raise ParameterError(
                f"the measured quantity must move along the reference, got a span of {span} {sensor.unit}; "
                "a constant reference teaches nothing"
            )
        if integral_gain_per_s > 0 and sensor is not Sensor.OUTPUT_TENSION:
            raise ParameterError(
                f'integral_gain_per_s must be 0 with sensor = "{sensor}", got {integral_gain_per_s}; '
                "it needs the output tension"
            )
        deviation = math.hypot(noise, MODEL_ERROR_SHARE * span)
        return cls(
            sensor=sensor,
            parameters=parameters,
            delay_samples=delay_samples,
            joint_delay_samples=joint_delay_samples,
            lowest=lowest,
            highest=highest,
            variance=deviation**2 * max(CORRELATION_S / step_s, 1.0),
            deviation=deviation,
            full_speed=FULL_SPEED_PER_S * span * step_s,
            drift_variance=DRIFT_PER_S * step_s,
            start_deviation=START_DEVIATION,
            slew=SLEW_PER_S * step_s,
            quick=min(step_s / QUICK_S, 1.0),
            slow=min(step_s / SLOW_S, 1.0),
            long_share=(long := min(step_s / LONG_S, 1.0)),
            watch_level=((WATCH_SHARE * span + 2 * noise) / deviation) ** 2,
            lost_level=((LOST_SHARE * span + 2 * noise) / deviation) ** 2,
            hold_travel=HOLD_SPANS * span,
            rest_samples=max(round(REST_S / step_s), 1),
            integral_gain=integral_gain_per_s * step_s,
            drift_level=SIGNIFICANT * noise * math.sqrt(long / (2 - long)),
            noise=noise,
            span=span,
            step_s=step_s,
        )

    @property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """Nuisance parameters of the sensor; one that is tuned as a factor is none."""
        if self.sensor is Sensor.OUTPUT_TENSION or Tunable.MU not in self.parameters:
            return ()
        tuned = {Tunable.LOAD_STIFFNESS: Nuisance.LOAD, Tunable.TENDON_STIFFNESS: Nuisance.TENDON}
        return tuple(n for n in Nuisance if n not in {tuned.get(p) for p in self.parameters})

    def with_integral_gain(self, gain_per_s: float) -> "Tuning":
        """The same with another integral action; 0 for none."""
        return replace(self, integral_gain=gain_per_s * self.step_s)
