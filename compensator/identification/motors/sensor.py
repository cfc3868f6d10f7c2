"""The loop as a virtual sensor: angle of the joint from angle and torque of the motor, whatever loads the joint.

Where something else loads the joint, no mechanism predicts the torque, but the torque determines the elongation of the
tendons. So the law is q = gain theta + compliance T + elongation mean(T along the path) + zero, with the memory of
friction in the mean (`models.joint.quasi_static`). It needs an encoder while it is fitted, and none afterwards.

A memory deeper than the torque's explains strokes from rest, and forgets any other start late or never. So where the
torque at the joint is known, a law whose exponents stay within the torque's is fitted as well, and both are judged on
data left out of the fit, from random starts: that with the narrower interval wins.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from tendonff.compensator.identification.answer.estimate import Estimate
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.log import MotorsLog
from tendonff.compensator.identification.motors.observed import ROW_S, STARTS, estimates_of, solved
from tendonff.models.capstan import CapstanLaw
from tendonff.models.joint.quasi_static import Followed, LoopSensor
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import Solution

SIZE_RAD = 0.01

JUDGED_STARTS, STARTS_WITHIN, SEED = 12, 0.6, 0
"""Random starts in each file that judge a law, within this share of it, beside its first row."""

PARTS = 3
"""A single file is left out in so many parts."""

UNITS = {
    "pull_exponent": "-",
    "release_exponent": "-",
    "preload_N_m": "N m",
    "gain": "-",
    "compliance_rad_per_N_m": "rad/(N m)",
    "elongation_rad_per_N_m": "rad/(N m)",
    "zero_rad": "rad",
}
T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SensorFile:
    """Angle of the joint in a file, by the sensor.

    Attributes
    ----------
    name, role : str
        Of the file; fit or validate.
    time_s, joint_rad, model_rad : ndarray, shape (rows,)
        Time [s], and the joint angle measured and by the sensor [rad].
    low_rad, high_rad : ndarray, shape (rows,)
        Its 95 % interval, nothing being known of the history before the file [rad].
    inside : float
        Share of the rows after random starts whose interval holds the measured angle.
    """

    name: str
    role: str
    time_s: Array
    joint_rad: Array
    model_rad: Array
    low_rad: Array
    high_rad: Array
    inside: float

    @property
    def error_rad(self) -> Array:
        """Predicted less measured, shape (rows,)."""
        return self.model_rad - self.joint_rad


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SensorFit:
    """A fitted virtual sensor.

    Attributes
    ----------
    sensor : LoopSensor
        Torque in N m.
    estimates : tuple of Estimate
    files : tuple of SensorFile
    own_zero_files : tuple of SensorFile
        The same by the sensor fitted with a zero for each file, and with that zero.
    band_rad : float
        What the interval adds on either side of the range over all histories: it then holds 95 % of the rows after
        random starts of files left out of the fit, of a single file of its parts.
    bounded : bool
        The exponents stay within those of the torque.
    """

    sensor: LoopSensor
    estimates: tuple[Estimate, ...]
    files: tuple[SensorFile, ...]
    own_zero_files: tuple[SensorFile, ...]
    band_rad: float
    bounded: bool

    def rms_deg(self, role: str, *, own_zero: bool = False) -> float | None:
        """RMS error over all files of a role, with one zero or with one for each; None without such files."""
        errors = [f.error_rad for f in (self.own_zero_files if own_zero else self.files) if f.role == role]
        return float(np.degrees(np.sqrt(np.mean(np.concatenate(errors) ** 2)))) if errors else None

    def inside_percent(self, role: str) -> float | None:
        """Rows inside the interval after random starts, over all files of a role; None without such files."""
        shares = [f.inside for f in self.files if f.role == role]
        return 100 * float(np.mean(shares)) if shares else None

    def as_json(self) -> dict[str, float | bool | None]:
        """Errors, for `fit.json`."""
        roles = ("fit", "validate")
        errors = {
            f"{role}_rms_deg{'_own_zero' if own else ''}": self.rms_deg(role, own_zero=own)
            for role in roles
            for own in (False, True)
        }
        inside = {f"{role}_inside_percent_from_random_starts": self.inside_percent(role) for role in roles}
        return {
            **errors,
            **inside,
            "band_95_deg": math.degrees(self.band_rad),
            "exponents_within_those_of_the_torque": self.bounded,
        }

    @property
    def sentence(self) -> str:
        """Its error, for the user."""
        role = "validate" if any(f.role == "validate" for f in self.files) else "fit"
        one, own = self.rms_deg(role), self.rms_deg(role, own_zero=True)
        where = "files that were not fitted" if role == "validate" else "the fitted files"
        inside = self.inside_percent(role) or 0.0
        return (
            f"as a virtual sensor the motor gives the joint's angle to {one:.2f} deg RMS on {where}, "
            f"{own:.2f} deg with a zero for each file; once strokes have wiped out what was before, 95 % within "
            f"{math.degrees(self.band_rad):.2g} deg ({inside:.0f} % inside the interval from random starts)"
        )


def fit_sensor(
    logs: Sequence[MotorsLog], judges: Sequence[MotorsLog], torque: Mapping[str, float] | None = None
) -> SensorFit:
    """Fit a virtual sensor to logs that all have the joint's angle; SolveError where none can be.

    `torque` holds the largest exponents of the torque at the joint, where that is known.
    """
    seen = [_thinned(log) for log in logs]
    tried = [_judged(seen, largest) for largest in ({}, *(() if torque is None else (torque,)))]
    best = min(tried, key=lambda law: law.width_rad)
    sensor = _sensor(best.solution.values)
    rows = [("fit", log.name, f) for log, f in zip(logs, seen, strict=True)]
    rows += [("validate", log.name, _thinned(log)) for log in judges]
    centred = _sensor(_solved(seen, best.solution.values, best.largest, own_zero=True).values)
    return SensorFit(
        sensor=sensor,
        estimates=estimates_of(best.solution, "sensor", UNITS, "fit of the virtual sensor"),
        files=tuple(_file(name, role, sensor, f, best.band_rad) for role, name, f in rows),
        own_zero_files=tuple(_file(name, role, _zeroed(centred, f), f, best.band_rad) for role, name, f in rows),
        band_rad=best.band_rad,
        bounded=bool(best.largest),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Judged:
    """A law with the interval that data left out of its fit ask for."""

    largest: Mapping[str, float]  # of the exponents
    solution: Solution
    band_rad: float
    width_rad: float  # half of the interval, the mean


def _judged(files: Sequence["_File"], largest: Mapping[str, float]) -> _Judged:
    solution = _fitted(files, largest)
    parts = list(files) if len(files) > 1 else _parts(files[0])
    beyond, ranges = list[Array](), list[Array]()
    for k, left in enumerate(parts):
        others = _sensor(_solved([f for j, f in enumerate(parts) if j != k], solution.values, largest).values)
        outside, wide = zip(*_from_starts(others, left, _beyond), strict=True)
        beyond.append(np.concatenate(outside))
        ranges.append(np.concatenate(wide))
    band = float(np.quantile(np.concatenate(beyond), 0.95))
    width = band + float(np.mean(np.concatenate(ranges))) / 2
    return _Judged(largest=largest, solution=solution, band_rad=band, width_rad=width)


def _parts(file: "_File") -> list["_File"]:
    """A single file in parts, which count as files."""
    time, drum, torque, joint = (np.array_split(column, PARTS) for column in file)
    return list(zip(time, drum, torque, joint, strict=True))


def _beyond(sensed: Followed, joint_rad: Array) -> tuple[Array, Array]:
    """Distance of the measured angle from the range over all histories, and the range's width."""
    outside = np.maximum(np.maximum(sensed.low_rad - joint_rad, joint_rad - sensed.high_rad), 0.0)
    return outside, sensed.high_rad - sensed.low_rad


