"""The record of a number that identification looks for, of whatever part of a mechanism: bounds, size, advice.

Its unit stands at the end of its name.
"""

from dataclasses import dataclass
from enum import Enum

from tendonff.ocp.fits.least_squares import Unknown


class Scale(Enum):
    """Unit of a number's bounds and of its size."""

    START = "the start, searched by its logarithm"
    TENSION = "the tension's range for bounds, its mean for sizes"
    ABSOLUTE = "the number's own"


@dataclass(frozen=True, slots=True, kw_only=True)
class Spec:
    """Particulars that every number has.

    Parameters
    ----------
    scale : Scale
        Unit of bounds, step, size and floor.
    low, high : float
        Bounds of the search; for `Scale.START` the second is a factor either way.
    step : float
        Usual step of the search; of the logarithm for `Scale.START`.
    floor : float
        Standard error of the method itself.
    key : str
        Its place in the scenario, "table.key"; empty where it has none.
    effect : str
        What the law gains with it, for names of laws.
    advice : str
        What to measure where the data do not identify it.
    """

    scale: Scale
    low: float
    high: float
    step: float
    floor: float = 0.0
    key: str = ""
    effect: str = ""
    advice: str = ""

    @property
    def logarithmic(self) -> bool:
        """Searched by its logarithm."""
        return self.scale is Scale.START

    def unknown(self, name: str, start: float, step: float | None = None, span_N: float = 1.0) -> Unknown:
        """Bounds and step of its search, by default the usual one, the tension's range being `span_N`."""
        usual = self.step if step is None else step
        if self.logarithmic:
            at = max(start, 1e-9)
            return Unknown(name=name, start=at, low=at / self.high, high=at * self.high, scale=usual, logarithmic=True)
        size = span_N if self.scale is Scale.TENSION else 1.0
        return Unknown(name=name, start=start, low=size * self.low, high=size * self.high, scale=size * usual)
