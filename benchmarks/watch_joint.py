"""Watch hidden loops drift: false alarms over 24 h of use, and time to the alarm for each change.

    python -m benchmarks.watch_joint [--hours 24] [--every 300] [--rigs 2]

Use is drawn by `tests/hand_in_use.py`: random moves at 0.5 to 2 rad/s, rests, one move in twelve against the stop, a
load that is drawn anew in every window. The mechanism is simulated with 16 masses a tendon at 5 ms, the watch fits one
of 6 whose numbers are 2 to 5 % off. `--every` seconds of use one window of 30 s is simulated and watched. The drifts:
friction rises by 30 % over two hours, pre-tension falls by 20 %, and either is there at once after ten minutes.
"""

import argparse
import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.motors.log import read_logs
from tendonff.compensator.identification.motors.numbers import Values
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.studies.watch.chart import courses_of
from tendonff.compensator.studies.watch.windows import Window, fit_window
from tendonff.models.joint.closed_form import GrossSliding, data_sheet
from tests.hand_in_use import HandInUse, known
from tests.hidden_loop import hidden, scenario

N = Parameter
WINDOW_S = 30.0


def watched(
    hand: HandInUse, hours: float, every_s: float, change: Callable[[float], Values], seed: int, file: Path
) -> list[Window]:
    """Windows of use, one of 30 s in every so many seconds."""
    mechanism = known(hand.mechanism)
    lost = data_sheet(GrossSliding.of(mechanism, 0.0), 0.0).lost_motion_rad
    found = []
    for k in range(round(hours * 3600 / every_s)):
        used = (k + 1) * every_s
        write_csv(file, hand.log(1000 * seed + k, WINDOW_S, change(used)))
        [part] = read_logs(scenario(), [file], Measurement())
        found.append(fit_window(part, mechanism, used, lost))
    return found


def said(windows: list[Window]) -> str:
    courses = courses_of(windows)
    alarms = sorted((c.alarm for c in courses if c.alarm is not None), key=lambda a: a.used_s)
    spread = ", ".join(f"{c.drift.number} {100 * float(np.std(np.log(c.ratio))):.1f} %" for c in courses)
    peak = max(float(c.total.max()) for c in courses)
    silent = sum(not w.values for w in windows)
    sentences = "; ".join(a.sentence for a in alarms) or "no alarm"
    return f"{sentences} [largest sum {peak:.2f}, scatter {spread}, {silent} of {len(windows)} windows left out]"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--every", type=float, default=300.0)
    parser.add_argument("--rigs", type=int, default=2)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        judge(asked.hours, asked.every, asked.rigs, Path(folder) / "log.csv")


def judge(all_hours: float, every_s: float, rigs: int, file: Path) -> None:
    for seed in range(1, 1 + rigs):
        true = hidden(seed).mechanism
        hand = HandInUse(mechanism=replace(true, drive=replace(true.drive, gear_efficiency=1.0)))
        steps: dict[str, Callable[[float], Values]] = {
            "mu +30 % after 10 min": lambda t: {N.MU: 1.3} if t > 600 else {},
            "T -20 % after 10 min": lambda t: {N.TENSION: 0.8} if t > 600 else {},
            "gear +50 % after 10 min": lambda t: {N.COULOMB: 1.5} if t > 600 else {},
        }
        for name, change in steps.items():
            print(f"rig {seed}, {name}: {said(watched(hand, 1 / 3, WINDOW_S, change, seed, file))}", flush=True)
        ramps: dict[str, Callable[[float], Values]] = {
            "mu +30 % over 2 h": lambda t: {N.MU: math.exp(math.log(1.3) * min(t / 7200, 1.0))},
            "T -20 % over 2 h": lambda t: {N.TENSION: math.exp(math.log(0.8) * min(t / 7200, 1.0))},
        }
        for name, change in ramps.items():
            print(f"rig {seed}, {name}: {said(watched(hand, 2.25, 60.0, change, seed, file))}", flush=True)
    for seed in range(1, 1 + rigs):
        true = hidden(seed).mechanism
        hand = HandInUse(mechanism=replace(true, drive=replace(true.drive, gear_efficiency=1.0)))
        windows = watched(hand, all_hours, every_s, lambda _: {}, seed + 50, file)
        print(f"rig {seed}, {all_hours:g} h without drift: {said(windows)}", flush=True)


if __name__ == "__main__":
    main()
