"""Result of the identification of driven joints, as data and as `fit.json`."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tendonff.compensator.identification.answer.result import Estimate, FitStatus
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.reading import Finding
from tendonff.compensator.identification.motors.first_look import FirstLook
from tendonff.compensator.identification.motors.parameters import ANGLE_OR_PUSH
from tendonff.compensator.identification.motors.sensor import SensorFit
from tendonff.compensator.identification.motors.torque import TorqueFit
from tendonff.compensator.reporting.results import Result
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenarios import parse_any

DESCRIBED_PERCENT = TUNED.poor_percent
"""A law with a larger RMS error of a torque, in % of its range, does not describe the device."""

NOT_NEEDED = "not needed"
"""End of the advice on a number without which a design is as good."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorsComparison:
    """Measurement and model of one file.

    Attributes
    ----------
    name, role : str
        Of the file; fit or validate.
    time_s : ndarray, shape (rows,)
    motor_rad, torque_N_m, model_N_m : ndarray, shape (rows, motors)
    joint_rad, model_rad : ndarray, shape (rows, joints)
        With the zeros of the encoders; NaN where there is none.
    felt_rad : ndarray, shape (rows, joints)
        Angles of several motors' joints by torques or cells alone, so too; NaN where no spring holds a joint.
    standing_rad : mapping of str to float
        Angles of joints at rest in the file, which no tendon drives.
    exponents : mapping of str to float
        mu theta of each tendon there, of several motors.
    counted : ndarray of bool, shape (rows,)
        Rows that count: friction has forgotten what was before the file.
    findings : tuple of Finding
        Data issues.
    """

    name: str
    role: str
    time_s: Array
    motor_rad: Array
    torque_N_m: Array
    model_N_m: Array
    joint_rad: Array
    model_rad: Array
    felt_rad: Array
    standing_rad: Mapping[str, float]
    exponents: Mapping[str, float]
    counted: Mask
    findings: tuple[Finding, ...]

    @property
    def torque_rms_N_m(self) -> Array:
        """RMS error of each torque, shape (motors,)."""
        return _rms((self.model_N_m - self.torque_N_m)[self.counted])

    @property
    def torque_percent(self) -> Array:
        """The same in % of its range."""
        return np.asarray(100 * self.torque_rms_N_m / np.maximum(np.ptp(self.torque_N_m, axis=0), 1e-300))

    @property
    def joint_rms_deg(self) -> Array:
        """RMS error of each joint's angle, shape (joints,); NaN without an encoder."""
        return np.asarray(np.degrees(_rms((self.model_rad - self.joint_rad)[self.counted])))

    @property
    def felt_rms_deg(self) -> Array:
        """The same by the motors' torques alone, shape (joints,)."""
        return np.asarray(np.degrees(_rms((self.felt_rad - self.joint_rad)[self.counted])))

    @property
    def encoders(self) -> tuple[int, ...]:
        """Numbers of the joints with an encoder."""
        return tuple(np.flatnonzero(np.isfinite(self.joint_rad).all(axis=0)).tolist())


