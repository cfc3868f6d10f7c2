"""Result of the identification of a mechanism with several motors, as data and as `fit.json`."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tendonff.compensator.identification.answer.result import Estimate
from tendonff.compensator.identification.measured import Array, Mask
from tendonff.compensator.reporting.results import Result
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenarios import parse_any

DESCRIBED_PERCENT = 10.0
"""A law with a larger RMS error of a torque, in % of its range, does not describe the device."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorsComparison:
    """Measurement and model of one file.

    Attributes
    ----------
    name, role : str
        Of the file; fit or validate.
    time_s : ndarray, shape (rows,)
    torque_N_m, model_N_m : ndarray, shape (rows, motors)
    joint_rad, model_rad : ndarray, shape (rows, joints)
        With the zeros of the encoders; NaN where there is none.
    counted : ndarray of bool, shape (rows,)
        Rows that count: friction has forgotten what was before the file.
    findings : tuple of str
        Data issues.
    """

    name: str
    role: str
    time_s: Array
    torque_N_m: Array
    model_N_m: Array
    joint_rad: Array
    model_rad: Array
    counted: Mask
    findings: tuple[str, ...]

    @property
    def torque_percent(self) -> Array:
        """RMS error of each torque in % of its range, shape (motors,)."""
        off = (self.model_N_m - self.torque_N_m)[self.counted]
        return np.asarray(100 * np.sqrt((off**2).mean(axis=0)) / np.maximum(np.ptp(self.torque_N_m, axis=0), 1e-300))

    @property
    def joint_rms_deg(self) -> Array:
        """RMS error of each joint's angle, shape (joints,); NaN without an encoder."""
        return np.asarray(np.degrees(np.sqrt(((self.model_rad - self.joint_rad)[self.counted] ** 2).mean(axis=0))))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class MotorsIdentification(Result):
    """Everything that logs of several motors identify.

    Attributes
    ----------
    asked : FingerScenario or JointScenario
        The scenario whose numbers were to be identified.
    text : str
        `fitted.toml`: the scenario with the identified values.
    motors, joints : tuple of str
        Their names.
    described : bool
        Whether the law describes the device.
    estimates : tuple of Estimate
        By the keys of the scenario.
    units : tuple of str
        Of the estimates.
    comparisons : tuple of MotorsComparison
    correlation_names, correlation : tuple of str and ndarray, shape (k, k)
        Of the fitted values.
    warnings : tuple of str
    inputs : tuple of Path
        The measured files.
    """

    shown_by: ClassVar[str] = "identification.motors.output"

    asked: FingerScenario | JointScenario
    text: str
    motors: tuple[str, ...]
    joints: tuple[str, ...]
    described: bool
    estimates: tuple[Estimate, ...]
    units: tuple[str, ...]
    comparisons: tuple[MotorsComparison, ...]
    correlation_names: tuple[str, ...]
    correlation: Array
    warnings: tuple[str, ...]
    inputs: tuple[Path, ...]

    def estimate(self, name: str) -> Estimate:
        """The estimate of that key."""
        return next(e for e in self.estimates if e.name == name)

    def of_role(self, role: str) -> tuple[MotorsComparison, ...]:
        """Files that were fitted, or that judge."""
        return tuple(c for c in self.comparisons if c.role == role)

    @property
    def worst_percent(self) -> float:
        """Largest RMS error of a torque in the fitted files, in % of its range."""
        return max(float(c.torque_percent.max()) for c in self.of_role("fit"))

    @property
    def headline(self) -> str:
        """The answer in two sentences."""
        if not self.described:
            return (
                f"The mechanism does not explain the torques: RMS error of one {self.worst_percent:.2g} % of its range."
            )
        friction = [e for e in self.estimates if e.name.endswith(".mu_dynamic") and e.identifiable]
        stiffness = [e for e in self.estimates if e.name.endswith(".stiffness_N_per_m") and e.identifiable]
        parts = [_range("mu", friction, ""), _range("tendon stiffness", stiffness, " N/m")]
        return (
            f"{'; '.join(parts)}. The model explains the motors' torques to {self.worst_percent:.2g} % of their range."
        )

    @property
    def missing(self) -> str:
        """Values that the files do not identify, and the move that would."""
        names = [e for e in self.estimates if not e.identifiable]
        if not names or not self.described:
            return ""
        advice = [e.advice for e in names if e.advice]
        way = f"; most would gain from: {max(set(advice), key=advice.count)}" if advice else ""
        return f"not identifiable (see the report): {', '.join(e.name for e in names)}{way}"

    def as_json(self) -> dict[str, Any]:
        """Contents of `fit.json`."""
        return {
            "schema": 1,
            "law": "whole mechanism",
            "law_describes_the_device": self.described,
            "estimates": {e.name: e.as_json() for e in self.estimates},
            "correlation": {"names": list(self.correlation_names), "matrix": self.correlation.tolist()},
            "files": [
                {
                    "name": c.name,
                    "role": c.role,
                    "torque_percent_of_range": dict(zip(self.motors, c.torque_percent.tolist(), strict=True)),
                    "joint_rms_deg": {
                        name: float(rms) if np.isfinite(rms) else None
                        for name, rms in zip(self.joints, c.joint_rms_deg, strict=True)
                    },
                    "findings": list(c.findings),
                }
                for c in self.comparisons
            ],
            "warnings": list(self.warnings),
        }

    @property
    def scenario(self) -> FingerScenario | JointScenario:
        """The scenario with what was identified put in."""
        found: Any = parse_any(self.text, self.asked.source)
        return found  # type: ignore[no-any-return]

    def lines(self, folder: str = "") -> Sequence[str]:
        """The answer in a few lines of text, its files being in `folder`."""
        return summary_lines(self, folder)

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `fitted.toml`, `fit.json`, figures and `report.html`, all or nothing; makes the folder."""
        self._views.write(self, folder, pdf=pdf)


def _range(label: str, found: Sequence[Estimate], unit: str) -> str:
    """A quantity of all tendons: its range, and the widest interval."""
    if not found:
        return f"{label} not identifiable"
    values = [e.value for e in found]
    half = max((e.interval[1] - e.interval[0]) / 2 / e.value for e in found if e.interval is not None)
    shown = f"{min(values):.3g} to {max(values):.3g}" if len(values) > 1 else f"{values[0]:.3g}"
    return f"{label} = {shown}{unit} (±{100 * half:.2g} % at most)"


def summary_lines(found: MotorsIdentification, folder: str = "") -> Sequence[str]:
    """The answer in a few lines of text, its files being in `folder`."""
    lines = [found.headline]
    lines += [
        f"  {e.name} = {e.value:.5g}  (95 %: {e.interval[0]:.5g} to {e.interval[1]:.5g})"
        for e in found.estimates
        if e.identifiable and e.interval is not None
    ]
    lines += [f"  {line}" for line in (found.missing,) if line]
    return [*lines, *((f"next: {step}",) if (step := next_step(found, folder)) else ())]


def next_step(found: MotorsIdentification, folder: str = "") -> str:
    """Next step, the fitted scenario being in `folder`; empty where nothing explains the torques."""
    if not found.described:
        return ""
    friction = [e for e in found.estimates if e.name.endswith(".mu_dynamic")]
    unknown = [e for e in friction if not e.identifiable]
    if len(unknown) == len(friction):
        way = next((e.advice for e in unknown if e.advice), "strokes of all joints over their range, both ways")
        return f"log {way} (identify --suggest writes such a routine): no mu is known, a design rests on the scenario's"
    return f"tendonff design {(Path(folder) / 'fitted.toml').as_posix()}"
