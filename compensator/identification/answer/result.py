"""Result of identification, as data and as `fit.json`."""

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, ClassVar

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.errors import FileError
from tendonff.compensator.identification.fitting.sliding import SectionFriction, SlidingRatio
from tendonff.compensator.identification.fitting.uncertainty import ByFile
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.reading import Finding
from tendonff.compensator.reporting.results import Result
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import CapstanLaw

EXPONENTS = {"mu_dynamic": "mu_theta", "mu_dynamic_release": "mu_theta_release"}
"""Friction as ln(T_in/T_out) in gross sliding, which follows from the coefficients."""


class FitStatus(StrEnum):
    """Outcome of an identification."""

    DESCRIBED = "described"
    SENSOR = "virtual sensor"  # no law of the mechanism explains the files, a virtual sensor does
    UNEXPLAINED = "no law explains the files"

    @property
    def is_unexplained(self) -> bool:
        """Nothing in `fitted.toml` comes from the files."""
        return self is FitStatus.UNEXPLAINED


RULE = (
    "the simplest law whose error on held-out data is within 2 % of the least; a further value is kept where it "
    "reduces that error significantly"
)
"""Choice of a law."""


def is_known(standard_error: float, size: float) -> bool:
    """Whether a value of a size is identifiable; what is not a number is not."""
    return standard_error < TUNED.identifiable_share * size


