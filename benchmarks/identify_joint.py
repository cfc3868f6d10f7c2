"""Identify hidden loops from motor signals, design from what was found, and run the design on the hidden plant.

    python -m benchmarks.identify_joint [--rigs 20] [--first 0] [--rounds 1]

Each loop is the explicit plant of `tests/joint_plant.py`, 40 masses a tendon and steps of 2 us, with numbers drawn by
`tests/hidden_loop.py`: 12-bit motor angle, 100 Hz, 3 mA noise, torque constant 10 % off, friction of the gear 5 to 30 %
of 2 a T, every fourth with an efficiency below one, a stop of 60 to 200 N m/rad, every other with an encoder. Prints
errors in % of what the motor measures, whether the 95 % interval holds the true value (+ or !), and the RMS error of
the joint after design from fitted.toml. `--relaxing` gives the tendons stress relaxation, a share of their stiffness,
within 0.5 to 3 s, `--adhesion` load-independent friction, a share of the pre-tension. Simulations are
counted, plain and with slopes; those are the same on every machine.
"""

import argparse
import math
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.identification.answer.result import AnyIdentification
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.motors.estimates import derived
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.motors.run import design_motors
from tendonff.ocp.fits import mechanism as fits
from tests.hidden_loop import FINE_S, HiddenLoop, hidden, scenario, write_log

FORCES = (
    "drive_torque_N_m",
    "motor_friction_N_m",
    "pretension_N",
    "stiffness_N_per_m",
    "soft_bristle_stiffness_N_per_m",
    "coulomb_N_m",
    "gravity_N_m",
)


def measured(loop: HiddenLoop) -> dict[str, float]:
    """The same, forces as the motor measures them."""
    return {name: value * (loop.scale if name in FORCES else 1.0) for name, value in truth(loop).items()}


def truth(loop: HiddenLoop) -> dict[str, float]:
    """True values of what is estimated."""
    first, drive, joint = loop.mechanism.tendons[0], loop.mechanism.drive, loop.mechanism.joint
    exponent, ratio, lost, friction, whole = derived(loop.mechanism, 0.0).tolist()
    return {
        "mu_theta": exponent,
        "tension_over_stiffness_m": ratio,
        "lost_motion_rad": lost,
        "drive_torque_N_m": friction,
        "motor_friction_N_m": whole,
        "pretension_N": drive.pretension_N or 0.0,
        "stiffness_N_per_m": first.tendon.stiffness_N_per_m,
        "soft_bristle_stiffness_N_per_m": first.friction.soft_bristle_stiffness_N_per_m,
        "coulomb_N_m": drive.coulomb_N_m,
        "gravity_N_m": joint.gravity_N_m,
        "stop_high_rad": joint.stop_high_rad or 0.0,
    }


def with_effects(loop: HiddenLoop, relaxing: float, adhesion: float) -> HiddenLoop:
    """The loop whose tendons relax by a share of their stiffness, and stick by a share of their tension."""
    time_s = float(np.random.default_rng(loop.seed).uniform(0.5, 3.0))
    tendons = tuple(
        replace(
            t,
            tendon=replace(
                t.tendon,
                relaxing_stiffness_N_per_m=relaxing * t.tendon.stiffness_N_per_m,
                relaxation_time_s=time_s,
            ),
            friction=replace(t.friction, adhesion_N=adhesion * (loop.mechanism.drive.pretension_N or 0.0)),
        )
        for t in loop.mechanism.tendons
    )
    return replace(loop, mechanism=replace(loop.mechanism, tendons=tendons))


def tracking_deg(loop: HiddenLoop, found: AnyIdentification, folder: Path) -> tuple[float, float]:
    """RMS error of the joint on the hidden plant: exact inverse designed from fitted.toml, and the ratio alone."""
    found.write(folder)
    design = design_motors(load_scenario(folder / "fitted.toml"))
    time = design.task.target_time_s
    fine = np.arange(round(time[-1] / FINE_S) + 1) * FINE_S
    errors = []
    for name in ("inverse", "linear"):
        motor = np.interp(fine, time, design.profiles[name].motor_rad[:, 0])
        reached = loop.follow(motor).angle_rad
        errors.append(math.degrees(float(np.sqrt(np.mean((reached - np.interp(fine, time, design.task.wanted)) ** 2)))))
    return errors[0], errors[1]


def counted(name: str, calls: Counter[str]) -> None:
    """Count the calls of a simulation by what fits joints."""
    simulation = getattr(fits, name)

    def counting(*args: object, **options: object) -> object:
        calls[name] += 1
        return simulation(*args, **options)

    setattr(fits, name, counting)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--relaxing", type=float, default=0.0)
    parser.add_argument("--adhesion", type=float, default=0.0)
    asked = parser.parse_args()
    errors: dict[str, list[float]] = {}
    calls = Counter[str]()
    for name in ("simulate_joint", "simulate_slopes"):
        counted(name, calls)
    held, count = 0, 0
    tracking = []
    for seed in range(asked.first, asked.first + asked.rigs):
        loop = with_effects(hidden(seed), asked.relaxing, asked.adhesion)
        with tempfile.TemporaryDirectory() as folder:
            log = write_log(loop, Path(folder) / "log.csv", encoder=seed % 2 == 1)
            calls.clear()
            found = identify(scenario(), [log])
            simulated = f"{calls['simulate_joint']} + {calls['simulate_slopes']} simulations"
            parts = []
            for name, value in truth(loop).items():
                estimate = found.estimate(name)
                off = 100 * (estimate.value / measured(loop)[name] - 1)
                errors.setdefault(name, []).append(abs(off))
                mark = " "
                if estimate.interval is not None:
                    inside = estimate.interval[0] <= value <= estimate.interval[1]
                    held, count, mark = held + inside, count + 1, "+" if inside else "!"
                parts.append(f"{off:+6.1f}{mark}")
            own, ratio = tracking_deg(loop, found, Path(folder) / "fit")
        tracking.append(own)
        tracked = f"tracking {own:.3f} deg (ratio {ratio:.2f})"
        print(f"{seed:3d} {' '.join(parts)}  {tracked}  {simulated}  {found.law}", flush=True)
    print("names: ", ", ".join(errors))
    print("median:", ", ".join(f"{name} {np.median(values):.2f} %" for name, values in errors.items()))
    print("worst: ", ", ".join(f"{name} {np.max(values):.2f} %" for name, values in errors.items()))
    print(f"intervals that hold: {held} of {count}, {100 * held / max(count, 1):.1f} %")
    print(f"tracking: median {np.median(tracking):.3f}, worst {np.max(tracking):.3f} deg")


if __name__ == "__main__":
    main()
