"""Result of the identification of a joint, as data and as `fit.json`."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tendonff.compensator.identification.answer.result import Estimate
from tendonff.compensator.identification.joint.first_look import FirstLook
from tendonff.compensator.identification.joint.parameters import ANGLE_OR_PUSH, JointNumber
from tendonff.compensator.identification.joint.sensor import SensorFit
from tendonff.compensator.identification.joint.torque import TorqueFit
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.identification.measured.reading import Finding
from tendonff.compensator.reporting.results import Result
from tendonff.compensator.scenario.driven.joint import JointScenario, parse_joint_scenario

DESCRIBED_PERCENT = 10.0
"""A law with a larger RMS error of the torque, in % of its range, does not describe the device."""


NOT_NEEDED = "not needed"
"""End of the advice on a number without which a design is as good."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointComparison:
    """Measurement and model of one file.

    Attributes
    ----------
    name, role : str
        Of the file; fit or validate.
    time_s, motor_rad, torque_N_m, model_N_m : ndarray, shape (rows,)
    joint_rad, model_rad : ndarray or None, shape (rows,)
        Of the joint, with the encoder's zero, where there is one.
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
    joint_rad: Array | None
    model_rad: Array | None
    counted: Mask
    findings: tuple[Finding, ...]

    @property
    def torque_rms_N_m(self) -> float:
        """RMS error of the torque."""
        return _rms((self.model_N_m - self.torque_N_m)[self.counted])

    @property
    def torque_percent(self) -> float:
        """The same in % of its range."""
        return 100 * self.torque_rms_N_m / max(float(np.ptp(self.torque_N_m)), 1e-300)

    @property
    def joint_rms_deg(self) -> float | None:
        """RMS error of the joint's angle; None without an encoder."""
        if self.joint_rad is None or self.model_rad is None:
            return None
        return float(np.degrees(_rms((self.model_rad - self.joint_rad)[self.counted])))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class JointIdentification(Result):
    """Everything that logs of a motor identify of a joint.

    Attributes
    ----------
    asked : JointScenario
        The scenario whose joint was to be identified.
    text : str
        `fitted.toml`: the scenario with the identified values.
    law : str
        Name of the chosen law.
    sensor : SensorFit or None
        Virtual sensor of the joint's angle, where an encoder was logged and the law does not describe the device.
    torque : TorqueFit or None
        Its torque by the same, where that was logged too.
    described : bool
        Whether the law describes the device.
    estimates : tuple of Estimate
        Numbers of the scenario, then what follows from them.
    looks : tuple of FirstLook
        Closed forms of each file.
    comparisons : tuple of JointComparison
        Measurement and model of each file.
    laws : tuple of (str, float, bool)
        Effects that were tried: name, gain of log-likelihood that each promised, and whether it was taken up.
    correlation_names, correlation : tuple of str and ndarray, shape (k, k)
        Of the fitted values.
    values : mapping
        Fitted values by number.
    warnings : tuple of str
        What the user should know.
    inputs : tuple of Path
        The measured files.
    """

    shown_by: ClassVar[str] = "identification.joint.output"

    asked: JointScenario
    text: str
    law: str
    sensor: SensorFit | None
    torque: TorqueFit | None
    described: bool
    estimates: tuple[Estimate, ...]
    looks: tuple[FirstLook, ...]
    comparisons: tuple[JointComparison, ...]
    laws: tuple[tuple[str, float, bool], ...]
    correlation_names: tuple[str, ...]
    correlation: Array
    values: Mapping[JointNumber, float]
    warnings: tuple[str, ...]
    inputs: tuple[Path, ...]

    def estimate(self, name: str) -> Estimate:
        """The estimate of that name."""
        return next(e for e in self.estimates if e.name == name)

    def of_role(self, role: str) -> tuple[JointComparison, ...]:
        """Files that were fitted, or that judge."""
        return tuple(c for c in self.comparisons if c.role == role)

    @property
    def headline(self) -> str:
        """The answer in two sentences."""
        if not self.described:
            worst = max(c.torque_percent for c in self.of_role("fit"))
            if self.sensor is not None:
                parts = [self.sensor.sentence, *(() if self.torque is None else (self.torque.sentence,))]
                return f"Something else loads the joint; {'; '.join(parts)}."
            return f"No law explains the log: the best, {self.law}, leaves {worst:.2g} % of the torque's range."
        parts = [
            _shown(self.estimate(name), label, unit, scale)
            for name, label, unit, scale in (
                ("mu_theta", "mu theta", "", 1.0),
                ("tension_over_stiffness_m", "T/k", " mm", 1e3),
                ("lost_motion_rad", "lost motion", " deg", 180 / np.pi),
                ("motor_friction_N_m", "friction at the motor", " N m", 1.0),
            )
        ]
        percent = max(c.torque_percent for c in self.of_role("fit"))
        return f"{'; '.join(parts)}. The model explains the motor's torque to {percent:.2g} % of its range."

    @property
    def missing(self) -> str:
        """Values that the files do not identify, and the move that would."""
        names = [e for e in self.estimates if not e.identifiable and not e.why.endswith(NOT_NEEDED)]
        advice = [e.advice for e in names if e.advice]
        if not names or not self.described:
            return ""
        way = f"; most would gain from: {max(set(advice), key=advice.count)}" if advice else ""
        return f"not identifiable (see the report): {', '.join(e.name for e in names)}{way}"

    def as_json(self) -> dict[str, Any]:
        """Contents of `fit.json`."""
        return {
            "schema": 1,
            "law": self.law,
            "law_describes_the_device": self.described,
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
                    "torque_rms_N_m": c.torque_rms_N_m,
                    "torque_percent_of_range": c.torque_percent,
                    "joint_rms_deg": c.joint_rms_deg,
                    "findings": [f.text for f in c.findings],
                }
                for c in self.comparisons
            ],
            "warnings": list(self.warnings),
        }

    @property
    def scenario(self) -> JointScenario:
        """The scenario with what was identified put in."""
        return parse_joint_scenario(self.text, self.asked.source)

    def lines(self, folder: str = "") -> Sequence[str]:
        """The answer in a few lines of text, its files being in `folder`."""
        return summary_lines(self, folder)

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `fitted.toml`, `fit.json`, figures, the suggested routine and `report.html`, all or nothing; makes the
        folder.
        """
        self._views.write(self, folder, pdf=pdf)


def _shown(estimate: Estimate, label: str, unit: str, scale: float) -> str:
    if not estimate.identifiable or estimate.interval is None:
        return f"{label} not identifiable"
    half = (estimate.interval[1] - estimate.interval[0]) / 2
    return f"{label} = {scale * estimate.value:.3g}{unit} (+-{100 * half / abs(estimate.value):.2g} %)"


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


def summary_lines(found: JointIdentification, folder: str = "") -> Sequence[str]:
    """The answer in a few lines of text, its files being in `folder`."""
    lines = [found.headline]
    lines += [
        f"  {e.name} = {e.value:.5g}  (95 %: {e.interval[0]:.5g} to {e.interval[1]:.5g})"
        for e in found.estimates
        if e.identifiable and e.interval is not None
    ]
    lines += [f"  {line}" for line in (found.missing,) if line]
    lines.append(f"law: {found.law}")
    return [*lines, *((f"next: {step}",) if (step := next_step(found, folder)) else ())]


def next_step(found: JointIdentification, folder: str = "") -> str:
    """Next step, the fitted scenario being in `folder`; empty where no law explains the log."""
    if not found.described:
        return ""
    if not found.estimate("lost_motion_rad").identifiable:
        return f"{ANGLE_OR_PUSH}; a design rests on the scenario's lost motion until then"
    return f"tendonff design {(Path(folder) / 'fitted.toml').as_posix()}"