_SHORT = 30  # characters of a reason that is shorter than a reference to another row


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Estimated value.

    Attributes
    ----------
    name : str
        Key of the scenario file, or what it is.
    value : float
        Estimate; the scenario's value where it was not fitted.
    standard_error, interval : float or None
        95 %; None where it was not fitted or is not identifiable.
    identifiable : bool
        Whether the data identify it separately.
    why : str
        Where the value comes from, or why the data do not identify it and which experiment would.
    scenario : float or None
        The scenario's own value.
    fitted : bool
        The value is the joint estimate, which fitted.toml has.
    note : str
        What the value belongs to, where its name does not tell.
    interval_as_measured : tuple of float, optional
        Interval of a force or torque if the torque constant is right, by which all of them are off alike; None where
        it is `interval`.
    """

    name: str
    value: float
    standard_error: float | None = None
    interval: tuple[float, float] | None = None
    identifiable: bool = False
    why: str
    scenario: float | None = None
    fitted: bool = False
    note: str = ""
    interval_as_measured: tuple[float, float] | None = None

    @property
    def own_half_width(self) -> float | None:
        """Half of the interval over the value, apart from the torque constant; None without an interval."""
        interval = self.interval_as_measured or self.interval
        return None if interval is None or not self.value else (interval[1] - interval[0]) / 2 / abs(self.value)

    @property
    def standing(self) -> str:
        """Treatment of a value that is not identifiable by itself."""
        if self.fitted:
            return "doubtful, fitted with the others"
        return "kept" if self.scenario is None or math.isclose(self.value, self.scenario) else "set"

    @property
    def advice(self) -> str:
        """Measurement to add, where the reason ends with it."""
        return self.why.rpartition("; ")[2] if "; " in self.why and not self.identifiable else ""

    @property
    def reason(self) -> str:
        """Why, and what the value belongs to."""
        return f"{self.why}; {self.note}" if self.note else self.why

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "estimate": self.value,
            "standard_error": self.standard_error,
            "interval_95": None if self.interval is None else list(self.interval),
            "identifiable": self.identifiable,
            "fitted": self.fitted,
            "why": self.reason,
            "scenario": self.scenario,
        }


def reasons_of(estimates: Sequence[Estimate]) -> list[str]:
    """Reasons for a column: what all stands in an earlier row already is a reference to that."""
    found, said = list[str](), dict[str, str]()
    for each in estimates:
        parts = each.reason.replace(each.name, "it").split("; ")
        first = said.get(parts[-1])
        again = first is not None and len(each.reason) > _SHORT and all(part in said for part in parts)
        found.append(f"as {first}" if again else each.reason)
        said = dict.fromkeys(parts, each.name) | said
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateLaw:
    """Compared law.

    Attributes
    ----------
    name : str
        Name of the law.
    stage : str
        "static" or "dynamic".
    free_values : int
        Number of values that were fitted.
    fit_percent, validation_percent : float
        RMS error in percent of the range of the explained channel.
    chosen : bool
        Whether it is the law of the fit.
    """

    name: str
    stage: str
    free_values: int
    fit_percent: float
    validation_percent: float
    chosen: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class FileResult:
    """Measured file.

    Attributes
    ----------
    role : str
        "fit" or "validate".
    error : FileError
        Error of the chosen law on it.
    findings : tuple of Finding
        Data issues in it.
    """

    role: str
    error: FileError
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PieceComparison:
    """Measurement and model of one piece, for the figures.

    Attributes
    ----------
    name, role : str
        Of the file.
    time_s, input_N : Array
        Shape (n,).
    given, measured, model : Array
        Shape (n,); the tension that drives the law; what it explains, measured and by the law, in N or m.
    elongation_m, model_elongation_m : Array or None
        Shape (n,).
    """

    name: str
    role: str
    time_s: Array
    input_N: Array
    given: Array
    measured: Array
    model: Array
    elongation_m: Array | None = None
    model_elongation_m: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Identification(Result):
    """Everything that a set of measurements identifies of a scenario.

    Attributes
    ----------
    scenario : Scenario
        The scenario with the identified values.
    asked : Measurement
        How the files were to be read.
    explain : Explain
        Channel that the model explains.
    described : bool
        The chosen law describes the device.
    estimates : tuple of Estimate
        Every value, fitted or kept.
    correlation_names : tuple of str
        Names of the fitted values.
    correlation : Array
        Shape (k, k); correlations of the fitted values.
    laws : tuple of CandidateLaw
        Candidate laws, compared.
    files : tuple of FileResult
        Error and data issues of each file.
    fit_percent, validation_percent : float, float or None
        RMS error over all files of that role in percent of their common range; None without validation files.
    replay_percent : float or None
        RMS error of `scenario`, simulated again over the fitted files, % of range; None where no law describes the
        device.
    replay_validation_percent : float or None
        The same over the validation files.
    sliding : tuple of SlidingRatio
        Logarithmic ratio of the tensions, by direction.
    warnings : tuple of str
        What the user should know.
    comparisons : tuple of PieceComparison
        Measurement and model of each piece.
    inputs : tuple of Path
        The measured files.
    by_file : tuple of ByFile
        Estimates by each of several files alone.
    output_delay_s : float or None
        How much later the output is read than the input.
    sections : tuple of SectionFriction
        Friction between tension cells, where there are more than two.
    comparable : bool
        The tensions are of the scenario's size; else no excitation is suggested.
    """

    shown_by: ClassVar[str] = "identification.answer.output"

    scenario: Scenario
    asked: Measurement
    explain: Explain
    described: bool
    estimates: tuple[Estimate, ...]
    correlation_names: tuple[str, ...]
    correlation: Array
    laws: tuple[CandidateLaw, ...]
    files: tuple[FileResult, ...]
    fit_percent: float
    validation_percent: float | None
    replay_percent: float | None
    sliding: tuple[SlidingRatio, ...]
    warnings: tuple[str, ...]
    comparisons: tuple[PieceComparison, ...]
    inputs: tuple[Path, ...]
    by_file: tuple[ByFile, ...] = ()
    output_delay_s: float | None = None
    sections: tuple[SectionFriction, ...] = ()
    comparable: bool = True
    replay_validation_percent: float | None = None

    @property
    def status(self) -> FitStatus:
        """Whether a law explains the files."""
        return FitStatus.DESCRIBED if self.described else FitStatus.UNEXPLAINED

    @property
    def headline(self) -> str:
        """The answer in one line."""
        return headline(self)

    @property
    def law(self) -> str:
        """Name of the chosen law."""
        return next(law.name for law in self.laws if law.chosen)

    def estimate(self, name: str) -> Estimate:
        """The estimate of that name."""
        return next(e for e in self.estimates if e.name == name)

    def as_json(self) -> dict[str, Any]:
        """Contents of `fit.json`."""
        return {
            "schema": 1,
            "explains": str(self.explain),
            "law": self.law,
            "law_describes_the_device": self.described,
            "status": str(self.status),
            "fit_percent_of_range": self.fit_percent,
            "validation_percent_of_range": self.validation_percent,
            "fitted_toml_percent_of_range": self.replay_percent,
            "files": [_file(f, "m" if self.explain is Explain.POSITION else "N") for f in self.files],
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
            "laws": [_law(law) for law in self.laws],
            "gross_sliding": {str(g.branch): _gross(g) for g in self.sliding},
            "warnings": list(self.warnings),
        }

    def lines(self, folder: str = "") -> Sequence[str]:
        """The answer in a few lines of text, its files being in `folder`."""
        return summary_lines(self, folder)

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `fitted.toml`, `fit.json`, figures, the suggested excitation and `report.html`, all or nothing; makes
        the folder.
        """
        self._views.write(self, folder, pdf=pdf)


