"""Difference of a method from the fixed step on every example: `python -m benchmarks.methods [METHOD [EXAMPLE ...]]`.

The exact inverse within the limits, its first 1000 steps; % of the reference's range, RMS and largest.
"""

import sys
import time
from pathlib import Path

import numpy as np

import tendonff as tf
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.ocp.joint.simulate import simulate_joint
from tendonff.ocp.mechanism.response import simulate_mechanism
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
    if isinstance(scenario, FingerScenario):
        task = FingerTask.of(scenario)
        motor, known = task.inversion.motor_rad[:ROWS], task.sampled.motion.angle_rad[:ROWS]
        problem, given = task.problem(scenario.mechanism), {"known": known, "effort": task.efforts[:ROWS]}
        runs = [simulate_mechanism(problem, motor, task.step_s, method=each, **given) for each in methods]
        return np.ptp(task.wanted_rad, axis=0), [run.position[:, : len(scenario.mechanism.joints)] for run in runs]
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
        began = time.perf_counter()
        span, (fixed, other) = responses(scenario, (tf.Method.BDF2, tf.Method(method)))
        apart, took = 100 * np.abs(other - fixed) / span, time.perf_counter() - began
        print(f"{name:22s} {np.sqrt(np.mean(apart**2)):.2g} % RMS, {apart.max():.2g} % at most, {took:.1f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
