"""Additions of an export for a scenario with [adaptation]: tuner, certified interval, an inverse with adjustable mu."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.compensators.tuning import Certified, tuned_chain, tuning_of
from tendonff.compensator.export.golden import Course, easy_rows
from tendonff.compensator.export.repeat import FLOAT_SHARE, Compared, repeated_rows
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.scenario.settings import Adaptation
from tendonff.ocp.adaptation.code import TunedChain
from tendonff.ocp.adaptation.target import tuned_numbers, tuner_code
from tendonff.ocp.adaptation.tuner import INTEGRAL, REALS, SelfTuner, SimulatedRig
from tendonff.ocp.adaptation.tuning import Sensor, Tunable
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.step.target import ChainCode, Tuned

_RIGS = (1.1, 1.03, 1.01)
"""Factors on friction of the rig behind the golden vectors: the first whose vectors the tuner repeats."""

_REPEATED = 0.9  # share of rows: fewer where what is unexplained makes the tuner's force ring between its limits

_DOUBLE_SHARE = 1e-9  # of the largest force: difference from the model that passes in double precision

_BOUNDS_ROUNDING = 5e-6  # of the largest bound: a few roundings in single precision, which never add up from row to row

NUDGES = 4
"""Runs in single precision whose measurements round differently."""

_COAST_S = 0.05  # time in which joints whose angles are missing come to rest [s]

_FRICTION = (Tunable.MU, Tunable.MU_PULL, Tunable.MU_RELEASE)
_MEASURED = {
    Sensor.OUTPUT_TENSION: "the output tension [N]",
    Sensor.ACTUATOR_POSITION: "the actuator's position relative to the start [m]",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveGolden:
    """Golden vectors of tuner and interval, one row per sample."""

    measured: FloatArray  # shape (rows,); what the tuner is given, exact in the real type
    force_N: FloatArray  # shape (rows,); what it answers
    # low_N, high_N: shape (rows,); interval for the force of the plant's golden vectors; empty where joints move the
    # path, which has none
    low_N: FloatArray
    high_N: FloatArray
    joint_rad: FloatArray  # shape (rows, joints); joint angles that its steps take, those at their ends
    easy: int  # rows before a step of its model that is split or takes long, in which exported code may do otherwise

    def given(self, reference_N: FloatArray, nudge: int = 0) -> FloatArray:
        """Inputs of the steps, shape (rows, 2): references, and measurements that round otherwise for each `nudge`."""
        sign = np.random.default_rng(nudge).choice((-1.0, 0.0, 1.0), len(self.measured)) if nudge else 0.0
        rounding = float(np.finfo(np.float32).eps) * np.abs(self.measured)
        return np.stack([reference_N, self.measured + sign * rounding], axis=1)


def tuned_part(problem: Problem, settings: Adaptation) -> Tuned:
    """Parts of the chain that the tuner needs."""
    tuning = tuning_of(problem, settings)
    return tuned_numbers(tuned_chain(problem, tuning), tuning)


def adaptive_code(
    problem: Problem,
    settings: Adaptation,
    precision: Precision,
    prefix: str,
    beside: ChainCode,
) -> dict[str, object]:
    """Values for the templates of the tuner, beside the chain's own code."""
    tuning = tuning_of(problem, settings)
    tuned = tuned_chain(problem, tuning)
    code = tuner_code(tuned, tuning, f"{prefix}_adaptive", precision, beside=beside)
    load = problem.transmission.load
    tunes_load = Tunable.LOAD_STIFFNESS in settings.parameters
    return {
        "header": code.header,
        "source": code.source,
        "tuning": tuning,
        "coast": math.exp(-problem.reference.step_s / _COAST_S),
        "tuning_reals": REALS,
        "tuning_integral": INTEGRAL,
        "tuning_value": lambda name: getattr(tuning, name),
        "sensor_index": int(tuning.sensor is Sensor.ACTUATOR_POSITION),
        "sensor_words": tuning.sensor.words,
        "measured_words": _MEASURED[tuning.sensor],
        "tuned_words": " and ".join(settings.parameters),
        "model_rows": code.model_rows,
        "mu_dynamic": main_mu(problem, settings),
        "mu_index": settings.parameters.index(_main(settings)),
        "mu_dynamic_release": other_mu(problem, settings),
        "release_index": -1 if other_mu(problem, settings) is None else settings.parameters.index(Tunable.MU_RELEASE),
        "tunes_load": tunes_load,
        "load_index": settings.parameters.index(Tunable.LOAD_STIFFNESS) if tunes_load else -1,
        "load_stiffness_N_per_m": load.stiffness_N_per_m,
    }


def _main(settings: Adaptation) -> Tunable:
    """The tuned friction that `<prefix>_adaptive_mu` tells."""
    return next(p for p in settings.parameters if p in _FRICTION)


def main_mu(problem: Problem, settings: Adaptation) -> float:
    """Coefficient of the scenario that `<prefix>_adaptive_mu` tells [-]."""
    friction = problem.transmission.friction
    return friction.release_dynamic if _main(settings) is Tunable.MU_RELEASE else friction.mu_dynamic


