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

    def __init__(self, transmission, rig_class) -> None:
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
        self.rig_class = rig_class
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

    def blind(self, tuner: SelfTuner, tuning: Tuning, reference, *, change: Callable | None = None, seed=0, **hidden):
        """Output tension, force and status bits; hidden: what the rig has and the tuner is not told."""
        rig = self.rig_class(self.transmission, START_N, step_s=2e-5, **hidden)
        noise = NOISE[tuning.sensor] * np.random.default_rng(seed).normal(size=len(reference))
        force, tensions, forces, status, past = START_N, [START_N], [START_N], [0], []
        for k, wanted in enumerate(reference[1:]):
            if change is not None:
                change(rig, k * STEP_S)
            true = rig.tension_N if tuning.sensor is Sensor.OUTPUT_TENSION else rig.position_m
            past.append(true + noise[k])
            new = tuner.step(wanted, past[max(0, k - tuning.delay_samples)])
            rig.advance(force, new, STEP_S)
            force = new
            tensions.append(rig.tension_N)
            forces.append(force)
            status.append(int(tuner.status))
        return np.array(tensions), np.array(forces), np.array(status)


@pytest.fixture(scope="session")
def bench(generic, independent_rig) -> Bench:
    return Bench(generic, independent_rig.Rig)


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
