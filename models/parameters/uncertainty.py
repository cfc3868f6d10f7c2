"""Interval of each number of a system that is not known exactly, and which error over what is possible counts."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

import numpy as np

from tendonff.models.errors import ParameterError, require_whole
from tendonff.models.layout import Array
from tendonff.models.parameters.numbers import FACTORS, is_whole, keys_of, number_of, with_numbers

S = TypeVar("S")


class Objective(StrEnum):
    """Which error over the parameter samples a robust profile makes small."""

    WORST = "worst"  # the largest
    MEAN = "mean"  # the root of the mean square


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Interval of a number of the scenario, or of several that vary together.

    Parameters
    ----------
    keys : tuple of str
        Dotted keys, as `models.parameters.numbers` reads them.
    half_width : float, optional
        Relative half-width [-], > 0 and < 1: 0.2 means within 20 % either way.
    low, high : float, optional
        Ends of the interval instead, in the unit of the keys, which all have the same value; low < high.
    """

    keys: tuple[str, ...]
    half_width: float | None = None
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        name = self.name
        if not self.keys or not all(self.keys):
            raise ParameterError(f'spread "{name}": a key is empty; write "friction.mu_dynamic" = 0.1')
        if self.half_width is not None and (self.low is not None or self.high is not None):
            raise ParameterError(f'spread "{name}": give the relative half-width or [low, high], not both')
        if self.half_width is not None:
            if not 0 < self.half_width < 1:
                raise ParameterError(
                    f'spread "{name}" must be > 0 and < 1, got {self.half_width}; 0.2 means within 20 % either way, '
                    "[low, high] gives the ends themselves"
                )
        elif self.low is None or self.high is None or not -math.inf < self.low < self.high < math.inf:
            raise ParameterError(
                f'spread "{name}" must be a relative half-width or [low, high] with low < high, '
                f"got [{self.low}, {self.high}]"
            )

    @property
    def name(self) -> str:
        """Its keys as they are written in the scenario."""
        return ", ".join(self.keys)

    @property
    def words(self) -> str:
        """Key and width: "mu ±10 %", "actuator.coulomb_N 0 to 15"."""
        if self.half_width is not None:
            return f"{self.name} ±{100 * self.half_width:.3g} %"
        return f"{self.name} {self.low:g} to {self.high:g}"

    def values(self, system: object, place: float) -> dict[str, float]:
        """The numbers at a place in the interval, from −1 (low) over 0 (middle) to 1 (high), by key."""
        if self.half_width is not None:
            factor = 1 + place * self.half_width
            return {key: factor * (number_of(system, key) or 0.0) for key in self.keys}
        low, high = self.low or 0.0, self.high or 0.0
        return dict.fromkeys(self.keys, low + 0.5 * (1 + place) * (high - low))

    def check(self, system: object) -> None:
        """Refuse a key that cannot vary; KeyError where there is none of that name."""
        for key in self.keys:
            value = number_of(system, key)
            if is_whole(system, key):
                raise ParameterError(f'spread "{key}": a whole number cannot be uncertain; leave it out')
            if self.half_width is not None and not value:
                held = "not set" if value is None else "0"
                raise ParameterError(
                    f'spread "{key}": the number is {held}, so that a share of it says nothing; give [low, high]'
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """Correlation of numbers that were measured together, whose intervals are those of 95 % of a normal distribution.

    Parameters
    ----------
    keys : tuple of str
        Intervals by their keys, as [robust.spread] has them.
    rows : tuple of tuple of float
        Correlation of each with each [-], 1 with itself.
    noise : tuple of tuple of float, optional
        The part of `rows` that noise alone makes [-]; the rest of an interval is doubt about the law. Default: all.
    """

    keys: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]
    noise: tuple[tuple[float, ...], ...] | None = None

    def __post_init__(self) -> None:
        count = len(self.keys)
        if count < 2 or len(set(self.keys)) != count:
            raise ParameterError(f"correlation: keys must be two different ones at least, got {list(self.keys)}")
        for name, rows in (("rows", self.rows), ("noise", self.by_noise)):
            if [len(row) for row in rows] != [count] * count:
                raise ParameterError(f"correlation: {name} must be {count} rows of {count} numbers, one for each key")
            matrix = np.array(rows)
            own = np.diag(matrix)
            symmetric = np.allclose(matrix, matrix.T, atol=1e-9) and (np.allclose(own, 1) or name == "noise")
            if not symmetric or own.max() > 1 + 1e-9 or float(np.linalg.eigvalsh(matrix).min()) < -_ROUNDING:
                raise ParameterError(
                    f"correlation: {name} must be symmetric, with {1 if name == 'rows' else 'at most 1'} on the "
                    "diagonal and no negative eigenvalue; copy them from fitted.toml"
                )

    @property
    def by_noise(self) -> tuple[tuple[float, ...], ...]:
        """The part that noise alone makes."""
        return self.rows if self.noise is None else self.noise


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherLaw:
    """Numbers of a law that explains the measurements as well as the one whose numbers the scenario has.

    Parameters
    ----------
    keys : tuple of str
        Dotted keys, as `models.parameters.numbers` reads them.
    values : tuple of float
        One for each.
    """

    keys: tuple[str, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.keys or len(set(self.keys)) != len(self.keys) or len(self.keys) != len(self.values):
            raise ParameterError(
                f"other_law: keys must be different ones, with one value for each; got {len(self.keys)} keys and "
                f"{len(self.values)} values"
            )

    @property
    def numbers(self) -> dict[str, float]:
        """The values by key."""
        return dict(zip(self.keys, self.values, strict=True))

    def of(self, system: S) -> S:
        """The system by this law; ParameterError where it has no such number, or one is out of its bounds."""
        if unknown := [key for key in self.keys if key not in keys_of(system)]:
            raise ParameterError(f'other_law: unknown key "{unknown[0]}"; copy the table from fitted.toml')
        return with_numbers(system, self.numbers)


_ROUNDING = 0.02  # of the rows' decimals, in their least eigenvalue


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """Uncertainty of the parameters; the default is certainty.

    Parameters
    ----------
    mu, stiffness, bristle_stiffness : float, optional
        Relative half-width of the uncertainty of the friction coefficients, of k1 and k2, and of the bristle
        stiffnesses [-], >= 0 and < 1: 0.2 means within 20 % either way. Default 0.
    samples : int, optional
        Number of parameter samples, 1 to 1000, the nominal ones and the extremes of each number among them, which are
        always taken. Default 8.
    objective : Objective, optional
        Worst or mean error over the samples. Default worst.
    seed : int, optional
        Seed of the sampling, >= 0. Default 0.
    spread : tuple of Spread, optional
        Intervals of further numbers of the scenario. Default none.
    correlation : Correlation, optional
        Of intervals that were measured together. Default: each number is uncertain by itself.
    other_law : OtherLaw, optional
        Numbers of another law that the measurements do not exclude. Default none.
    """

    mu: float = 0.0
    stiffness: float = 0.0
    bristle_stiffness: float = 0.0
    samples: int = 8
    objective: Objective = Objective.WORST
    seed: int = 0
    spread: tuple[Spread, ...] = ()
    correlation: Correlation | None = None
    other_law: OtherLaw | None = None

    def __post_init__(self) -> None:
        for name in FACTORS:
            value = getattr(self, name)
            if not (math.isfinite(value) and 0 <= value < 1):
                raise ParameterError(
                    f"{name} must be a finite number >= 0 and < 1, got {value}; 0.2 means within 20 % either way"
                )
        require_whole("samples", self.samples, least=1, most=1000, hint="8 is a good start")
        require_whole("seed", self.seed, least=0, most=2**32 - 1, hint="any number will do")
        keys = [key for spread in self.spreads for key in spread.keys]
        if twice := [key for key in keys if keys.count(key) > 1]:
            raise ParameterError(f'"{twice[0]}" has two spreads; give one')

    def check_correlation(self) -> None:
        """Refuse a correlation of what has no interval."""
        known = [spread.name for spread in self.spreads]
        for key in () if self.correlation is None else self.correlation.keys:
            if key not in known:
                raise ParameterError(f'correlation: "{key}" has no interval in [robust.spread]; give it one there')

    @property
    def spreads(self) -> tuple[Spread, ...]:
        """The intervals of all that is uncertain."""
        widths = {name: getattr(self, name) for name in FACTORS}
        return (
            *(Spread(keys=(name,), half_width=width) for name, width in widths.items() if width > 0),
            *self.spread,
        )

    @property
    def correlated(self) -> tuple[int, ...]:
        """Places among the intervals of those that are correlated."""
        names = [spread.name for spread in self.spreads]
        return () if self.correlation is None else tuple(names.index(key) for key in self.correlation.keys)

    @property
    def correlations(self) -> Array:
        """Correlation of each interval with each, shape (k, k)."""
        matrix, rows = np.eye(len(self.spreads)), list(self.correlated)
        if self.correlation is not None:
            matrix[np.ix_(rows, rows)] = self.correlation.rows
        return matrix

    @property
    def is_certain(self) -> bool:
        """No parameter is uncertain."""
        return not self.spreads
