"""Result of an identification, of one tendon or of the motors of any mechanism: as data, in words, as `fit.json`."""

import math
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from tendonff.compensator.identification.answer.estimate import EXPONENTS, Estimate
from tendonff.compensator.identification.answer.records import CandidateLaw, Channel, Effect, FileResult
from tendonff.compensator.identification.fitting.sliding import SectionFriction, SlidingRatio
from tendonff.compensator.identification.fitting.uncertainty import ByFile
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.first_look import FirstLook
from tendonff.compensator.identification.motors.sensor import SensorFit
from tendonff.compensator.identification.motors.torque import TorqueFit
from tendonff.compensator.identification.parameters import ANGLE_OR_PUSH
from tendonff.compensator.reporting.results import Result
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import CapstanLaw

S = TypeVar("S", bound=Scenario | JointScenario | FingerScenario)

RULE = (
    "the simplest law whose error on held-out data is within 2 % of the least; a further value is kept where it "
    "reduces that error significantly"
)
"""Choice of a law of one tendon."""

NOT_NEEDED = "not needed"
"""End of the advice on a number without which a design is as good."""


class FitStatus(StrEnum):
    """Outcome of an identification."""

    DESCRIBED = "described"
    SENSOR = "virtual sensor"  # no law of the mechanism explains the files, a virtual sensor does
    UNEXPLAINED = "no law explains the files"

    @property
    def is_unexplained(self) -> bool:
        """Nothing in `fitted.toml` comes from the files."""
        return self is FitStatus.UNEXPLAINED


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Identification(Result, Generic[S]):
    """Everything that a set of measurements identifies of a scenario.

    What the channels of the files do not tell is empty, or None.

    Attributes
    ----------
    asked : Scenario, JointScenario or FingerScenario
        The scenario whose numbers were to be identified.
    how : Measurement
        How the files were to be read.
    scenario : Scenario, JointScenario or FingerScenario
        The scenario with the identified values.
    explain : Explain or None
        Channel of one tendon that the law explains; None for the torques of motors.
    law : str
        Name of the chosen law.
    described : bool
        It describes the device.
    estimates : tuple of Estimate
        Every value, fitted or kept; those of several motors by their keys in the scenario.
    correlation_names : tuple of str
        Names of the fitted values.
    correlation : Array
        Shape (k, k); correlations of the fitted values.
    files : tuple of FileResult
        Errors and data issues of each file.
    channels : tuple of Channel
        Measurement and law.
    fit_percent, validation_percent : float, float or None
        RMS error over all files of that role in percent of their common range, of motors the largest of a torque in
        percent of its range; None without validation files.
    warnings : tuple of str
        What the user should know.
    inputs : tuple of Path
        The measured files.
    suggests : bool
        The fitted scenario suggests what to log next: of a tendon, the tensions are of its size; of motors, a loop is
        described.
    laws : tuple of CandidateLaw
        Candidate laws, compared.
    effects : tuple of Effect
        Effects of motors that were tried.
    replay_percent, replay_validation_percent : float or None
        RMS error of `scenario`, simulated again over the files that were fitted, or judge, % of range; None where no
        law describes the device.
    sliding : tuple of SlidingRatio
        Logarithmic ratio of the tensions, by direction.
    by_file : tuple of ByFile
        Estimates by each of several files alone.
    output_delay_s : float or None
        How much later the output is read than the input.
    sections : tuple of SectionFriction
        Friction between tension cells, where there are more than two.
    looks : tuple of FirstLook
        Closed forms of each file of a loop.
    sensor : SensorFit or None
        Virtual sensor of the joint's angle, where an encoder was logged and no law describes the device.
    torque : TorqueFit or None
        Its torque by the same, where that was logged too.
    """

    shown_by: ClassVar[str] = "identification.answer.output"

    asked: S
    how: Measurement
    scenario: S
    explain: Explain | None
    law: str
    described: bool
    estimates: tuple[Estimate, ...]
    correlation_names: tuple[str, ...]
    correlation: Array
    files: tuple[FileResult, ...]
    channels: tuple[Channel, ...]
    fit_percent: float
    validation_percent: float | None
    warnings: tuple[str, ...]
    inputs: tuple[Path, ...]
    suggests: bool = True
    laws: tuple[CandidateLaw, ...] = ()
    effects: tuple[Effect, ...] = ()
    replay_percent: float | None = None
    replay_validation_percent: float | None = None
    sliding: tuple[SlidingRatio, ...] = ()
    by_file: tuple[ByFile, ...] = ()
    output_delay_s: float | None = None
    sections: tuple[SectionFriction, ...] = ()
    looks: tuple[FirstLook, ...] = ()
    sensor: SensorFit | None = None
    torque: TorqueFit | None = None

    @property
    def status(self) -> FitStatus:
        """Whether a law explains the files."""
        if self.described:
            return FitStatus.DESCRIBED
        return FitStatus.UNEXPLAINED if self.sensor is None else FitStatus.SENSOR

    @property
    def headline(self) -> str:
        """The answer in one line."""
        return headline(self)

    @property
    def missing(self) -> str:
        """Values that the log does not identify, and the one measurement that would identify most of them."""
        derived = EXPONENTS.values()
        names = [e for e in self.estimates if not (e.identifiable or e.name in derived or e.why.endswith(NOT_NEEDED))]
        if not self.described or not names:
            return ""
        advice = Counter(e.advice for e in names if e.advice)
        way = f"; most would gain from: {advice.most_common(1)[0][0]}" if advice else ""
        return f"not identifiable (see the report): {', '.join(e.name for e in names)}{way}"

    def estimate(self, name: str) -> Estimate:
        """The estimate of that name."""
        return next(e for e in self.estimates if e.name == name)

    def as_json(self) -> dict[str, Any]:
        """Contents of `fit.json`: the same keys whatever was identified."""
        return {
            "schema": 1,
            "explains": "torque" if self.explain is None else str(self.explain),
            "law": self.law,
            "law_describes_the_device": self.described,
            "status": str(self.status),
            "fit_percent_of_range": self.fit_percent,
            "validation_percent_of_range": self.validation_percent,
            "fitted_toml_percent_of_range": self.replay_percent,
            "files": [file.as_json() for file in self.files],
            "estimates": {e.name: e.as_json() for e in self.estimates},
            "correlation": {"names": list(self.correlation_names), "matrix": self.correlation.tolist()},
            "by_file": {
                f.file: {
                    "started_s": f.started_s,
                    "estimates": {n: {"estimate": v, "standard_error": f.errors[n]} for n, v in f.values.items()},
                }
                for f in self.by_file
            },
            "sections": [asdict(section) for section in self.sections],
            "output_delay_s": self.output_delay_s,
            "laws": [law.as_json() for law in self.laws],
            "effects": [asdict(effect) for effect in self.effects],
            "gross_sliding": {str(g.branch): _gross(g) for g in self.sliding},
            "first_look": [_look(look) for look in self.looks],
            "virtual_sensor": None if self.sensor is None else self.sensor.as_json(),
            "virtual_torque_sensor": None if self.torque is None else self.torque.as_json(),
            "warnings": list(self.warnings),
        }

    def lines(self, folder: str = "") -> Sequence[str]:
        """The answer in a few lines of text, its files being in `folder`."""
        lines = [headline(self, folder)]
        lines += [
            f"  {e.name} = {e.value:.5g}  (95 %: {e.interval[0]:.5g} to {e.interval[1]:.5g}){e.note and f', {e.note}'}"
            for e in self.estimates
            if e.identifiable and e.interval is not None
        ]
        said = (self.missing, _crosstalk(self), *_by_torques(self), *(section.text for section in self.sections))
        lines += [f"  {line}" for line in said if line]
        lines.append(f"law: {self.law}{f'; {RULE}' if self.laws else ''}")
        if self.replay_percent is not None:
            lines.append(f"fitted.toml, read back: RMS error {self.replay_percent:.2f} % of range on fitted files")
        return lines

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `fitted.toml`, `fit.json`, figures, what is suggested to log next, and `report.html`, all or nothing;
        makes the folder.
        """
        self._views.write(self, folder, pdf=pdf)


AnyIdentification = Identification[Any]


def _gross(ratio: SlidingRatio) -> dict[str, Any]:
    return {
        "ln_input_over_output": ratio.log_ratio,
        "interval_5_to_95_percent": None if ratio.interval is None else list(ratio.interval),
        "rows": ratio.rows,
        "why_not": ratio.reason or None,
    }


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


def headline(found: AnyIdentification, folder: str = "") -> str:
    """The answer in one line: friction, how well it explains the log, and the command to go on with."""
    if found.status is FitStatus.SENSOR:
        parts = [each.sentence for each in (found.sensor, found.torque) if each is not None]
        return f"Something else loads the joint; {'; '.join(parts)}."
    step = next_step(found, folder)
    if not found.described:
        worst, where = max((found.fit_percent, ""), (found.validation_percent or 0.0, " on the validation files"))
        return (
            f"No law explains the log: the best, {found.law}, has an RMS error of {worst:.3g} % of range{where}. "
            f"fitted.toml has the scenario's own values. Next: {step}"
        )
    percent, judged_percent = (  # of what goes on: fitted.toml may lack offsets of the cells that the law has
        (found.fit_percent, found.validation_percent)
        if found.replay_percent is None
        else (found.replay_percent, found.replay_validation_percent)
    )
    judged = "" if judged_percent is None else f" and the validation files to {judged_percent:.2g} %"
    return f"{'; '.join(_shown(found))}; the model explains the log to {percent:.2g} %{judged}. Next: {step}"


_OF_A_LOOP = (
    ("mu_theta", "mu theta", "", 1.0),
    ("tension_over_stiffness_m", "T/k", " mm", 1e3),
    ("lost_motion_rad", "lost motion", " deg", 180 / math.pi),
    ("motor_friction_N_m", "friction at the motor", " N m", 1.0),
)
_OF_TENDONS = (("mu_dynamic", "mu", ""), ("stiffness_N_per_m", "tendon stiffness", " N/m"))


def _shown(found: AnyIdentification) -> list[str]:
    """Friction of one tendon; what follows of a loop; else friction and stiffness of all tendons."""
    by_name = {e.name: e for e in found.estimates}
    if "lost_motion_rad" in by_name:
        return [_range(label, [by_name[n]], unit, scale) for n, label, unit, scale in _OF_A_LOOP]
    if "mu_dynamic" not in by_name:
        return [_range(label, _of(found, key), unit) for key, label, unit in _OF_TENDONS]
    pull, release = _friction(found)
    reach = max(pull.relative, release.relative)
    doubt = f" (+-{100 * reach:.2g} %)" if reach < 1 else ", not identifiable"
    same = math.isclose(pull.value, release.value, rel_tol=1e-3)
    return [f"mu = {pull.value:.3g}{'' if same else f' pulling, {release.value:.3g} releasing'}{doubt}"]


def _friction(found: AnyIdentification) -> list[Estimate]:
    """Coefficients of friction: of one tendon in both directions, or of all tendons."""
    return [e for e in found.estimates if e.name in EXPONENTS] or _of(found, "mu_dynamic")


def _of(found: AnyIdentification, key: str) -> list[Estimate]:
    """Estimates of a key of all tendons."""
    return [e for e in found.estimates if e.name.startswith("tendons.") and e.name.endswith(f".{key}")]


def _range(label: str, estimates: Sequence[Estimate], unit: str, scale: float = 1.0) -> str:
    """A quantity of all tendons: its range, and the widest interval."""
    known = [e for e in estimates if e.interval is not None]
    if not known:
        return f"{label} not identifiable"
    values, half = [scale * e.value for e in known], 100 * max(e.relative for e in known)
    ends = " to ".join(dict.fromkeys(f"{value:.3g}" for value in (min(values), max(values))))
    return f"{label} = {ends}{unit} (+-{half:.2g} %{' at most' if len(values) > 1 else ''})"


def next_step(found: AnyIdentification, folder: str = "") -> str:
    """Next step, the files being in `folder`: a design, or the log that tells what it would rest on."""
    advice = next((e.advice for e in _friction(found) if e.advice), "")
    if found.explain is None:
        if not found.described:
            return "log the joint without what else loads it, or see the warnings for another cause"
        if any(e.name == "lost_motion_rad" for e in found.estimates):
            if not found.estimate("lost_motion_rad").identifiable:
                return f"{ANGLE_OR_PUSH}; a design rests on the scenario's lost motion until then"
        elif not any(e.identifiable for e in _friction(found)):
            way = advice or "strokes of all joints over their range, both ways"
            return f"log {way} (identify --suggest writes such a routine): a design rests on the scenario's mu"
    elif not found.described or max(e.relative for e in _friction(found)) >= 1:
        if not found.suggests:
            return "log the rig of this scenario, in N (--scale): the tensions are not of its size"
        if not found.described:
            return (
                "drive the near end alone and log both tensions and its position, or see the warnings for another cause"
            )
        return (
            f"run {_in(folder, 'suggested_force.csv')} on the rig and log both tensions{advice and f' ({advice})'}; "
            "until such a log is identified a design rests on a mu that nothing confirms"
        )
    return f"tendonff design {_in(folder, 'fitted.toml')}"


def _in(folder: str, name: str) -> str:
    return (Path(folder) / name).as_posix()


def crosstalk_shares(pull: float, release: float, crosstalk: float = 0.01) -> tuple[float, float]:
    """Relative change of mu theta, pulling and releasing, where the output's cell also shows a share of the input.

    ln(T_in/T_out) loses ln(1 + c e^a) while the tendon is pulled, and ln(1 + c e^-a) while it is let go, where it is
    negative.
    """
    return -math.log1p(crosstalk * math.exp(pull)) / pull, math.log1p(crosstalk * math.exp(-release)) / release


def _crosstalk(found: AnyIdentification) -> str:
    """Sentence about what no log of two cells shows; empty where only one is read."""
    if not found.described or found.explain in (None, Explain.POSITION):
        return ""
    law = CapstanLaw.of(found.scenario.transmission)
    if min(law.pull_exponent, law.release_exponent) <= 0:
        return ""
    pull, release = crosstalk_shares(law.pull_exponent, law.release_exponent)
    return (
        "no log shows crosstalk: where the output's tension cell shows 1 % of the input, mu comes out "
        f"{-100 * pull:.2g} % too small pulling and {100 * release:.2g} % too large releasing; load one cell alone and "
        "read both"
    )


def _by_torques(found: AnyIdentification) -> Iterator[str]:
    """Angles of joints by torques alone, of files that judge, where an encoder tells how near they come."""
    by_torques: dict[str, list[tuple[float, float]]] = {}
    for file in found.files:
        for name, torques in file.named("joint_by_torques_rms_deg").items():
            angles = file.named("joint_rms_deg")[name]
            if found.described and file.role == "validate" and torques is not None and angles is not None:
                by_torques.setdefault(name, []).append((torques, angles))
    for name, known in by_torques.items():
        torques, angles = map(max, zip(*known, strict=True))
        yield f"{name} by torques alone to {torques:.2g} deg RMS, by angles of the motors to {angles:.2g} deg"
