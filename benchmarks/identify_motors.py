"""Identify hidden pairs and fingers, design from what was found, and run the design on the hidden plant.

    python -m benchmarks.identify_motors pair|finger [--rigs 3] [--first 0] [--stiffening 0.0] [--no-encoder]

Each rig is the explicit plant of `tests/finger_plant.py` (16 masses a tendon, steps of 4 us; pairs 8 and 2 us) with
friction, stiffness and dry friction of each motor drawn by the seed, 12 bits and 1 % of noise. Prints the errors of
mu theta and stiffness in % of the true values, how many 95 % intervals hold, and the RMS error of the joints after
`design` from fitted.toml, with that of `linear`. `--stiffening 0.3` lets the true stiffness grow by 30 % as the
tension rises to twice that of the start, whose stiffness is the one that is compared.
"""

import argparse
import math
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.motors.run import mechanism_of, suggest_motor_routine
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.motors.run import design_motors
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.fits.mechanism import MotorRun
from tests import finger_plant

EXAMPLES = Path(__file__).parents[1] / "examples"
ROW_S, COUNT_RAD, NOISE = 1e-3, 2 * np.pi / 4096, 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """Hidden mechanism, and the plant that simulates it.

    Attributes
    ----------
    mechanism : Finger
    truth : dict of str to float
        Numbers by their keys.
    dry_N_m : tuple of float
        Dry friction of each motor.
    tension_N : ndarray, shape (tendons,)
        At the start.
    stiffening : tuple of float
        Share by which the stiffness grows from its value at a tension to twice that, and this tension [N].
    masses, step_s : int, float
        Of the plant.
    """

    mechanism: Finger
    truth: dict[str, float]
    dry_N_m: tuple[float, ...]
    tension_N: np.ndarray
    stiffening: tuple[float, float]
    masses: int
    step_s: float

    @property
    def drums_m(self) -> np.ndarray:
        """Travel of each tendon per radian of each motor, shape (motors, tendons)."""
        names = [tendon.name for tendon in self.mechanism.tendons]
        found = np.zeros((len(self.mechanism.motors), len(names)))
        for row, motor in zip(found, self.mechanism.motors, strict=True):
            for name, winding in zip(motor.winds, motor.winding_m, strict=True):
                row[names.index(name)] = winding
        return found

    def respond(self, motor_rad: np.ndarray, start_rad: np.ndarray) -> finger_plant.FingerResponse:
        """Angles and tensions under angles of the motors a row of 1 ms each."""
        return finger_plant.respond(
            self.mechanism.joints,
            self.mechanism.tendons,
            self.drums_m,
            motor_rad,
            ROW_S,
            start_rad,
            self.tension_N,
            stiffening=self.stiffening,
            masses=self.masses,
            step_s=self.step_s,
        )


def hidden(scenario, kind: str, seed: int, stiffening: float) -> Rig:
    """A rig whose tendons differ from the scenario's, and from each other."""
    rng, (finger, _) = np.random.default_rng(seed), mechanism_of(scenario)
    truth = {}
    for tendon in finger.tendons:
        truth[f"tendons.{tendon.name}.friction.mu_dynamic"] = tendon.friction.mu_dynamic * rng.uniform(0.7, 1.4)
        stiffness = tendon.tendon.stiffness_N_per_m * rng.uniform(0.75, 1.3)
        truth[f"tendons.{tendon.name}.tendon.stiffness_N_per_m"] = stiffness
    dry = rng.uniform(0.002, 0.004, 2) if kind == "pair" else rng.uniform(0.004, 0.008, len(finger.motors))
    return Rig(
        mechanism=with_numbers(finger, truth),
        truth=truth,
        dry_N_m=tuple(dry.tolist()),
        tension_N=np.full(len(finger.tendons), 5.0 if kind == "pair" else 11.5),
        stiffening=(stiffening, 5.0 if kind == "pair" else 11.5),
        masses=8 if kind == "pair" else 16,
        step_s=2e-6 if kind == "pair" else 4e-6,
    )