def _from_starts(sensor: LoopSensor, file: "_File", of: Callable[[Followed, Array], T]) -> list[T]:
    """Results of `of` on the sensor's answer and the measured angle, from the first row on and from random ones."""
    _, drum, torque, joint = file
    draw = np.random.default_rng(SEED)
    starts = draw.integers(0, max(int(STARTS_WITHIN * len(drum)), 1), JUDGED_STARTS)
    return [of(sensor.follow(drum[k:], torque[k:]), joint[k:]) for k in (0, *starts.tolist())]


def _zeroed(sensor: LoopSensor, file: "_File") -> LoopSensor:
    """The sensor with the zero of a file."""
    _, drum, torque, joint = file
    off = float(np.mean(sensor.angle_rad(drum, torque) - joint))
    return replace(sensor, zero_rad=sensor.zero_rad - off)


def _file(name: str, role: str, sensor: LoopSensor, file: "_File", band_rad: float) -> SensorFile:
    time, drum, torque, joint = file
    sensed = sensor.follow(drum, torque)
    held = _from_starts(sensor, file, lambda answer, there: _beyond(answer, there)[0] <= band_rad)
    return SensorFile(
        name=name,
        role=role,
        time_s=time,
        joint_rad=joint,
        model_rad=sensed.angle_rad,
        low_rad=sensed.low_rad - band_rad,
        high_rad=sensed.high_rad + band_rad,
        inside=float(np.mean(np.concatenate(held))),
    )