def _file(result: FileResult, unit: str) -> dict[str, Any]:
    return {
        "name": result.error.name,
        "role": result.role,
        f"rms_{unit}": result.error.rms,
        f"range_{unit}": result.error.span,
        "rms_percent_of_range": result.error.percent,
        "findings": [
            {"kind": str(f.issue), "count": f.count, "times_s": list(f.times_s), "text": f.text}
            for f in result.findings
        ],
    }


def _law(law: CandidateLaw) -> Mapping[str, Any]:
    percents = (law.fit_percent, law.validation_percent)
    fit, validation = (percent if math.isfinite(percent) else None for percent in percents)
    return {
        "name": law.name,
        "stage": law.stage,
        "free_values": law.free_values,
        "fit_percent_of_range": fit,
        "validation_percent_of_range": validation,
        "chosen": law.chosen,
    }


def _gross(ratio: SlidingRatio) -> Mapping[str, Any]:
    return {
        "ln_input_over_output": ratio.log_ratio,
        "interval_5_to_95_percent": None if ratio.interval is None else list(ratio.interval),
        "rows": ratio.rows,
        "why_not": ratio.reason or None,
    }


def estimate_columns(estimates: Sequence[Estimate]) -> dict[str, list[object]]:
    """Every estimate: value, ends of its 95 % interval, and where the value comes from."""
    low, high = zip(*(each.interval or (math.nan, math.nan) for each in estimates), strict=True)
    names = ("name", "value", "identifiable", "fitted", "scenario", "reason")
    columns: dict[str, list[object]] = {name: [getattr(each, name) for each in estimates] for name in names}
    return columns | {"low_95": list(low), "high_95": list(high)}


def headline(found: Identification, folder: str = "") -> str:
    """The answer in one line: friction, how well it explains the log, and the command to go on with."""
    if not found.described:
        worst, where = max((found.fit_percent, ""), (found.validation_percent or 0.0, " on the validation files"))
        return (
            f"No law explains the log: the best, {found.law}, has an RMS error of {worst:.3g} % of range{where}. "
            f"fitted.toml has the scenario's own values. Next: {_next_log(found, folder)}"
        )
    pull, release = found.estimate("mu_dynamic"), found.estimate("mu_dynamic_release")
    reach = max((_relative(e) for e in (pull, release)), default=math.inf)
    doubt = f" (+-{100 * reach:.2g} %)" if reach < 1 else ", not identifiable"
    same = math.isclose(pull.value, release.value, rel_tol=1e-3)
    both = f"{pull.value:.3g}" if same else f"{pull.value:.3g} pulling, {release.value:.3g} releasing"
    percent, judged_percent = (  # of what goes on: fitted.toml may lack offsets of the cells that the law has
        (found.fit_percent, found.validation_percent)
        if found.replay_percent is None
        else (found.replay_percent, found.replay_validation_percent)
    )
    judged = "" if judged_percent is None else f" and the validation files to {judged_percent:.2g} %"
    step = f"tendonff design {_in(folder, 'fitted.toml')}" if reach < 1 else _next_log(found, folder)
    return f"mu = {both}{doubt}; the model explains the log to {percent:.2g} %{judged}. Next: {step}"


