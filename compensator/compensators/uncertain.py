"""Systems, transmissions or mechanisms of a joint, admitted by the uncertainty that the scenario states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from tendonff.models.joint.parameters.drive import JointDrive
from tendonff.models.parameters import Actuator
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.parameters.uncertainty import Spread, Uncertainty
from tendonff.models.servo import ASSUMED_S, DriveClass

ASSUMED: Final = Uncertainty(mu=0.1, samples=3)
"""Uncertainty where the scenario states none: friction known to 10 % either way."""

TWO_SIDED: Final = 1.96
"""Half of an interval of 95 % over the standard deviation of a normal distribution."""

S = TypeVar("S")
FloatArray = NDArray[np.float64]

UNSTATED: Final = (DriveClass.INDUSTRIAL, DriveClass.DYNAMIXEL, DriveClass.HOBBY_SERVO)
"""Classes, one of which a drive that is not stated may be of."""

_TIMES = ("servo_time_s", "delay_s")
_NAMED = 3  # spreads that a sentence names


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample(Generic[S]):
    """System admitted by the uncertainty.

    Parameters
    ----------
    system : Transmission or Mechanism
    numbers : mapping of str to float, optional
        The numbers that differ from the scenario's, by key; a factor for mu, stiffness and bristle_stiffness. Empty for
        the nominal one.
    """

    system: S
    numbers: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt(Generic[S]):
    """Systems that may be the real one.

    Parameters
    ----------
    system : Transmission or Mechanism
        The nominal one.
    uncertainty : Uncertainty
        Intervals of the numbers that are not known exactly.
    is_assumed : bool
        The scenario states no uncertainty.
    samples : tuple of Sample
        The nominal one, both ends of each interval with all else nominal, then a Sobol sequence over all intervals.
    """

    system: S
    uncertainty: Uncertainty
    is_assumed: bool
    samples: tuple[Sample[S], ...]

    @classmethod
    def of(cls, system: S, uncertainty: Uncertainty, assumed: Uncertainty = ASSUMED) -> "Doubt[S]":
        """Uncertainty of a system; the assumed one where the scenario states none."""
        is_assumed = uncertainty.is_certain or uncertainty.samples == 1
        stated = assumed if is_assumed else uncertainty
        stated = replace(stated, spread=(*stated.spread, *_of_drive(system, stated)))
        samples = sample_systems(system, stated)
        return cls(system=system, uncertainty=stated, is_assumed=is_assumed, samples=samples)

    @property
    def spreads(self) -> tuple[Spread, ...]:
        """Intervals in the order of the samples at their ends."""
        return self.uncertainty.spreads

    def ends(self, k: int) -> tuple[int, int]:
        """Numbers of the two samples at the ends of interval k."""
        return 1 + 2 * k, 2 + 2 * k

    @property
    def other(self) -> Sample[S] | None:
        """The system by another law that the measurements do not exclude; None without one."""
        law = self.uncertainty.other_law
        return None if law is None else Sample(system=law.of(self.system), numbers=law.numbers)

    def at(self, places: Sequence[float]) -> Sample[S]:
        """The sample at a place in each interval, from −1 (low) to 1 (high)."""
        return _sample(self.system, self.spreads, places)

    @property
    def drives_not_stated(self) -> tuple[str, ...]:
        """Places of drives of which no lag, no delay and no class is stated."""
        known = {key for spread in self.spreads for key in spread.keys}
        return tuple(
            place
            for place, each in _drives(self.system).items()
            if each.drive_class is None
            and not any(getattr(each, t) is not None or f"{place}.{t}" in known for t in _TIMES)
        )

    @staticmethod
    def latest_s(kind: DriveClass) -> float:
        """Longest lag and delay of a class together [s]."""
        return sum(high for _, high in ASSUMED_S[kind].values())

    @property
    def widths(self) -> str:
        """The intervals in words: "mu ±10 %"; the first three where there are more."""
        words = [spread.words for spread in self.spreads]
        more = f" and {len(words) - _NAMED} more" if len(words) > _NAMED else ""
        return ", ".join(words[:_NAMED]) + more

    def __str__(self) -> str:
        source = "assumed; set [robust]" if self.is_assumed else "as [robust] states"
        return f"{self.widths} ({source})"


def _of_drive(system: object, stated: Uncertainty) -> list[Spread]:
    """Lag and delay of drives of which the scenario states the class alone, but for those that have an interval.

    Drives of one class lag alike.
    """
    known = {key for spread in stated.spreads for key in spread.keys}
    alike: dict[tuple[str, tuple[float, float]], list[str]] = {}
    for place, drive in _drives(system).items():
        if drive.drive_class is not None:
            for key, interval in ASSUMED_S[DriveClass(drive.drive_class)].items():
                if getattr(drive, key) is None and f"{place}.{key}" not in known:
                    alike.setdefault((key, interval), []).append(f"{place}.{key}")
    return [Spread(keys=tuple(keys), low=low, high=high) for (_, (low, high)), keys in alike.items()]


def _drives(system: object) -> dict[str, Actuator | JointDrive]:
    """Drives of a system by their places in it."""
    found = {table: drive for table in ("actuator", "drive") if (drive := getattr(system, table, None)) is not None}
    return found | {f"motors.{motor.name}.drive": motor.drive for motor in getattr(system, "motors", ())}


def sample_systems(system: S, uncertainty: Uncertainty) -> tuple[Sample[S], ...]:
    """The nominal system, both ends of each interval, then points of a Sobol sequence up to `samples` in all.

    At an end of an interval all else is nominal, but for what is correlated with it: that is where it is then expected.
    """
    nominal, spreads, along = Sample(system=system), uncertainty.spreads, uncertainty.correlations
    ends: list[Sample[S]] = []
    for k in range(len(spreads)):
        moved = np.flatnonzero(along[k]).tolist()
        ends += [_sample(system, [spreads[m] for m in moved], side * along[k, moved]) for side in (-1.0, 1.0)]
    further = draw_systems(system, uncertainty, max(uncertainty.samples - 1 - len(ends), 0))
    return (nominal, *ends, *further)


def draw_systems(system: S, uncertainty: Uncertainty, count: int) -> tuple[Sample[S], ...]:
    """Points of a Sobol sequence over all intervals, shifted by the seed (Cranley, Patterson 1976).

    Numbers that are correlated are drawn from their normal distribution, none beyond its interval.
    """
    spreads = uncertainty.spreads
    if count == 0 or not spreads:
        return ()
    from scipy.stats import qmc  # here, since it takes half a second to import and most commands draw nothing

    points = qmc.Sobol(len(spreads), scramble=False).random_base2((count - 1).bit_length())[:count]
    shifted = (points + np.random.default_rng(uncertainty.seed).random(len(spreads))) % 1.0
    return tuple(_sample(system, spreads, row) for row in drawn_places(uncertainty, shifted))


def drawn_places(uncertainty: Uncertainty, points: FloatArray, *, noise_alone: bool = False) -> FloatArray:
    """Places in the intervals, from −1 to 1, for points of the unit cube, shape (points, intervals) both.

    With `noise_alone` the law by which correlated numbers were found is the right one.
    """
    places = 2 * points - 1
    together, found = list(uncertainty.correlated), uncertainty.correlation
    if found is not None:
        from scipy.special import ndtri

        root = correlation_root(np.array(found.by_noise if noise_alone else found.rows))
        normal = ndtri(np.clip(points[:, together], 1e-12, 1 - 1e-12)) / TWO_SIDED
        places[:, together] = np.clip(normal @ root, -1, 1)
    return places


def correlation_root(correlation: FloatArray) -> FloatArray:
    """Symmetric square root of a correlation, what rounding took below nothing left out."""
    sizes, directions = np.linalg.eigh(correlation)
    root: FloatArray = (directions * np.sqrt(np.clip(sizes, 0, None))) @ directions.T
    return root


def _sample(system: S, spreads: Sequence[Spread], places: Sequence[float] | FloatArray) -> Sample[S]:
    values: dict[str, float] = {}
    for spread, place in zip(spreads, places, strict=True):
        values |= spread.values(system, float(place))
    return Sample(system=with_numbers(system, values), numbers=values)
