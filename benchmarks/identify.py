"""Accuracy of identification on hidden rigs, and the error of a design from its result on them.

Every rig is an independent plant (`plant.c`: 40 masses, its own discretisation) with parameters drawn at random around
the nominal scenario. Two logs at 1 kHz, the suggested excitation and random strokes, get noise of 0.2 to 1 % of range,
spikes, gaps and missing cells. Rigs of the group "mismatch" have something besides that no model here knows. Prints,
for every rig and in sum: errors, share of the 95 % intervals that hold the truth, RMS error of the exact inverse
designed from the fitted scenario, and how far the fitted scenario's own error is from the one reported. Rigs of the
group "proximal" have the first group's parameters and no sensor at the far end.

    python benchmarks/identify.py [RIGS_PER_GROUP [FIRST_SEED [RESULTS [GROUP ...]]]]

A rig takes about half a minute; started again, rigs that are in RESULTS (identify.jsonl) are not measured again.
"""

import json
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from identify_bound import bounds
from independent_plant import Array, Plant

from tendonff.compensator.identification.answer.result import Identification
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.suggest import suggest
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.inverse import invert

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SAMPLE_S, REST_N = 1e-3, 30.0
NAMES = (
    "mu_dynamic",
    "mu_dynamic_release",
    "adhesion_N",
    "soft_bristle_stiffness_N_per_m",
    "stiffness_N_per_m",
    "relaxing_stiffness_N_per_m",
    "relaxation_time_s",
)
GROUPS = ("nominal", "mismatch", "proximal")
MISMATCHES = ("Stribeck effect", "uneven path", "output offset", "other bristle")


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """A hidden rig and its logger."""

    plant: Plant
    noise: float
    output_offset_N: float
    mismatch: str


def drawn(nominal: Transmission, seed: int, *, mismatch: bool) -> Rig:
    """A rig somewhere around the nominal one; half of them have adhesion."""
    rng = np.random.default_rng([seed, 7])
    mu = rng.uniform(0.14, 0.28)
    release = mu * rng.uniform(0.75, 1.1)
    t, f = nominal.tendon, nominal.friction
    kind = MISMATCHES[seed % len(MISMATCHES)] if mismatch else "none"
    excess = rng.uniform(0.05, 0.2) if kind == "Stribeck effect" else 0.0
    adhesion = rng.uniform(0.3, 3.0) if rng.uniform() < 0.5 else 0.0
    hidden = replace(
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
            mu_static=mu * (1 + excess),
            mu_dynamic_release=release,
            mu_static_release=release * (1 + excess),
            stribeck_velocity_m_per_s=f.stribeck_velocity_m_per_s * (rng.uniform(0.3, 3) if excess else 1),
            soft_bristle_stiffness_N_per_m=f.soft_bristle_stiffness_N_per_m * rng.uniform(0.5, 2),
            adhesion_N=adhesion,
        ),
    )
    plant = Plant(
        transmission=hidden,
        power=rng.uniform(0.6, 1.6) if kind == "other bristle" else 1.0,
        concentration=rng.uniform(1.5, 2.3) if kind == "uneven path" else 1.0,
    )
    offset = rng.choice([-1, 1]) * rng.uniform(0.1, 0.4) if kind == "output offset" else 0.0
    return Rig(plant=plant, noise=rng.uniform(0.002, 0.01), output_offset_N=float(offset), mismatch=kind)


def strokes(seed: int, seconds: float = 24.0) -> Array:
    """A force of random smooth strokes and short holds."""
    rng = np.random.default_rng([seed, 8])
    time_s = np.arange(0, seconds, SAMPLE_S)
    turns = np.cumsum(rng.uniform(0.5, 1.6, 60))
    levels = np.concatenate([[REST_N], np.ravel([[rng.uniform(45, 110), rng.uniform(12, 40)] for _ in range(30)])])
    k = np.searchsorted(turns, time_s, side="right")
    start = np.concatenate([[0.0], turns])[k]
    s = np.clip((time_s - start) / (0.8 * (turns[k] - start)), 0, 1)
    return np.asarray(levels[k] + (levels[k + 1] - levels[k]) * s**3 * (10 - 15 * s + 6 * s * s))


