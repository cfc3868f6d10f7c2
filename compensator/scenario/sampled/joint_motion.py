"""The joints of a scenario over time."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np

from tendonff.compensator.files.quantities import ANGLE_UNITS, Quantity, read_quantities, time_quantity
from tendonff.compensator.files.reading import FloatArray, suggestion
from tendonff.compensator.files.text import InputError, discreetly, require_named
from tendonff.compensator.scenario.joints import ConstantJoint, CsvJoint, Joint, SineJoint, WaypointJoint
from tendonff.compensator.scenario.reference import along_sines, along_waypoints
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.errors import ParameterError
from tendonff.models.parameters import Transmission
from tendonff.models.path import JointMotion, check_motion


def moved(scenario: Scenario, end_s: float, *, periodic: bool = False) -> Transmission:
    """The scenario's transmission with the motion of its joints until `end_s` [s], which repeats then or not."""
    return replace(scenario.transmission, motion=sample_joints(scenario, end_s, periodic=periodic))


def moved_by_file(scenario: Scenario, path: Path) -> Scenario:
    """The scenario with the motion of its joints from one file: time_s, NAME_rad; InputError where it has none."""
    _need_joints(scenario, "--joints")
    file = str(path.resolve())
    joints: dict[str, Joint] = {k: CsvJoint(file=file, range_rad=v.range_rad) for k, v in scenario.joints.items()}
    return replace(scenario, joints=joints)


def motion_by_file(motion: JointMotion, others: tuple[str, ...], path: Path, end_s: float, file: str) -> JointMotion:
    """Motion whose other joints, those that no tendon drives, move as a file says: time_s, NAME_rad.

    The driven ones stay as they are, at least until `end_s` [s]. InputError where there are no others, or the file has
    no meaning; `file` is the scenario's name.
    """
    if not others:
        raise InputError(
            f"{file}: --joints moves joints that no tendon drives, and there are none; add a table [joints.NAME] and "
            "name it in a section"
        )
    step = float(motion.time_s[1] - motion.time_s[0])
    time = step * np.arange(max(len(motion.time_s), math.ceil(end_s / step - 1e-9) + 1), dtype=np.float64)
    columns = [
        read_motion(path, name, time, end_s) if name in others else np.interp(time, motion.time_s, column)
        for name, column in motion.by_joint.items()
    ]
    return replace(motion, time_s=time, angle_rad=np.column_stack(columns), period_s=None)


class _WithJoints(Protocol):
    """A scenario with joints that no tendon drives."""

    @property
    def source(self) -> Path:
        """The file it was read from."""

    @property
    def joints(self) -> dict[str, Joint]:
        """By name."""


S = TypeVar("S", bound=_WithJoints)


def posed(scenario: S, angles_rad: Mapping[str, float]) -> S:
    """Scenario with joints at constant angles [rad] by name; the others keep its motion.

    InputError where there is no joint of a name.
    """
    _need_joints(scenario, "--pose")
    for name in angles_rad:
        if name not in scenario.joints:
            raise InputError(
                f'{scenario.source.name}: there is no joint "{name}"{suggestion(name, list(scenario.joints))}'
            )
    still = {
        name: ConstantJoint(angle_rad=angle, range_rad=scenario.joints[name].range_rad)
        for name, angle in angles_rad.items()
    }
    return replace(scenario, joints={**scenario.joints, **still})  # type: ignore[type-var]


def _need_joints(scenario: _WithJoints, option: str) -> None:
    if not scenario.joints:
        raise InputError(
            f"{scenario.source.name}: {option} needs joints; add a table [joints.NAME] and name it in a section"
        )


