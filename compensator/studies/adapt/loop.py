"""Study of a joint that tunes itself: what the exported module computes, on loops that differ from the scenario."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tendonff.compensator.compensators.motors.adaptation import TunedJoint, with_factor
from tendonff.compensator.compensators.motors.drive import commanded
from tendonff.compensator.compensators.motors.task import verifying_masses
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.scenario.driven.joint import JointScenario, SampledJoint, sample_joint
from tendonff.compensator.scenario.driven.settings import JointAdaptation
from tendonff.compensator.studies.adapt.study import AdaptationStudy, Trials, there_and_back
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.path import JointMotion
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
class LoopVariation:
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
    LoopVariation(name="as the scenario"),
    LoopVariation(name="friction \N{MINUS SIGN}30 %", mu=0.7),
    LoopVariation(name="friction +30 %", mu=1.3),
    LoopVariation(name="pre-tension \N{MINUS SIGN}20 %", pretension=0.8),
    LoopVariation(name="pre-tension +20 %", pretension=1.2),
    LoopVariation(name="friction \N{MINUS SIGN}30 %, pre-tension \N{MINUS SIGN}20 %", mu=0.7, pretension=0.8),
    LoopVariation(name="friction +30 %, pre-tension +20 %", mu=1.3, pretension=1.2),
    LoopVariation(name="tendons 20 % softer", stiffness=0.8),
    LoopVariation(name="friction +30 %, encoder's zero off by 1 deg", mu=1.3, zero_rad=np.deg2rad(1.0)),
    LoopVariation(name="friction +30 %, encoder stuck after 5 s", mu=1.3, stuck=True),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopCase:
    """Loop with the plain and the self-tuning inverse.

    Attributes
    ----------
    variation : LoopVariation
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

    variation: LoopVariation
    plain_rad: FloatArray
    tuned_rad: FloatArray
    factor: FloatArray
    frozen_after_s: float | None
    step_s: float

    def settled_deg(self, error_rad: FloatArray) -> float:
        """RMS of an error after `SETTLED_S` [deg]."""
        return float(np.rad2deg(np.sqrt(np.mean(error_rad[round(SETTLED_S / self.step_s) :] ** 2))))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoopStudy(AdaptationStudy):
    """Self-tuning of a joint on every loop; see `AdaptationStudy`.

    Attributes
    ----------
    tuning : JointTuning
        Numbers of the recursion.
    time_s, reference_rad : ndarray, shape (n,)
        Reference, repeated until it is long enough.
    """

    shown_by: ClassVar[str] = "studies.adapt.loop_pages"

    tuning: JointTuning
    time_s: FloatArray
    reference_rad: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTrials(Trials):
    """Loops of 40 masses that differ from the scenario, with the plain and the self-tuning inverse.

    The motor is assumed to follow its command.
    """

    scenario: JointScenario
    tuning: JointTuning
    sampled: SampledJoint
    known: tuple[FloatArray, FloatArray]
    variations: tuple[LoopVariation, ...]

    @classmethod
    def of(cls, scenario: JointScenario) -> "LoopTrials":
        """See `Trials.of`."""
        sampled = sample_joint(scenario)
        tuned = TunedJoint.of(scenario, sampled)
        ideal = replace(scenario.mechanism.drive, servo_time_s=0.0, delay_s=0.0, backlash_rad=0.0, drive_class=None)
        scenario = replace(scenario, mechanism=replace(scenario.mechanism, drive=ideal))
        longer = _extended(sampled, scenario.run.step_s)
        known = inverses(scenario, longer)
        return cls(scenario=scenario, tuning=tuned.tuning, sampled=longer, known=known, variations=VARIATIONS)

    def case(self, one: LoopVariation) -> LoopCase:
        """See `Trials.case`."""
        plain, _, _ = _run(self.scenario, self.sampled, one, self.known, None)
        error, factor, frozen = _run(self.scenario, self.sampled, one, self.known, self.tuning)
        return LoopCase(
            variation=one,
            plain_rad=plain,
            tuned_rad=error,
            factor=factor,
            frozen_after_s=frozen,
            step_s=self.scenario.run.step_s,
        )

    def study(self, cases: Sequence[LoopCase]) -> LoopStudy:
        """See `Trials.study`."""
        return LoopStudy(
            scenario=self.scenario,
            tuning=self.tuning,
            time_s=self.sampled.time_s[1:],
            reference_rad=self.sampled.angle_rad[1:],
            cases=tuple(cases),
            headline=_headline(list(cases), self.scenario),
            warnings=tuple(_warnings(list(cases))),
        )


def _extended(sampled: SampledJoint, step_s: float) -> SampledJoint:
    """Reference and other joints until they are long enough: there and back."""
    once = len(sampled.time_s)
    rows = max(once, round(SHORTEST_S / step_s) + 1)
    places = there_and_back(once, rows)
    time: FloatArray = np.arange(rows, dtype=np.float64) * step_s
    motion = sampled.motion
    return replace(
        sampled,
        time_s=time,
        angle_rad=sampled.angle_rad[places],
        wanted=sampled.wanted[places],
        contact_N_m=sampled.contact_N_m[places],
        motion=JointMotion(names=motion.names, time_s=time, angle_rad=motion.at((places * step_s).astype(np.float64))),
    )


def _plant(mechanism: Mechanism, one: LoopVariation) -> Mechanism:
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
    one: LoopVariation,
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


def _headline(cases: list[LoopCase], scenario: JointScenario) -> str:
    off = [case for case in cases if not case.variation.stuck and case.variation.stiffness == 1]
    plain, tuned = (max(c.settled_deg(e) for c, e in zip(off, errors, strict=True)) for errors in errors_of(off))
    parameters = scenario.adaptation.parameters if scenario.adaptation is not None else ()
    words = {JointTunable.MU: "friction", JointTunable.PRETENSION: "pre-tension"}
    names = " and ".join(words[parameter] for parameter in parameters)
    one = " by one factor" if len(parameters) > 1 else ""
    return (
        f"Expect an RMS error of up to {tuned:.2g} deg after {SETTLED_S:g} s with {names} tuned{one} from the joint's "
        f"angle, for friction ±30 % and pre-tension ±20 % (without: up to {plain:.2g} deg)."
    )


def errors_of(cases: list[LoopCase]) -> tuple[list[FloatArray], list[FloatArray]]:
    """Errors of all loops: with the inverse alone, and with self-tuning."""
    return [case.plain_rad for case in cases], [case.tuned_rad for case in cases]


def _warnings(cases: list[LoopCase]) -> list[str]:
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
