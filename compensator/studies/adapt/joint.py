"""Study of a joint that tunes itself: what the exported module computes, on loops that differ from the scenario."""

import os
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.motors.adaptation import TunedJoint, with_factor
from tendonff.compensator.compensators.motors.drive import commanded
from tendonff.compensator.compensators.motors.task import verifying_masses
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.writing import atomic_directory, write_csv
from tendonff.compensator.reporting.colours import BLUE, INK, VERMILION
from tendonff.compensator.reporting.page import (
    FileNote,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
    provenance_of,
    summary_head,
    write_pages,
)
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, thinned
from tendonff.compensator.reporting.results import Result, Views
from tendonff.compensator.scenario.driven.joint import JointScenario, SampledJoint, sample_joint
from tendonff.compensator.scenario.driven.settings import JointAdaptation
from tendonff.compensator.studies.adapt.result import moving_rms
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.path import JointMotion
from tendonff.models.turns import in_turn
from tendonff.ocp.adaptation.joint import JointTunable, JointTuning
from tendonff.ocp.adaptation.joint_tuner import JointTuner
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.joint.invert import JointStatus, engine_of, invert_joint
from tendonff.ocp.joint.start import joint_problem, start_memory

SHORTEST_S = 8.0
"""Least duration of a run [s]: shorter references go forwards and backwards until then."""

SETTLED_S = 4.0
"""Errors after this time count as settled [s]."""

_PLANT_SUBSTEPS = 2
_STUCK_S = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JointVariation:
    """Loop that differs from the scenario.

    Attributes
    ----------
    name : str
        Description, as shown.
    mu, pretension, stiffness : float
        Factors on friction, pre-tension and stiffness of the tendons.
    zero_rad : float
        Offset of the joint's encoder [rad].
    stuck : bool
        The encoder stays where it is after 5 s.
    """

    name: str
    mu: float = 1.0
    pretension: float = 1.0
    stiffness: float = 1.0
    zero_rad: float = 0.0
    stuck: bool = False


