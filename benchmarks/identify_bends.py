"""Joint angle of a flexible instrument from two tensions at its drums, over bends that no fit has seen.

    python -m benchmarks.identify_bends [--rigs 3] [--first 0]

Each rig is the pair of `tests/bent_instrument.py`: ten files of 12 s, one for each bend of the sheath from 0.2 to
3 rad, cells with 1 % of noise, motors and the wrist's encoder in 12 bits, each bend stated to 0.03 rad. Five files are
fitted and the angle in the other five is asked for, and conversely; so every bend is unseen once. Beside the
identified mechanism stand laws of four numbers by least squares on the same files, of tensions that went through a
further low-pass of 5 Hz; phi is the wrap angle as stated, s the way each motor goes, built up within 3 mrad, P the play
of ln T:

    slopes      q = a+ (T1 - T2) + b+ as the wrist turns up, a- (T1 - T2) + b- as it turns down
    linear      q = a + b T1 + c T2 + d s
    bend        q = a + b (T1 - T2) + c phi s (T1 + T2) + d s
    capstan     q = a + b (T1 exp(-c phi s1) - d T2 exp(-c phi s2))
    capstans    q = a + b (T1 exp(-c phi s1) - T2 exp(-d phi s2))
    play        q = a + b (P(T1, c phi) - d P(T2, c phi))
    plays       q = a + b (P(T1, c phi) - P(T2, d phi))

The play is the exact law of a cable that its drum alone drives; here the other cable moves its far end as well. The
best law is the one with the least error on the unseen files.
"""

import argparse
import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import butter, filtfilt

from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.motors.log import MotorsLog, read_several
from tendonff.compensator.identification.motors.run import mechanism_of
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.models.capstan import CapstanLaw
from tendonff.ocp.fits.mechanism import Several
from tests.bent_instrument import BENDS_RAD, SHAFT_RAD, BentInstrument, scenario

MASSES, LOW_PASS_HZ = 12, 5.0


class Seen:
    """A file as the laws see it: tensions, ways, wrap angle, and the angle of the wrist to be found."""

    def __init__(self, log: MotorsLog, drum_m: float) -> None:
        self.tension_N = filtfilt(*butter(2, 2 * LOW_PASS_HZ * log.run.step_s), (log.torque_N_m / drum_m).T)
        self.way = log.run.way().T
        self.phi = SHAFT_RAD + log.run.standing_rad["bend"]
        self.joint_rad, self.counted = log.joint_rad[:, 0], log.counted

    @property
    def turn(self) -> np.ndarray:
        """Way of the wrist."""
        return (self.way[0] - self.way[1]) / 2

    def pull(self, tension: np.ndarray, exponent: float) -> np.ndarray:
        """Tension at the far end by the play."""
        law = CapstanLaw(pull_exponent=exponent, release_exponent=exponent)
        return law.output_history_N(tension)


def one(seen: Seen) -> np.ndarray:
    return np.ones_like(seen.joint_rad)


def slopes(seen: Seen) -> list[np.ndarray]:
    difference, up = seen.tension_N[0] - seen.tension_N[1], (seen.turn > 0) * 1.0
    return [up * difference, up, (1 - up) * difference, 1 - up]


def linear(seen: Seen) -> list[np.ndarray]:
    return [one(seen), *seen.tension_N, seen.turn]


def bend(seen: Seen) -> list[np.ndarray]:
    first, second = seen.tension_N
    return [one(seen), first - second, seen.phi * seen.turn * (first + second), seen.turn]


def capstan(seen: Seen, c: float) -> list[np.ndarray]:
    first, second = seen.tension_N * np.exp(-c * seen.phi * seen.way)
    return [one(seen), first, second]


def capstans(seen: Seen, c: float, d: float) -> list[np.ndarray]:
    first, second = (t * np.exp(-x * seen.phi * s) for t, x, s in zip(seen.tension_N, (c, d), seen.way, strict=True))
    return [one(seen), first - second]


def play(seen: Seen, c: float) -> list[np.ndarray]:
    return [one(seen), *(seen.pull(t, abs(c) * seen.phi) for t in seen.tension_N)]


def plays(seen: Seen, c: float, d: float) -> list[np.ndarray]:
    first, second = (seen.pull(t, abs(x) * seen.phi) for t, x in zip(seen.tension_N, (c, d), strict=True))
    return [one(seen), first - second]


