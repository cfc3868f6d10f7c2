"""A finger-like rig with its tuners, and the loop around a rig that shares no code with them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.ocp.adaptation.code import TunedChain
from tendonff.ocp.adaptation.tuner import SelfTuner
from tendonff.ocp.adaptation.tuning import Sensor, Tunable, Tuning
from tendonff.ocp.tracking.limits import ForceLimits

STEP_S, START_N = 1e-3, 30.0
NOISE = {Sensor.OUTPUT_TENSION: 0.165, Sensor.ACTUATOR_POSITION: 2e-5}
SPAN = {Sensor.OUTPUT_TENSION: 33.0, Sensor.ACTUATOR_POSITION: 0.0115}


class Bench:
    """Tuners of one transmission, and blind runs on the independent rig."""

    step_s, start_N, noise = STEP_S, START_N, NOISE

    def __init__(self, transmission, rigs) -> None:
        friction = replace(
            transmission.friction,
            mu_dynamic=0.2,
            mu_static=0.2,
            mu_dynamic_release=None,
            mu_static_release=None,
            soft_bristle_stiffness_N_per_m=5e4,
            adhesion_N=0.0,
        )
        load = replace(transmission.load, damping_N_s_per_m=8.0)
        self.transmission = replace(transmission, friction=friction, load=load)
        self.rigs = rigs
        self.limits = ForceLimits.of(self.transmission.actuator)

    def tuning(self, sensor: Sensor, parameters=(Tunable.MU,), *, delay: int = 2, gain: float = 0.0) -> Tuning:
        return Tuning.of(
            sensor=sensor,
            parameters=parameters,
            delay_samples=delay,
            noise=NOISE[sensor],
            span=SPAN[sensor],
            step_s=STEP_S,
            integral_gain_per_s=gain,
        )

    def tuner(self, tuning: Tuning, limits: ForceLimits | None = None) -> SelfTuner:
        tuned = TunedChain.of(self.transmission, Level.PRESLIDING, tuning.parameters)
        return SelfTuner(tuned, STEP_S, tuning, limits or self.limits, START_N)

    def blind(self, tuner: SelfTuner, tuning: Tuning, reference, *, change: Callable | None = None, **hidden):
        """Output tension and status bits; hidden: what the rig has and the tuner does not know."""
        rig = self.rigs.Rig(self.transmission, START_N, step_s=2e-5, **hidden)
        position = tuning.sensor is Sensor.ACTUATOR_POSITION
        noise = NOISE[tuning.sensor] * np.random.default_rng(0).normal(size=len(reference))
        measure = (lambda r: r.position_m) if position else (lambda r: r.tension_N)
        return self.rigs.closed_loop(rig, tuner, reference, measure, noise, delay=tuning.delay_samples, change=change)


@pytest.fixture(scope="session")
def bench(generic, independent_rig) -> Bench:
    return Bench(generic, independent_rig)


@pytest.fixture(scope="session")
def reference():
    """Two sines, 4 s."""
    t = np.arange(4001) * STEP_S
    sines = 12 * np.sin(2 * np.pi * 0.5 * t) + 5 * np.sin(2 * np.pi * 1.3 * t)
    return START_N + np.minimum(t / 0.5, 1) * sines


@pytest.fixture(scope="session")
def percent(reference):
    """RMS error in percent of the range of a reference, from a time on."""

    def error(tension, wanted=reference, after_s=2.0, until_s=None):
        part = slice(round(after_s / STEP_S), None if until_s is None else round(until_s / STEP_S))
        return 100 * float(np.sqrt(np.mean((tension[part] - wanted[part]) ** 2))) / float(np.ptp(wanted))

    return error