def _read(angle_rad: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """An angle in counts from any zero."""
    return np.round(angle_rad / COUNT_RAD + rng.uniform()) * COUNT_RAD


def write_log(rig: Rig, scenario, folder: Path, seed: int, *, encoder: bool) -> Path:
    """Log of the suggested routine."""
    routine, rng = suggest_motor_routine(scenario), np.random.default_rng(seed)
    time = np.arange(round(routine.time_s[-1] / ROW_S) + 1) * ROW_S
    motor = np.column_stack([np.interp(time, routine.time_s, angle) for angle in routine.motor_rad.T])
    start = routine.joint_rad[0]
    found = rig.respond(motor, start)
    held = np.vstack([rig.tension_N, found.drum_N]) @ rig.drums_m.T
    columns = {"time_s": time}
    for k, (each, friction) in enumerate(zip(rig.mechanism.motors, rig.dry_N_m, strict=True)):
        torque = held[:, k] + friction * MotorRun.of_one(motor[:, k], ROW_S, 0.0).way()[:, 0]
        columns[f"motor_{each.name}_rad"] = _read(motor[:, k], rng)
        columns[f"motor_torque_{each.name}_N_m"] = torque + NOISE * np.ptp(torque) * rng.standard_normal(len(time))
    if encoder:
        for name, angle in zip(rig.mechanism.names, np.vstack([start, found.angle_rad]).T, strict=True):
            columns[f"joint_{name}_rad"] = _read(angle, rng)
    write_csv(folder / "log.csv", columns)
    return folder / "log.csv"


def tracking_deg(rig: Rig, fitted: Path) -> dict[str, float]:
    """RMS error of the joints on the hidden plant, of the design from a fitted scenario."""
    design = design_motors(load_scenario(fitted))
    time, found = design.task.target_time_s, {}
    fine = np.arange(round(time[-1] / ROW_S) + 1) * ROW_S
    wanted = np.column_stack([np.interp(fine, time, q) for q in design.task.wanted.reshape(-1, len(time))])
    plant = replace(rig, tension_N=design.profiles["inverse"].tension_N[0])
    for name in ("inverse", "linear"):
        motor = np.column_stack([np.interp(fine, time, x) for x in design.profiles[name].motor_rad.T])
        reached = plant.respond(motor - motor[0], wanted[0]).angle_rad
        found[name] = math.degrees(float(np.sqrt(np.mean((reached - wanted[1:]) ** 2))))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=("pair", "finger"))
    parser.add_argument("--rigs", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--stiffening", type=float, default=0.0)
    parser.add_argument("--no-encoder", action="store_true")
    asked = parser.parse_args()
    example = "instrument_pair" if asked.kind == "pair" else "three_joint_finger"
    worst: dict[str, list[float]] = {"mu": [], "stiffness": [], "inverse": [], "linear": []}
    held = count = 0
    for seed in range(asked.first, asked.first + asked.rigs):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            text = (EXAMPLES / f"{example}.toml").read_text("utf-8")
            text = text.replace("damping_N_s_per_m = 0.5", "damping_N_s_per_m = 0.02")  # light for an explicit plant
            (folder / "rig.toml").write_text(text, encoding="utf-8")
            scenario = load_scenario(folder / "rig.toml")
            rig = hidden(scenario, asked.kind, seed, asked.stiffening)
            log = write_log(rig, scenario, folder, seed, encoder=not asked.no_encoder)
            found = identify(scenario, [log])
            found.write(folder / "fit")
            tracked = tracking_deg(rig, folder / "fit" / "fitted.toml")
        for key, value in rig.truth.items():
            estimate = found.estimate(key)
            worst["mu" if key.endswith("mu_dynamic") else "stiffness"].append(100 * abs(estimate.value / value - 1))
            if estimate.interval is not None:
                count, held = count + 1, held + (estimate.interval[0] <= value <= estimate.interval[1])
        for name, off in tracked.items():
            worst[name].append(off)
        own = {
            key: max(values[-len(rig.mechanism.tendons) :])
            for key, values in worst.items()
            if key in ("mu", "stiffness")
        }
        print(
            f"{seed:3d} mu {own['mu']:.2f} %, stiffness {own['stiffness']:.2f} % at most; after design "
            f"{tracked['inverse']:.3f} deg (linear {tracked['linear']:.2f})",
            flush=True,
        )
    print(f"intervals that hold: {held} of {count}")
    print(", ".join(f"{key}: median {np.median(x):.3f}, worst {np.max(x):.3f}" for key, x in worst.items()))


if __name__ == "__main__":
    main()
