"""Table [reference] of a driven joint: a wanted angle, or a wanted torque while the joint's motion is known."""

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError, read_csv
from tendonff.compensator.files.text import require_named
from tendonff.compensator.scenario.reference import Shape, along_sines, along_waypoints, require_waypoints
from tendonff.compensator.scenario.unit import NEWTON_METRE, RADIAN, Unit
from tendonff.models.errors import ParameterError, require


class JointQuantity(StrEnum):
    """Quantity of the reference at the joint.

    Attributes
    ----------
    ANGLE
        Its angle [rad].
    TORQUE
        The torque that it gives to what it touches [N m], while something else decides its motion.
    """

    ANGLE = "joint_angle"
    TORQUE = "joint_torque"


_UNIT = {JointQuantity.ANGLE: RADIAN, JointQuantity.TORQUE: NEWTON_METRE}


@dataclass(frozen=True, slots=True, kw_only=True)
class _JointRequest:
    quantity: JointQuantity = JointQuantity.ANGLE
    periodic: bool = False

    @property
    def shown(self) -> Unit:
        """Unit of the reference, as figures and tables have it."""
        return _UNIT[self.quantity]

    @property
    def unit(self) -> str:
        """Unit of the reference, as names of keys and columns have it."""
        return self.shown.key

    def _one_of(self, stem: str) -> tuple[float, ...]:
        """The series of the reference; that of the other one is refused."""
        other = next(unit.key for unit in _UNIT.values() if unit.key != self.unit)
        names = {"rad": f"{stem}_rad" if stem == "amplitudes" else "angles_rad"}
        names["N_m"] = f"{stem}_N_m" if stem == "amplitudes" else "torques_N_m"
        values: tuple[float, ...] | None = getattr(self, names[self.unit])
        if getattr(self, names[other]) is not None:
            raise ParameterError(
                f'{names[other]} is not for quantity = "{self.quantity}"; give {names[self.unit]} alone'
            )
        if not values:
            raise ParameterError(f'{names[self.unit]} is missing: quantity = "{self.quantity}" asks for it')
        for k, value in enumerate(values):
            if not math.isfinite(value):
                raise ParameterError(f"{names[self.unit]}[{k}] must be a finite number, got {value}; use 0 for none")
        return values


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSine(_JointRequest):
    """offset + fade(t) sum_i amplitudes[i] sin(2 pi frequencies_Hz[i] t), with a fade whose rate has no jumps.

    Parameters
    ----------
    quantity : JointQuantity, optional
        "joint_angle" (default) or "joint_torque".
    periodic : bool, optional
        It is one period of a periodic reference.
    frequencies_Hz : tuple of float
        Frequency of each sine [Hz], > 0.
    duration_s : float
        Length of the reference [s], > 0.
    fade_in_s : float, optional
        Time in which the oscillation grows to its full amplitude [s], >= 0.
    amplitudes_rad, amplitudes_N_m : tuple of float
        Amplitude of each sine, of the reference.
    offset_rad, offset_N_m : float, optional
        Angle or torque at the start and in the middle.
    """

    frequencies_Hz: tuple[float, ...]
    duration_s: float
    fade_in_s: float = 0.0
    amplitudes_rad: tuple[float, ...] | None = None
    amplitudes_N_m: tuple[float, ...] | None = None
    offset_rad: float = 0.0
    offset_N_m: float = 0.0

    def __post_init__(self) -> None:
        amplitudes = self._one_of("amplitudes")
        if len(amplitudes) != len(self.frequencies_Hz):
            raise ParameterError(
                f"frequencies_Hz must be as many as the amplitudes ({len(amplitudes)}), got "
                f"{len(self.frequencies_Hz)}; give one amplitude for each frequency"
            )
        for k, frequency in enumerate(self.frequencies_Hz):
            require(f"frequencies_Hz[{k}]", frequency, above=0, hint="leave the sine out if it is not needed")
        require("duration_s", self.duration_s, above=0, hint="a few periods of the slowest sine")
        require("fade_in_s", self.fade_in_s, least=0, hint="use 0 for none")

    def sample(self, time_s: FloatArray, folder: Path) -> FloatArray:  # noqa: ARG002
        """Values at instants, shape (rows,)."""
        amplitudes = self._one_of("amplitudes")
        offset = self.offset_rad if self.quantity is JointQuantity.ANGLE else self.offset_N_m
        return offset + along_sines(amplitudes, self.frequencies_Hz, self.fade_in_s, time_s, Shape.SMOOTH)

    def length_s(self, folder: Path) -> float:  # noqa: ARG002
        """Length of the reference [s]."""
        return self.duration_s


@dataclass(frozen=True, slots=True, kw_only=True)
class JointWaypoints(_JointRequest):
    """Angles or torques at given times, joined by lines or smooth steps.

    Parameters
    ----------
    quantity : JointQuantity, optional
        "joint_angle" (default) or "joint_torque".
    periodic : bool, optional
        It is one period of a periodic reference.
    times_s : tuple of float
        Times of the waypoints [s], rising from 0.
    angles_rad, torques_N_m : tuple of float
        Values there, of the reference.
    shape : Shape, optional
        Course between them: smooth (default) or linear.
    """

    times_s: tuple[float, ...]
    angles_rad: tuple[float, ...] | None = None
    torques_N_m: tuple[float, ...] | None = None
    shape: Shape = Shape.SMOOTH

    def __post_init__(self) -> None:
        require_waypoints(self.times_s, "the waypoints", self._one_of("waypoints"))

    def sample(self, time_s: FloatArray, folder: Path) -> FloatArray:  # noqa: ARG002
        """Values at instants, shape (rows,)."""
        return along_waypoints(self.times_s, self._one_of("waypoints"), self.shape, time_s)

    def length_s(self, folder: Path) -> float:  # noqa: ARG002
        """Length of the reference [s]."""
        return self.times_s[-1]


@dataclass(frozen=True, slots=True, kw_only=True)
class JointCsv(_JointRequest):
    """Samples from a file with the columns time_s and angle_rad, or torque_N_m.

    Parameters
    ----------
    quantity : JointQuantity, optional
        "joint_angle" (default) or "joint_torque".
    periodic : bool, optional
        It is one period of a periodic reference.
    file : str
        Name of the file, relative to the scenario file.
    """

    file: str

    def _read(self, folder: Path) -> tuple[FloatArray, FloatArray]:
        column = "angle_rad" if self.quantity is JointQuantity.ANGLE else "torque_N_m"
        require_named(folder / self.file, "[reference]: file")
        table = read_csv(folder / self.file, ("time_s", column), increasing="time_s", starts_at_zero=True)
        if len(table["time_s"]) < 2:
            raise InputError(
                f"{self.file}: needs at least two rows, got {len(table['time_s'])}; give a longer reference"
            )
        return table["time_s"], table[column]

    def sample(self, time_s: FloatArray, folder: Path) -> FloatArray:
        """Values at instants, shape (rows,)."""
        time, values = self._read(folder)
        from scipy.interpolate import PchipInterpolator  # a third of a second to import, for a smooth file alone

        found: FloatArray = PchipInterpolator(time, values)(np.minimum(time_s, time[-1]))
        return found

    def length_s(self, folder: Path) -> float:
        """Length of the reference [s]."""
        return float(self._read(folder)[0][-1])


JointReference = JointSine | JointWaypoints | JointCsv
KINDS: dict[str, type[JointReference]] = {"sine": JointSine, "waypoints": JointWaypoints, "csv": JointCsv}
