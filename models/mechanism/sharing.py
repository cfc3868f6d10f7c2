"""Rule by which tendons share torques that they could share in many ways."""

from dataclasses import dataclass

from tendonff.models.errors import require


@dataclass(frozen=True, slots=True, kw_only=True)
class Sharing:
    """The least sum of tensions, of which none is too small, with a price on their change.

    Parameters
    ----------
    least_tension_N : float, optional
        Tension at the far end below which no tendon goes that is alone on its motor [N], >= 0. Default 2.
    smooth_N : float, optional
        Width of a smooth barrier above it [N], > 0: tendons that nothing loads keep the sum of both. Default 1.
    change_weight : float, optional
        Price of changing a tension by 1 N within 1 ms, over that of carrying 1 N [-], >= 0. Default 10.
    """

    least_tension_N: float = 2.0
    smooth_N: float = 1.0
    change_weight: float = 10.0

    def __post_init__(self) -> None:
        require("least_tension_N", self.least_tension_N, least=0, hint="a tendon cannot push; try 2")
        require("smooth_N", self.smooth_N, above=0, hint="a quarter of least_tension_N is a good start")
        require("change_weight", self.change_weight, least=0, hint="0 lets tensions jump at reversals")
