"""Error on a second run of laws that were fitted to logs like those of a tendon in a sheath.

Every rig is an independent plant (`plant.c`): an uneven path, bristles that do not fill as Dahl's do, friction that
differs by up to a factor of two between the directions. Its two runs are logged at 100 Hz without positions, with
spikes of single samples, gaps of seconds and a few lost rows; in the last third of the first one the tendon slides one
way only. Prints, for every rig, the RMS error on the second run of the law that is chosen for the first one and of the
quasi-static law alone (`--static`), in % of the output's range, and their ratio.

    python benchmarks/identify_sheath.py [RIGS [FIRST]]
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from identify import EXAMPLES, SAMPLE_S
from independent_plant import Array, Plant

from tendonff.compensator.identification.answer.result import Identification
from tendonff.compensator.identification.fitting.dynamic import ChainLaw
from tendonff.compensator.identification.fitting.errors import percent_of
from tendonff.compensator.identification.fitting.parametric_chain import ParametricChain
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.cleaning import Record, clean
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.scenario.measurement import Explain
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import CapstanLaw
from tendonff.models.capstan.spread_bounds import middle_exponent
from tendonff.models.parameters import Transmission
from tendonff.ocp.fits.static import StaticParameter, output_from_input

P = StaticParameter
SECONDS, REST_N, EVERY = 60.0, 20.0, 10
SPIKES, GAPS_S = 12, (0.05, 1.2, 3.0)


def drawn(nominal: Transmission, rng: np.random.Generator) -> Plant:
    """A rig."""
    mu = float(rng.uniform(0.1, 0.25))
    release = mu * float(rng.uniform(0.5, 1.0))
    friction = replace(
        nominal.friction,
        mu_dynamic=mu,
        mu_static=mu,
        mu_dynamic_release=release,
        mu_static_release=release,
        adhesion_N=float(rng.uniform(0.0, 3.0)),
        soft_bristle_stiffness_N_per_m=nominal.friction.soft_bristle_stiffness_N_per_m * float(rng.uniform(0.5, 3.0)),
    )
    return Plant(
        transmission=replace(nominal, friction=friction),
        power=float(rng.uniform(0.6, 1.6)),
        concentration=float(rng.uniform(1.0, 2.3)),
    )


def force(rng: np.random.Generator, *, one_way: bool) -> Array:
    """Random strokes; with `one_way` the last third rises all the way, with short holds."""
    time_s = np.arange(0, SECONDS, SAMPLE_S)
    turns = np.cumsum(rng.uniform(0.6, 3.0, 100))
    levels = np.concatenate([[REST_N], np.ravel([[rng.uniform(60, 120), rng.uniform(8, 30)] for _ in range(50)])])
    if one_way:
        first = int(np.searchsorted(turns, SECONDS * 2 / 3)) + 1
        last = int(np.searchsorted(turns, SECONDS)) + 1
        levels[first : last + 1] = np.linspace(30, 120, last + 1 - first)
    k = np.searchsorted(turns, time_s, side="right")
    start = np.concatenate([[0.0], turns])[k]
    s = np.clip((time_s - start) / (0.8 * (turns[k] - start)), 0, 1)
    return np.asarray(levels[k] + (levels[k + 1] - levels[k]) * s**3 * (10 - 15 * s + 6 * s * s))


def write_run(path: Path, plant: Plant, rng: np.random.Generator, *, one_way: bool) -> None:
    """Log of one run."""
    channels = plant.respond(force(rng, one_way=one_way), SAMPLE_S, REST_N)[::EVERY, :2]
    rows, spans = len(channels), np.ptp(channels, axis=0)
    channels += 0.004 * spans * rng.standard_normal(channels.shape)
    for column in (0, 1):
        hit = rng.integers(0, rows, SPIKES)
        channels[hit, column] += rng.choice([-0.5, 0.5], SPIKES) * spans[column]
    table = np.column_stack([np.arange(rows) * SAMPLE_S * EVERY, channels])
    keep = rng.uniform(size=rows) > 1e-3
    for gap in GAPS_S:
        start = int(rng.uniform(0.1, 0.6) * rows)
        keep[start : start + round(gap / (SAMPLE_S * EVERY))] = False
    header = "time_s,input_tension_N,output_tension_N"
    np.savetxt(path, table[keep], fmt="%.9g", delimiter=",", header=header, comments="")


def left_percent(found: Identification, run: Path) -> float:
    """Error of the fitted scenario on another run, % of range."""
    scenario = found.scenario
    record = clean(read_measurement(run, scenario.measurement), scenario.measurement)
    if next(law.stage for law in found.laws if law.chosen) == "dynamic":
        count = scenario.transmission.path.segments
        model = ParametricChain(transmission=scenario.transmission, level=scenario.run.level, count=count)
        return percent_of(ChainLaw(model=model, values=model.values(), explain=Explain.OUTPUT), [record])
    return static_percent(scenario, record)


def static_percent(scenario: Scenario, record: Record) -> float:
    """Error of the quasi-static law of a scenario, % of range."""
    law = CapstanLaw.of(scenario.transmission)
    values = {
        P.PULL: -middle_exponent(-law.pull_exponent, law.pull_spread),
        P.RELEASE: middle_exponent(law.release_exponent, law.release_spread),
        P.PULL_SPREAD: law.pull_spread,
        P.RELEASE_SPREAD: law.release_spread,
        P.ADHESION: law.adhesion_N,
    }
    off = [
        (output_from_input(values, p.input_N, float(p.output_N[0])).prediction_N - p.output_N)[p.good]
        for p in record.pieces
    ]
    return float(100 * np.sqrt(np.mean(np.concatenate(off) ** 2)) / np.ptp(record.joined("output_N")))


def main(rigs: int, first: int) -> None:
    nominal = load_scenario(EXAMPLES / "finger.toml")
    ratios = []
    for seed in range(first, first + rigs):
        rng = np.random.default_rng([seed, 41])
        plant = drawn(nominal.transmission, rng)
        with tempfile.TemporaryDirectory() as folder:
            runs = Path(folder) / "first.csv", Path(folder) / "second.csv"
            for path in runs:
                write_run(path, plant, rng, one_way=path is runs[0])
            chosen, static = (identify(nominal, [runs[0]], static_only=only) for only in (False, True))
            errors = [left_percent(found, runs[1]) for found in (chosen, static)]
        ratios.append(errors[0] / errors[1])
        print(
            f"{seed:3d} second run {errors[0]:5.2f} % ({chosen.law}), static law {errors[1]:5.2f} % ({static.law}): "
            f"ratio {ratios[-1]:.2f}",
            flush=True,
        )
    print(f"ratio: median {np.median(ratios):.2f}, largest {max(ratios):.2f}")


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:]]
    main(*(*given, *(10, 0)[len(given) :]))
