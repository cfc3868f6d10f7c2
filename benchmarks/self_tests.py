"""Export random legal scenarios and run the self test that is shipped with each; all must pass.

Run: python benchmarks/self_tests.py [--count 60] [--seed 1] [--self-tuning]

Also counts those in which a module was worse than none and was left out, and prints the largest tolerance of each
module's golden vectors over the range of the reference, and the share of rows that are compared in single precision.
With --self-tuning half of the scenarios have it.
"""

import argparse
import collections
import math
import re
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import tendonff as tf
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.reference import Shape, SineReference, WaypointReference
from tendonff.compensator.scenario.settings import Adaptation, Stream
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError
from tendonff.ocp.adaptation.tuning import Sensor, Tunable
from tendonff.ocp.errors import SolveError

FLAGS = ("-std=c99", "-O2", "-w", "-fno-math-errno")  # contraction as the compiler likes it
MOST = 1e-3 * 1.005  # of the range: tolerances above are counted, which the self test prints in three digits
BASE = Path(__file__).resolve().parents[1] / "examples" / "finger.toml"


def a_scenario(chance: np.random.Generator, self_tuning: bool = False) -> tf.Scenario:
    """A scenario over several decades of every parameter, and whatever reference."""

    def around(value: float, decades: float = 0.5) -> float:
        return float(value * 10 ** chance.uniform(-decades, decades))

    base = load_scenario(BASE)
    t = base.transmission
    mu = float(chance.uniform(0.02, 0.35))
    bristle = around(1e6)
    friction = replace(
        t.friction,
        mu_dynamic=mu,
        mu_static=mu * float(chance.choice([1.0, 1.0, 1.2])),
        viscous_N_s_per_m=around(1.0),
        bristle_stiffness_N_per_m=bristle,
        soft_bristle_stiffness_N_per_m=bristle * 10 ** float(chance.uniform(-2, -0.5)),
        adhesion_N=float(chance.choice([0.0, chance.uniform(0, 3)])),
    )
    tension = around(30.0, 0.7)
    span = tension * float(chance.uniform(0.05, 0.8))
    angle = float(chance.uniform(0.5, 6.0))
    most = (tension + span) * math.exp(1.3 * mu * angle) * float(chance.uniform(1.0, 4.0)) + 5
    actuator = replace(
        t.actuator,
        mass_kg=around(0.15),
        damping_N_s_per_m=around(5.0),
        force_max_N=most,
        force_rate_max_N_per_s=most * 10 ** float(chance.uniform(0.3, 3)),
    )
    transmission = replace(
        t,
        path=replace(t.path, total_angle_rad=angle, segments=int(chance.integers(1, 13))),
        tendon=replace(
            t.tendon,
            mass_kg=around(0.002),
            stiffness_N_per_m=around(2e4),
            relaxing_stiffness_N_per_m=around(6e3),
            relaxation_time_s=around(0.4),
            damping_N_s_per_m=around(2.0),
        ),
        friction=friction,
        actuator=actuator,
        load=replace(t.load, mass_kg=around(0.02), stiffness_N_per_m=around(3e3), damping_N_s_per_m=around(8.0)),
    )
    duration = float(chance.uniform(0.6, 2.5))
    if chance.random() < 0.5:
        reference = SineReference(
            initial_tension_N=tension,
            amplitudes_N=(0.7 * span, 0.3 * span),
            frequencies_Hz=(around(0.7), around(2.0)),
            duration_s=duration,
            fade_in_s=0.3 * duration,
        )
    else:
        times = np.linspace(0, duration, int(chance.integers(3, 8)))
        values = tension + span * chance.uniform(-1, 1, len(times))
        values[0] = tension
        shape = Shape.SMOOTH if chance.random() < 0.7 else Shape.LINEAR
        reference = WaypointReference(
            initial_tension_N=tension,
            times_s=tuple(map(float, times)),
            tensions_N=tuple(map(float, values)),
            shape=shape,
        )
    step = float(chance.choice([2e-4, 5e-4, 1e-3, 2e-3]))
    level = list(tf.Level)[int(chance.integers(0, 3))]
    stream = Stream(preview_s=float(chance.choice([0.0, 0.02])), resolution_N=float(chance.choice([0.0, span / 2000])))
    return replace(
        base,
        transmission=transmission,
        reference=reference,
        run=replace(base.run, step_s=step, level=level),
        stream=stream,
        adaptation=_self_tuning(chance, span, span / transmission.load.stiffness_N_per_m) if self_tuning else None,
    )


