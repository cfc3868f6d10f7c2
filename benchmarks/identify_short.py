"""Results of identification on short logs of rigs at the edge of its model class.

Every rig is an independent plant (`plant.c`) around the finger of the examples: bristles from soft to stiff, friction
from next to nothing to a tension ratio of seven, logs of 10 to 60 s at 40 to 1000 Hz. In some logs the output is read
earlier than the input, some outputs are only proportional to the input, in some the two columns are swapped or one has
the other sign. Prints for every log the answer or the refusal, and beside an answer the RMS error on the rig of the
exact inverse from its fitted scenario and of the inverse without friction.

    python benchmarks/identify_short.py [LOGS [FIRST]]
"""

import sys
import tempfile
import time
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from identify import EXAMPLES, SAMPLE_S, left_percent
from independent_plant import Array, Plant

from tendonff.compensator.identification.identify import identify
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import TendonffError
from tendonff.models.parameters import Transmission

KINDS = ("plain", "plain", "leading output", "plain", "linear output", "swapped columns", "plain", "reversed sign")
RATES_HZ = (40, 100, 200, 500, 1000)
LEADS_S = (0.004, 0.03)
GAIN = 0.93
HEADER = ("time_s", "input_tension_N", "output_tension_N", "input_position_m", "output_position_m")


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """A short log and the rig behind it.

    Parameters
    ----------
    seed : int
    kind : str
        One of `KINDS`.
    hidden : Transmission
        The rig.
    seconds, rate_Hz : float
        Length and sampling rate.
    positions : bool
        Both positions are logged as well.
    """

    seed: int
    kind: str
    hidden: Transmission
    seconds: float
    rate_Hz: float
    positions: bool


def drawn(nominal: Transmission, seed: int) -> Log:
    """A rig and a log at random."""
    rng = np.random.default_rng([seed, 17])
    mu = float(np.exp(rng.uniform(np.log(0.02), np.log(2.0)))) / nominal.path.total_angle_rad
    release = mu * float(rng.uniform(0.85, 1.0))
    friction = replace(
        nominal.friction,
        mu_dynamic=mu,
        mu_static=mu,
        mu_dynamic_release=release,
        mu_static_release=release,
        soft_bristle_stiffness_N_per_m=float(np.exp(rng.uniform(np.log(2e4), np.log(1e7)))),
    )
    return Log(
        seed=seed,
        kind=KINDS[seed % len(KINDS)],
        hidden=replace(nominal, friction=friction),
        seconds=float(rng.uniform(10, 60)),
        rate_Hz=float(rng.choice(RATES_HZ)),
        positions=bool(rng.uniform() < 0.6),
    )


def force(log: Log) -> Array:
    """Strokes of half a second to two, over a range in which the output moves too."""
    rng = np.random.default_rng([log.seed, 18])
    time_s = np.arange(0, log.seconds, SAMPLE_S)
    strokes = int(log.seconds) + 2
    turns = np.cumsum(rng.uniform(0.5, 2.0, 2 * strokes))
    levels = np.concatenate([[30.0], np.ravel([[rng.uniform(60, 130), rng.uniform(8, 25)] for _ in range(strokes)])])
    k = np.searchsorted(turns, time_s, side="right")
    start = np.concatenate([[0.0], turns])[k]
    s = np.clip((time_s - start) / (0.8 * (turns[k] - start)), 0, 1)
    return np.asarray(levels[k] + (levels[k + 1] - levels[k]) * s**3 * (10 - 15 * s + 6 * s * s))


def write_log(path: Path, log: Log, plant: Plant) -> None:
    """Write what its logger wrote."""
    channels = plant.respond(force(log), SAMPLE_S, 30.0)
    rng = np.random.default_rng([log.seed, 19])
    if log.kind == "leading output":
        lead = int(rng.uniform(*LEADS_S) / SAMPLE_S)
        channels[:-lead, [1, 3]] = channels[lead:, [1, 3]]
        channels = channels[:-lead]
    if log.kind == "linear output":
        channels[:, 1] = GAIN * channels[:, 0]
    if log.kind == "swapped columns":
        channels[:, [0, 1]] = channels[:, [1, 0]]
    if log.kind == "reversed sign":
        channels[:, 1] *= -1
    channels += rng.uniform(0.001, 0.01) * np.ptp(channels, axis=0) * rng.standard_normal(channels.shape)
    table = np.column_stack([np.arange(len(channels)) * SAMPLE_S, channels])[:: round(1 / (SAMPLE_S * log.rate_Hz))]
    table = table if log.positions else table[:, :3]
    header = ",".join(HEADER[: table.shape[1]])
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header=header, comments="")


def study(nominal: Scenario, seed: int) -> str:
    """Result of a log in a few lines."""
    log = drawn(nominal.transmission, seed)
    plant = Plant(transmission=log.hidden)
    theta = log.hidden.path.total_angle_rad
    head = (
        f"{seed:3d} {log.kind:15s} {log.seconds:4.0f} s {log.rate_Hz:5.0f} Hz {'q' if log.positions else '-'} "
        f"mu theta {theta * log.hidden.friction.mu_dynamic:5.3f} "
        f"bristle {log.hidden.friction.soft_bristle_stiffness_N_per_m:.1e}"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        write_log(path, log, plant)
        start = time.process_time()
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                found = identify(nominal, [path])
        except TendonffError as error:
            return f"{head} refused ({time.process_time() - start:.0f} s): {error}"
        except Exception as error:  # noqa: BLE001 - to be counted
            return f"{head} CRASHED ({time.process_time() - start:.0f} s): {type(error).__name__} {error}"
        seconds = time.process_time() - start
    caught_text = f" WARNED {caught[0].message}" if caught else ""
    if not found.described:
        return f"{head} refused, no law ({seconds:.0f} s): {'; '.join(found.warnings)}{caught_text}"
    strong = replace(nominal.transmission.actuator, force_max_N=1e4)  # friction of the rig is no matter of the actuator
    nominal = replace(nominal, transmission=replace(nominal.transmission, actuator=strong))
    fitted = replace(
        nominal, transmission=replace(found.scenario.transmission, actuator=strong), run=found.scenario.run
    )
    friction = nominal.transmission.friction
    none = replace(
        friction, mu_dynamic=1e-9, mu_static=1e-9, mu_dynamic_release=1e-9, mu_static_release=1e-9, adhesion_N=0.0
    )
    try:
        left = left_percent(fitted, plant, fitted.transmission)
    except Exception as error:  # noqa: BLE001 - to be counted
        return f"{head} answer ({seconds:.0f} s) DESIGN FAILED {error}"
    free = left_percent(nominal, plant, replace(nominal.transmission, friction=none))
    mark = "" if left < free else " WORSE"
    f = found.scenario.transmission.friction
    return (
        f"{head} answer ({seconds:.0f} s) design {left:.2f} % frictionless {free:.2f} %{mark}: mu theta "
        f"{theta * f.mu_dynamic:.4g} bristle {f.soft_bristle_stiffness_N_per_m:.2g} {found.law} fit "
        f"{found.fit_percent:.2f} %{caught_text}"
    )


if __name__ == "__main__":
    _, *words = sys.argv
    count, first = (int(word) for word in (*words, *("30", "0")[len(words) :]))
    scenario = load_scenario(EXAMPLES / "finger.toml")
    for number in range(first, first + count):
        print(study(scenario, number), flush=True)
