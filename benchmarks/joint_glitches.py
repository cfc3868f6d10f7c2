"""Faults of a motor's encoder in the exported observer of a joint, as figures.

    python benchmarks/joint_glitches.py

Twelve faults on the way of examples/hand_joint.toml: the time until the observed angle is within 0.2 deg of the one
without a fault again, and the largest error meanwhile.
"""

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tendonff as tf
from tendonff.compensator.compensators.motors.joint import linear_motor_rad
from tendonff.compensator.export.host import HostCode, compile_on_host
from tendonff.compensator.export.joint.text import joint_sources
from tendonff.compensator.scenario.driven.joint import JointScenario, sample_joint
from tendonff.ocp.codegen.precision import Precision

Array = NDArray[np.float64]
DRIVER = """#include "tff_joint.h"
void observe(long n, const tff_real *motor, const tff_real *contact, tff_real *angle, tff_real *status)
{
    static tff_joint self;
    long k;
    (void)tff_joint_init(&self, 0, angle[0], 0);
    for (k = 1; k < n; k++) {
        status[k] = (tff_real)tff_joint_observe(&self, TFF_STEP_S, motor[k], contact[k]);
        angle[k] = self.angle_rad;
    }
}
"""
BACK_RAD = np.deg2rad(0.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Samples whose motor angle is off by `jump_rad`."""

    start: float  # share of the course
    samples: int
    jump_rad: float


FAULTS = tuple(
    Fault(start=start, samples=samples, jump_rad=jump)
    for start in (0.2, 0.45, 0.7)
    for samples, jump in ((2, 2 * np.pi), (20, 1.0), (2, -2 * np.pi), (400, 2 * np.pi))
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """Motor angles and what the observer makes of them."""

    code: HostCode
    motor_rad: Array  # shape (n,)
    start_rad: float

    @classmethod
    def of(cls, scenario: JointScenario, precision: Precision = Precision.DOUBLE) -> "Course":
        """The motor of a scenario, as the ratio alone leads it."""
        sampled = sample_joint(scenario)
        code = compile_on_host(joint_sources((scenario,), precision=precision), DRIVER, precision)
        motor = linear_motor_rad(scenario, sampled).ravel()
        return cls(code=code, motor_rad=motor, start_rad=float(sampled.angle_rad[0]))

    def observed(self, motor_rad: Array, contact_N_m: Array | None = None) -> tuple[Array, NDArray[np.uint32]]:
        """Angles [rad] and status bits, shape (n,)."""
        contact = np.zeros_like(motor_rad) if contact_N_m is None else contact_N_m
        angle, status = np.full(len(motor_rad), self.start_rad), np.zeros(len(motor_rad))
        given = [self.code.array(each) for each in (motor_rad, contact, angle, status)]
        self.code.function("observe", ctypes.c_long, *(self.code.reals,) * 4)(len(motor_rad), *given)
        return np.asarray(given[2], dtype=float), np.asarray(given[3]).astype(np.uint32)

    def faulty(self, fault: Fault) -> Array:
        """The motor's angles with a fault."""
        at = round(fault.start * len(self.motor_rad))
        motor = self.motor_rad.copy()
        motor[at : at + fault.samples] += fault.jump_rad
        return motor


def main() -> None:
    """Print a line for each fault."""
    scenario = tf.load_scenario(Path(__file__).parents[1] / "examples" / "hand_joint.toml")
    course, step = Course.of(scenario), scenario.run.step_s
    right, _ = course.observed(course.motor_rad)
    print("start  samples  jump [rad]  back after [ms]  largest error [deg]")
    for fault in FAULTS:
        angle, _ = course.observed(course.faulty(fault))
        error = np.abs(angle - right)
        end = round(fault.start * len(angle)) + fault.samples
        off = np.flatnonzero(error[end:] > BACK_RAD)
        back = 0 if not len(off) else 1e3 * step * (int(off[-1]) + 1)
        print(
            f"{fault.start:5.2f} {fault.samples:8d} {fault.jump_rad:11.3f} {back:16.0f} {np.rad2deg(error.max()):20.3f}"
        )


if __name__ == "__main__":
    main()
