"""Knobs: numbers of a scenario that the interactive page turns, and over which range."""

import math
from dataclasses import dataclass, replace

from tendonff.compensator.scenario.joints import ConstantJoint, CsvJoint, Joint, SineJoint, WaypointJoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Knob:
    """Slider of the page.

    Attributes
    ----------
    key, title : str
        Dotted key of the number, as in [robust.spread].
    value : float
        Where it starts.
    start, end, step : float
        Its range; of a logarithmic one `start` and `end` are in decades about the value.
    shown : str
        Format of its number.
    is_logarithmic : bool
    scale : float
        The scenario's number over what the slider shows.
    is_set : bool
        The user sets it, such as a limit, so that every design knows it.
    """

    key: str
    title: str
    value: float
    start: float
    end: float
    step: float = 0.01
    shown: str = "0.000"
    is_logarithmic: bool = False
    scale: float = 1.0
    is_set: bool = False

    @classmethod
    def decades(cls, key: str, title: str, value: float, decades: float, *, is_set: bool = False) -> "Knob":
        """A logarithmic one, so many decades either way."""
        return cls(key=key, title=title, value=value, start=-decades, end=decades, is_logarithmic=True, is_set=is_set)

    @classmethod
    def factor(cls, key: str, title: str) -> "Knob":
        """A factor on several numbers."""
        return cls(key=key, title=title, value=1.0, start=0.2, end=2.5, step=0.05, shown="0.00")

    @classmethod
    def tension(cls, key: str, title: str, now: float | None, least: float = 0.1) -> "Knob":
        """A tension [N], from a share of what it is now."""
        now = now or 0.0
        return cls(key=key, title=title, value=now, start=least * now, end=max(4 * now, 10.0), step=0.1, shown="0.0")

    @classmethod
    def weight(cls, joint: str, title: str, now: float) -> "Knob":
        """Torque of the weight at a joint [N m]."""
        most = max(5 * abs(now), 0.1)
        return cls(key=f"joints.{joint}.gravity_N_m", title=title, value=now, start=-most, end=most, step=0.005)


FRICTION_AND_STIFFNESS = (
    Knob.factor("mu", "friction: factor on mu [-]"),
    Knob.factor("stiffness", "tendon stiffness: factor [-]"),
)
"""Of several tendons at once."""


def pose_knobs(joints: dict[str, Joint]) -> dict[str, Knob]:
    """Knob of each joint whose motion was not measured: the angle by which it is turned."""
    return {
        name: Knob(
            key=f"pose of {name}",
            title=f"pose: {name} turned by [deg]",
            value=0.0,
            start=-45.0,
            end=45.0,
            step=1.0,
            shown="0",
            scale=math.radians(1.0),
        )
        for name, joint in joints.items()
        if not isinstance(joint, CsvJoint)
    }


def shifted(joint: Joint, by_rad: float) -> Joint:
    """A joint that does the same about another angle; one whose motion was measured stays."""
    match joint:
        case ConstantJoint():
            return replace(joint, angle_rad=joint.angle_rad + by_rad)
        case SineJoint():
            return replace(joint, offset_rad=joint.offset_rad + by_rad)
        case WaypointJoint():
            return replace(joint, angles_rad=tuple(angle + by_rad for angle in joint.angles_rad))
        case CsvJoint():
            return joint
