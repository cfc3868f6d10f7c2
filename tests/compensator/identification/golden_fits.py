"""Fits that are kept: a few small logs, and what identification found in them when they were stored.

`python tests/compensator/identification/golden_fits.py` stores what is found now; the change of `golden_fits.json` is
part of the review.
"""

import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from synthetic import DIRTY, Faults, write_synthetic

from tendonff.compensator.identification.identify import identify
from tendonff.compensator.scenarios import load_scenario

STORED = Path(__file__).with_name("golden_fits.json")
EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
STEP_S = 4e-3
RIGS = {
    "positions": {"mu": 0.24, "release": 0.2, "adhesion": 2.0, "bristle": 4e4, "faults": DIRTY},
    "tensions": {"mu": 0.3, "release": 0.3, "adhesion": 0.0, "bristle": 8e4, "faults": Faults(noise=0.003)},
    "stiff": {"mu": 0.15, "release": 0.12, "adhesion": 0.0, "bristle": 3e6, "faults": Faults(noise=0.003)},
    "near end": {"mu": 0.22, "release": 0.22, "adhesion": 0.0, "bristle": 6e4, "faults": Faults(noise=0.002)},
}
KEPT = {"positions": range(5), "tensions": range(3), "stiff": range(5), "near end": (0, 1, 3)}


def strokes(seed, seconds):
    """Smooth strokes of a second between random levels."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, STEP_S)
    tops, valleys = rng.uniform(60, 90, int(seconds) + 2), rng.uniform(8, 30, int(seconds) + 2)
    levels = np.where(np.arange(int(seconds) + 2) % 2, tops, valleys)
    levels[0] = 35.0
    k = time.astype(int)
    s = np.clip((time - k) / 0.9, 0, 1)
    return time, levels[k] + (levels[k + 1] - levels[k]) * s**3 * (10 - 15 * s + 6 * s * s)


def found_in(name, folder):
    """Identification of one of the logs."""
    rig, nominal = RIGS[name], load_scenario(EXAMPLES / "finger.toml")
    t = nominal.transmission
    friction = replace(
        t.friction,
        mu_dynamic=rig["mu"],
        mu_static=rig["mu"],
        mu_dynamic_release=rig["release"],
        mu_static_release=rig["release"],
        adhesion_N=rig["adhesion"],
        soft_bristle_stiffness_N_per_m=rig["bristle"],
    )
    log = Path(folder) / "log.csv"
    seed = list(RIGS).index(name)
    truth = replace(t, friction=friction)
    write_synthetic(log, truth, *strokes(seed, 12.0), replace(rig["faults"], seed=seed), step_s=STEP_S)
    rows = [line.split(",") for line in log.read_text().splitlines()]
    log.write_text("\n".join(",".join(row[k] for k in KEPT[name]) for row in rows) + "\n")
    return identify(nominal, [log])


def as_stored(found):
    """What is kept of it: values, half-widths of their intervals, and what decides."""
    return {
        "law": found.law,
        "described": found.described,
        "fit_percent": found.fit_percent,
        "estimates": {
            e.name: {
                "value": e.value,
                "half_width": None if e.interval is None else (e.interval[1] - e.interval[0]) / 2,
            }
            for e in found.estimates
        },
    }


if __name__ == "__main__":
    kept = {}
    for rig_name in RIGS:
        with tempfile.TemporaryDirectory() as where:
            kept[rig_name] = as_stored(found_in(rig_name, where))
    STORED.write_text(json.dumps(kept, indent=1) + "\n")