def write_log(path: Path, rig: Rig, force_N: Array, seed: int, *, proximal: bool = False) -> None:
    """Log of the rig: noise, spikes, two gaps and missing cells; of the near end alone on request."""
    channels = rig.plant.respond(force_N, SAMPLE_S, float(force_N[0]))
    channels[:, 1] += rig.output_offset_N
    rng = np.random.default_rng([seed, 9])
    rows = len(channels)
    channels += rig.noise * np.ptp(channels, axis=0) * rng.standard_normal(channels.shape)
    for column in range(4):
        hit = rng.integers(0, rows, 6)
        channels[hit, column] += rng.choice([-0.6, 0.6], 6) * np.ptp(channels[:, column])
    channels[rng.integers(0, rows, 3), 0] = np.nan
    keep = np.ones(rows, dtype=bool)
    for length in (6, 300):
        start = int(rng.uniform(0.3, 0.9) * rows)
        keep[start : start + length] = False
    table = np.column_stack([np.arange(rows) * SAMPLE_S, channels])[keep]
    names = ["time_s", "input_tension_N", "output_tension_N", "input_position_m", "output_position_m"]
    kept = (0, 1, 3) if proximal else range(5)
    lines = [",".join("" if np.isnan(row[k]) else f"{row[k]:.9g}" for k in kept) for row in table.tolist()]
    path.write_text("\n".join([",".join(names[k] for k in kept), *lines]) + "\n", encoding="utf-8")


def truth_of(transmission: Transmission, name: str) -> float:
    friction, tendon = transmission.friction, transmission.tendon
    if name == "mu_dynamic_release":
        return friction.release_dynamic
    return float(getattr(friction, name) if hasattr(friction, name) else getattr(tendon, name))


def left_percent(scenario: Scenario, plant: Plant, transmission: Transmission) -> float:
    """RMS error of the exact inverse of `transmission` on the plant, % of reference range."""
    reference = sample_reference(scenario)
    chain = Chain.of(transmission, scenario.run.level)
    force = invert(chain, reference.tension_N, reference.step_s).force_N
    got = plant.respond(np.asarray(force), reference.step_s, float(force[0]))[:, 1]
    return float(100 * np.sqrt(np.mean((got - reference.tension_N) ** 2)) / np.ptp(reference.tension_N))


def study(nominal: Scenario, seed: int, group: str) -> dict[str, Any]:
    """Logs, fit and design of a rig."""
    rig = drawn(nominal.transmission, seed, mismatch=group == "mismatch")
    excitation = suggest(nominal)
    times = np.arange(0, excitation.time_s[-1], SAMPLE_S)
    with tempfile.TemporaryDirectory() as folder:
        logs = [Path(folder) / f"log{k}.csv" for k in (1, 2)]
        forces = (np.interp(times, excitation.time_s, excitation.force_N), strokes(seed))
        for k, (log, force) in enumerate(zip(logs, forces, strict=True)):
            write_log(log, rig, force, 10 * seed + k, proximal=group == "proximal")
        start = time.perf_counter()
        found = identify(nominal, logs)
        seconds = time.perf_counter() - start
    fitted = replace(nominal, transmission=found.scenario.transmission, run=found.scenario.run)
    bound = None
    if group != "proximal" and rig.plant.transmission.friction.adhesion_N > 0:
        clean = [rig.plant.respond(force, SAMPLE_S, float(force[0])) for force in forces]
        bound = bounds(rig.plant.transmission, rig.noise, clean, SAMPLE_S)["adhesion_N"]
    return {
        "seed": seed,
        "group": group,
        "mismatch": rig.mismatch,
        "noise": rig.noise,
        "seconds": seconds,
        "law": found.law,
        "fit_percent": found.fit_percent,
        "replay_percent": getattr(found, "replay_percent", None),
        "left_percent": left_percent(fitted, rig.plant, fitted.transmission),
        "left_nominal_percent": left_percent(nominal, rig.plant, nominal.transmission),
        "left_true_percent": left_percent(nominal, rig.plant, rig.plant.transmission),
        "adhesion_bound_N": bound,
        "values": {name: _value(found, rig, name) for name in NAMES},
    }


def _value(found: Identification, rig: Rig, name: str) -> dict[str, Any]:
    estimate = found.estimate(name)
    in_file = truth_of(found.scenario.transmission, name)
    return {
        "truth": truth_of(rig.plant.transmission, name),
        "estimate": estimate.value,
        "interval": None if estimate.interval is None else list(estimate.interval),
        "error": estimate.standard_error,
        "identifiable": estimate.identifiable,
        "fitted": in_file,
    }


def line(row: dict[str, Any]) -> str:
    """Result of a rig in one line: error in % of the truth, a star where the interval misses it."""
    shown = []
    for name, value in row["values"].items():
        size = value["truth"] if name != "adhesion_N" else 1.0
        missed = value["interval"] is not None and not value["interval"][0] <= value["truth"] <= value["interval"][1]
        mark = "*" if missed else "" if value["interval"] is not None else "?"
        scale = 100 if name != "adhesion_N" else 1
        shown.append(f"{name.split('_')[0][:5]} {scale * (value['estimate'] - value['truth']) / size:+.3g}{mark}")
    return (
        f"{row['group']} {row['seed']:3d} {row['mismatch']:15s} {row['seconds']:5.1f} s fit {row['fit_percent']:.2f} % "
        f"replay {row['replay_percent'] or 0:.2f} % design {row['left_percent']:.2f} % "
        f"(nominal {row['left_nominal_percent']:.1f}) {'  '.join(shown)}  {row['law']}"
    )


