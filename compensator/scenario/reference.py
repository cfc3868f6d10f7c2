"""Table [reference]: the desired tension at the far end, one class per kind."""

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

from tendonff.compensator.scenario.checks import require_number
from tendonff.models.errors import ParameterError


class Shape(StrEnum):
    """Course between two waypoints.

    Attributes
    ----------
    LINEAR
        Straight line.
    SMOOTH
        Quintic smooth step: velocity and acceleration are continuous and zero at the waypoints; never overshoots.
    """

    LINEAR = "linear"
    SMOOTH = "smooth"


def _require_tension(name: str, value: float) -> None:
    require_number(name, value, above=0, hint="a tendon cannot push, so the reference must stay above 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class SineReference:
    """T_ref(t) = T0 + min(t/fade_in_s, 1) sum_i amplitudes_N[i] sin(2 pi frequencies_Hz[i] t).

    Parameters
    ----------
    initial_tension_N : float
        Tension T0 at rest and in the middle of the oscillation [N], > 0.
    amplitudes_N : tuple of float
        Amplitude of each sine [N].
    frequencies_Hz : tuple of float
        Frequency of each sine [Hz], > 0; as many as amplitudes.
    duration_s : float
        Length of the reference [s], > 0.
    fade_in_s : float
        Time in which the oscillation grows to its full amplitude [s], >= 0.
    """

    initial_tension_N: float
    amplitudes_N: tuple[float, ...]
    frequencies_Hz: tuple[float, ...]
    duration_s: float
    fade_in_s: float

    def __post_init__(self) -> None:
        _require_tension("initial_tension_N", self.initial_tension_N)
        if not self.amplitudes_N or len(self.amplitudes_N) != len(self.frequencies_Hz):
            raise ParameterError(
                f"amplitudes_N must be as many as frequencies_Hz and at least one, got {len(self.amplitudes_N)} and "
                f"{len(self.frequencies_Hz)}; give one amplitude for each frequency"
            )
        for k, amplitude in enumerate(self.amplitudes_N):
            if not math.isfinite(amplitude):
                raise ParameterError(f"amplitudes_N[{k}] must be a finite number, got {amplitude}; use 0 for none")
        for k, frequency in enumerate(self.frequencies_Hz):
            require_number(f"frequencies_Hz[{k}]", frequency, above=0, hint="leave the sine out if it is not needed")
        require_number("duration_s", self.duration_s, above=0, hint="a few periods of the slowest sine")
        require_number("fade_in_s", self.fade_in_s, least=0, hint="use 0 for none")


@dataclass(frozen=True, slots=True, kw_only=True)
class WaypointReference:
    """Tensions at given times, joined by lines or smooth steps.

    Parameters
    ----------
    times_s : tuple of float
        Times of the waypoints [s], rising from 0.
    tensions_N : tuple of float
        Tension at each of them [N], > 0.
    shape : Shape
        Course between them: linear or smooth.
    initial_tension_N : float, optional
        Tension at rest before the start [N], > 0; default: the first waypoint's.
    """

    times_s: tuple[float, ...]
    tensions_N: tuple[float, ...]
    shape: Shape
    initial_tension_N: float | None = None

    def __post_init__(self) -> None:
        if len(self.times_s) < 2 or len(self.times_s) != len(self.tensions_N):
            raise ParameterError(
                f"times_s must be as many as tensions_N and at least two, got {len(self.times_s)} and "
                f"{len(self.tensions_N)}; give one tension for each time"
            )
        for k, time in enumerate(self.times_s):
            require_number(f"times_s[{k}]", time, least=0, hint="waypoints are counted from the start of the run")
        if self.times_s[0] != 0:
            raise ParameterError(f"times_s must start at 0, got {self.times_s[0]}; the run starts at time 0")
        for earlier, later in pairwise(self.times_s):
            if not later > earlier:
                raise ParameterError(f"times_s must increase, got {later} after {earlier}; sort the waypoints")
        for k, tension in enumerate(self.tensions_N):
            _require_tension(f"tensions_N[{k}]", tension)
        if self.initial_tension_N is not None:
            _require_tension("initial_tension_N", self.initial_tension_N)


@dataclass(frozen=True, slots=True, kw_only=True)
class CsvReference:
    """Samples from a file with the columns time_s, tension_N.

    Parameters
    ----------
    file : str
        Name of the file, relative to the scenario file.
    cutoff_Hz : float, optional
        Corner frequency of a zero-phase low-pass [Hz], > 0; left out, the samples are taken as they are.
    initial_tension_N : float, optional
        Tension at rest before the start [N], > 0; default: the first sample.
    """

    file: str
    cutoff_Hz: float | None = None
    initial_tension_N: float | None = None

    def __post_init__(self) -> None:
        if not self.file.strip() or "\0" in self.file:
            raise ParameterError(f"file must name a CSV file, got {self.file!r}; it is relative to the scenario file")
        if self.cutoff_Hz is not None:
            require_number("cutoff_Hz", self.cutoff_Hz, above=0, hint="leave it out to take the samples as they are")
        if self.initial_tension_N is not None:
            _require_tension("initial_tension_N", self.initial_tension_N)


ReferenceSpec = SineReference | WaypointReference | CsvReference
