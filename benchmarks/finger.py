"""A finger of three joints and four tendons on an independent explicit plant: `python -m benchmarks.finger`.

Errors over all joints after the fade [deg], and the time of a step of the inverse and of the simulation [us].
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parent.parent / "tests"), str(Path(__file__).parent.parent / "tests/ocp/mechanism")]

import test_finger as finger  # noqa: E402  # the same mechanism and plant as in the tests

from tendonff.models.mechanism.geometry import Geometry  # noqa: E402
from tendonff.ocp.mechanism.response import invert_mechanism, simulate_mechanism  # noqa: E402


def best_us(call, steps, repeats=5):
    """Shortest time of a step over some repeats [us]."""
    took = []
    for _ in range(repeats):
        begun = time.perf_counter()
        call()
        took.append(time.perf_counter() - begun)
    return 1e6 * min(took) / steps


def main() -> None:
    """Print the table."""
    wanted, step = finger.WANTED, finger.STEP_S
    length = Geometry(tendons=finger.finger().tendons, bodies=tuple(finger.JOINTS)).length_m(wanted)
    linear = -(length - length[0]) / finger.DRUM_M
    exact = invert_mechanism(finger.problem(), wanted, step)
    stretch = invert_mechanism(finger.problem(mu=0.0), wanted, step)
    fine = invert_mechanism(finger.problem(segments=24), wanted, step)

    def error(motor, factor=1.0, **plant):
        return finger.rms_deg(finger.on_the_plant(motor, factor * exact.tension_N[0], **plant))

    print(f"lengths alone                         {error(linear):.3f}")
    print(f"lengths and elasticity                {error(stretch.motor):.3f}")
    print(f"exact inverse, 12 masses              {error(exact.motor):.4f}")
    print(f"exact inverse, 24 masses              {error(fine.motor):.4f}")
    for mu in (0.12, 0.18):
        print(f"exact inverse, mu of the plant {mu}    {error(exact.motor, mu=mu):.3f}")
    off = error(exact.motor, 0.8, mu=0.18, stiffness=1.6e4)
    print(f"exact inverse, mu, k, T 20 % off      {off:.3f}")
    rate = [np.abs(np.diff(motor, axis=0)).max() / step for motor in (exact.motor, linear)]
    print(f"fastest motor [rad/s]                 {rate[0]:.3g}, by lengths {rate[1]:.3g}")
    inverse = best_us(lambda: invert_mechanism(finger.problem(), wanted, step), len(wanted))
    forward = best_us(lambda: simulate_mechanism(finger.problem(), exact.motor, step), len(wanted))
    print(f"a step [us]                           inverse {inverse:.1f}, simulation {forward:.1f}")


if __name__ == "__main__":
    main()
