"""Searches for a number: bounds, size and advice, by the tensions at a tendon's ends or by motors.

Its unit stands at the end of its name.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from tendonff.ocp.fits.chain import Reading
from tendonff.ocp.fits.least_squares import Unknown
from tendonff.ocp.fits.static import StaticParameter
from tendonff.ocp.sensitivity import Parameter as ChainNumber


class Scale(Enum):
    """Unit of a number's bounds and of its size."""

    START = "the start, searched by its logarithm"
    TENSION = "the tension's range for bounds, its mean for sizes"
    ABSOLUTE = "the number's own"


class Role(Enum):
    """When a number is free."""

    CORE = "always"
    TENDON = "where the elongation, or the position of the near end, is explained"
    CONSTANT = "where the data support it"
    LOAD = "where friction that falls with the load explains more than load-independent friction"
    SPEED = "where the data support a dependence on speed"
    KEPT = "never; with the number that it belongs to"
    CELL = "never; found where friction does not act"
    STOP = "where the joint ran into a stop"
    EXTRA = "where the torques of motors support it"
    PARTNER = "beside the number that it belongs to"
    START = "in each log"


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Particulars that every search has.

    Parameters
    ----------
    role : Role
    scale : Scale
        Unit of bounds, step, size and floor.
    low, high : float
        Bounds of the search; for `Scale.START` the second is a factor either way.
    step : float
        Usual step of the search; of the logarithm for `Scale.START`.
    floor : float
        Standard error of the method itself.
    advice : str
        What to measure where the data do not identify it.
    """

    role: Role
    scale: Scale
    low: float
    high: float
    step: float
    floor: float = 0.0
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


@dataclass(frozen=True, slots=True, kw_only=True)
class ByTensions(Search):
    """Search by the tensions, and the positions, at the ends of one tendon.

    Parameters
    ----------
    nudge : float
        Where the search starts if the number may vanish.
    size : float
        What a standard error is judged against; 0 for the value itself.
    alike : float
        Factor by which the scatter between blocks understates the error.
    number : ChainNumber or Reading, optional
        Number of the undivided tendon or of the measurement that it is; None for one that several follow from.
    static : StaticParameter, optional
        What the static laws call it.
    may_vanish : bool
        A law may do without it.

    Notes
    -----
    `floor` is a share of the value, for `Scale.TENSION` of the mean tension. Without an `advice` it is full strokes at
    several loads.
    """

    scale: Scale = Scale.START
    low: float = 0.0
    high: float = 1e3
    step: float = 0.7
    nudge: float = 0.0
    size: float = 0.0
    alike: float = 1.0
    number: ChainNumber | Reading | None = None
    static: StaticParameter | None = None
    may_vanish: bool = False

    @property
    def signed(self) -> bool:
        """The number may be negative."""
        return self.low < 0

    def begun(self, name: str, start: float, span_N: float) -> Unknown:
        """Bounds and step of its search, the output tension's range being `span_N`."""
        return self.unknown(name, start, max(start, self.step) if self.scale is Scale.ABSOLUTE else None, span_N)

    def size_of(self, value: float, mean_N: float) -> float:
        """Scale of its standard error, the mean output tension being `mean_N`."""
        return (self.size * (mean_N if self.scale is Scale.TENSION else 1.0)) or abs(value)

    def floor_of(self, value: float, mean_N: float) -> float:
        """Standard error of the method itself."""
        return self.floor * (mean_N if self.scale is Scale.TENSION else abs(value))


@dataclass(frozen=True, slots=True, kw_only=True)
class ByMotors(Search):
    """Search by what motors feel of joints and their tendons.

    Parameters
    ----------
    shared : str
        Factor that scales it on all tendons alike, which may differ in it otherwise.
    apart : bool
        Each tendon, motor and joint has its own where several motors feel them; else it is searched for as a factor.
    start : float
        Where an extra number starts that the scenario does not have.
    prior, prior_apart : float
        Standard deviation that is known before, of the logarithm; 0 for none. The second of each tendon's own.
    floor_of_friction : float
        Floor as a share of the friction of free strokes, beside which it is seen.
    of_force : bool
        It is a force or torque: known as well as the scale of the measured torque.
    cornered : bool
        Its law has a corner at zero, and so no slope.
    advice_apart : str
        Which move would identify each tendon's or motor's own, by default the same.

    Notes
    -----
    `floor` is a share of what is positive or a force, else in the number's unit.
    """

    scale: Scale = Scale.ABSOLUTE
    low: float = -np.inf
    high: float = np.inf
    step: float = 0.2
    shared: str = ""
    apart: bool = True
    start: float = 0.0
    prior: float = 0.0
    prior_apart: float = 0.0
    floor_of_friction: float = 0.0
    of_force: bool = False
    cornered: bool = False
    advice_apart: str = ""
