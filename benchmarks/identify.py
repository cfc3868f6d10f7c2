"""How well identification finds a known truth: blind repetitions on dirty made-up measurements.

Every repetition draws a transmission at random, plays the excitation that `tendonff identify --suggest` proposes for
the nominal scenario on a chain of 40 masses, adds 0.5 % noise, spikes, gaps and missing cells, and fits starting from
the nominal scenario. Prints errors, the share of 95 % intervals that hold the truth, and times.

    python benchmarks/identify.py [REPETITIONS] [FIRST_SEED]
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.identification.run import identify
from tendonff.compensator.identification.suggest import suggest
from tendonff.compensator.identification.synthetic import DIRTY, write_synthetic
from tendonff.compensator.scenario.scenario import load_scenario
from tendonff.models.parameters import Transmission

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
NAMES = (
    "mu_dynamic",
    "mu_dynamic_release",
    "stiffness_N_per_m",
    "relaxing_stiffness_N_per_m",
    "relaxation_time_s",
    "soft_bristle_stiffness_N_per_m",
)


def drawn(nominal: Transmission, rng: np.random.Generator) -> Transmission:
    """A transmission somewhere around the nominal one."""
    mu = rng.uniform(0.14, 0.28)
    release = mu * rng.uniform(0.75, 1.1)
    t, f = nominal.tendon, nominal.friction
    return replace(
        nominal,
        tendon=replace(
            t,
            stiffness_N_per_m=t.stiffness_N_per_m * rng.uniform(0.7, 1.4),
            relaxing_stiffness_N_per_m=t.relaxing_stiffness_N_per_m * rng.uniform(0.6, 1.6),
            relaxation_time_s=t.relaxation_time_s * rng.uniform(0.6, 1.5),
        ),
        friction=replace(
            f,
            mu_dynamic=mu,
            mu_static=mu,
            mu_dynamic_release=release,
            mu_static_release=release,
            soft_bristle_stiffness_N_per_m=f.soft_bristle_stiffness_N_per_m * rng.uniform(0.5, 2),
        ),
    )


def truth_of(transmission: Transmission, name: str) -> float:
    return float(getattr(transmission.friction, name, None) or getattr(transmission.tendon, name))


def main(repetitions: int, first_seed: int) -> None:
    nominal = load_scenario(EXAMPLES / "finger.toml")
    force = suggest(nominal)
    errors: dict[str, list[float]] = {name: [] for name in NAMES}
    inside: dict[str, list[bool]] = {name: [] for name in NAMES}
    seconds: list[float] = []
    together: list[bool] = []
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "trial.csv"
        for seed in range(first_seed, first_seed + repetitions):
            truth = drawn(nominal.transmission, np.random.default_rng(seed))
            write_synthetic(data, truth, force.time_s, force.force_N, replace(DIRTY, seed=seed))
            start = time.perf_counter()
            found = identify(nominal, [data])
            seconds.append(time.perf_counter() - start)
            shown = []
            for name in NAMES:
                estimate = found.estimate(name)
                if not estimate.identifiable or estimate.interval is None:
                    shown.append(f"{name} not identified")
                    continue
                true = truth_of(truth, name)
                errors[name].append(estimate.value / true - 1)
                inside[name].append(estimate.interval[0] <= true <= estimate.interval[1])
                shown.append(f"{100 * errors[name][-1]:+.2f}{'' if inside[name][-1] else '*'}")
            together.append("*" not in "".join(shown))
            print(f"{seed:3d} {seconds[-1]:5.1f} s  {found.law}: {'  '.join(shown)}", flush=True)
    print(
        f"\n{repetitions} repetitions, {force.time_s[-1]:.0f} s at 1 kHz each, median time {np.median(seconds):.1f} s"
    )
    for name in NAMES:
        e = 100 * np.abs(errors[name])
        print(
            f"{name:32s} found in {len(e):3d}  median error {np.median(e):5.2f} %  largest {e.max():5.2f} %  "
            f"truth in the interval {100 * np.mean(inside[name]):5.1f} %"
        )
    every = np.concatenate([np.array(inside[name]) for name in NAMES])
    print(f"truth in the interval: {100 * every.mean():.1f} % of all values, every value of a fit at once in", end=" ")
    print(f"{100 * np.mean(together):.1f} % (independent intervals would give {100 * 0.95 ** len(NAMES):.0f} %)")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50, int(sys.argv[2]) if len(sys.argv) > 2 else 0)
