"""Share of the 95 % intervals of identification that hold the truth, on short logs of hidden rigs.

Every rig is an independent plant (`plant.c`) drawn as in `identify.py`; its log has 24 s of random strokes at 200 to
1000 Hz, six in ten with both positions. Each seed is one rig without a model error, and one with: a gain of the output
cell 2 % off (stated in [measurement]), a kept stiffness of the tendon 50 % off, an output 2 ms late, a second
relaxation, an uneven path, a pulley. With --unlisted the error is one that no option, law or constant of identification
was chosen for: friction that falls with tension, that grows along the path, a far cell that shows 1 % of the near one,
cells whose gain or zero drifts over the log. With --promise the inverse designed from each fitted scenario is simulated
on the rig, beside the errors that the design expects and its worst case. With --static the quasi-static laws alone are
judged, on the rig without a model error and on one whose contact is 30 times as stiff. Logs are kept in the folder of
temporary files.

    python benchmarks/identify_coverage.py [SEEDS [FIRST [RESULTS]]] [--static] [--unlisted] [--promise]

Started again, rigs that are in RESULTS (coverage.jsonl) are not identified again.
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
from identify import EXAMPLES, SAMPLE_S, drawn, strokes, truth_of
from independent_plant import Plant

from tendonff.compensator.compensators.base import Problem, with_motion
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.identification.answer.result import Identification
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import TendonffError

FOLDER = Path(tempfile.gettempdir()) / "tendonff-coverage-logs"
GROUPS = ("nominal", "model error", "stiff contact", "unlisted error")
ERRORS = ("gain", "kept stiffness", "delay", "second relaxation", "uneven path", "pulley")
UNLISTED = ("falls with tension", "grows along path", "crosstalk", "drifting gain", "drifting zero")
FALLING, MEAN_N, GROWING, CROSSTALK, DRIFT, ZERO_N = 0.1, 50.0, 0.3, 0.01, 0.01, 0.3
RATES_HZ = (200, 500, 1000)
SECONDS = 24.0
STIFFER = 30.0
GAIN_UNCERTAINTY = 0.02
TENDON = ("stiffness_N_per_m", "relaxing_stiffness_N_per_m", "relaxation_time_s")
FRICTION = ("mu_dynamic", "mu_dynamic_release", "adhesion_N", "soft_bristle_stiffness_N_per_m")
HEADER = ("time_s", "input_tension_N", "output_tension_N", "input_position_m", "output_position_m")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A hidden rig, its log, and the scenario that is identified.

    Parameters
    ----------
    plant : Plant
    error : str
        One of `ERRORS` or `UNLISTED`, or "none".
    gain : float
        Of the output cell.
    delay_s : float
        Of the output.
    noise : float
        Share of each channel's range.
    positions : bool
        Both are logged.
    every : int
        Rows of 1 ms to a sample.
    scenario : Scenario
    """

    plant: Plant
    error: str
    gain: float
    delay_s: float
    noise: float
    positions: bool
    every: int
    scenario: Scenario


def case_of(nominal: Scenario, seed: int, group: str) -> Case:
    """The rig of a seed."""
    known = {"model error": ERRORS, "unlisted error": UNLISTED}.get(group, ("none",))
    error = known[seed % len(known)]
    rig = drawn(nominal.transmission, seed, mismatch=False)
    rng = np.random.default_rng([seed, 27, GROUPS.index(group)])
    hidden, plant, scenario = rig.plant.transmission, rig.plant, nominal
    if group == "stiff contact":
        bristle = STIFFER * hidden.friction.soft_bristle_stiffness_N_per_m
        friction = replace(hidden.friction, soft_bristle_stiffness_N_per_m=bristle)
        plant = replace(plant, transmission=replace(hidden, friction=friction))
    positions = bool(rng.uniform() < 0.6) and error != "kept stiffness"
    sign = float(rng.choice([-1, 1]))
    if error == "gain":
        scenario = replace(scenario, measurement=replace(scenario.measurement, gain_uncertainty=GAIN_UNCERTAINTY))
    if error == "kept stiffness":
        tendon = replace(hidden.tendon, stiffness_N_per_m=hidden.tendon.stiffness_N_per_m * (1 + 0.5 * sign))
        scenario = replace(scenario, transmission=replace(scenario.transmission, tendon=tendon))
    if error == "second relaxation":
        tendon = hidden.tendon
        second = (0.3 * tendon.relaxing_stiffness_N_per_m, tendon.relaxation_time_s * float(rng.choice([0.1, 8.0])))
        plant = replace(plant, second_relaxation=second)
    if error == "uneven path":
        plant = replace(plant, concentration=float(rng.uniform(1.5, 2.3)))
    if error == "falls with tension":
        plant = replace(plant, falling=(FALLING, MEAN_N))
    if error == "grows along path":
        plant = replace(plant, growing=GROWING * sign)
    if error == "pulley":
        plant = replace(plant, pulley=float(rng.uniform(0.15, 0.35)))
    return Case(
        plant=plant,
        error=error,
        gain=1 + 0.02 * sign if error == "gain" else 1.0,
        delay_s=2e-3 if error == "delay" else 0.0,
        noise=rig.noise,
        positions=positions,
        every=round(1 / (SAMPLE_S * float(rng.choice(RATES_HZ)))),
        scenario=scenario,
    )


