"""Table [reference]: the desired tension at the far end, one class per kind, and the courses of sines and waypoints."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.scenario.unit import METRE, NEWTON, Unit
from tendonff.models.errors import ParameterError, require, require_given, require_range


class Shape(StrEnum):
    """Course between two waypoints."""

    LINEAR = "linear"
    # quintic smooth step: velocity and acceleration are continuous and zero at the waypoints; never overshoots
    SMOOTH = "smooth"


def _require_tension(name: str, value: float) -> None:
    require(name, value, least=0, hint="a tendon cannot push, so the reference cannot lie below 0")


def require_waypoints(times_s: tuple[float, ...], name: str, values: tuple[float, ...]) -> None:
    """Refuse times that do not rise from 0, or are not as many as the values of that name, at least two."""
    if len(times_s) < 2 or len(times_s) != len(values):
        raise ParameterError(
            f"times_s must be as many as {name} and at least two, got {len(times_s)} and {len(values)}; give one value "
            "for each time"
        )
    for k, time in enumerate(times_s):
        require(f"times_s[{k}]", time, least=0, hint="waypoints are counted from the start of the run")
    if times_s[0] != 0:
        raise ParameterError(f"times_s must start at 0, got {times_s[0]}; the run starts at time 0")
    for earlier, later in pairwise(times_s):
        if not later > earlier:
            raise ParameterError(f"times_s must increase, got {later} after {earlier}; sort the waypoints")


class Hold(StrEnum):
    """Force while the reference rests."""

    EXACT = "exact"  # what the exact inverse asks for, which may let the force go through the whole deadband
    KEEP = "keep"  # it stays: inside the deadband nothing need move


class Quantity(StrEnum):
    """Quantity of the reference at the far end."""

    TENSION = "tension"
    POSITION = "position"  # of the load, relative to the start; the tension follows from the load's own balance


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """Keys common to every kind of reference.

    Attributes
    ----------
    quantity : Quantity
        What is given: a tension, or a position of the load.
    periodic : bool
        Whether it is one period of a periodic reference.
    hold : Hold
        Force while the reference rests.
    least_tension_N : float or None
        Tension to which a lower reference is raised [N], > 0; default: 2 % of the range, where the reference touches 0.
    range_N : tuple of float or None
        Tensions that a live reference may have [N], > 0: low and high. Default: from almost none to the largest that
        the actuator reaches.
    """

    quantity: Quantity = Quantity.TENSION
    periodic: bool = False
    hold: Hold = Hold.EXACT
    least_tension_N: float | None = None
    range_N: tuple[float, ...] | None = None

    def _check(self, tensions: str | None = None, positions: str | None = None) -> None:
        """Check the common keys; of the series of those names exactly that of the reference's quantity is given."""
        require_given("least_tension_N", self.least_tension_N, above=0, hint="a tendon cannot push")
        require_range("range_N", self.range_N)
        if self.range_N is not None:
            require("range_N[0]", self.range_N[0], above=0, hint="a tendon cannot push")
        if self.periodic and self.hold is Hold.KEEP:
            raise ParameterError('hold = "keep" is for references that come to rest; leave it out with periodic = true')
        if tensions is not None and positions is not None:
            wanted, other = (positions, tensions) if self.wants_position else (tensions, positions)
            if getattr(self, wanted) is None:
                raise ParameterError(f'{wanted} is missing: quantity = "{self.quantity}" asks for it')
            if getattr(self, other) is not None:
                raise ParameterError(f'{other} is not for quantity = "{self.quantity}"; give {wanted} alone')
        initial: float | None = getattr(self, "initial_tension_N", None)
        if initial is not None:
            _require_tension("initial_tension_N", initial)
        elif self.wants_position:
            raise ParameterError('initial_tension_N is missing: quantity = "position" counts from a rest under it')

    @property
    def wants_position(self) -> bool:
        """Whether the reference is the load's position."""
        return self.quantity is Quantity.POSITION

    @property
    def unit(self) -> Unit:
        """Unit of its quantity."""
        return METRE if self.wants_position else NEWTON

    @property
    def output(self) -> str:
        """The quantity that follows the reference, in words."""
        return "load position" if self.wants_position else "output tension"


@dataclass(frozen=True, slots=True, kw_only=True)
class SineReference(Request):
    """T_ref(t) = T0 + fade(t) sum_i amplitudes_N[i] sin(2 pi frequencies_Hz[i] t).

    Parameters
    ----------
    initial_tension_N : float
        Tension T0 at rest and in the middle of the oscillation [N], >= 0.
    amplitudes_N, amplitudes_m : tuple of float
        Amplitude of each sine, of the tension [N] or of the load's position [m], according to `quantity`.
    frequencies_Hz : tuple of float
        Frequency of each sine [Hz], > 0; as many as amplitudes.
    duration_s : float
        Length of the reference [s], > 0.
    fade_in_s : float
        Time in which the oscillation grows to its full amplitude [s], >= 0.
    fade : Shape, optional
        Course of that growth: linear, min(t/fade_in_s, 1), or smooth, whose rate has no jump.
    quantity, periodic, hold, least_tension_N, range_N
        As in `Request`.
    """

    initial_tension_N: float
    frequencies_Hz: tuple[float, ...]
    duration_s: float
    fade_in_s: float
    fade: Shape = Shape.LINEAR
    amplitudes_N: tuple[float, ...] | None = None
    amplitudes_m: tuple[float, ...] | None = None

    @property
    def amplitudes(self) -> tuple[float, ...]:
        """Amplitudes of the reference's quantity [N or m]."""
        return (self.amplitudes_m if self.wants_position else self.amplitudes_N) or ()

    def __post_init__(self) -> None:
        self._check("amplitudes_N", "amplitudes_m")
        name = "amplitudes_m" if self.wants_position else "amplitudes_N"
        if not self.amplitudes or len(self.amplitudes) != len(self.frequencies_Hz):
            raise ParameterError(
                f"{name} must be as many as frequencies_Hz and at least one, got {len(self.amplitudes)} and "
                f"{len(self.frequencies_Hz)}; give one amplitude for each frequency"
            )
        for k, amplitude in enumerate(self.amplitudes):
            if not math.isfinite(amplitude):
                raise ParameterError(f"{name}[{k}] must be a finite number, got {amplitude}; use 0 for none")
        for k, frequency in enumerate(self.frequencies_Hz):
            require(f"frequencies_Hz[{k}]", frequency, above=0, hint="leave the sine out if it is not needed")
        require("duration_s", self.duration_s, above=0, hint="a few periods of the slowest sine")
        require("fade_in_s", self.fade_in_s, least=0, hint="use 0 for none")