LAWS: dict[str, tuple[Callable[..., list[np.ndarray]], int]] = {
    "slopes": (slopes, 0),
    "linear": (linear, 0),
    "bend": (bend, 0),
    "capstan": (capstan, 1),
    "capstans": (capstans, 2),
    "play": (play, 1),
    "plays": (plays, 2),
}
"""Columns of each law, and how many of its four numbers are inside of them."""


def by_law(law: Callable[..., list[np.ndarray]], inside: int, seen: Sequence[Seen]) -> Callable[[Seen], np.ndarray]:
    """A law by least squares: numbers in front of the columns solved for, those inside searched."""
    wanted = np.concatenate([each.joint_rad[each.counted] for each in seen])

    def solved(numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rows = np.vstack([np.column_stack(law(each, *numbers))[each.counted] for each in seen])
        front = np.linalg.lstsq(rows, wanted, rcond=None)[0]
        return front, rows @ front - wanted

    numbers = np.empty(0)
    if inside:
        tried = [least_squares(lambda x: solved(x)[1], np.full(inside, c), diff_step=1e-3) for c in (0.05, 0.15, 0.3)]
        numbers = min(tried, key=lambda each: each.cost).x
    front, _ = solved(numbers)
    return lambda each: np.column_stack(law(each, *numbers)) @ front


def by_mechanism(fitted, log: MotorsLog, start_N: np.ndarray) -> np.ndarray:
    """Joint angle where the identified mechanism feels the tensions of a file, whose encoder it is not given."""
    finger, sampled = mechanism_of(fitted)
    blind = replace(log.run, joint_rad=np.full_like(log.joint_rad, np.nan), start_rad=sampled.angle_rad[0])
    rig = Several(mechanism=finger, tension_N={t.name: x for t, x in zip(finger.tendons, start_N, strict=True)})
    return rig.joints_rad(blind, log.torque_N_m, segments=MASSES)[:, 0]


def judged(rig: BentInstrument, folder: Path) -> dict[str, list[float]]:
    """RMS errors on every bend, unseen by the fit [deg]; and what identification found."""
    known, drum_m = scenario(), rig.mechanism.drum_radius_m[0]
    files, conditions = zip(*(rig.log(folder, number) for number in range(len(BENDS_RAD))), strict=True)
    how = Measurement(conditions=conditions)
    finger, sampled = mechanism_of(known)
    logs = read_several(finger, files, sampled.angle_rad[0], how)
    found: dict[str, list[float]] = {name: [] for name in ("mechanism", "by motors", *LAWS)}
    for first in (0, 1):
        fit = identify(known, files[first::2], files[1 - first :: 2], how=how)
        for key, value in rig.truth.items():
            low, high = fit.estimate(key).interval or (math.nan, math.nan)
            holds = "holds" if low <= value <= high else "MISSES"
            print(f"    {key}: {100 * (fit.estimate(key).value / value - 1):+.2f} %, interval {holds}")
        found["by motors"] += [f.named("joint_rms_deg")["wrist"] for f in fit.files if f.role == "validate"]
        training, unseen = logs[first::2], logs[1 - first :: 2]
        learned = {name: by_law(*law, [Seen(log, drum_m) for log in training]) for name, law in LAWS.items()}
        for log in unseen:
            seen = Seen(log, drum_m)
            angles = {name: law(seen) for name, law in learned.items()}
            angles["mechanism"] = by_mechanism(fit.scenario, log, log.torque_N_m[:5].mean(axis=0) / drum_m)
            for name, angle in angles.items():
                off = (angle - seen.joint_rad)[seen.counted]
                found[name].append(math.degrees(float(np.sqrt(np.mean(off**2)))))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    asked = parser.parse_args()
    ratios = []
    for seed in range(asked.first, asked.first + asked.rigs):
        with tempfile.TemporaryDirectory() as name:
            found = judged(BentInstrument.drawn(seed), Path(name))
        whole = {name: float(np.sqrt(np.mean(np.square(errors)))) for name, errors in found.items()}
        best = min(LAWS, key=lambda law: whole[law])
        ratios.append(whole["mechanism"] / whole[best])
        worst = max(a / b for a, b in zip(found["mechanism"], found[best], strict=True))
        print(f"{seed}: " + ", ".join(f"{law} {error:.3f}" for law, error in whole.items()) + " deg")
        print(f"   over the best law, {best}: {ratios[-1]:.2f}; on its worst bend {worst:.2f}", flush=True)
    print(f"largest ratio of {asked.rigs}: {max(ratios):.2f} (bar 1.5)")


if __name__ == "__main__":
    main()
