"""Torque at the joint of a loop from angle and torque of the motor, whatever loads the joint.

Where something else loads the joint, its torque follows from the motor's by friction alone: the capstan law with the
loop's pre-tension, behind a drive that is sprung (`models.joint.quasi_static.LoopTorque`). It needs the torque at the
joint while it is fitted, and none afterwards.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from tendonff.compensator.identification.answer.estimate import Estimate
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.motors.log import MotorsLog
from tendonff.compensator.identification.motors.observed import ROW_S, STARTS, estimates_of, solved
from tendonff.models.capstan import CapstanLaw
from tendonff.models.joint.quasi_static import LoopTorque
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import Solution

SLID_SHARE = 0.02
"""Share of the motor's range after which a loop is taken to slide."""

_SIZE_SHARE = 0.01  # of the torque's range: size of an error
UNITS = {
    "pull_exponent": "-",
    "release_exponent": "-",
    "preload_N_m": "N m",
    "spring_N_m_per_rad": "N m/rad",
    "offset_N_m": "N m",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TorqueFile:
    """Torque at the joint in a file.

    Attributes
    ----------
    name, role : str
        Of the file; fit or validate.
    time_s, joint_N_m, model_N_m : ndarray, shape (rows,)
        Time [s], and the torque measured and by the law [N m].
    """

    name: str
    role: str
    time_s: Array
    joint_N_m: Array
    model_N_m: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TorqueFit:
    """A fitted law of the torque.

    Attributes
    ----------
    law : LoopTorque
        Torques in N m.
    estimates : tuple of Estimate
    files : tuple of TorqueFile
    band_N_m : float or None
        Half-width that holds 95 % of the rows of another file, with a confidence of 95 %; None of a single file.
    """

    law: LoopTorque
    estimates: tuple[Estimate, ...]
    files: tuple[TorqueFile, ...]
    band_N_m: float | None

    def rms_N_m(self, role: str) -> float | None:
        """RMS error over all files of a role; None without such files."""
        errors = [f.model_N_m - f.joint_N_m for f in self.files if f.role == role]
        return float(np.sqrt(np.mean(np.concatenate(errors) ** 2))) if errors else None

    def as_json(self) -> dict[str, float | None]:
        """Errors, for `fit.json`."""
        found = {f"{role}_rms_N_m": self.rms_N_m(role) for role in ("fit", "validate")}
        return {**found, "band_95_N_m": self.band_N_m}

    @property
    def largest_exponents(self) -> dict[str, float]:
        """Upper ends of the intervals of the exponents, by name."""
        ends = {e.name.removeprefix("torque_"): e.interval for e in self.estimates}
        found = {name: (ends[name], getattr(self.law.law, name)) for name in ("pull_exponent", "release_exponent")}
        return {name: value if ends is None else ends[1] for name, (ends, value) in found.items()}

    @property
    def sentence(self) -> str:
        """Its error, for the user."""
        role = "validate" if any(f.role == "validate" for f in self.files) else "fit"
        where = "files that were not fitted" if role == "validate" else "the fitted files"
        span = float(np.ptp(np.concatenate([f.joint_N_m for f in self.files if f.role == role])))
        error = self.rms_N_m(role) or 0.0
        band = "" if self.band_N_m is None else f", 95 % within {self.band_N_m:.2g} N m"
        return f"its torque to {error:.2g} N m RMS ({100 * error / span:.2g} % of range) on {where}{band}"


_File = tuple[Array, Array, Array, Array, Mask]


def fit_torque(logs: Sequence[MotorsLog], judges: Sequence[MotorsLog]) -> TorqueFit:
    """Fit the law to logs that all have the torque at the joint; SolveError where it cannot be."""
    seen = [_thinned(log) for log in logs]
    slid_rad = SLID_SHARE * max(float(np.ptp(f[1])) for f in seen)
    solution = _fitted(seen, slid_rad)
    band = None
    if len(seen) > 1:
        left: list[Array] = []
        for k, file in enumerate(seen):
            others = _solved([f for j, f in enumerate(seen) if j != k], solution.values, slid_rad)
            _, drum, torque, joint, _ = file
            left.append(_law(others.values, slid_rad).torque(drum, torque) - joint)
        band = half_width(left)
    law = _law(solution.values, slid_rad)
    rows = [("fit", log.name, f) for log, f in zip(logs, seen, strict=True)]
    rows += [("validate", log.name, _thinned(log)) for log in judges]
    return TorqueFit(
        law=law,
        estimates=estimates_of(solution, "torque", UNITS, "fit of the torque at the joint"),
        files=tuple(
            TorqueFile(name=name, role=role, time_s=t, joint_N_m=joint, model_N_m=law.torque(drum, torque))
            for role, name, (t, drum, torque, joint, _) in rows
        ),
        band_N_m=band,
    )


def half_width(left: Sequence[Array]) -> float:
    """Half-width that holds 95 % of the rows of another file, from errors in files that were left out of the fit.

    Rows of a file err together, most of all under a load that no other file has: the scatter is known no better than
    from as many values as there are files, so it is taken at its upper 95 % limit (a tolerance interval).
    """
    scatter = len(left) / float(chi2.ppf(0.05, len(left)))
    return float(np.quantile(np.abs(np.concatenate(left)), 0.95) * np.sqrt(scatter))


def _thinned(log: MotorsLog) -> _File:
    """Time, motor's angle as read, its torque and that at the joint, at rows `ROW_S` apart, and which count."""
    if log.joint_torque_N_m is None:
        raise SolveError(f"{log.name}: no torque at the joint")
    every = max(1, round(ROW_S / log.run.step_s))
    motor = log.run.motor_rad[:, 0] + log.zero_rad
    return (
        log.time_s[::every],
        motor[::every],
        log.torque_N_m[::every, 0],
        log.joint_torque_N_m[::every],
        log.counted[::every],
    )


def _errors(law: LoopTorque, file: _File) -> Array:
    """Law less measured at the rows that what was before does not touch."""
    _, drum, torque, joint, counted = file
    return (law.torque(drum, torque) - joint)[counted]


def _law(values: Mapping[str, float], slid_rad: float) -> LoopTorque:
    return LoopTorque(
        law=CapstanLaw(
            pull_exponent=values["pull_exponent"],
            release_exponent=values["release_exponent"],
            adhesion_N=values["preload_N_m"],
        ),
        spring=values["spring_N_m_per_rad"],
        offset=values["offset_N_m"],
        slid_rad=slid_rad,
    )


def _fitted(files: Sequence[_File], slid_rad: float) -> Solution:
    """The best of several starts."""
    torque = np.concatenate([f[2] for f in files])
    tried = []
    for exponent in STARTS:
        memory = {"pull_exponent": exponent, "release_exponent": exponent, "preload_N_m": 0.6 * float(np.ptp(torque))}
        plain = _law({**memory, "spring_N_m_per_rad": 0.0, "offset_N_m": 0.0}, slid_rad)
        off = -np.concatenate([_errors(plain, f) for f in files])
        rows = np.column_stack([np.concatenate([f[1][f[4]] for f in files]), np.ones(len(off))])
        (spring, offset), *_ = np.linalg.lstsq(rows, off, rcond=None)
        start = {**memory, "spring_N_m_per_rad": float(spring), "offset_N_m": float(offset)}
        tried.append(_solved(files, start, slid_rad))
    return min(tried, key=lambda s: s.cost)


def _solved(files: Sequence[_File], start: Mapping[str, float], slid_rad: float) -> Solution:
    size = _SIZE_SHARE * float(np.ptp(np.concatenate([f[3] for f in files])))

    def errors(values: Mapping[str, float]) -> Array:
        law = _law(values, slid_rad)
        return np.concatenate([_errors(law, f) for f in files]) / size

    return solved(start, errors, [f[0][f[4]] for f in files])
