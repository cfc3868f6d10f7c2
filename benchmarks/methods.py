"""Difference of a method from the fixed step on every example: `python -m benchmarks.methods [METHOD [EXAMPLE ...]]`.

The exact inverse within the limits, its first 1000 steps; % of the reference's range, RMS and largest.
"""

import sys
import time
from pathlib import Path

import numpy as np

import tendonff as tf
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.ocp.joint.simulate import simulate_joint
from tendonff.ocp.tendon.simulate import simulate

EXAMPLES = Path(__file__).parent.parent / "examples"
ROWS = 1001


def responses(scenario, methods):
    """Reference's range, and what the exact inverse gives by each method."""
    if isinstance(scenario, JointScenario):
        task = JointTask.of(scenario)
        motor, contact = task.inversion.motor_rad[:ROWS], task.sampled.contact_N_m[:ROWS]
        step = scenario.run.step_s
        runs = [simulate_joint(task.problem, motor, step, contact_N_m=contact, method=each) for each in methods]
        return np.ptp(task.sampled.angle_rad), [run.require().angle_rad for run in runs]
    problem = tf.Problem.of(scenario)
    reference = problem.reference
    force = problem.limited(problem.inversion.force_N)[:ROWS]
    state = problem.chain.rest_state(reference.initial_tension_N)
    runs = [simulate(problem.chain, force, reference.step_s, state=state, method=each) for each in methods]
    return np.ptp(reference.tension_N), [run.require().output_tension_N for run in runs]


def main(method: str = "idas", *names: str) -> None:
    """Print the table."""
    for name in names or sorted(path.stem for path in EXAMPLES.glob("*.toml")):
        scenario = tf.load_scenario(EXAMPLES / f"{name}.toml")
        if isinstance(scenario, FingerScenario):
            print(f"{name:22s} several joints: the fixed step alone")
            continue
        began = time.perf_counter()
        span, (fixed, other) = responses(scenario, (tf.Method.BDF2, tf.Method(method)))
        apart, took = 100 * np.abs(other - fixed) / span, time.perf_counter() - began
        print(f"{name:22s} {np.sqrt(np.mean(apart**2)):.2g} % RMS, {apart.max():.2g} % at most, {took:.1f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