def _self_tuning(chance: np.random.Generator, tension_N: float, travel_m: float) -> Adaptation | None:
    """Self-tuning from either sensor in half of the scenarios."""
    if chance.random() < 0.5:
        return None
    sensor = list(Sensor)[int(chance.integers(0, 2))]
    both = (Tunable.MU_PULL, Tunable.MU_RELEASE)
    others = [(), (Tunable.MU,), both, (Tunable.MU, Tunable.LOAD_STIFFNESS), (Tunable.MU, Tunable.TENDON_STIFFNESS)]
    return Adaptation(
        sensor=sensor,
        parameters=others[int(chance.integers(0, len(others)))],
        noise=float(chance.choice([0.0, 0.005])) * (tension_N if sensor is Sensor.OUTPUT_TENSION else travel_m),
        delay_samples=int(chance.integers(0, 6)),
    )


GOLDEN = re.compile(
    r"(?P<what>\w+: golden vectors[a-z ]*)(?P<means>, means of \d+)?"
    r"(?:, (?P<rows>\d+) of (?P<all>\d+) rows)?, largest difference of .* at most (?P<N>\S+)"
)


def self_test(exported: object) -> tuple[str, str]:
    """Failures, line by line, empty where there are none; and all that was said."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "c"
        exported.write(folder)
        sources = sorted(str(p) for p in folder.glob("tff_*.c"))
        program = folder / "self_test"
        subprocess.run(["cc", *FLAGS, str(folder / "self_test.c"), *sources, "-lm", "-o", str(program)], check=True)
        done = subprocess.run([str(program)], capture_output=True, text=True, check=False)
        lines = [line for line in done.stdout.splitlines() if "FAILS" in line]
        return "" if done.returncode == 0 else "; ".join(lines) or f"exit status {done.returncode}", done.stdout


def main() -> int:
    """Report failures; exit status 1 where there is one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--self-tuning", action="store_true")
    options = parser.parse_args()
    chance = np.random.default_rng(options.seed)
    bad, tried, tuned, refused, harmful = [], 0, 0, collections.Counter(), collections.Counter()
    widest: dict[tuple[str, str], list[float]] = collections.defaultdict(list)
    compared: dict[str, list[float]] = collections.defaultdict(list)
    means: collections.Counter[str] = collections.Counter()
    while tried < options.count:
        try:
            scenario = a_scenario(chance, options.self_tuning)
            profile = tf.sample_reference(scenario).tension_N
            exports = {p: export_project(scenario, precision=p, profile_N=profile) for p in tf.Precision}
        except (InputError, ParameterError, SolveError) as error:
            refused[type(error).__name__] += 1
            continue
        tried += 1
        tuned += scenario.adaptation is not None
        for precision, exported in exports.items():
            harmful.update(each.module for each in exported.judged if each.fault and precision is tf.Precision.DOUBLE)
            failed, said = self_test(exported)
            if failed:
                bad.append(f"{tried} {precision}: {failed}")
                print(bad[-1], flush=True)
            for found in GOLDEN.finditer(said):
                means[found["what"]] += found["means"] is not None
                widest[found["what"], precision].append(float(found["N"]) / scale_of(profile))
                if found["rows"]:
                    compared[found["what"]].append(int(found["rows"]) / int(found["all"]))
    print(f"of these {tuned} with self-tuning; share of rows compared where not all are:")
    for what, shares in sorted(compared.items()):
        print(f"  {what}: {np.round(sorted(shares), 2)}")
    print(f"compared as means over a few rows: {dict(+means)}")
    for (what, precision), shares in sorted(widest.items()):
        above = sum(share > MOST for share in shares)
        print(f"{what}, {precision}: tolerance at most {max(shares):.2g} of range, above {MOST:.2g} in {above}")
    print(
        f"{options.count} legal scenarios: {len(bad)} self tests of {2 * options.count} fail; refused {dict(refused)}"
    )
    print(f"modules left out because they would do harm: {dict(harmful)}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
