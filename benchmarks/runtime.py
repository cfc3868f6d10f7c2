"""Time of a control cycle of seventeen joints in Python, and what steps of other lengths cost in accuracy."""

import math
import time
from pathlib import Path

import numpy as np

import tendonff as tf
from tendonff.compensator.scenario.driven.joint import JointScenario, sample_joint

JOINTS, CYCLES = 17, 1000
EXAMPLES = Path(__file__).parents[1] / "examples"


def cycle_ms(scenario: JointScenario) -> float:
    """Time of a cycle in which every joint is commanded once [ms], the median of ten parts."""
    angle = sample_joint(scenario).angle_rad[:CYCLES].tolist()
    hand = [tf.Runtime(scenario) for _ in range(JOINTS)]
    spent = []
    for part in np.array_split(angle, 10):
        start = time.perf_counter()
        for wanted in part.tolist():
            for joint in hand:
                joint.step(wanted)
        spent.append((time.perf_counter() - start) / len(part))
    return 1e3 * float(np.median(spent))


def jitter_deg(scenario: JointScenario, least_s: float, most_s: float) -> float:
    """Largest difference between commands at random times and those at every sample [deg]."""
    sampled = sample_joint(scenario)
    every = tf.Runtime(scenario)
    commands = np.array([np.atleast_1d(every.step(float(angle))) for angle in sampled.angle_rad])
    runtime, chance, now, worst = tf.Runtime(scenario), np.random.default_rng(1), 0.0, 0.0
    runtime.step(float(sampled.angle_rad[0]))
    while True:
        dt = chance.uniform(least_s, most_s)
        now += dt
        if now > sampled.time_s[-1]:
            return math.degrees(worst)
        command = runtime.step(float(np.interp(now, sampled.time_s, sampled.angle_rad)), dt=dt)
        expected = np.array([np.interp(now, sampled.time_s, column) for column in commands.T])
        worst = max(worst, float(np.abs(command - expected).max()))


def main() -> None:
    """Print the table."""
    for name in ("hand_joint", "instrument_pair"):
        scenario = tf.load_scenario(EXAMPLES / f"{name}.toml")
        print(f"{name}: {JOINTS} joints {cycle_ms(scenario):.3f} ms a cycle")
        for least, most in ((1e-3, 3e-3), (5e-3, 15e-3), (15e-3, 25e-3)):
            off = jitter_deg(scenario, least, most)
            print(
                f"  called every {1e3 * least:g} to {1e3 * most:g} ms: {off:.3f} deg from the samples' commands at most"
            )


if __name__ == "__main__":
    main()