def log_of(case: Case, seed: int, group: str) -> Path:
    """The rig's log, simulated unless it is there."""
    path = FOLDER / f"{group.replace(' ', '_')}_{seed}.csv"
    if not path.exists():
        force = strokes(seed, SECONDS)
        channels = case.plant.respond(force, SAMPLE_S, float(force[0]))
        late = round(case.delay_s / SAMPLE_S)
        channels[late:, [1, 3]] = channels[: len(channels) - late, [1, 3]]
        channels[:, 1] *= case.gain
        _misread(channels, case.error)
        rng = np.random.default_rng([seed, 29])
        channels += case.noise * np.ptp(channels, axis=0) * rng.standard_normal(channels.shape)
        table = np.column_stack([np.arange(len(channels)) * SAMPLE_S, channels])[:: case.every]
        table = table if case.positions else table[:, :3]
        FOLDER.mkdir(exist_ok=True)
        np.savetxt(path, table, fmt="%.9g", delimiter=",", header=",".join(HEADER[: table.shape[1]]), comments="")
    return path


def _misread(channels: FloatArray, error: str) -> None:
    """Put errors of cells into the tensions, in place."""
    along = np.linspace(0, 1, len(channels))
    if error == "crosstalk":
        channels[:, 1] += CROSSTALK * channels[:, 0]
    if error == "drifting gain":
        channels[:, 1] *= 1 + DRIFT * along
    if error == "drifting zero":
        channels[:, 1] += ZERO_N * along


def _truth(case: Case, name: str, found: Identification) -> float:
    """True value; of friction that falls with tension at the one at which the fitted law holds."""
    value = truth_of(case.plant.transmission, name)
    exponent, at_N = case.plant.falling
    if exponent and name.startswith("mu_"):
        value *= ((found.scenario.transmission.friction.reference_tension_N or at_N) / at_N) ** -exponent
    return value


def promise(case: Case, fitted: Scenario) -> dict[str, float]:
    """RMS error that a design leaves on the rig, and what it says of it [% of range]."""
    problem = Problem.of(fitted)
    profile, reference = with_motion(problem, "inverse", compensator("inverse").profile(problem)), problem.reference
    got = case.plant.respond(profile.force_N, reference.step_s, float(profile.force_N[0]))[:, 1]
    band = problem.expect({"inverse": profile}).best
    left = 100 * float(np.sqrt(np.mean((got - reference.tension_N) ** 2))) / reference.range_N
    low, high = band.likely_percent
    worst = band.worst.rmse_percent_of_range
    return {"left": left, "expected": band.expected_percent, "low": low, "high": high, "worst": worst}


def result(nominal: Scenario, seed: int, group: str, *, static: bool, promised: bool = False) -> dict[str, Any]:
    """Identification of a rig and the truth."""
    case = case_of(nominal, seed, group)
    log = log_of(case, seed, group)
    names = FRICTION + (TENDON if case.error != "second relaxation" else ())
    row: dict[str, Any] = {"seed": seed, "group": group, "error": case.error, "positions": case.positions}
    row |= {"noise": case.noise, "rate_Hz": 1 / (SAMPLE_S * case.every), "law": "none", "values": {}}
    start = time.process_time()
    try:
        found = identify(case.scenario, [log], static_only=static)
    except TendonffError as error:
        return row | {"seconds": time.process_time() - start, "law": f"refused: {error}"}
    row |= {"seconds": time.process_time() - start, "law": found.law, "fit_percent": found.fit_percent}
    if promised:
        row["promise"] = promise(case, found.scenario)
    estimates = {e.name: e for e in found.estimates}
    for name in names:
        if (e := estimates.get(name)) is not None and e.interval is not None:
            row["values"][name] = {
                "truth": _truth(case, name, found),
                "estimate": e.value,
                "interval": list(e.interval),
                "identifiable": e.identifiable,
            }
    return row