def summary(rows: Sequence[dict[str, Any]]) -> Iterable[str]:
    """Coverage and errors of a group."""
    left = np.array([row["left_percent"] for row in rows])
    yield f"{rows[0]['group']}: {len(rows)} rigs, median time {np.median([r['seconds'] for r in rows]):.0f} s"
    above = int((left > 0.6).sum())
    yield f"  design leaves {np.median(left):.2f} % (median), {left.max():.2f} % (worst), above 0.6 %: {above}"
    known = np.array([row["left_true_percent"] for row in rows])
    yield f"  with the true values it leaves {np.median(known):.2f} % (median), {known.max():.2f} % (worst)"
    every: list[bool] = []
    for name in NAMES:
        values = [row["values"][name] for row in rows if row["values"][name]["interval"] is not None]
        if not values:
            continue
        inside = [v["interval"][0] <= v["truth"] <= v["interval"][1] for v in values]
        every += inside
        off = [abs(v["estimate"] - v["truth"]) / (v["truth"] if name != "adhesion_N" else 1.0) for v in values]
        unit = "N" if name == "adhesion_N" else "%"
        scale = 1 if unit == "N" else 100
        yield (
            f"  {name:32s} in {len(values):3d}  median error {scale * np.median(off):6.3f} {unit}  largest "
            f"{scale * max(off):6.2f} {unit}  truth in the interval {100 * np.mean(inside):5.1f} %"
        )
    errors = [abs(r["values"]["mu_dynamic"]["estimate"] / r["values"]["mu_dynamic"]["truth"] - 1) for r in rows]
    yield f"  mu_dynamic within 3 %: {sum(x <= 0.03 for x in errors)} of {len(errors)}"
    unknown = {name: sum(not row["values"][name]["identifiable"] for row in rows) for name in NAMES}
    yield "  not identifiable: " + (
        ", ".join(f"{name} in {count}" for name, count in unknown.items() if count) or "none"
    )
    yield f"  truth in the interval: {100 * np.mean(every):.1f} % of {len(every)} values"
    rubbing = [row for row in rows if row["values"]["adhesion_N"]["truth"] > 0 and row.get("adhesion_bound_N")]
    if rubbing:
        close = []
        for row in rubbing:
            adhesion = row["values"]["adhesion_N"]
            truth, error = adhesion["truth"], adhesion["fitted"] / adhesion["truth"] - 1
            close.append(abs(error) <= 0.2)
            yield (
                f"    rig {row['seed']:3d}: noise {100 * row['noise']:.2f} %, adhesion {truth:.2f} N, least error "
                f"{100 * row['adhesion_bound_N'] / truth:4.1f} %, error {100 * error:+6.1f} %"
            )
        yield f"  adhesion in fitted.toml within 20 %: {sum(close)} of {len(close)}"
    off = [abs(row["replay_percent"] / row["fit_percent"] - 1) for row in rows if row["replay_percent"]]
    yield f"  fitted.toml simulated again, within 5 % of its error: {sum(x <= 0.05 for x in off)} of {len(off)}"


def measured(results: Path, rigs: range, groups: Sequence[str]) -> list[dict[str, Any]]:
    """Rows of all rigs in these groups; those that `results` has already are taken from it, the others join it."""
    rows = [json.loads(text) for text in results.read_text().splitlines()] if results.exists() else []
    done = {(row["seed"], row["group"]) for row in rows}
    nominal = load_scenario(EXAMPLES / "finger.toml")
    for seed in rigs:
        for group in groups:
            if (seed, group) not in done:
                rows.append(study(nominal, seed, group))
                print(line(rows[-1]), flush=True)
                with results.open("a", encoding="utf-8") as file:
                    print(json.dumps(rows[-1]), file=file)
    return [row for row in rows if row["seed"] in rigs]


def main(count: int, first: int, results: Path, groups: Sequence[str]) -> None:
    rows = measured(results, range(first, first + count), groups)
    for group in groups:
        print("\n".join(summary([row for row in rows if row["group"] == group])))


if __name__ == "__main__":
    _, *words = sys.argv
    rigs, first_seed, file = (*words[:3], *("25", "0", "identify.jsonl")[len(words[:3]) :])
    main(int(rigs), int(first_seed), Path(file), words[3:] or GROUPS)
