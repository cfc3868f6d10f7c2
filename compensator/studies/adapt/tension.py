"""Study of a tension whose compensator tunes itself: its plants and schemes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.certificate import FeedbackCertificate, feedback_certificate
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.tuning import (
    Certified,
    certified,
    check_tuning,
    integral_gain_per_s,
    learnt,
    tuning_of,
)
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.settings import Adaptation
from tendonff.compensator.studies.adapt.result import (
    SETTLED_S,
    WINDOW_S,
    WORSE_SECOND,
    Case,
    Change,
    Scheme,
    TensionStudy,
    Trace,
    Variation,
    friction_off,
    moving_rms,
    variations,
    worst_second,
)
from tendonff.compensator.studies.adapt.study import Trials, there_and_back
from tendonff.ocp.adaptation.code import TunedChain
from tendonff.ocp.adaptation.information import Information
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig, TunedRun, TunerStatus
from tendonff.ocp.adaptation.tuning import Sensor, Tunable, Tuning

PLANT_MASSES = 40
PLANT_SUBSTEPS = 2
_SEGMENTS_OF_A_DRIFT = 120
_VARIED = (Tunable.MU_PULL, Tunable.MU_RELEASE, Tunable.TENDON_STIFFNESS, Tunable.LOAD_STIFFNESS)
_STRETCHES_S = 0.5  # time in which a tendon gets longer
_POSTURE_S = 4.0  # period of a load that changes with posture


@dataclass(frozen=True, slots=True, kw_only=True)
class TensionTrials(Trials):
    """Plants that differ from the scenario of a tension, with feedforward, feedback and self-tuning."""

    problem: Problem
    settings: Adaptation
    scenario: Scenario
    tuning: Tuning
    known: Information
    certificate: FeedbackCertificate | None
    bounds: Certified | None
    variations: tuple[Variation, ...]

    @classmethod
    def of(cls, scenario: Scenario) -> "TensionTrials":
        """See `Trials.of`."""
        settings = scenario.adaptation
        if settings is None:
            raise InputError(
                f'{scenario.source.name}: table [adaptation] is missing; it holds sensor ("output_tension" or '
                '"actuator_position"), noise, delay_samples, parameters, range and integral_gain_per_s'
            )
        check_tuning(scenario)
        problem = Problem.of(scenario)
        moving, law = problem.chain.moving, problem.transmission.friction.load_dependence
        tuning = tuning_of(problem, settings)
        return cls(
            problem=problem,
            settings=settings,
            scenario=scenario,
            tuning=tuning,
            known=learnt(problem, tuning),
            bounds=None if moving else certified(problem),
            certificate=_certificate(problem, settings),
            variations=variations(settings.sensor, moving=moving, load_exponent=law[0]),
        )

    def case(self, one: Variation) -> Case:
        """See `Trials.case`."""
        return _case(self.problem, self.tuning, self.certificate, one)

    def study(self, cases: Sequence[Case]) -> TensionStudy:
        """See `Trials.study`."""
        problem, reference, cases = self.problem, self.problem.reference, list(cases)
        known, bounds = self.known, self.bounds
        advice = _advice(problem, self.settings, _widest(cases))
        share = reference.share_of if reference.position_m is None else "range of the tension"
        return TensionStudy(
            scenario=self.scenario,
            reference=reference,
            tuning=self.tuning,
            information=known,
            certificate=self.certificate,
            interval=None if bounds is None else bounds.interval,
            bounds_N=None if bounds is None else (bounds.low_N, bounds.high_N),
            cases=tuple(cases),
            headline=_headline(cases, known, advice, share),
            warnings=_warnings(cases, known, self.certificate),
        )


def _certificate(problem: Problem, settings: Adaptation) -> FeedbackCertificate | None:
    if settings.sensor is not Sensor.OUTPUT_TENSION:
        return None
    gain = integral_gain_per_s(problem, settings)
    return feedback_certificate(problem.transmission, problem.reference.step_s, settings.delay_samples, gain)


def _advice(problem: Problem, settings: Adaptation, widest: Case) -> tuple[str, float] | None:
    """Parameter to tune beside friction, and the error with it on the worst plant [%]; None where it does not help.

    A unit that tunes friction alone cannot know what else is off: it says DOUBT, and the study finds the reason.
    """
    if {Tunable.LOAD_STIFFNESS, Tunable.TENDON_STIFFNESS} & set(settings.parameters):
        return None
    found = []
    for second in (Tunable.LOAD_STIFFNESS, Tunable.TENDON_STIFFNESS):
        if second is Tunable.LOAD_STIFFNESS and problem.chain.far_joint is not None:
            continue
        pair = replace(settings, parameters=(Tunable.MU, second))
        case = _case(problem, tuning_of(problem, pair), None, widest.variation, (Scheme.SELF_TUNING,))
        found.append((case.traces[Scheme.SELF_TUNING].settled_percent, second))
    left, second = min(found)
    if left > 0.5 * widest.traces[Scheme.SELF_TUNING].settled_percent:
        return None
    return f'parameters = ["{Tunable.MU}", "{second}"]', left


def _case(
    problem: Problem,
    tuning: Tuning,
    certificate: FeedbackCertificate | None,
    one: Variation,
    schemes: Sequence[Scheme] = tuple(Scheme),
) -> Case:
    reference = problem.reference
    problem, wanted = _extended(problem, one.duration_s)
    rows = len(wanted) - 1
    mu = np.ones(rows) * one.mu
    load = np.ones(rows) * one.load
    if one.change is Change.MU_DRIFT:
        mu = 1 + (one.mu - 1) * np.linspace(0, 1, rows)
    elif one.change is Change.POSTURE:
        swing = 2 * np.pi * np.arange(rows) * reference.step_s / _POSTURE_S
        load = 1 + (one.load - 1) * np.sin(swing)
    elif one.change is not Change.NOTHING:
        (mu if one.change is Change.MU_STEP else load)[: rows // 2] = 1.0
    traces = {}
    for scheme in schemes:
        if scheme is Scheme.FEEDBACK and certificate is None:
            continue
        run = _run(problem, _scheme_tuning(tuning, certificate, scheme), one, wanted, mu, load, scheme)
        traces[scheme] = _trace(scheme, run, wanted, reference)
    return Case(
        variation=one,
        time_s=np.arange(1, rows + 1, dtype=np.float64) * reference.step_s,
        reference_N=wanted[1:],
        mu_factor=mu,
        traces=traces,
        worst_second=_worst_second(traces, wanted[1:], reference),
    )


def _worst_second(traces: dict[Scheme, Trace], wanted: FloatArray, reference: Reference) -> tuple[float, float]:
    if not {Scheme.SELF_TUNING, Scheme.FEEDFORWARD} <= traces.keys():
        return 0.0, 0.0
    tuned, plain = (traces[s].tension_N - wanted for s in (Scheme.SELF_TUNING, Scheme.FEEDFORWARD))
    return worst_second(tuned, plain, reference.step_s, reference.range_N)


def _scheme_tuning(tuning: Tuning, certificate: FeedbackCertificate | None, scheme: Scheme) -> Tuning:
    if scheme is Scheme.FEEDFORWARD:
        return tuning.with_integral_gain(0.0)
    if scheme is Scheme.FEEDBACK and certificate is not None and tuning.integral_gain == 0:
        return tuning.with_integral_gain(certificate.recommended_gain_per_s)
    return tuning


def _run(
    problem: Problem,
    tuning: Tuning,
    one: Variation,
    wanted: FloatArray,
    mu: FloatArray,
    load: FloatArray,
    scheme: Scheme,
) -> TunedRun:
    reference, start = problem.reference, problem.reference.initial_tension_N
    tuned, plant = _chains(problem, tuning, one.load_exponent)
    bristle = {"bristle_stiffness_N_per_m": one.bristle * plant.whole.value("bristle_stiffness_N_per_m")}
    plant = replace(plant, whole=plant.whole.changed(bristle))
    noise = np.random.default_rng(0).normal(size=len(mu)) * tuning.noise + one.offset * tuning.span
    segments = 1 if one.change is Change.NOTHING and not one.stretch_m else _SEGMENTS_OF_A_DRIFT
    cuts = np.linspace(0, len(mu), segments + 1, dtype=int)
    tuner = SelfTuner(tuned, reference.step_s, tuning, problem.limits, start, joints_late_s=one.joints_late_s)
    late = 0 if one.delay_s is None else round(one.delay_s / reference.step_s)
    middle = len(mu) // 2
    stretching = slice(middle, middle + round(_STRETCHES_S / reference.step_s))
    rig: SimulatedRig | None = None
    runs = []
    for first, last in pairwise(cuts):
        values = {
            Tunable.MU_PULL: float(mu[first]),
            Tunable.MU_RELEASE: float(mu[first]) * one.release,
            Tunable.LOAD_STIFFNESS: float(load[first]),
            Tunable.TENDON_STIFFNESS: one.stiffness,
        }
        chain = plant.with_factors(values)
        if rig is None:
            rig = SimulatedRig(
                chain,
                reference.step_s,
                PLANT_SUBSTEPS,
                start * one.start,
                sensor_gain=one.gain,
                delay_samples=tuning.delay_samples + late,
                gear_N=one.gear * reference.range_N,
                crosstalk=one.crosstalk,
            )
        rig.change(chain)
        if one.stretch_m:
            covered = max(min(last, stretching.stop) - max(first, stretching.start), 0)
            rig.stretch(one.stretch_m * covered / (stretching.stop - stretching.start))
        part = slice(first, last)
        runs.append(tuner.run(rig, wanted[1:][part], noise[part], adapt=scheme is Scheme.SELF_TUNING))
    return TunedRun.joined(runs)


def _chains(problem: Problem, tuning: Tuning, load_exponent: float | None) -> tuple[TunedChain, TunedChain]:
    """The tuner's chain and the plant's; a rig runs by the laws of its tuner, which then has the exponent 0."""
    transmission, friction = problem.transmission, problem.transmission.friction
    stated = bool(friction.load_exponent)
    if load_exponent is not None and not stated:
        falling = replace(
            friction,
            load_exponent=load_exponent,
            reference_tension_N=problem.reference.initial_tension_N,
            pull_spread=None,
            release_spread=None,
        )
        transmission = replace(transmission, friction=falling)
    tuned = TunedChain.of(transmission, problem.level, tuning.parameters)
    plant = TunedChain.of(transmission, problem.level, _VARIED, PLANT_MASSES)
    if load_exponent is not None:
        plant = replace(plant, whole=plant.whole.changed({"load_exponent": load_exponent}))
        if not stated:
            without = replace(tuned, whole=tuned.whole.changed({"load_exponent": 0.0}))
            tuned = replace(without, chain=without.with_factors({}))
    return tuned, plant


def _extended(problem: Problem, duration_s: float) -> tuple[Problem, FloatArray]:
    """The reference and the joints until they are long enough: repeated where they are a cycle, else there and back."""
    reference, step = problem.reference, problem.reference.step_s
    once = len(reference.tension_N)
    rows = max(once, math.ceil(duration_s / step) + 1)
    cycle = reference.periodic and once > 1
    places = np.arange(rows) % (once - 1) if cycle else there_and_back(once, rows)
    motion = problem.transmission.motion
    if motion is not None:
        motion = replace(
            motion,
            time_s=step * np.arange(rows, dtype=np.float64),
            angle_rad=motion.at((step * places).astype(np.float64)),
        )
        problem = replace(problem, transmission=replace(problem.transmission, motion=motion))
    return problem, reference.tension_N[places]


def _trace(scheme: Scheme, run: TunedRun, wanted: FloatArray, reference: Reference) -> Trace:
    error, step, scale = run.tension_N - wanted[1:], reference.step_s, reference.range_N
    settled = error[round(SETTLED_S / step) :] if len(error) * step > 2 * SETTLED_S else error[len(error) // 2 :]
    bad = np.flatnonzero(moving_rms(error, step) > 0.01 * scale)
    last = int(bad[-1]) + 1 if bad.size else 0
    frozen = np.flatnonzero(run.status & TunerStatus.FROZEN)
    tuning = scheme is Scheme.SELF_TUNING
    return Trace(
        tension_N=run.tension_N,
        factors=run.factors,
        deviation=run.deviation,
        rmse_percent=100 * float(np.sqrt(np.mean(error**2))) / scale,
        settled_percent=100 * float(np.sqrt(np.mean(settled**2))) / scale,
        time_to_one_percent_s=last * step if last < len(error) - max(round(WINDOW_S / step), 1) else None,
        frozen_after_s=float(frozen[0]) * step if tuning and frozen.size else None,
    )


def _widest(cases: list[Case]) -> Case:
    return max(cases, key=lambda case: case.traces[Scheme.SELF_TUNING].settled_percent)


def _headline(cases: list[Case], known: Information, advice: tuple[str, float] | None, share: str) -> str:
    off = [case for case in cases if case.variation in (friction_off(0.8), friction_off(1.2))]
    plain = max(case.traces[Scheme.FEEDFORWARD].settled_percent for case in off)
    tuned = max(case.traces[Scheme.SELF_TUNING].settled_percent for case in off)
    widest = _widest(cases)
    most, most_plain = (widest.traces[s].settled_percent for s in (Scheme.SELF_TUNING, Scheme.FEEDFORWARD))
    better = "" if advice is None else f"; with {advice[0]} {advice[1]:.2g} % there"
    return (
        f"Expect an RMS error of up to {tuned:.2g} % of {share} after {SETTLED_S:g} s with self-tuning "
        f"from {known.tuning.sensor.words}, for mu ±20 % and all else as in the scenario (without: up to "
        f"{plain:.2g} %), and of up to {most:.2g} % where other parameters are off too "
        f"({widest.variation.name}; without: {most_plain:.2g} %{better}). "
        f"{known.sentences()[0].capitalize()}."
    )


def _warnings(cases: list[Case], known: Information, certificate: FeedbackCertificate | None) -> tuple[str, ...]:
    notes = list(known.doubts())
    if certificate is not None and not certificate.holds:
        notes.append(certificate.sentence())
    for case in cases:
        tuned, plain = case.traces[Scheme.SELF_TUNING], case.traces[Scheme.FEEDFORWARD]
        if case.is_limit:
            notes.append(
                f"do not use it where {case.variation.name}: RMS error {tuned.settled_percent:.3g} % of range after "
                f"{SETTLED_S:g} s, plain feedforward {plain.settled_percent:.3g} %"
            )
    seconds = [
        f"{case.variation.name} ({ratio:.2g} times, {left:.2g} % of range)"
        for case in cases
        for ratio, left in (case.worst_second,)
        if ratio > WORSE_SECOND and not case.is_limit
    ]
    if seconds:
        notes.append(
            f"in single seconds more than {WORSE_SECOND:g} times the error of plain feedforward where "
            + "; ".join(seconds)
        )
    if any(case.variation.load_exponent and case.worst_second[0] > WORSE_SECOND for case in cases):
        notes.append(
            f'where friction falls with the tension tune its exponent too: parameters = ["{Tunable.MU}", '
            f'"{Tunable.LOAD_EXPONENT}"]'
        )
    frozen = [
        f"{case.variation.name} (after {after:.2f} s)"
        for case in cases
        if (after := case.traces[Scheme.SELF_TUNING].frozen_after_s) is not None
    ]
    if frozen:
        notes.append(
            "the model stopped explaining the measurement, and tuning froze at the last safe values: "
            + "; ".join(frozen)
        )
    return tuple(notes)