def line(row: dict[str, Any]) -> str:
    """A rig in one line: error over half-width of each value, a star where the interval misses the truth."""
    shown = " ".join(
        f"{name.split('_')[0][:5]}{'R' if 'release' in name else ''} {ratio:+.2f}{'*' if abs(ratio) > 1 else ''}"
        for name, ratio in ratios(row).items()
    )
    where = f"{row['rate_Hz']:.0f} Hz {'q' if row['positions'] else '-'}, {row['seconds']:.1f} s"
    return f"{row['group']} {row['seed']:3d} {row['error']:17s} {where:17s} {shown}  {row['law']}"


def ratios(row: dict[str, Any]) -> dict[str, float]:
    """Error over half-width of the interval, from its middle, by name."""
    found = {}
    for name, value in row["values"].items():
        low, high = value["interval"]
        found[name] = ((low + high) / 2 - value["truth"]) / max((high - low) / 2, 1e-300)
    return found


def half_widths(rows: Sequence[dict[str, Any]], name: str) -> float:
    """Median half-width of an interval over the truth, in %; of adhesion in N."""
    some = [row["values"][name] for row in rows if name in row["values"]]
    return float(
        np.median(
            [
                (v["interval"][1] - v["interval"][0]) / 2 / (0.01 * v["truth"] if name != "adhesion_N" else 1.0)
                for v in some
            ]
        )
    )


def summary(rows: Sequence[dict[str, Any]]) -> Iterable[str]:
    """Coverage of a group, by value and by model error."""
    seconds = [row["seconds"] for row in rows]
    yield f"{rows[0]['group']}: {len(rows)} rigs, CPU median {np.median(seconds):.1f} s, most {max(seconds):.1f} s"
    every = [(row["error"], name, abs(ratio)) for row in rows for name, ratio in ratios(row).items()]
    sizes = np.array([ratio for _, _, ratio in every])
    yield (
        f"  truth in the interval: {100 * np.mean(sizes <= 1):.1f} % of {len(sizes)} values, "
        f"median error / half-width {np.median(sizes):.3f}"
    )
    said = [row["promise"] for row in rows if "promise" in row]
    if said:
        keys = ("left", "expected", "low", "high", "worst")
        left, expected, low, high, worst = (np.array([each[key] for each in said]) for key in keys)
        below = [int((left <= most).sum()) for most in (low, high, worst)]
        yield f"  design leaves {left.mean():.3f} % of range (mean), {expected.mean():.3f} expected"
        yield f"  of {len(left)} below the range {below[0]}, in it or below {below[1]}, up to the worst {below[2]}"
    for place in (0, 1):
        for kind in dict.fromkeys(entry[place] for entry in every):
            some = np.array([entry[2] for entry in every if entry[place] == kind])
            wide = f", half-width {half_widths(rows, kind):.2g}" if place else ""
            yield (
                f"    {kind:32s} {int((some <= 1).sum()):3d} of {len(some):3d}, median {np.median(some):.2f}, "
                f"largest {some.max():.1f}{wide}"
            )


def main(count: int, first: int, results: Path, *, static: bool, unlisted: bool, promise: bool) -> None:
    rows = [json.loads(text) for text in results.read_text().splitlines()] if results.exists() else []
    done = {(row["seed"], row["group"]) for row in rows}
    nominal = load_scenario(EXAMPLES / "finger.toml")
    groups = GROUPS[::2] if static else GROUPS[::3] if unlisted else GROUPS[:2]
    for seed in range(first, first + count):
        for group in groups:
            if (seed, group) not in done:
                rows.append(result(nominal, seed, group, static=static, promised=promise))
                print(line(rows[-1]), flush=True)
                with results.open("a", encoding="utf-8") as file:
                    print(json.dumps(rows[-1]), file=file)
    for group in groups:
        print("\n".join(summary([r for r in rows if r["group"] == group and r["seed"] in range(first, first + count)])))


if __name__ == "__main__":
    chosen = [word for word in sys.argv[1:] if not word.startswith("--")]
    seeds, first_seed, file = (*chosen, *("100", "0", "coverage.jsonl")[len(chosen) :])
    options = {name: f"--{name}" in sys.argv for name in ("static", "unlisted", "promise")}
    main(int(seeds), int(first_seed), Path(file), **options)