def _next_log(found: Identification, folder: str) -> str:
    """The measurement that tells mu, where these files do not."""
    if not found.comparable:
        return "log the rig of this scenario, in N (--scale): the tensions are not of its size"
    if not found.described:
        return "drive the near end alone and log both tensions and its position, or see the warnings for another cause"
    advice = next((e.advice for e in map(found.estimate, _FRICTION) if e.advice), "")
    return (
        f"run {_in(folder, 'suggested_force.csv')} on the rig and log both tensions{advice and f' ({advice})'}; until "
        "such a log is identified a design rests on a mu that nothing confirms"
    )


_FRICTION = ("mu_dynamic", "mu_dynamic_release")


def _in(folder: str, name: str) -> str:
    return (Path(folder) / name).as_posix()


def _relative(estimate: Estimate) -> float:
    """Half-width of an interval over its value."""
    if estimate.interval is None or estimate.value == 0:
        return math.inf
    return (estimate.interval[1] - estimate.interval[0]) / 2 / abs(estimate.value)


def missing(found: Identification) -> str:
    """Values that the log does not identify, and the one measurement that would identify most of them."""
    names = [e for e in found.estimates if not e.identifiable and e.name not in EXPONENTS.values()]
    if not found.described or not names:
        return ""
    advice = Counter(e.advice for e in names if e.advice)
    way = f"; most would gain from: {advice.most_common(1)[0][0]}" if advice else ""
    return f"not identifiable (see the report): {', '.join(e.name for e in names)}{way}"


def crosstalk_shares(pull: float, release: float, crosstalk: float = 0.01) -> tuple[float, float]:
    """Relative change of mu theta, pulling and releasing, where the output's cell also shows a share of the input.

    ln(T_in/T_out) loses ln(1 + c e^a) while the tendon is pulled, and ln(1 + c e^-a) while it is let go, where it is
    negative.
    """
    return -math.log1p(crosstalk * math.exp(pull)) / pull, math.log1p(crosstalk * math.exp(-release)) / release


def _crosstalk(found: Identification) -> str:
    """Sentence about what no log of two cells shows; empty where only one is read."""
    law = CapstanLaw.of(found.scenario.transmission)
    if not found.described or found.explain is Explain.POSITION or min(law.pull_exponent, law.release_exponent) <= 0:
        return ""
    pull, release = crosstalk_shares(law.pull_exponent, law.release_exponent)
    return (
        "no log shows crosstalk: where the output's tension cell shows 1 % of the input, mu comes out "
        f"{-100 * pull:.2g} % too small pulling and {100 * release:.2g} % too large releasing; load one cell alone and "
        "read both"
    )


def summary_lines(found: Identification, folder: str = "") -> Sequence[str]:
    """The answer in a few lines of text, its files being in `folder`."""
    lines = [headline(found, folder)]
    lines += [
        f"  {e.name} = {e.value:.5g}  (95 %: {e.interval[0]:.5g} to {e.interval[1]:.5g}){e.note and f', {e.note}'}"
        for e in found.estimates
        if e.identifiable and e.interval is not None
    ]
    lines += [
        f"  {line}"
        for line in (missing(found), _crosstalk(found), *(section.text for section in found.sections))
        if line
    ]
    lines.append(f"law: {found.law}; {RULE}")
    if found.replay_percent is not None:
        lines.append(f"fitted.toml, read back: RMS error {found.replay_percent:.2f} % of range on fitted files")
    return lines