_File = tuple[Array, Array, Array, Array]


def _thinned(log: MotorsLog) -> _File:
    """Time, motor's angle as read, torque and the joint's angle at rows `ROW_S` apart."""
    if not log.encoders.all():
        raise SolveError(f"{log.name}: no angle of the joint")
    every = max(1, round(ROW_S / log.run.step_s))
    motor = log.run.motor_rad[:, 0] + log.zero_rad
    return log.time_s[::every], motor[::every], log.torque_N_m[::every, 0], log.joint_rad[::every, 0]


def _sensor(values: Mapping[str, float]) -> LoopSensor:
    """Sensor of values; without a zero, one of none."""
    return LoopSensor(
        law=CapstanLaw(
            pull_exponent=values["pull_exponent"],
            release_exponent=values["release_exponent"],
            adhesion_N=values["preload_N_m"],
        ),
        gain=values["gain"],
        compliance=values["compliance_rad_per_N_m"],
        elongation=values["elongation_rad_per_N_m"],
        zero_rad=values.get("zero_rad", 0.0),
    )


def _fitted(files: Sequence[_File], largest: Mapping[str, float]) -> Solution:
    """The best of several starts, whose linear numbers are those of least squares."""
    torque = np.concatenate([f[2] for f in files])
    preload = 0.8 * float(np.ptp(torque))
    tried = []
    for exponent in STARTS:
        memory = {n: min(exponent, largest.get(n, np.inf)) for n in ("pull_exponent", "release_exponent")}
        memory["preload_N_m"] = preload
        rows = np.vstack([_columns(memory, f) for f in files])
        joint = np.concatenate([f[3] for f in files])
        linear, *_ = np.linalg.lstsq(rows, joint, rcond=None)
        names = ("gain", "compliance_rad_per_N_m", "elongation_rad_per_N_m", "zero_rad")
        start = {**memory, **dict(zip(names, linear.tolist(), strict=True))}
        tried.append(_solved(files, start, largest))
    return min(tried, key=lambda s: s.cost)


def _columns(memory: Mapping[str, float], file: _File) -> Array:
    """Columns of the linear numbers."""
    _, drum, torque, _ = file
    plain = {"gain": 0.0, "compliance_rad_per_N_m": 0.0, "elongation_rad_per_N_m": 1.0, "zero_rad": 0.0}
    mean = _sensor({**memory, **plain}).angle_rad(drum, torque)
    return np.column_stack([drum, torque, mean, np.ones(len(drum))])


def _solved(
    files: Sequence[_File], start: Mapping[str, float], largest: Mapping[str, float], *, own_zero: bool = False
) -> Solution:
    def errors(values: Mapping[str, float]) -> Array:
        sensor = _sensor(values)
        found = [sensor.angle_rad(f[1], f[2]) - f[3] for f in files]
        return np.concatenate([e - e.mean() if own_zero else e for e in found]) / SIZE_RAD

    free = {n: value for n, value in start.items() if not (own_zero and n == "zero_rad")}
    return solved(free, errors, [f[0] for f in files], largest=largest)
