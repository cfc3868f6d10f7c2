"""The interval of `<prefix>_bounds` against random plants whose directions are anywhere within what it admits.

    python benchmarks/bounds.py           50 plants of 40 masses on each rig

The force is that of the design. Plants differ in friction of each direction (within the spread), and in the second row
of each rig also in bristles (a factor of 2), tendon and load (20 %). *Outside* counts samples below `low` or above
`high`; *width* is the mean of high - low over the range of the reference.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.tuning import BOUND_SPREAD, certified
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.simulate import simulate

EXAMPLES = Path(__file__).parents[1] / "examples"
RIGS = ("finger", "bowden", "surgical", "exosuit")
PLANTS, MASSES = 50, 40


def plant(transmission: Transmission, rng: np.random.Generator, others: bool) -> Transmission:
    """A transmission at random."""
    t = transmission
    pull, release = 1 + rng.uniform(-BOUND_SPREAD, BOUND_SPREAD, 2)
    friction = replace(
        t.friction,
        mu_dynamic=pull * t.friction.mu_dynamic,
        mu_static=pull * t.friction.mu_static,
        mu_dynamic_release=release * t.friction.release_dynamic,
        mu_static_release=release * t.friction.release_static,
    )
    if not others:
        return replace(t, friction=friction)
    soft = 2 ** rng.uniform(-1, 1)
    tendon, load = 1 + rng.uniform(-0.2, 0.2, 2)
    friction = replace(friction, soft_bristle_stiffness_N_per_m=soft * friction.soft_bristle_stiffness_N_per_m)
    elastic = {name: tendon * getattr(t.tendon, name) for name in ("stiffness_N_per_m", "relaxing_stiffness_N_per_m")}
    return replace(
        t,
        friction=friction,
        tendon=replace(t.tendon, **elastic),
        load=replace(t.load, stiffness_N_per_m=load * t.load.stiffness_N_per_m),
    )


def main() -> None:
    """Print the table."""
    for name in RIGS:
        problem = Problem.of(load_scenario(EXAMPLES / f"{name}.toml"))
        found, reference = certified(problem), problem.reference
        force, span = problem.limited(problem.inversion.force_N), float(np.ptp(reference.tension_N))
        for others in (False, True):
            rng, rows, plants, worst = np.random.default_rng(1), 0, 0, 0.0
            for _ in range(PLANTS):
                chain = Chain.of(plant(problem.transmission, rng, others), problem.level, MASSES)
                start = reference.initial_tension_N
                run = simulate(chain, force, reference.step_s, initial_tension_N=start).require()
                beyond = np.maximum(found.low_N - run.output_tension_N, run.output_tension_N - found.high_N)
                rows, plants = rows + int((beyond > 0).sum()), plants + int((beyond > 0).any())
                worst = max(worst, float(beyond.max()))
            width = 100 * float(np.mean(found.high_N - found.low_N)) / span
            print(
                f"{name:10} {'all numbers' if others else 'friction alone':15} outside {rows} of {PLANTS * len(force)} "
                f"samples on {plants} plants, by {100 * worst / span:.2f} % of range at most; margin "
                f"{100 * found.interval.margin:.2f} %, width {width:.0f} % of range",
                flush=True,
            )


if __name__ == "__main__":
    main()
