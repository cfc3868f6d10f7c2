"""Self test of fingers: their golden courses, what never may happen, and the observer."""

import math

import numpy as np

from tendonff.compensator.export.driven.checks import (
    FAR,
    HELD,
    LOST,
    DrivenTest,
    Status,
    check_calls,
    finished,
    follow,
    motor_ports,
)
from tendonff.compensator.export.script import ANSWER, Check, ModuleRecord, Port

ALL_AT_ONCE = Status.TORQUE_LIMITED | Status.SLACK
"""Bits that an observer may set along a good course."""


def tested_finger(prefix: str, name: str, which: int, joints: int, motors: int, tendons: int) -> ModuleRecord:
    """A finger of the exported folder."""
    call = f"{prefix}_finger"
    return ModuleRecord(
        name=f"finger_{name}",
        type=call,
        inputs={"angle": joints, "torque": joints, "motor": motors, "dt": 0, "which": 0},
        calls={
            "init": f"answer = (double){call}_init_at(self, {which}, &{{angle}}, &{{torque}})",
            "init_of": f"answer = (double){call}_init(self, (int){{which}}, &{{angle}})",
            "step": f"answer = (double){call}_step(self, &{{angle}}, &{{torque}})",
            "step_dt": f"answer = (double){call}_step_dt(self, {{dt}}, &{{angle}}, &{{torque}})",
            "observe": f"answer = (double){call}_observe(self, {{dt}}, &{{motor}}, &{{torque}})",
        },
        ports=(*motor_ports(motors, tendons), Port(name="joint angle [rad]", member="joint_rad", count=joints)),
    )


def check_finger(test: DrivenTest, fingers: int, evaluations: int, bodies: int) -> None:
    """All checks of a finger; the sizes are those of the folder."""
    check = follow(test, {})
    bounded(check, evaluations)
    check.when("slack", 1e-30, math.inf, lambda c: c.bits("status", some=Status.SLACK))
    check.when("slack", -math.inf, 0.0, _unloaded)
    finished(check, test)
    check = test.script.check(test.module, "a finger that is none is refused")
    check.call("init_of", which=-1.0, **test.at(0)).near(ANSWER, 0.0).call("init_of", which=float(fingers)).near(
        ANSWER, 0.0
    )
    joints = test.given["angle"].shape[1]
    bad = [("angle", 0, LOST, Status.INPUT_HELD), ("angle", joints - 1, FAR, Status.RANGE)]
    check_calls(test, [*bad, ("torque", joints - 1, LOST, Status.INPUT_HELD), ("torque", 0, FAR, Status.RANGE)])
    _observe(test, evaluations * (1 + bodies))


def bounded(check: Check, evaluations: int) -> Check:
    """Expect work within its bound."""
    return check.within("evaluations", 0.0, float(evaluations))


def _unloaded(check: Check) -> None:
    """No loop hangs loose: a tendon that pushes is reported."""
    check.bits("status", none=Status.SLACK)
    check.when("least tension", -math.inf, 0.0, lambda c: c.bits("status", some=Status.WOULD_PUSH))


def _observe(test: DrivenTest, evaluations: int) -> None:
    """Conversely: the joints where their motors are, until one of the course's tendons would push."""
    step, _, _ = test.times()
    pushed = np.flatnonzero((test.tension_N < 0.0).any(axis=1))
    rows = int(pushed[0]) if pushed.size else test.rows
    start = min(test.rows // 3, rows)
    torque, angle = test.given["torque"], test.given["angle"]

    def observed(check: Check, some: slice) -> Check:
        check = check.then(len(range(*some.indices(rows))))
        check.call("observe", dt=step, motor=test.motor_rad[:rows][some], torque=torque[:rows][some])
        check.bits("status", none=0xFFFFFFFF & ~int(ALL_AT_ONCE))
        bounded(check, evaluations).near("joint angle", angle[:rows][some], 20 * test.bounds.motor_rad)
        return check.near("tension", test.tension_N[:rows][some], 20 * test.bounds.tension_N)

    check = test.check("the joints are observed where their motors are")
    check = observed(check, slice(1, start))
    if start >= rows:
        return
    check = test.script.check(test.module, "a motor angle or time that is no number moves nothing")
    lost = test.motor_rad[start].copy()
    lost[-1] = math.nan
    given = {"torque": torque[start]}
    check.call("observe", dt=step, motor=lost, **given).bits("status", exactly=Status.INPUT_HELD).held("joint angle")
    check.call("observe", dt=-step, motor=test.motor_rad[start]).bits("status", exactly=Status.INPUT_HELD)
    part = float(test.script.real(0.5 * test.part_s))
    check.held("joint angle").call("observe", dt=part).bits("status", exactly=Status.OK).held("joint angle")
    check.call("observe", dt=float(test.script.real(step) - test.script.real(part)))
    check.bits("status", none=HELD | Status.FAILED).near("joint angle", angle[start], 20 * test.bounds.motor_rad)
    observed(test.script.check(test.module, "and the course is observed further"), slice(start + 1, rows))
