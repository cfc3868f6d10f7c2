"""A section of the path, as a user writes it: an arc, a straight or a pulley, which a joint may move."""

import math
from dataclasses import dataclass
from enum import StrEnum

from tendonff.models.errors import ParameterError


class SectionKind(StrEnum):
    """What the tendon touches in a section.

    Attributes
    ----------
    ARC
        A curved guide on which the tendon slides; a straight is an arc of angle zero.
    PULLEY
        A wheel on a bearing that turns with the tendon.
    """

    ARC = "arc"
    PULLEY = "pulley"


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A stretch of the path, from the actuator to the load.

    Parameters
    ----------
    name : str
    angle_rad : float
        Wrap angle at joint angle zero [rad], >= 0.
    length_m : float, optional
        Length at joint angle zero [m], >= 0; default: in proportion to the angles.
    kind : SectionKind, optional
    bearing_exponent : float, optional
        For a pulley: ln(T_in/T_out) at which its bearing turns [-], instead of coefficients.
    mu_dynamic, mu_static, mu_dynamic_release, mu_static_release : float, optional
        Instead of those of the whole [-].
    joint : str, optional
        The joint that moves this section.
    angle_per_rad, length_per_rad_m : float, optional
        Change of wrap angle [rad] and of length [m] per radian of the joint.
    """

    name: str
    angle_rad: float
    length_m: float | None = None
    kind: SectionKind = SectionKind.ARC
    bearing_exponent: float | None = None
    mu_dynamic: float | None = None
    mu_static: float | None = None
    mu_dynamic_release: float | None = None
    mu_static_release: float | None = None
    joint: str | None = None
    angle_per_rad: float = 0.0
    length_per_rad_m: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", SectionKind(self.kind))
        bounded = ("angle_rad", "length_m", "bearing_exponent", "mu_dynamic", "mu_static")
        for name in (*bounded, "mu_dynamic_release", "mu_static_release"):
            value = getattr(self, name)
            if value is not None and not 0 <= value < math.inf:
                raise ParameterError(f'section "{self.name}": {name} must be a finite number >= 0, got {value}')
        for name in ("angle_per_rad", "length_per_rad_m"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise ParameterError(f'section "{self.name}": {name} must be finite, got {value}')
            if value != 0 and self.joint is None:
                raise ParameterError(
                    f'section "{self.name}": {name} = {value:g} needs a joint; name it with joint = "..."'
                )
        if (self.kind is SectionKind.PULLEY) != (self.bearing_exponent is not None):
            raise ParameterError(f'section "{self.name}": bearing_exponent belongs to kind = "pulley", and to it alone')
        if self.kind is SectionKind.PULLEY and self.angle_rad == 0:
            raise ParameterError(f'section "{self.name}": a pulley needs angle_rad > 0, got 0')
        dynamic, static = self.mu_dynamic, self.mu_static
        if dynamic is not None and static is not None and static < dynamic:
            raise ParameterError(f'section "{self.name}": mu_static must be >= mu_dynamic = {dynamic:g}, got {static}')
