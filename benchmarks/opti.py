"""`tf.opti` against the default search: `python -m benchmarks.opti [EXAMPLE [DURATION_S [STEP_S]]]`.

Solve time, and RMS error on 40 masses at a tenth of the step; by default `finger_fast`, 1 s at 5 ms.
"""

import sys
import time
from dataclasses import replace

import numpy as np

import tendonff as tf
from tendonff.compensator.compensators.optimal import solve


def main(example: str = "finger_fast", duration_s: str = "1.0", step_s: str = "0.005") -> None:
    """Print the table."""
    scenario = tf.load_scenario(f"examples/{example}.toml")
    scenario = replace(
        scenario,
        run=replace(scenario.run, step_s=float(step_s)),
        reference=replace(scenario.reference, duration_s=float(duration_s)),
    )
    problem = tf.Problem.of(scenario)
    plant, reference = tf.Plant.fine(problem.transmission, problem.level), problem.reference

    def error(force_N):
        output = plant.respond(tf.Profile(force_N=force_N), reference).require().output_N
        return float(np.sqrt(np.mean((output - reference.tension_N) ** 2)))

    began = time.perf_counter()
    default = solve(problem)
    took = time.perf_counter() - began
    posed = tf.opti(scenario)
    answer = posed.solve()
    force = np.interp(reference.time_s, posed.time_s, answer.value(posed.force_N))
    clipped = error(problem.limited(problem.inversion.force_N))
    print(f"clipped inverse                          {clipped:.4f} N on 40 masses")
    print(f"sqp    {took:6.2f} s                          {error(default.force_N):.4f} N")
    print(f"ipopt  {answer.solve_s:6.2f} s, {answer.iterations:3d} iterations         {error(force):.4f} N")
    print(answer.message)


if __name__ == "__main__":
    main(*sys.argv[1:])
