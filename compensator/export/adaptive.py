"""What an export adds for a scenario with [adaptation]: tuner, certified interval, an inverse whose mu can be set."""

import math
from dataclasses import asdict, dataclass

import numpy as np

from tendonff.compensator.adapt.setup import Certified, certified, tuned_chain, tuning_of
from tendonff.compensator.compensators.base import CModule, FloatArray, Problem
from tendonff.compensator.export.text.table_index import rounded
from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenario.adaptation import Adaptation
from tendonff.ocp.adaptation.target import tuner_code
from tendonff.ocp.adaptation.tuner import REALS, SelfTuner, SimulatedRig
from tendonff.ocp.adaptation.tuning import Sensor, Tunable
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.step.target import controller_limits

ADAPTIVE = CModule(name="adaptive", content="exact inverse that tunes itself to a measurement")
BOUNDS = CModule(name="bounds", content="certified interval of the output tension")
ADAPTIVE_MODULES = (ADAPTIVE, BOUNDS)

_RIG = 1.1
"""Factor on friction of the rig behind the golden vectors."""

_FRICTION = (Tunable.MU, Tunable.MU_PULL, Tunable.MU_RELEASE)
_MEASURED = {
    Sensor.OUTPUT_TENSION: "the output tension [N]",
    Sensor.ACTUATOR_POSITION: "the actuator's position relative to the start [m]",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveGolden:
    """Golden vectors of tuner and interval, one row per sample.

    Parameters
    ----------
    measured : ndarray, shape (rows,)
        What the tuner is given, exact in the real type.
    force_N : ndarray, shape (rows,)
        What it answers.
    low_N, high_N : ndarray, shape (rows,)
        Interval for the force of the plant's golden vectors.
    """

    measured: FloatArray
    force_N: FloatArray
    low_N: FloatArray
    high_N: FloatArray


def adaptive_code(problem: Problem, settings: Adaptation, precision: Precision, prefix: str) -> dict[str, object]:
    """What the templates of tuner and interval need."""
    if problem.chain.moving:
        raise InputError(
            "[adaptation]: the tuner for a path in sections or one that moves is not exported as C or FMU yet; "
            "leave the table out here (tendonff adapt takes such paths)"
        )
    tuning, bounds = tuning_of(problem, settings), certified(problem)
    tuned = tuned_chain(problem, tuning)
    code = tuner_code(tuned, problem.reference.step_s, f"{prefix}_adaptive", precision, settings.delay_samples)
    friction, load = problem.transmission.friction, problem.transmission.load
    main = next(p for p in settings.parameters if p in _FRICTION)
    tunes_load = Tunable.LOAD_STIFFNESS in settings.parameters
    return {
        **asdict(code),
        "tuning": tuning,
        "tuning_reals": REALS,
        "tuning_value": lambda name: getattr(tuning, name),
        "sensor_index": int(tuning.sensor is Sensor.ACTUATOR_POSITION),
        "sensor_words": tuning.sensor.words,
        "measured_words": _MEASURED[tuning.sensor],
        "tuned_words": " and ".join(settings.parameters),
        "model_rows": 2 * (2 + controller_limits(precision).splits),  # of inner links, and of those at the ends
        "mu_dynamic": friction.release_dynamic if main is Tunable.MU_RELEASE else friction.mu_dynamic,
        "mu_index": settings.parameters.index(main),
        "tunes_load": tunes_load,
        "load_index": settings.parameters.index(Tunable.LOAD_STIFFNESS) if tunes_load else -1,
        "load_stiffness_N_per_m": load.stiffness_N_per_m,
        "interval": bounds.interval,
        "bound_ratios": _ratios(bounds),
    }


def _ratios(bounds: Certified) -> dict[str, float]:
    interval = bounds.interval
    low, high = interval.low_law, interval.high_law
    return {
        "low_pull": math.exp(-low.pull_exponent),
        "low_release": math.exp(low.release_exponent),
        "high_pull": math.exp(-high.pull_exponent),
        "high_release": math.exp(high.release_exponent),
        "narrow": math.exp(-interval.margin),
        "wide": math.exp(interval.margin),
    }


def adaptive_golden(
    problem: Problem, settings: Adaptation, reference_N: FloatArray, plant_force_N: FloatArray, precision: Precision
) -> AdaptiveGolden:
    """Golden vectors: the tuner on a rig with more friction, and the interval.

    Parameters
    ----------
    problem : Problem
    settings : Adaptation
    reference_N, plant_force_N : ndarray, shape (rows,)
        Those of the other modules.
    precision : Precision
    """
    tuning, step, start = tuning_of(problem, settings), problem.reference.step_s, float(reference_N[0])
    tuned = tuned_chain(problem, tuning)
    main = next(p for p in settings.parameters if p in _FRICTION)
    rig = SimulatedRig(tuned.with_factors({main: _RIG}), step, 1, start)
    run = SelfTuner(tuned, step, tuning, problem.limits, start).run(rig, reference_N, np.zeros(len(reference_N)))
    measured = rounded(run.measured, precision)
    tuner = SelfTuner(tuned, step, tuning, problem.limits, start)
    force = [tuner.step(float(r), float(m)) for r, m in zip(reference_N, measured, strict=True)]
    low, high = certified(problem).interval.history_N(plant_force_N, start)
    return AdaptiveGolden(measured=measured, force_N=np.array(force), low_N=low, high_N=high)
