"""Self-tuning of a joint: the loops between which its tuner runs, and the numbers of its recursion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.joint import JointScenario, SampledJoint
from tendonff.compensator.scenario.driven.reference import JointQuantity
from tendonff.models.errors import ParameterError
from tendonff.models.joint.closed_form import GrossSliding, data_sheet
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.adaptation.joint import JointTunable, JointTuning


@dataclass(frozen=True, slots=True, kw_only=True)
class TunedJoint:
    """A loop whose inverse runs at the bounds of a factor beside its own, and the numbers of its recursion.

    Attributes
    ----------
    low, high : JointScenario
        The scenario with the factor at its bounds.
    tuning : JointTuning
    """

    low: JointScenario
    high: JointScenario
    tuning: JointTuning

    @classmethod
    def of(cls, scenario: JointScenario, sampled: SampledJoint) -> "TunedJoint":
        """Tuner of a scenario with [adaptation]; InputError where the joint's angle identifies nothing."""
        settings, mechanism, file = scenario.adaptation, scenario.mechanism, scenario.source.name
        if settings is None:
            raise InputError(f'{file}: table [adaptation] is missing; sensor = "joint_angle" is all it needs')
        if mechanism.drive.kind is not DriveKind.LOOP or len(mechanism.tendons) != 2:
            raise InputError(
                f"{file} [adaptation]: self-tuning is for a loop, whose lost motion the joint's angle identifies; a "
                "pair has none, leave the table out"
            )
        if scenario.reference.quantity is JointQuantity.TORQUE:
            raise InputError(
                f"{file} [adaptation]: self-tuning is for a reference of angle; where a torque is wanted leave it out"
            )
        start = float(sampled.angle_rad[0])
        low, high = settings.range
        law = GrossSliding.of(
            mechanism, start, {k: float(v[0]) for k, v in sampled.others(mechanism.joint.name).items()}
        )
        try:
            tuning = JointTuning.of(
                low=low,
                high=high,
                ratio=abs(mechanism.drum_radius_m[0] / mechanism.drive.gear_ratio / mechanism.arms_at(start)[0]),
                span_rad=sampled.range,
                lost_motion_rad=data_sheet(law, 1.0).lost_motion_rad,
                noise_rad=settings.noise,
                delay_samples=settings.delay_samples,
                step_s=scenario.run.step_s,
            )
        except ParameterError as error:
            raise InputError(f"{file} [adaptation]: {error}") from None
        return cls(
            low=_at(scenario, settings.parameters, low), high=_at(scenario, settings.parameters, high), tuning=tuning
        )


def with_factor(mechanism: Mechanism, parameters: Sequence[JointTunable], factor: float) -> Mechanism:
    """The mechanism with a factor on what is tuned."""
    given = {"mu": factor} if JointTunable.MU in parameters else {}
    if JointTunable.PRETENSION in parameters:
        given["drive.pretension_N"] = factor * (mechanism.drive.pretension_N or 0.0)
    return with_numbers(mechanism, given)


def _at(scenario: JointScenario, parameters: Sequence[JointTunable], factor: float) -> JointScenario:
    return replace(scenario, mechanism=with_factor(scenario.mechanism, parameters, factor))
