"""Unit of a reference and its errors."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """Unit of a reference and its errors.

    Attributes
    ----------
    key : str
        As names of columns and keys have it.
    shown : str
        As figures and tables have it.
    factor : float
        The shown value over the computed one [-].
    """

    key: str
    shown: str
    factor: float = 1.0


NEWTON = Unit(key="N", shown="N")
RADIAN = Unit(key="rad", shown="deg", factor=180 / math.pi)
METRE = Unit(key="m", shown="mm", factor=1e3)
NEWTON_METRE = Unit(key="N_m", shown="N m")
