"""Answers of an observer: estimates with bounds, and the status of its last step."""

from dataclasses import dataclass
from enum import StrEnum


class ObserverStatus(StrEnum):
    """Something that a step says of itself.

    Attributes
    ----------
    INPUT_HELD
        An input is no number or out of range: the last good estimate is held, and nothing is known of the output.
    SLACK
        The output tension is zero.
    FAILED
        No answer was found: the last estimate is held.
    FAR_MOVED
        Something else than the tendon has moved the far end: the bounds are those of any history.
    """

    INPUT_HELD = "input_held"
    SLACK = "slack"
    FAILED = "failed"
    FAR_MOVED = "far_moved"


_BITS = {
    1: ObserverStatus.INPUT_HELD,
    8: ObserverStatus.SLACK,
    16: ObserverStatus.FAILED,
    512: ObserverStatus.FAR_MOVED,
}


def statuses(bits: int) -> tuple[ObserverStatus, ...]:
    """Meaning of the status bits of the exported observer."""
    return tuple(status for bit, status in _BITS.items() if bits & bit)


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """An estimate with its bounds.

    Attributes
    ----------
    value, low, high : float
        In the unit of what is estimated.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """State of the far end; None for what a scenario does not have.

    Attributes
    ----------
    tension_N : Estimate or None
        Output tension of a tendon [N].
    angle_rad : Estimate or None
        Angle of a joint [rad].
    torque_N_m : Estimate or None
        Torque that the tendons give at the joint [N m].
    """

    tension_N: Estimate | None = None
    angle_rad: Estimate | None = None
    torque_N_m: Estimate | None = None