def sample_joints(scenario: Scenario, end_s: float, *, periodic: bool = False) -> JointMotion | None:
    """Angles of all joints at the steps of the run until `end_s` [s], their period or not; None for no joints.

    InputError if a file of motion is too short, or the path has no meaning under the motion.
    """
    transmission, file = scenario.transmission, scenario.source.name
    if not scenario.joints:
        return None
    step = scenario.run.step_s
    time = np.arange(math.ceil(end_s / step - 1e-9) + 1, dtype=np.float64) * step
    folder = scenario.source.parent
    columns = [joint_angles(joint, name, time, folder, end_s) for name, joint in scenario.joints.items()]
    for (name, joint), column in zip(scenario.joints.items(), columns, strict=True):
        _check_range(name, joint, column, file)
    if periodic:
        for (name, joint), column in zip(scenario.joints.items(), columns, strict=True):
            _check_period(name, joint, column, end_s, file)
            column[-1] = column[0]
    names, period = tuple(scenario.joints), end_s if periodic else None
    motion = JointMotion(
        names=names,
        time_s=time,
        angle_rad=np.column_stack(columns),
        period_s=period,
        range_rad=tuple(joint.range_rad for joint in scenario.joints.values()),
    )
    lengths = [section.length_m for section in transmission.path.parts]
    total = None if any(length is None for length in lengths) else math.fsum(x for x in lengths if x is not None)
    try:
        check_motion(transmission.path.parts, total, motion)
    except ParameterError as error:
        raise InputError(f"{file}: {error}") from None
    return motion


def _check_range(name: str, joint: Joint, angle_rad: FloatArray, file: str) -> None:
    """Refuse a motion that leaves the range of its joint."""
    given = joint.range_rad
    if given is not None and not (given[0] <= angle_rad.min() and angle_rad.max() <= given[1]):
        raise InputError(
            f"{file} [joints.{name}]: range_rad = [{given[0]:g}, {given[1]:g}] does not hold its motion, which goes "
            f"from {angle_rad.min():.4g} to {angle_rad.max():.4g} rad; widen it"
        )


def _check_period(name: str, joint: Joint, angle_rad: FloatArray, period_s: float, file: str) -> None:
    """Refuse a joint that is elsewhere after a period of the reference."""
    off = abs(float(angle_rad[-1] - angle_rad[0]))
    fades = isinstance(joint, SineJoint) and joint.fade_in_s > 0
    if fades or off > 1e-6 * max(float(np.ptp(angle_rad)), 1e-9):
        raise InputError(
            f"{file} [joints.{name}]: the reference repeats after {period_s:g} s, the joint starts at "
            f"{angle_rad[0]:.4g} rad and is at {angle_rad[-1]:.4g} rad then; give it whole periods and fade_in_s = 0"
        )


def joint_angles(joint: Joint, name: str, time_s: FloatArray, folder: Path, end_s: float) -> FloatArray:
    """Angles of one joint at instants [rad]; InputError where a file of motion ends before `end_s` [s]."""
    if isinstance(joint, ConstantJoint):
        return np.full(time_s.shape, joint.angle_rad)
    if isinstance(joint, SineJoint):
        amplitudes, frequencies = joint.amplitudes_rad, joint.frequencies_Hz
        return joint.offset_rad + along_sines(amplitudes, frequencies, joint.fade_in_s, time_s, joint.fade)
    if isinstance(joint, WaypointJoint):
        return along_waypoints(joint.times_s, joint.angles_rad, joint.shape, time_s)
    return read_motion(folder / joint.file, name, time_s, end_s)


def read_motion(path: Path, name: str, time_s: FloatArray, end_s: float) -> FloatArray:
    """Angles [rad] of one joint at `time_s` from a file with the columns time_s and NAME_rad.

    InputError where the file is refused, or ends before `end_s` [s].
    """
    from scipy.interpolate import PchipInterpolator  # costs a second to import, and a first look needs none of it

    time, angle = read_angles(path, name)
    if len(time) < 2 or time[-1] < end_s - 1e-9:
        raise InputError(
            f'{path.name}: "{name}" is known from 0 to {time[-1]:g} s, but the run takes from 0 to {end_s:g} s; give a '
            "longer motion or a shorter reference"
        )
    angles: FloatArray = PchipInterpolator(time, angle)(np.minimum(time_s, time[-1]))
    return angles


def read_angles(path: Path, name: str) -> tuple[FloatArray, FloatArray]:
    """Times [s] and angles [rad] of one joint as a file has them, shape (rows,); InputError where it is refused."""
    wanted = (
        time_quantity('a column "time_s" instead of "{}"'),
        Quantity(
            name=f"{name}_rad",
            words=(name.lower(),),
            units=ANGLE_UNITS,
            option=f'a column "{name}_rad" instead of "{{}}"',
        ),
    )
    require_named(path, f"[joints.{name}]: file")
    with discreetly():
        values = read_quantities(path, wanted, starts_at_zero=True).values
    return values["time_s"], values[f"{name}_rad"]