def other_mu(problem: Problem, settings: Adaptation) -> float | None:
    """Coefficient that `<prefix>_adaptive_mu_release` tells beside the other [-]; None without that function."""
    if not {Tunable.MU_PULL, Tunable.MU_RELEASE} <= set(settings.parameters):
        return None
    return problem.transmission.friction.release_dynamic


def _tolerance_N(problem: Problem, course: Course, precision: Precision) -> float:
    """Largest difference of the tuner's force from the model that passes [N]."""
    if precision is Precision.FLOAT:
        return FLOAT_SHARE * scale_of(problem.reference.tension_N)
    return _DOUBLE_SHARE * max(course.scale_N, 1.0)


def _bounds_tolerance_N(golden: AdaptiveGolden, course: Course, precision: Precision) -> float:
    """Largest difference of a bound from the model that passes [N]."""
    if precision is Precision.DOUBLE:
        return _DOUBLE_SHARE * course.scale_N
    return min(_BOUNDS_ROUNDING * float(golden.high_N.max(initial=1.0)), FLOAT_SHARE * scale_of(course.reference_N))


def bounds_code(bounds: Certified) -> dict[str, object]:
    """Values for the templates of the interval; a path that joints move has no total angle to make one of."""
    interval = bounds.interval
    low, high = interval.low_law, interval.high_law
    ratios = {
        "low_pull": math.exp(-low.pull_exponent),
        "low_release": math.exp(low.release_exponent),
        "high_pull": math.exp(-high.pull_exponent),
        "high_release": math.exp(high.release_exponent),
        "narrow": math.exp(-interval.margin),
        "wide": math.exp(interval.margin),
    }
    width_N = float(np.mean(bounds.high_N - bounds.low_N))
    return {"interval": interval, "bound_ratios": ratios, "bound_width_N": width_N}


def adaptive_golden(
    problem: Problem, settings: Adaptation, course: Course, precision: Precision, bounds: Certified | None = None
) -> AdaptiveGolden:
    """Golden vectors along the course of the other modules: the tuner on a rig with more friction, and the interval.

    The rig is one whose measurements may round otherwise without the tuner's force being another.
    """
    reference_N = course.reference_N
    tuning, step, start = tuning_of(problem, settings), problem.reference.step_s, float(reference_N[0])
    moved = replace(problem.transmission, motion=course.chain.motion)
    tuned = TunedChain.of(moved, problem.level, tuning.parameters)
    late_s = (
        -tuning.joint_delay_samples * step
    )  # the test passes the angles as they are: what it finds is ahead of them

    def tuner_of() -> SelfTuner:
        return SelfTuner(tuned, step, tuning, problem.limits, start, joints_late_s=late_s)

    def answers(given: FloatArray) -> FloatArray:
        tuner = tuner_of()
        return np.array([tuner.step(reference, measured) for reference, measured in given.tolist()])

    low = high = np.empty(0)
    if bounds is not None:
        low, high = bounds.interval.history_N(course.plant_force_N, start)
    ahead = course.joint_rad[np.minimum(np.arange(1, len(reference_N) + 1), len(reference_N) - 1)]
    most = 0.5 * _tolerance_N(problem, course, Precision.FLOAT)

    def vectors(factor: float) -> tuple[float, AdaptiveGolden]:
        """Of a rig with this factor on friction; and the share of rows that the tuner repeats."""
        rig = SimulatedRig(tuned.with_factors({_main(settings): factor}), step, 1, start)
        run = tuner_of().run(rig, reference_N, np.zeros(len(reference_N)))
        measured = rounded(run.measured, precision)
        golden = AdaptiveGolden(measured=measured, force_N=measured, low_N=low, high_N=high, joint_rad=ahead, easy=0)
        force, *others = (answers(golden.given(reference_N, nudge)) for nudge in range(NUDGES))
        easy = easy_rows(tuned.chain, force, step, start)
        repeated = repeated_rows(force, others, most)[:easy]
        return float(repeated.sum()) / len(force), replace(golden, force_N=force, easy=easy)

    tried: list[tuple[float, AdaptiveGolden]] = []
    for factor in _RIGS:
        tried.append(vectors(factor))
        if tried[-1][0] >= _REPEATED:
            break
    return max(tried, key=lambda found: found[0])[1]


def adaptive_test(
    problem: Problem,
    settings: Adaptation,
    course: Course,
    precision: Precision,
    golden: AdaptiveGolden,
    found: Sequence[FloatArray] = (),
) -> dict[str, object]:
    """Values for the self test of tuner and interval; answers of the exported code are none where it was not run."""
    tuning, tolerance = tuning_of(problem, settings), _tolerance_N(problem, course, precision)
    repeated = repeated_rows(golden.force_N, found, 0.5 * tolerance)
    if not len(found):
        repeated[golden.easy :] = False
    return {
        "golden": golden,
        "compared": Compared(tolerance=tolerance, expected=np.where(repeated, golden.force_N, np.nan)),
        "tuning": tuning,
        "far": 1e3 * tuning.span,  # no factor explains that
        "mu_index": settings.parameters.index(_main(settings)),
        "mu_dynamic": main_mu(problem, settings),
        "mu_release": other_mu(problem, settings),
        "bounds_tolerance_N": _bounds_tolerance_N(golden, course, precision),
    }
