"""[joints.NAME]: what the joints of a moving path do, and its sampling."""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.reference import Shape
from tendonff.compensator.scenario.tables import read_table, show
from tendonff.models.errors import ParameterError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tendonff.compensator.scenario.scenario import Scenario
    from tendonff.models.parameters import Transmission
    from tendonff.models.path import JointMotion


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantJoint:
    """A joint that stands still.

    Parameters
    ----------
    angle_rad : float
        Its angle [rad].
    """

    angle_rad: float

    def __post_init__(self) -> None:
        _finite("angle_rad", (self.angle_rad,))


@dataclass(frozen=True, slots=True, kw_only=True)
class SineJoint:
    """offset + min(t/fade_in_s, 1) sum_i a_i sin(2 pi f_i t).

    Parameters
    ----------
    offset_rad : float
        Angle at the start [rad].
    amplitudes_rad : tuple of float
        a_i [rad].
    frequencies_Hz : tuple of float
        f_i [Hz], as many.
    fade_in_s : float
        Time in which the swing grows to its full size [s].
    """

    offset_rad: float = 0.0
    amplitudes_rad: tuple[float, ...] = ()
    frequencies_Hz: tuple[float, ...] = ()
    fade_in_s: float = 0.0

    def __post_init__(self) -> None:
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
class WaypointJoint:
    """Angles at instants.

    Parameters
    ----------
    times_s : tuple of float
        Instants [s], from 0, strictly increasing.
    angles_rad : tuple of float
        Angles there [rad].
    shape : Shape
        "linear" between them, or "smooth".
    """

    times_s: tuple[float, ...]
    angles_rad: tuple[float, ...]
    shape: Shape = Shape.SMOOTH

    def __post_init__(self) -> None:
        _finite("times_s", self.times_s)
        _finite("angles_rad", self.angles_rad)
        if len(self.times_s) != len(self.angles_rad) or len(self.times_s) < 2:
            raise ParameterError(
                f"angles_rad must be as many as times_s ({len(self.times_s)}), at least 2, got {len(self.angles_rad)}"
            )
        if self.times_s[0] != 0 or any(b <= a for a, b in zip(self.times_s, self.times_s[1:], strict=False)):
            raise ParameterError(f"times_s must begin at 0 and rise strictly, got {list(self.times_s)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class CsvJoint:
    """Angles from a file with the columns time_s and NAME_rad, linear between rows.

    Parameters
    ----------
    file : str
        CSV file, relative to the scenario.
    """

    file: str


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
    """The tables [joints.NAME].

    Parameters
    ----------
    raw : object
        What tomllib read.
    file : str
        For messages.

    Raises
    ------
    InputError
    """
    if not isinstance(raw, Mapping):
        raise InputError(f"{file}: joints must be a table of tables, got {show(raw)}; write [joints.NAME]")
    joints: dict[str, Joint] = {}
    for name, table in raw.items():
        where = f"joints.{name}"
        if not name.isidentifier():
            raise InputError(
                f'{file} [{where}]: the name of a joint must be letters, digits and underscores, got "{name}"'
            )
        kind = table.get("kind") if isinstance(table, Mapping) else None
        if kind not in KINDS:
            kinds = ", ".join(f'"{k}"' for k in KINDS)
            raise InputError(f"{file} [{where}]: kind must be one of {kinds}, got {show(kind)}")
        joints[name] = read_table(KINDS[kind], table, file=file, table=where, extra_keys=("kind",))
    return joints


def sample_joints(scenario: "Scenario", end_s: float) -> "JointMotion | None":
    """Angles of all joints of a scenario over time, at the steps of its run.

    Parameters
    ----------
    scenario : Scenario
    end_s : float
        Until when [s].

    Returns
    -------
    JointMotion or None
        None where the scenario has no joints.

    Raises
    ------
    InputError
        If a file of motion is too short, or the path has no meaning under the motion.
    """
    import numpy as np

    from tendonff.models.path import JointMotion, check_motion

    transmission, file = scenario.transmission, scenario.source.name
    if not scenario.joints:
        return None
    step = scenario.run.step_s
    time = np.arange(math.ceil(end_s / step - 1e-9) + 1, dtype=np.float64) * step
    columns = [_angles(joint, name, time, scenario.source, end_s) for name, joint in scenario.joints.items()]
    motion = JointMotion(names=tuple(scenario.joints), time_s=time, angle_rad=np.column_stack(columns))
    lengths = [section.length_m for section in transmission.path.parts]
    total = None if any(length is None for length in lengths) else math.fsum(x for x in lengths if x is not None)
    try:
        check_motion(transmission.path.parts, total, motion)
    except ParameterError as error:
        raise InputError(f"{file}: {error}") from None
    return motion


def _angles(
    joint: Joint, name: str, time_s: "NDArray[np.float64]", source: str | os.PathLike[str], end_s: float
) -> "NDArray[np.float64]":
    import numpy as np

    if isinstance(joint, ConstantJoint):
        return np.full(time_s.shape, joint.angle_rad)
    if isinstance(joint, SineJoint):
        pairs = zip(joint.amplitudes_rad, joint.frequencies_Hz, strict=True)
        swing = sum(a * np.sin(2 * np.pi * f * time_s) for a, f in pairs)
        fade = np.minimum(time_s / joint.fade_in_s, 1.0) if joint.fade_in_s > 0 else np.ones(time_s.shape)
        angles: NDArray[np.float64] = joint.offset_rad + fade * swing
        return angles
    if isinstance(joint, WaypointJoint):
        from tendonff.compensator.scenario.sampling import along_waypoints

        return along_waypoints(joint.times_s, joint.angles_rad, joint.shape, time_s)
    return read_motion(Path(source).parent / joint.file, name, time_s, end_s)


def read_motion(
    path: str | os.PathLike[str], name: str, time_s: "NDArray[np.float64]", end_s: float
) -> "NDArray[np.float64]":
    """Angles of one joint from a CSV file with the columns time_s and NAME_rad.

    Parameters
    ----------
    path : path-like
    name : str
        Of the joint.
    time_s : ndarray
        Where they are wanted [s].
    end_s : float
        Until when the motion must be known [s].

    Raises
    ------
    InputError
        If a column is missing, a value is no number, or the motion is too short.
    """
    import numpy as np
    import pandas as pd

    file = Path(path)
    column = f"{name}_rad"
    try:
        table = pd.read_csv(file)
    except (OSError, ValueError) as error:
        raise InputError(f"{file.name}: cannot be read as CSV: {error}") from None
    for wanted in ("time_s", column):
        if wanted not in table.columns:
            raise InputError(f'{file.name}: column "{wanted}" is missing; it has {", ".join(map(str, table.columns))}')
    values = table[["time_s", column]].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    if not np.isfinite(values).all() or len(values) < 2 or not (np.diff(values[:, 0]) > 0).all():
        raise InputError(
            f"{file.name}: time_s must rise strictly and both columns be finite numbers, two rows at least"
        )
    if values[0, 0] > 1e-9 or values[-1, 0] < end_s - 1e-9:
        raise InputError(
            f'{file.name}: "{name}" is known from {values[0, 0]:g} to {values[-1, 0]:g} s, but the run takes from 0 '
            f"to {end_s:g} s; give a longer motion or a shorter reference"
        )
    angles: NDArray[np.float64] = np.interp(time_s, values[:, 0], values[:, 1])
    return angles


def moved(scenario: "Scenario", end_s: float) -> "Transmission":
    """The scenario's transmission with the motion of its joints.

    Parameters
    ----------
    scenario : Scenario
    end_s : float
        Until when the motion must be known [s].
    """
    return replace(scenario.transmission, motion=sample_joints(scenario, end_s))
