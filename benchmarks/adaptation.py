"""Self-tuning on many rigs that differ at random from the controller's model, wrong models included.

    python benchmarks/adaptation.py           200 rigs of each kind, about a minute
    TENDONFF_RIGS=2000 python benchmarks/adaptation.py

The finger on references at random (two sines, 6 s), 1 kHz, 2 ms delay, noise 0.5 % of range or 20 um; the rig has 40
masses and a quarter of the step. Errors are RMS after 2 s in % of the range of the reference. *Plain* is the exact
inverse at the scenario's values on the same rig, *worse* the share of rigs where self-tuning has more than 1.3 times
its error and more than 1 %, *frozen* the share where the watch acted. Last, an hour of noise at rest after a motion.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.adaptation.code import TunedChain
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig, TunerStatus
from tendonff.ocp.adaptation.tuning import Sensor, Tunable, Tuning
from tendonff.ocp.tracking.limits import ForceLimits

RIGS = int(os.environ.get("TENDONFF_RIGS", "200"))
STEP_S, START_N, DURATION_S = 1e-3, 30.0, 6.0
TRANSMISSION = load_scenario(Path(__file__).parents[1] / "examples" / "finger.toml").transmission
LIMITS = ForceLimits.of(TRANSMISSION.actuator)
NOISE = {Sensor.OUTPUT_TENSION: 0.165, Sensor.ACTUATOR_POSITION: 2e-5}
VARIED = (Tunable.MU, Tunable.TENDON_STIFFNESS, Tunable.LOAD_STIFFNESS)
KINDS = {
    "friction within 40 %": {"mu": 0.4},
    "friction 20 %, bristles a factor of 2": {"mu": 0.2, "bristle": 1.0},
    "friction and tendon 20 %": {"mu": 0.2, "stiffness": 0.2},
    "friction 20 %, load 5 %": {"mu": 0.2, "load": 0.05},
    "friction 20 %, load 30 %": {"mu": 0.2, "load": 0.3},
    "friction right, load 30 %": {"load": 0.3},
}
VARIANTS = (
    (Sensor.OUTPUT_TENSION, (Tunable.MU,)),
    (Sensor.ACTUATOR_POSITION, (Tunable.MU,)),
    (Sensor.ACTUATOR_POSITION, (Tunable.MU, Tunable.LOAD_STIFFNESS)),
)


def reference(rng: np.random.Generator) -> np.ndarray:
    """Two sines that keep the tension between 8 and 52 N."""
    t = np.arange(round(DURATION_S / STEP_S) + 1) * STEP_S
    slow, fast = rng.uniform(6, 14), rng.uniform(2, 8)
    sines = slow * np.sin(2 * np.pi * rng.uniform(0.3, 0.8) * t) + fast * np.sin(2 * np.pi * rng.uniform(0.9, 2) * t)
    return START_N + np.minimum(t / 0.5, 1) * sines


def one(seed: int, spread: dict[str, float]) -> list[tuple[float, float, bool]]:
    """Plain error, error and whether it froze, for each variant on one rig."""
    rng = np.random.default_rng(seed)
    draw = {name: 1 + rng.uniform(-width, width) for name, width in spread.items() if name != "bristle"}
    bristle = 2.0 ** rng.uniform(-spread.get("bristle", 0.0), spread.get("bristle", 0.0))
    plant = TunedChain.of(TRANSMISSION, Level.PRESLIDING, VARIED, 40)
    name = "bristle_stiffness_N_per_m"
    plant = replace(plant, whole=plant.whole.changed({name: bristle * plant.whole.value(name)}))
    factors = (draw.get("mu", 1.0), draw.get("stiffness", 1.0), draw.get("load", 1.0))
    chain, wanted = plant.with_factors(dict(zip(VARIED, factors, strict=True))), reference(rng)
    answers = []
    for sensor, parameters in VARIANTS:
        tuned = TunedChain.of(TRANSMISSION, Level.PRESLIDING, parameters)
        travel = np.ptp(wanted) * (1 / TRANSMISSION.load.stiffness_N_per_m)
        span = float(np.ptp(wanted) if sensor is Sensor.OUTPUT_TENSION else travel)
        numbers = Tuning.of(
            sensor=sensor, parameters=parameters, delay_samples=2, noise=NOISE[sensor], span=span, step_s=STEP_S
        )
        noise, errors, frozen = NOISE[sensor] * rng.normal(size=len(wanted) - 1), [], False
        for adapt in (False, True):
            tuner = SelfTuner(tuned, STEP_S, numbers, LIMITS, START_N)
            run = tuner.run(SimulatedRig(chain, STEP_S, 4, START_N), wanted[1:], noise, adapt=adapt)
            late = (run.tension_N - wanted[1:])[round(2 / STEP_S) :]
            errors.append(100 * float(np.sqrt(np.mean(late**2)) / np.ptp(wanted)))
            frozen = adapt and bool((run.status & TunerStatus.FROZEN).any())
        answers.append((errors[0], errors[1], frozen))
    return answers


def an_hour_of_noise() -> None:
    """Drift of mu at rest."""
    for sensor in Sensor:
        tuned = TunedChain.of(TRANSMISSION, Level.PRESLIDING, (Tunable.MU,))
        span = 33.0 if sensor is Sensor.OUTPUT_TENSION else 0.011
        numbers = Tuning.of(
            sensor=sensor, parameters=(Tunable.MU,), delay_samples=2, noise=NOISE[sensor], span=span, step_s=STEP_S
        )
        tuner, rng = SelfTuner(tuned, STEP_S, numbers, LIMITS, START_N), np.random.default_rng(0)
        rig = SimulatedRig(tuned.with_factors({Tunable.MU: 1.2}), STEP_S, 1, START_N)
        wanted = reference(rng)
        found = tuner.run(rig, wanted[1:], NOISE[sensor] * rng.normal(size=len(wanted) - 1)).factors[-1, 0]
        for _ in range(60):
            hold = np.full(60_000, wanted[-1])
            last = tuner.run(rig, hold, NOISE[sensor] * rng.normal(size=len(hold))).factors[-1, 0]
        print(f"an hour of noise at rest, {sensor}: mu factor {found:.5f} -> {last:.5f} (true 1.2)")


def main() -> None:
    """Print the table."""
    for kind, spread in KINDS.items():
        answers = np.array([one(seed, spread) for seed in range(RIGS)])
        middle, worst = np.median(answers[:, 0, 0]), answers[:, 0, 0].max()
        print(f"\n{kind}: plain {middle:.2f} % in the middle, {worst:.1f} % at worst")
        for k, (sensor, parameters) in enumerate(VARIANTS):
            plain, tuned, frozen = answers[:, k].T
            worse = (tuned > 1) & (tuned > 1.3 * plain)
            print(
                f"  {sensor + ', ' + ' + '.join(parameters):38} {np.median(tuned):6.2f} % in the middle, "
                f"{np.quantile(tuned, 0.95):6.2f} % at 95 %, {tuned.max():6.2f} % at worst; "
                f"worse {100 * worse.mean():.0f} %, frozen {100 * frozen.mean():.0f} %"
            )
    an_hour_of_noise()


if __name__ == "__main__":
    main()
