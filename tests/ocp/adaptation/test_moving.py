"""Self-tuning where joints move the path: blind on 60 masses in four sections, and against central differences."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.adaptation.code import TunedChain
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig, TunerStatus
from tendonff.ocp.adaptation.tuning import Sensor, Tunable, Tuning
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tracking.limits import ForceLimits
from tests.moving_plant import SECTIONS, MovingPlant, moving_finger

pytestmark = pytest.mark.compiler
STEP_S, START_N, DELAY, FINER = 1e-3, 30.0, 2, 2
TIME = np.arange(0.0, 3.0, STEP_S)
REFERENCE = 30 + np.minimum(TIME / 0.5, 1) * (12 * np.sin(2 * np.pi * 0.9 * TIME) + 4 * np.sin(2 * np.pi * 2.1 * TIME))
NOISE = {Sensor.OUTPUT_TENSION: 0.16, Sensor.ACTUATOR_POSITION: 2e-5}
LIMITS = ForceLimits(minimum_N=0.0, maximum_N=200.0, rate_N_per_s=1e5)


@pytest.fixture(scope="module")
def finger(generic: Transmission) -> Transmission:
    return moving_finger(generic, TIME, segments=12)


def rougher(finger: Transmission, mu: float) -> Transmission:
    """Another friction on all sections."""
    sections = tuple(
        replace(s, mu_dynamic=mu * s.mu_dynamic, mu_static=mu * s.mu_static) if s.mu_dynamic and s.mu_static else s
        for s in SECTIONS
    )
    friction = replace(finger.friction, mu_dynamic=0.2 * mu, mu_static=0.2 * mu)
    return replace(finger, path=replace(finger.path, sections=sections), friction=friction)


def tuner_for(finger: Transmission, sensor: Sensor) -> SelfTuner:
    tuned = TunedChain.of(finger, Level.PRESLIDING, (Tunable.MU,))
    states = invert(tuned.chain, REFERENCE, STEP_S, record=True).states
    assert states is not None
    position = sensor is Sensor.ACTUATOR_POSITION
    span = np.ptp(states[:, tuned.chain.layout.part("q_a")] if position else REFERENCE)
    tuning = Tuning.of(
        sensor=sensor,
        parameters=(Tunable.MU,),
        delay_samples=DELAY,
        noise=NOISE[sensor],
        span=float(span),
        step_s=STEP_S,
    )
    return SelfTuner(tuned, STEP_S, tuning, LIMITS, START_N)


def blind(tuner: SelfTuner, plant: MovingPlant, sensor: Sensor) -> float:
    """RMS error after 2 s in percent of range."""
    force, position, tension, seen = START_N, 0.0, [START_N], []
    noise = NOISE[sensor] * np.random.default_rng(0).normal(size=len(REFERENCE))
    for k, wanted in enumerate(REFERENCE[1:]):
        seen.append((position if sensor is Sensor.ACTUATOR_POSITION else tension[-1]) + noise[k])
        new = tuner.step(float(wanted), float(seen[max(0, k - DELAY)]))
        for part in range(1, FINER + 1):
            output = plant.step(force + (new - force) * part / FINER)
            position += plant.h * float(plant.v[0])
        force = new
        tension.append(output)
    late = np.array(tension[2000:]) - REFERENCE[2000:]
    return 100 * float(np.sqrt(np.mean(late**2)) / np.ptp(REFERENCE))


@pytest.mark.parametrize(
    ("sensor", "mu"),
    [
        (Sensor.ACTUATOR_POSITION, 0.8),
        *(pytest.param(sensor, 1.2, marks=pytest.mark.nightly) for sensor in Sensor),  # exported they are met too
    ],
)
def test_friction_that_is_20_percent_off_is_found_while_joints_move(finger, sensor, mu, record_property):
    tuner = tuner_for(finger, sensor)
    left = blind(tuner, MovingPlant(rougher(finger, mu), START_N, STEP_S / FINER, 15), sensor)
    record_property("figure", f"moving path, self-tuning, {sensor}, mu {mu:g}: {left:.2f} % of range after 2 s")
    assert left <= 0.8
    assert tuner.factors[0] == pytest.approx(mu, rel=0.02)
    assert not tuner.status & TunerStatus.FROZEN


def test_without_tuning_it_misses_by_more_than_5_percent_there(finger):
    """What is measured is no number."""
    tuner, plant = tuner_for(finger, Sensor.ACTUATOR_POSITION), MovingPlant(rougher(finger, 1.2), START_N, STEP_S, 15)
    tension = [plant.step(tuner.step(float(wanted), np.nan)) for wanted in REFERENCE[1:]]
    late = np.array(tension[2000:]) - REFERENCE[2001:]
    assert 100 * np.sqrt(np.mean(late**2)) / np.ptp(REFERENCE) > 5


@pytest.mark.parametrize("sensor", Sensor)
def test_slopes_on_a_moving_path_are_the_derivatives_of_the_prediction(finger, sensor):
    """Against rigs with other friction under the same force: central differences."""
    tuned, silent = TunedChain.of(finger, Level.PRESLIDING, (Tunable.MU,)), np.zeros(len(REFERENCE) - 1)
    base = tuner_for(finger, sensor).run(
        SimulatedRig(tuned.chain, STEP_S, 1, START_N), REFERENCE[1:], silent, adapt=False
    )
    outputs = []
    for mu in (1 - 1e-5, 1 + 1e-5):
        rig = SimulatedRig(tuned.with_factors({Tunable.MU: mu}), STEP_S, 1, START_N)
        run = tuner_for(finger, sensor).run(rig, REFERENCE[1:], silent, adapt=False)
        # What was measured is two samples old; the first is not known before.
        outputs.append(run.measured[DELAY + 1 :])
    expected = (outputs[1] - outputs[0]) / 2e-5
    assert base.slopes[: len(expected), 0] == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


def test_without_learning_it_is_the_exact_inverse_of_the_moving_path(finger):
    tuned = TunedChain.of(finger, Level.PRESLIDING, (Tunable.MU,))
    tuner = tuner_for(finger, Sensor.ACTUATOR_POSITION)
    forces = [tuner.step(float(wanted), np.nan) for wanted in REFERENCE[1:]]
    assert forces == pytest.approx(invert(tuned.chain, REFERENCE, STEP_S).force_N[1:], abs=1e-7)