def _rms(rows: Array) -> Array:
    return np.asarray(np.sqrt((rows**2).mean(axis=0)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class MotorsIdentification(Result):
    """Everything that logs of motors identify.

    Attributes
    ----------
    asked : JointScenario or FingerScenario
        The scenario whose numbers were to be identified.
    text : str
        `fitted.toml`: the scenario with the identified values.
    law : str
        Name of the chosen law.
    motors, joints : tuple of str
        Their names; the motor of a loop is "motor".
    described : bool
        Whether the law describes the device.
    estimates : tuple of Estimate
        Numbers, of several motors by their keys in the scenario; then what follows from those of a loop.
    units : mapping of str to str
        Of the estimates.
    comparisons : tuple of MotorsComparison
    correlation_names, correlation : tuple of str and ndarray, shape (k, k)
        Of the fitted values.
    warnings : tuple of str
        What the user should know.
    inputs : tuple of Path
        The measured files.
    laws : tuple of (str, float, bool)
        Effects that were tried: name, gain of log-likelihood that each promised, and whether it was taken up.
    looks : tuple of FirstLook
        Closed forms of each file of a loop.
    sensor : SensorFit or None
        Virtual sensor of the joint's angle, where an encoder was logged and the law does not describe the device.
    torque : TorqueFit or None
        Its torque by the same, where that was logged too.
    """

    shown_by: ClassVar[str] = "identification.motors.output"

    asked: JointScenario | FingerScenario
    text: str
    law: str
    motors: tuple[str, ...]
    joints: tuple[str, ...]
    described: bool
    estimates: tuple[Estimate, ...]
    units: Mapping[str, str]
    comparisons: tuple[MotorsComparison, ...]
    correlation_names: tuple[str, ...]
    correlation: Array
    warnings: tuple[str, ...]
    inputs: tuple[Path, ...]
    laws: tuple[tuple[str, float, bool], ...] = ()
    looks: tuple[FirstLook, ...] = ()
    sensor: SensorFit | None = None
    torque: TorqueFit | None = None

    def estimate(self, name: str) -> Estimate:
        """The estimate of that name."""
        return next(e for e in self.estimates if e.name == name)

    def of_role(self, role: str) -> tuple[MotorsComparison, ...]:
        """Files that were fitted, or that judge."""
        return tuple(c for c in self.comparisons if c.role == role)

    @property
    def worst_percent(self) -> float:
        """Largest RMS error of a torque in the fitted files, in % of its range."""
        return max(float(c.torque_percent.max()) for c in self.of_role("fit"))

    @property
    def status(self) -> FitStatus:
        """Whether a law explains the files."""
        if self.described:
            return FitStatus.DESCRIBED
        return FitStatus.UNEXPLAINED if self.sensor is None else FitStatus.SENSOR

    @property
    def headline(self) -> str:
        """The answer in two sentences."""
        if self.sensor is not None and not self.described:
            parts = [self.sensor.sentence, *(() if self.torque is None else (self.torque.sentence,))]
            return f"Something else loads the joint; {'; '.join(parts)}."
        if not self.described:
            return (
                f"No law explains the log: the best, {self.law}, leaves {self.worst_percent:.2g} % of a torque's range."
            )
        which = "the" if len(self.motors) == 1 else "each"
        explained = f"The model explains {which} motor's torque to {self.worst_percent:.2g} % of its range."
        return f"{'; '.join(_shown(self))}. {explained}"

    @property
    def missing(self) -> str:
        """Values that the files do not identify, and the move that would."""
        names = [e for e in self.estimates if not e.identifiable and not e.why.endswith(NOT_NEEDED)]
        if not names or not self.described:
            return ""
        advice = [e.advice for e in names if e.advice]
        way = f"; most would gain from: {max(set(advice), key=advice.count)}" if advice else ""
        return f"not identifiable (see the report): {', '.join(e.name for e in names)}{way}"

    def as_json(self) -> dict[str, Any]:
        """Contents of `fit.json`."""
        return {
            "schema": 1,
            "law": self.law,
            "law_describes_the_device": self.described,
            "status": str(self.status),
            "estimates": {e.name: e.as_json() for e in self.estimates},
            "correlation": {"names": list(self.correlation_names), "matrix": self.correlation.tolist()},
            "virtual_sensor": None if self.sensor is None else self.sensor.as_json(),
            "virtual_torque_sensor": None if self.torque is None else self.torque.as_json(),
            "first_look": [_look(look) for look in self.looks],
            "effects": [
                {"name": name, "gain_of_log_likelihood": gain, "taken_up": taken} for name, gain, taken in self.laws
            ],
            "files": [
                {
                    "name": c.name,
                    "role": c.role,
                    "torque_rms_N_m": _named(self.motors, c.torque_rms_N_m),
                    "torque_percent_of_range": _named(self.motors, c.torque_percent),
                    "joint_rms_deg": _named(self.joints, c.joint_rms_deg),
                    **(self._of_several(c) if c.exponents else {}),
                    "findings": [f.text for f in c.findings],
                }
                for c in self.comparisons
            ],
            "warnings": list(self.warnings),
        }

    def _of_several(self, file: MotorsComparison) -> dict[str, Any]:
        """Part of a file's entry in `fit.json` that several motors have."""
        return {
            "joint_by_torques_rms_deg": _named(self.joints, file.felt_rms_deg),
            "condition_rad": dict(file.standing_rad),
            "mu_theta": dict(file.exponents),
        }

    @property
    def scenario(self) -> JointScenario | FingerScenario:
        """The scenario with what was identified put in."""
        found: Any = parse_any(self.text, self.asked.source)
        return found  # type: ignore[no-any-return]

    def lines(self, folder: str = "") -> Sequence[str]:
        """The answer in a few lines of text, its files being in `folder`."""
        return summary_lines(self, folder)

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `fitted.toml`, `fit.json`, figures, of a loop the suggested routine, and `report.html`, all or nothing;
        makes the folder.
        """
        self._views.write(self, folder, pdf=pdf)


def _named(names: Sequence[str], values: Array) -> dict[str, float | None]:
    return {name: float(v) if np.isfinite(v) else None for name, v in zip(names, values, strict=True)}


_OF_A_LOOP = (
    ("mu_theta", "mu theta", "", 1.0),
    ("tension_over_stiffness_m", "T/k", " mm", 1e3),
    ("lost_motion_rad", "lost motion", " deg", 180 / np.pi),
    ("motor_friction_N_m", "friction at the motor", " N m", 1.0),
)
_OF_TENDONS = (("mu_dynamic", "mu", ""), ("stiffness_N_per_m", "tendon stiffness", " N/m"))


def _shown(found: MotorsIdentification) -> list[str]:
    """Numbers that follow of a loop; else friction and stiffness of all tendons."""
    by_name = {e.name: e for e in found.estimates}
    if "mu_theta" in by_name:
        return [_range(label, [by_name[n]], unit, scale) for n, label, unit, scale in _OF_A_LOOP]
    return [_range(label, _of(found, key), unit) for key, label, unit in _OF_TENDONS]


def _of(found: MotorsIdentification, key: str) -> list[Estimate]:
    """Estimates of a key of all tendons."""
    return [e for e in found.estimates if e.name.startswith("tendons.") and e.name.endswith(f".{key}")]


def _range(label: str, estimates: Sequence[Estimate], unit: str, scale: float = 1.0) -> str:
    """A quantity of all tendons: its range, and the widest interval."""
    known = [
        (scale * e.value, scale * (e.interval[1] - e.interval[0]) / 2) for e in estimates if e.interval is not None
    ]
    if not known:
        return f"{label} not identifiable"
    values, half = [value for value, _ in known], max(100 * half / abs(value) for value, half in known)
    shown = " to ".join(dict.fromkeys(f"{value:.3g}" for value in (min(values), max(values))))
    return f"{label} = {shown}{unit} (+-{half:.2g} %{' at most' if len(values) > 1 else ''})"


def _look(look: FirstLook) -> dict[str, Any]:
    return {
        "drive_torque_N_m": look.drive_torque_N_m,
        "offset_N_m": look.offset_N_m,
        "mu_theta": look.exponent,
        "tension_over_stiffness_m": look.tension_over_stiffness_m,
        "pushes": [
            {"way": p.way, "touch_rad": p.touch_rad, "kink_rad": p.kink_rad, "slopes_N_m_per_rad": p.slopes_N_m_per_rad}
            for p in look.pushes
        ],
    }


def summary_lines(found: MotorsIdentification, folder: str = "") -> Sequence[str]:
    """The answer in a few lines of text, its files being in `folder`."""
    lines = [found.headline]
    lines += [
        f"  {e.name} = {e.value:.5g}  (95 %: {e.interval[0]:.5g} to {e.interval[1]:.5g})"
        for e in found.estimates
        if e.identifiable and e.interval is not None
    ]
    lines += [f"  {line}" for line in (*_felt(found), found.missing) if line]
    lines.append(f"law: {found.law}")
    return [*lines, *((f"next: {step}",) if (step := next_step(found, folder)) else ())]


def _felt(found: MotorsIdentification) -> Iterator[str]:
    """Angles of joints by torques alone, of files that judge, where an encoder tells how near they come."""
    files = found.of_role("validate") if found.described else ()
    for k, name in enumerate(found.joints):
        if known := [(c.felt_rms_deg, c.joint_rms_deg) for c in files if np.isfinite(c.felt_rms_deg[k])]:
            torques, angles = (max(float(x[k]) for x in each) for each in zip(*known, strict=True))
            yield f"{name} by torques alone to {torques:.2g} deg RMS, by angles of the motors to {angles:.2g} deg"


def next_step(found: MotorsIdentification, folder: str = "") -> str:
    """Next step, the fitted scenario being in `folder`; empty where no law explains the log."""
    if not found.described:
        return ""
    friction = _of(found, "mu_dynamic")
    if friction and not any(e.identifiable for e in friction):
        way = next((e.advice for e in friction if e.advice), "strokes of all joints over their range, both ways")
        return f"log {way} (identify --suggest writes such a routine): no mu is known, a design rests on the scenario's"
    if not friction and not found.estimate("lost_motion_rad").identifiable:
        return f"{ANGLE_OR_PUSH}; a design rests on the scenario's lost motion until then"
    return f"tendonff design {(Path(folder) / 'fitted.toml').as_posix()}"
