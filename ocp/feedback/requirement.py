"""Margins that a design of feedback keeps: light, because scenario files state them."""

from dataclasses import dataclass

from tendonff.models.errors import ParameterError, require


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirement:
    """Margins that every branch must have.

    Parameters
    ----------
    gain_margin : float
        Factor on the gain up to instability [-], > 1.
    phase_margin_deg : float
        Lag up to instability where the loop's gain is 1 [deg], > 0 and < 90.
    """

    gain_margin: float = 2.0
    phase_margin_deg: float = 45.0

    def __post_init__(self) -> None:
        require("gain_margin", self.gain_margin, above=1, hint="2 is usual")
        require("phase_margin_deg", self.phase_margin_deg, above=0, hint="45 is usual")
        if not self.phase_margin_deg < 90:
            raise ParameterError(f"phase_margin_deg must be < 90, got {self.phase_margin_deg}; 45 is usual")