VARIATIONS = (
    JointVariation(name="as the scenario"),
    JointVariation(name="friction \N{MINUS SIGN}30 %", mu=0.7),
    JointVariation(name="friction +30 %", mu=1.3),
    JointVariation(name="pre-tension \N{MINUS SIGN}20 %", pretension=0.8),
    JointVariation(name="pre-tension +20 %", pretension=1.2),
    JointVariation(name="friction \N{MINUS SIGN}30 %, pre-tension \N{MINUS SIGN}20 %", mu=0.7, pretension=0.8),
    JointVariation(name="friction +30 %, pre-tension +20 %", mu=1.3, pretension=1.2),
    JointVariation(name="tendons 20 % softer", stiffness=0.8),
    JointVariation(name="friction +30 %, encoder's zero off by 1 deg", mu=1.3, zero_rad=np.deg2rad(1.0)),
    JointVariation(name="friction +30 %, encoder stuck after 5 s", mu=1.3, stuck=True),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointCase:
    """Loop with the plain and the self-tuning inverse.

    Attributes
    ----------
    variation : JointVariation
        The loop.
    plain_rad, tuned_rad : ndarray, shape (n,)
        Error of the joint's angle.
    factor : ndarray, shape (n,)
        Factor in use.
    frozen_after_s : float or None
        When tuning froze.
    step_s : float
        Sample time.
    """

    variation: JointVariation
    plain_rad: FloatArray
    tuned_rad: FloatArray
    factor: FloatArray
    frozen_after_s: float | None
    step_s: float

    def settled_deg(self, error_rad: FloatArray) -> float:
        """RMS of an error after `SETTLED_S` [deg]."""
        return float(np.rad2deg(np.sqrt(np.mean(error_rad[round(SETTLED_S / self.step_s) :] ** 2))))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class JointAdaptationStudy(Result):
    """A study of a joint that tunes itself; can be written.

    Attributes
    ----------
    scenario : JointScenario
        The scenario it was made for.
    tuning : JointTuning
        Numbers of the recursion.
    time_s, reference_rad : ndarray, shape (n,)
        Reference, repeated until it is long enough.
    cases : tuple of JointCase
        Every loop.
    headline : str
        One sentence.
    warnings : tuple of str
        What the user should know.
    """

    shown_by: ClassVar[str] = "studies.adapt.joint"

    scenario: JointScenario
    tuning: JointTuning
    time_s: FloatArray
    reference_rad: FloatArray
    cases: tuple[JointCase, ...]
    headline: str
    warnings: tuple[str, ...]

    @property
    def lines(self) -> tuple[str, ...]:
        """The finding in words."""
        return (self.headline,)

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `estimate.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder."""
        figures = _figures(self)
        summary: dict[str, object] = {
            **summary_head(self.scenario),
            "headline": self.headline,
            "plants": {
                case.variation.name: {
                    "plain_settled_rmse_deg": case.settled_deg(case.plain_rad),
                    "settled_rmse_deg": case.settled_deg(case.tuned_rad),
                    "factor_at_end": float(case.factor[-1]),
                    "frozen_after_s": case.frozen_after_s,
                }
                for case in self.cases
            },
            "warnings": list(self.warnings),
        }
        with atomic_directory(folder) as partial:
            write_csv(partial / "estimate.csv", _columns(self))
            write_pages(partial, summary, figures, _report(self, figures), pdf=pdf)


def _columns(study: JointAdaptationStudy) -> dict[str, FloatArray]:
    rows = thinned(len(study.time_s))
    columns = {"time_s": study.time_s[rows], "reference_rad": study.reference_rad[rows]}
    for k, case in enumerate(study.cases, start=1):
        columns |= {f"error_{k}_rad": case.tuned_rad[rows], f"factor_{k}": case.factor[rows]}
    return columns


def _figures(study: JointAdaptationStudy) -> dict[str, Figure]:
    with figure_style():
        return {"overview": _overview(study), "friction": _course(study)}


VIEWS = Views(write=JointAdaptationStudy.write, columns=_columns, figures=_figures)


@in_turn
def adapt_joint(scenario: JointScenario, *, progress: Progress = silent) -> JointAdaptationStudy:
    """Try self-tuning of a joint on loops of 40 masses that differ from the scenario.

    The motor is assumed to follow its command. Arguments and errors as of `tendonff.adapt`.
    """
    sampled = sample_joint(scenario)
    tuned = TunedJoint.of(scenario, sampled)
    ideal = replace(scenario.mechanism.drive, servo_time_s=0.0, delay_s=0.0, backlash_rad=0.0, drive_class=None)
    scenario = replace(scenario, mechanism=replace(scenario.mechanism, drive=ideal))
    longer = _extended(sampled, scenario.run.step_s)
    known = inverses(scenario, longer)
    cases = []
    for one in VARIATIONS:
        plain, _, _ = _run(scenario, longer, one, known, None)
        error, factor, frozen = _run(scenario, longer, one, known, tuned.tuning)
        cases.append(
            JointCase(
                variation=one,
                plain_rad=plain,
                tuned_rad=error,
                factor=factor,
                frozen_after_s=frozen,
                step_s=scenario.run.step_s,
            )
        )
        progress(len(cases), len(VARIATIONS))
    return JointAdaptationStudy(
        scenario=scenario,
        tuning=tuned.tuning,
        time_s=longer.time_s[1:],
        reference_rad=longer.angle_rad[1:],
        cases=tuple(cases),
        headline=_headline(cases, scenario),
        warnings=tuple(_warnings(cases)),
    )


def _extended(sampled: SampledJoint, step_s: float) -> SampledJoint:
    """Reference and other joints until they are long enough: there and back."""
    once = len(sampled.time_s)
    rows = max(once, round(SHORTEST_S / step_s) + 1)
    there = np.arange(rows) % (2 * once - 2)
    places = np.minimum(there, 2 * once - 2 - there)
    time: FloatArray = np.arange(rows, dtype=np.float64) * step_s
    motion = sampled.motion
    return replace(
        sampled,
        time_s=time,
        angle_rad=sampled.angle_rad[places],
        wanted=sampled.wanted[places],
        contact_N_m=sampled.contact_N_m[places],
        motion=JointMotion(names=motion.names, time_s=time, angle_rad=motion.at(places * step_s)),
    )


def _plant(mechanism: Mechanism, one: JointVariation) -> Mechanism:
    given = with_numbers(mechanism, {"stiffness": one.stiffness})
    return with_factor(with_factor(given, (JointTunable.MU,), one.mu), (JointTunable.PRETENSION,), one.pretension)


def inverses(scenario: JointScenario, sampled: SampledJoint) -> tuple[FloatArray, FloatArray]:
    """Motor angles and their commands with the factor at its bounds and at 1, shape (rows, 3) each."""
    settings: JointAdaptation | None = scenario.adaptation
    names, (low, high) = ((), (1.0, 1.0)) if settings is None else (settings.parameters, settings.range)
    motors, commands = [], []
    for factor in (low, 1.0, high):
        problem = joint_problem(with_factor(scenario.mechanism, names, factor), scenario.run.level, sampled.motion)
        found = invert_joint(problem, sampled.angle_rad, scenario.run.step_s)
        if found.status is JointStatus.FAILED:
            raise SolveError(f"with a factor of {factor:g}, {found.message}")
        motors.append(found.motor_rad[:, 0])
        commands.append(commanded(scenario.mechanism.drive, found.motor_rad, scenario.run.step_s, live=True)[:, 0])
    return np.column_stack(motors), np.column_stack(commands)


def _run(
    scenario: JointScenario,
    sampled: SampledJoint,
    one: JointVariation,
    known: tuple[FloatArray, FloatArray],
    tuning: JointTuning | None,
) -> tuple[FloatArray, FloatArray, float | None]:
    """Error of the joint's angle, the factor in use, and when tuning froze; the inverse alone without `tuning`."""
    settings: JointAdaptation | None = scenario.adaptation
    delay, noise = (0, 0.0) if settings is None else (settings.delay_samples, settings.noise)
    step, angle = scenario.run.step_s, sampled.angle_rad
    mechanism, rows = _plant(scenario.mechanism, one), len(angle) - 1
    problem = joint_problem(mechanism, scenario.run.level, sampled.motion, segments=verifying_masses(mechanism))
    engine, memory = engine_of(problem, step / _PLANT_SUBSTEPS, Engine.AUTO), start_memory(problem, hanging=True)
    winding = np.array(problem.windings_m) / mechanism.drive.gear_ratio
    fastest = scenario.mechanism.drive.speed_max_rad_per_s
    change = np.inf if fastest is None else fastest * step
    tuner = None if tuning is None else JointTuner(tuning, angle, *known, change)
    measured = np.random.default_rng(0).normal(size=rows + 1) * noise + one.zero_rad
    measured[0] += angle[0]
    found, factor, commands, frozen = np.empty(rows), np.ones(rows), known[1][:, 1].copy(), None
    # Within so many samples the measurements are known before the plant moves.
    ahead = rows if tuner is None else delay + 1
    for first in range(0, rows, ahead):
        last = min(first + ahead, rows)
        if tuner is not None:
            for k in range(first, last):
                commands[k + 1], factor[k] = tuner.step(float(measured[max(k - delay, 0)])), tuner.factor
                if frozen is None and tuner.frozen:
                    frozen = (k + 1) * step
        fine = np.arange((last - first) * _PLANT_SUBSTEPS + 1) / _PLANT_SUBSTEPS
        motor = np.interp(fine, np.arange(last - first + 1), commands[first : last + 1])
        run = engine.run(memory, motor[:, None] * winding, np.zeros(len(motor)), None)
        if len(run.angle_rad) < len(fine) - 1:
            raise SolveError(f"{one.name}: the simulated loop failed at {first * step:.6g} s; use a smaller step_s")
        found[first:last] = run.angle_rad[_PLANT_SUBSTEPS - 1 :: _PLANT_SUBSTEPS]
        measured[first + 1 : last + 1] += found[first:last]
        if one.stuck and first * step >= _STUCK_S:
            measured[first + 1 : last + 1] = measured[first]
    return found - angle[1:], factor, frozen


def _headline(cases: list[JointCase], scenario: JointScenario) -> str:
    off = [case for case in cases if not case.variation.stuck and case.variation.stiffness == 1]
    plain, tuned = (max(c.settled_deg(e) for c, e in zip(off, errors, strict=True)) for errors in _errors_of(off))
    parameters = scenario.adaptation.parameters if scenario.adaptation is not None else ()
    words = {JointTunable.MU: "friction", JointTunable.PRETENSION: "pre-tension"}
    names = " and ".join(words[parameter] for parameter in parameters)
    one = " by one factor" if len(parameters) > 1 else ""
    return (
        f"Expect an RMS error of up to {tuned:.2g} deg after {SETTLED_S:g} s with {names} tuned{one} from the joint's "
        f"angle, for friction ±30 % and pre-tension ±20 % (without: up to {plain:.2g} deg)."
    )


def _errors_of(cases: list[JointCase]) -> tuple[list[FloatArray], list[FloatArray]]:
    return [case.plain_rad for case in cases], [case.tuned_rad for case in cases]


def _warnings(cases: list[JointCase]) -> list[str]:
    notes = []
    for case in cases:
        plain, tuned = case.settled_deg(case.plain_rad), case.settled_deg(case.tuned_rad)
        if tuned > 1.05 * plain and tuned > 0.05:
            notes.append(f"{case.variation.name}: RMS error {tuned:.2g} deg with self-tuning, {plain:.2g} deg without")
        if case.frozen_after_s is not None:
            notes.append(
                f"{case.variation.name}: tuning froze after {case.frozen_after_s:.2f} s at the factor "
                f"{case.factor[-1]:.3f}"
            )
    return notes


def _overview(study: JointAdaptationStudy) -> Figure:
    figure, axes = new_figure(height_in=0.26 * len(study.cases) + 1.0)
    panel, places = axes[0, 0], np.arange(len(study.cases))[::-1]
    for errors, colour, marker, label in (
        (_errors_of(list(study.cases))[0], VERMILION, "|", "inverse alone"),
        (_errors_of(list(study.cases))[1], BLUE, "o", "self-tuning"),
    ):
        found = [max(case.settled_deg(e), 1e-4) for case, e in zip(study.cases, errors, strict=True)]
        panel.plot(found, places, linestyle="", marker=marker, color=colour, label=label)
    panel.set_yticks(places, [case.variation.name for case in study.cases])
    panel.set(xscale="log", xlabel=f"RMS error after {SETTLED_S:g} s [deg]", title="Loops that differ")
    panel.xaxis.set_major_formatter("{x:g}")
    legend_below(figure, panel, columns=2)
    return figure


def _course(study: JointAdaptationStudy) -> Figure:
    case = next(case for case in study.cases if case.variation.mu > 1 and case.variation.pretension == 1)
    figure, axes = new_figure(2, 1, share_x=True, height_in=4.2)
    rows = thinned(len(study.time_s))
    for error, colour, label in ((case.plain_rad, VERMILION, "inverse alone"), (case.tuned_rad, BLUE, "self-tuning")):
        mean = np.rad2deg(moving_rms(error, case.step_s))
        axes[0, 0].plot(study.time_s[rows], mean[rows], color=colour, label=label)
    axes[0, 0].set(ylabel="error [deg]", title=f"Error (RMS over 0.25 s): {case.variation.name}")
    axes[1, 0].plot(study.time_s[rows], case.factor[rows], color=INK)
    axes[1, 0].set(xlabel="time [s]", ylabel="factor [-]")
    legend_below(figure, axes[0, 0], columns=2)
    return figure


def _report(study: JointAdaptationStudy, figures: dict[str, Figure]) -> Report:
    pictures = pictures_of(
        figures,
        {
            "overview": "Each row is a loop that differs from the scenario as its name says; sensor noise as stated.",
            "friction": "Above: error. Below: the factor that the controller uses.",
        },
    )
    table = Table(
        caption=f"RMS error after {SETTLED_S:g} s [deg]",
        columns=("loop", "inverse alone", "self-tuning", "factor at the end", "status"),
        rows=[
            (
                case.variation.name,
                case.settled_deg(case.plain_rad),
                case.settled_deg(case.tuned_rad),
                float(case.factor[-1]),
                "good" if case.frozen_after_s is None else f"frozen after {case.frozen_after_s:.2f} s",
            )
            for case in study.cases
        ],
    )
    return Report(
        title=f"Self-tuning: {study.scenario.name}",
        summary=study.headline,
        warnings=study.warnings,
        sections=(
            Section(
                title="Loops that differ",
                blocks=(
                    Text(
                        "The compensator has the scenario's parameters; the loop differs from them, has 40 masses a "
                        "tendon and sensor noise, and its motor follows its command. The joint's angle identifies the "
                        "lost motion alone, one number of friction, pre-tension and stiffness together: a factor of "
                        "0.8 may be friction or pre-tension. identify and watch separate them, with a push against a "
                        "stop."
                    ),
                    pictures["overview"],
                    table,
                ),
            ),
            Section(title="Error and factor over time", blocks=(pictures["friction"],)),
        ),
        provenance=provenance_of(study.scenario, "adapt"),
        files=(
            FileNote(name="estimate.csv", content="reference, and error and factor of every loop over time"),
            FileNote(name="summary.json", content="everything on this page for other programs"),
        ),
    )