@dataclass(frozen=True, slots=True, kw_only=True)
class WaypointReference(Request):
    """Tensions at given times, joined by lines or smooth steps.

    Parameters
    ----------
    times_s : tuple of float
        Times of the waypoints [s], rising from 0.
    tensions_N, positions_m : tuple of float
        Tension [N], >= 0, or the load's position relative to the start [m] at each of them, according to `quantity`.
    shape : Shape
        Course between them: linear or smooth.
    initial_tension_N : float, optional
        Tension at rest before the start [N], > 0; default: the first waypoint's.
    quantity, periodic, hold, least_tension_N, range_N
        As in `Request`.
    """

    times_s: tuple[float, ...]
    shape: Shape
    tensions_N: tuple[float, ...] | None = None
    positions_m: tuple[float, ...] | None = None
    initial_tension_N: float | None = None

    @property
    def duration_s(self) -> float:
        """Length of the reference [s]."""
        return self.times_s[-1]

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the reference's quantity [N or m]."""
        return (self.positions_m if self.wants_position else self.tensions_N) or ()

    def __post_init__(self) -> None:
        self._check("tensions_N", "positions_m")
        name = "positions_m" if self.wants_position else "tensions_N"
        require_waypoints(self.times_s, name, self.values)
        for k, value in enumerate(self.values):
            if self.wants_position:
                require(f"positions_m[{k}]", value, hint="it counts from the start at rest")
            else:
                _require_tension(f"tensions_N[{k}]", value)


class Interpolation(StrEnum):
    """Course between two samples of a file."""

    # piecewise cubic Hermite (Fritsch-Carlson): the rate is continuous, and no piece leaves the range of its ends
    MONOTONE = "monotone"
    LINEAR = "linear"  # the rate jumps at every sample


@dataclass(frozen=True, slots=True, kw_only=True)
class CsvReference(Request):
    """Samples from a file with the columns time_s, tension_N.

    Parameters
    ----------
    file : str
        Name of the file, relative to the scenario file.
    cutoff_Hz : float, optional
        Corner frequency of a zero-phase low-pass [Hz], > 0; left out, the samples are taken as they are.
    initial_tension_N : float, optional
        Tension at rest before the start [N], > 0; default: the first sample.
    time_column, tension_column, position_column : str, optional
        Columns of the file; default: time_s and tension_N (position_m), or as their names and units suggest.
    interpolation : Interpolation, optional
        Course between the samples: monotone (default) or linear.
    quantity, periodic, hold, least_tension_N, range_N
        As in `Request`.
    """

    file: str
    cutoff_Hz: float | None = None
    initial_tension_N: float | None = None
    time_column: str | None = None
    tension_column: str | None = None
    position_column: str | None = None
    interpolation: Interpolation = Interpolation.MONOTONE

    def __post_init__(self) -> None:
        self._check()
        if not self.file.strip() or "\0" in self.file:
            raise ParameterError(f"file must name a CSV file, got {self.file!r}; it is relative to the scenario file")
        require_given("cutoff_Hz", self.cutoff_Hz, above=0, hint="leave it out to take the samples as they are")


ReferenceSpec = SineReference | WaypointReference | CsvReference


def along_sines(
    amplitudes: Sequence[float],
    frequencies_Hz: Sequence[float],
    fade_in_s: float,
    time_s: FloatArray,
    fade: Shape = Shape.LINEAR,
) -> FloatArray:
    """fade(t) sum_i a_i sin(2 pi f_i t), in the unit of the amplitudes; the fade rises from 0 to 1 in `fade_in_s`."""
    waves = np.zeros_like(time_s)
    for amplitude, frequency in zip(amplitudes, frequencies_Hz, strict=True):
        waves += amplitude * np.sin(2 * np.pi * frequency * time_s)
    return waves * along_waypoints((0.0, fade_in_s), (0.0, 1.0), fade, time_s) if fade_in_s > 0 else waves


def along_waypoints(
    times_s: Sequence[float], waypoints: Sequence[float], shape: Shape, time_s: FloatArray
) -> FloatArray:
    """A course through waypoints at the times `time_s` [s], held beyond them."""
    times, values, time = np.array(times_s), np.array(waypoints), time_s
    if shape is Shape.LINEAR:
        straight: FloatArray = np.interp(time, times, values)
        return straight
    # 10 u^3 - 15 u^4 + 6 u^5 is the lowest polynomial with zero velocity and acceleration at both ends: the pieces
    # join with two continuous derivatives, and each is monotone, so no piece leaves the range of its two waypoints.
    piece = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2)
    u = np.clip((time - times[piece]) / (times[piece + 1] - times[piece]), 0.0, 1.0)
    result: FloatArray = values[piece] + (values[piece + 1] - values[piece]) * u**3 * (10 - 15 * u + 6 * u * u)
    return result
