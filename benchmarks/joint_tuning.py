"""A joint that tunes itself, on a plant that is written without the package's models.

`python -m benchmarks.joint_tuning` runs the exported code of `examples/hand_joint_adaptive.toml` on the plant of
`tests/joint_plant.py`, 40 masses a tendon and steps of 2 us, whose friction and pre-tension are off. Its encoder has
12 bits a turn.
"""

from pathlib import Path

import numpy as np

import tendonff as tf
from tendonff.compensator.scenario.driven.joint import JointScenario, sample_joint
from tendonff.models.parameters.numbers import with_numbers
from tests.joint_plant import Plant

SCENARIO = Path(__file__).parents[1] / "examples" / "hand_joint_adaptive.toml"
COUNT_RAD = 2 * np.pi / 4096
LOOPS = ((1.0, 1.0), (0.7, 1.0), (1.3, 1.0), (1.0, 0.8), (1.0, 1.2), (0.7, 0.8), (1.3, 1.2))
STUCK_S = 4.0


def errors_deg(
    scenario: JointScenario, mu: float, tension: float, kind: str, *, stuck: bool = False
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Errors of three strokes, shape (3, rows), the factors in use, and whether tuning froze."""
    once = sample_joint(scenario).angle_rad
    angle, step = np.concatenate([once, once[1:], once[1:]]), scenario.run.step_s
    pretension = tension * (scenario.mechanism.drive.pretension_N or 0.0)
    mechanism = with_numbers(scenario.mechanism, {"mu": mu, "drive.pretension_N": pretension})
    plant = Plant(mechanism, step, float(angle[0]), tensions_N=np.full(2, pretension))
    runtime, delay = tf.Runtime(scenario, kind=kind), scenario.adaptation.delay_samples if scenario.adaptation else 0
    found, factors, last, measured, frozen = [float(angle[0])], [], 0.0, 0.0, False
    for k in range(1, len(angle)):
        if not (stuck and k * step > STUCK_S):
            measured = round(found[max(k - 1 - delay, 0)] / COUNT_RAD) * COUNT_RAD
        command = float(runtime.step(float(angle[k]), measured=measured))
        found.append(plant.turn(np.array([last, command]))[0, 0])
        factors.append(runtime.factor)
        frozen |= tf.RuntimeStatus.FROZEN in runtime.status
        last = command
    error = np.rad2deg(np.array(found) - angle)[1:].reshape(3, -1)
    return error, np.array(factors), frozen


def rms(error: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(error**2)))


def main() -> None:
    """Print a row for each loop."""
    scenario = tf.load_scenario(SCENARIO)
    print("| friction | pre-tension | inverse | self-tuning, first stroke | third stroke | factor |")
    print("|---|---|---|---|---|---|")
    for mu, tension in LOOPS:
        plain, _, _ = errors_deg(scenario, mu, tension, "joint")
        tuned, factors, _ = errors_deg(scenario, mu, tension, "adaptive")
        first, third = rms(tuned[0]), rms(tuned[2])
        print(
            f"| {mu:g} | {tension:g} | {rms(plain[2]):.3f} | {first:.3f} | {third:.3f} | {factors[-1]:.3f} |",
            flush=True,
        )
    error, factors, frozen = errors_deg(scenario, 1.3, 1.0, "adaptive", stuck=True)
    kept = factors[round(STUCK_S / scenario.run.step_s)]
    print(
        f"encoder stuck after {STUCK_S:g} s, friction 1.3: frozen {frozen}, factor {kept:.3f} then, {factors[-1]:.3f} "
        f"at the end; third stroke {rms(error[2]):.3f} deg"
    )


if __name__ == "__main__":
    main()
