"""Kinds of a runtime, and the status of its last step; light, and free of anything that compiles."""

from enum import StrEnum

from tendonff.models.choice import Choice


class RuntimeKind(Choice):
    """Compensator that a runtime runs, named as its module of exported C.

    Attributes
    ----------
    INVERSE
        The exact inverse.
    STREAM
        The same behind a filter, for references that arrive live.
    ADAPTIVE
        The exact inverse, of one tendon or of a joint, that tunes itself to a measurement ([adaptation]).
    JOINT
        The inverse of driven joints between tendons, one or several.
    """

    INVERSE = "inverse"
    STREAM = "stream"
    ADAPTIVE = "adaptive"
    JOINT = "joint"


class RuntimeStatus(StrEnum):
    """Something that a step says of itself.

    Attributes
    ----------
    INPUT_HELD
        Reference, time or angle is no number, or an angle jumped: the last good command is held.
    RANGE
        Reference or angle is a number out of `Runtime.ranges` (another unit?): held like INPUT_HELD; a stream takes it
        to the end of the range.
    FORCE_LIMITED
        A limit of the actuator's force binds.
    RATE_LIMITED
        The force rate limit binds.
    TORQUE_LIMITED
        The motor would have to give more than `torque_max_N_m`; nothing is changed.
    SPEED_LIMITED
        `speed_max_rad_per_s` binds.
    WOULD_PUSH
        A tendon would have to push.
    FAILED
        No answer was found: the last command is held.
    SLACK
        A tendon of a loop hangs loose.
    FROZEN
        The model does not explain the measurement: safe values hold.
    AT_BOUND
        An estimate is at an end of its range.
    DOUBT
        More stays unexplained than a good model leaves.
    PAUSE
        The time since the last call is a pause (milliseconds?): the rig is taken to stand where it was.
    """

    INPUT_HELD = "input_held"
    RANGE = "range"
    FORCE_LIMITED = "force_limited"
    RATE_LIMITED = "rate_limited"
    TORQUE_LIMITED = "torque_limited"
    SPEED_LIMITED = "speed_limited"
    WOULD_PUSH = "would_push"
    FAILED = "failed"
    SLACK = "slack"
    FROZEN = "frozen"
    AT_BOUND = "at_bound"
    DOUBT = "doubt"
    PAUSE = "pause"


_TENDON = {
    1: RuntimeStatus.INPUT_HELD,
    2: RuntimeStatus.FORCE_LIMITED,
    4: RuntimeStatus.RATE_LIMITED,
    8: RuntimeStatus.WOULD_PUSH,
    16: RuntimeStatus.FAILED,
    64: RuntimeStatus.FROZEN,
    128: RuntimeStatus.AT_BOUND,
    256: RuntimeStatus.DOUBT,
    1024: RuntimeStatus.RANGE,
}
_JOINT = _TENDON | {2: RuntimeStatus.TORQUE_LIMITED, 4: RuntimeStatus.SPEED_LIMITED, 32: RuntimeStatus.SLACK}


def statuses(bits: int, *, driven: bool) -> tuple[RuntimeStatus, ...]:
    """Meaning of the status bits of exported C, of a driven joint or of one tendon."""
    known = _JOINT if driven else _TENDON
    return tuple(status for bit, status in known.items() if bits & bit)
