"""[joints.NAME]: what the joints of a moving path do."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.reference import Shape, require_waypoints
from tendonff.compensator.scenario.tables import read_kind, show
from tendonff.models.errors import ParameterError, require_range


@dataclass(frozen=True, slots=True, kw_only=True)
class _Live:
    """Key of every joint."""

    range_rad: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantJoint(_Live):
    """Joint at a constant angle.

    Parameters
    ----------
    angle_rad : float
        Its angle [rad].
    range_rad : tuple of float, optional
        Angles that are accepted live [rad]: low and high. Default: what the path admits, up to a turn.
    """

    angle_rad: float

    def __post_init__(self) -> None:
        require_range("range_rad", self.range_rad)
        _finite("angle_rad", (self.angle_rad,))


@dataclass(frozen=True, slots=True, kw_only=True)
class SineJoint(_Live):
    """offset + fade(t) sum_i a_i sin(2 pi f_i t).

    Parameters
    ----------
    offset_rad : float
        Angle at the start [rad].
    amplitudes_rad : tuple of float
        Amplitudes a_i of the sines [rad].
    frequencies_Hz : tuple of float
        Frequencies f_i of the sines [Hz], as many.
    fade_in_s : float
        Time in which the swing grows to its full size [s].
    fade : Shape, optional
        Course of that growth: linear, min(t/fade_in_s, 1), or smooth, whose rate has no jump.
    range_rad : tuple of float, optional
        Angles that are accepted live [rad]: low and high. Default: what the path admits, up to a turn.
    """

    offset_rad: float = 0.0
    amplitudes_rad: tuple[float, ...] = ()
    frequencies_Hz: tuple[float, ...] = ()
    fade_in_s: float = 0.0
    fade: Shape = Shape.LINEAR

    def __post_init__(self) -> None:
        require_range("range_rad", self.range_rad)
        _finite("offset_rad", (self.offset_rad,))
        _finite("amplitudes_rad", self.amplitudes_rad)
        _finite("frequencies_Hz", self.frequencies_Hz)
        if len(self.amplitudes_rad) != len(self.frequencies_Hz) or not self.amplitudes_rad:
            raise ParameterError(
                f"frequencies_Hz must be as many as amplitudes_rad ({len(self.amplitudes_rad)}) and at least one, got "
                f"{len(self.frequencies_Hz)}"
            )
        if not 0 <= self.fade_in_s < math.inf:
            raise ParameterError(f"fade_in_s must be a finite number >= 0, got {self.fade_in_s}")


@dataclass(frozen=True, slots=True, kw_only=True)
class WaypointJoint(_Live):
    """Angles at instants.

    Parameters
    ----------
    times_s : tuple of float
        Instants [s], from 0, strictly increasing.
    angles_rad : tuple of float
        Angles there [rad].
    shape : Shape
        "linear" between them, or "smooth".
    range_rad : tuple of float, optional
        Angles that are accepted live [rad]: low and high. Default: what the path admits, up to a turn.
    """

    times_s: tuple[float, ...]
    angles_rad: tuple[float, ...]
    shape: Shape = Shape.SMOOTH

    def __post_init__(self) -> None:
        require_range("range_rad", self.range_rad)
        _finite("times_s", self.times_s)
        _finite("angles_rad", self.angles_rad)
        require_waypoints(self.times_s, "angles_rad", self.angles_rad)


@dataclass(frozen=True, slots=True, kw_only=True)
class CsvJoint(_Live):
    """Angles from a file with the columns time_s and NAME_rad, or NAME in degrees; smooth between rows.

    Parameters
    ----------
    file : str
        CSV file, relative to the scenario.
    range_rad : tuple of float, optional
        Angles that are accepted live [rad]: low and high. Default: what the path admits, up to a turn.
    """

    file: str

    def __post_init__(self) -> None:
        require_range("range_rad", self.range_rad)


Joint = ConstantJoint | SineJoint | WaypointJoint | CsvJoint
KINDS: dict[str, type[Joint]] = {
    "constant": ConstantJoint,
    "sine": SineJoint,
    "waypoints": WaypointJoint,
    "csv": CsvJoint,
}


def _finite(name: str, values: tuple[float, ...]) -> None:
    for value in values:
        if not math.isfinite(value):
            raise ParameterError(f"{name} must be finite, got {value}")


def read_joints(raw: object, file: str) -> dict[str, Joint]:
    """The tables [joints.NAME], from what tomllib read; InputError where they are wrong."""
    if not isinstance(raw, Mapping):
        raise InputError(f"{file}: joints must be a table of tables, got {show(raw)}; write [joints.NAME]")
    joints: dict[str, Joint] = {}
    for name, table in raw.items():
        where = f"joints.{name}"
        if not name.isidentifier():
            raise InputError(
                f'{file} [{where}]: the name of a joint must be letters, digits and underscores, got "{name}"'
            )
        joints[name] = read_kind(KINDS, table, file=file, table=where)
    return joints
