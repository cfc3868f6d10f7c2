"""Self test of joints: their golden courses, what never may happen, the observer with faults, and self-tuning."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

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
from tendonff.compensator.export.joint.observed import LOST_S
from tendonff.compensator.export.script import ANSWER, Check, ModuleRecord, Port
from tendonff.compensator.files.reading import FloatArray

_TURN = 2 * math.pi
_START_RAD = (1.5, -0.75)  # of motors that do not start at 0
_BESIDE = 2.5  # the same for an observer [rad]
_NEAR_RAD = 0.05  # of the joint, after a fault
_GOOD = HELD | Status.FAILED | Status.RESTARTED
_STUCK = 0.35  # by how much a stuck sensor may move a factor


@dataclass(frozen=True, slots=True, kw_only=True)
class Observed:
    """Bounds of the observer.

    Attributes
    ----------
    angle_rad : float
        What the observed angle may be off; 0 where the course is not one for an observer.
    tension_N : float
        What observed tensions may be off.
    drift_rad : float
        Change of a motor's angle in a sample that an observer still takes.
    ahead_rad : float
        What motors may be off after a restart.
    least_rad, most_rad : float
        Accepted angles of the joint.
    """

    angle_rad: float
    tension_N: float
    drift_rad: float
    ahead_rad: float
    least_rad: float
    most_rad: float


def tested_joint(prefix: str, name: str, which: int, motors: int, tendons: int, others: int) -> ModuleRecord:
    """A joint of the exported folder."""
    call, more = f"{prefix}_joint", ", &{other}" if others else ""
    load = f"{{contact}}{more}"
    ahead = "(double)(self->motor_rad[{k}] - (&{{motor}})[{k}])"
    return ModuleRecord(
        name=f"joint_{name}",
        type=call,
        inputs={"angle": 0, "contact": 0, "motor": 2, "dt": 0, "which": 0, **({"other": others} if others else {})},
        calls={
            "init": f"answer = (double){call}_init(self, {which}, {{angle}}, {load})",
            "init_of": f"answer = (double){call}_init(self, (int32_t){{which}}, {{angle}}, {load})",
            "init_at": f"answer = (double){call}_init_at(self, {which}, {{angle}}, &{{motor}}, {load})",
            "step": f"answer = (double){call}_step(self, {{angle}}, {load})",
            "step_dt": f"answer = (double){call}_step_dt(self, {{dt}}, {{angle}}, {load})",
            "observe": f"answer = (double){call}_observe_motors(self, {{dt}}, &{{motor}}, {load})",
            "observe_one": f"answer = (double){call}_observe(self, {{dt}}, *(&{{motor}}), {load})",
            # what all motors are ahead alike is tension
            "ahead": "answer = " + " - ".join(ahead.format(k=k) for k in range(motors)),
        },
        ports=(
            *motor_ports(motors, tendons),
            Port(name="angle [rad]", member="angle_rad"),
            Port(name="missed [s]", member="missed_s"),
        ),
    )


def tested_adaptive(prefix: str, name: str, which: int, others: int) -> ModuleRecord:
    """A joint that tunes itself."""
    call, more = f"{prefix}_joint_adaptive", ", &{other}" if others else ""
    return ModuleRecord(
        name=f"joint_{name}_adaptive",
        type=call,
        inputs={"angle": 0, "contact": 0, "measured": 0, "factor": 0, **({"other": others} if others else {})},
        calls={
            "init": f"answer = (double){call}_init(self, {which}, {{angle}}, {{contact}}{more})",
            "step": f"answer = (double){call}_step(self, {{angle}}, {{contact}}, {{measured}}{more})",
            "assume": f"{call}_assume(self, {{factor}})",
        },
        ports=(
            Port(name="command [rad]", member="command_rad"),
            Port(name="factor", member="factor"),
            Port(name="seen", member="seen", kind="u"),
        ),
    )


def check_joint(test: DrivenTest, observed: Observed, torque_N_m: FloatArray, records: int, push_N: float) -> None:
    """All checks of a joint.

    `torque_N_m` is that of the motors along the course, `records` the number of joints in the code, and `push_N` the
    tension below which a tendon counts as pushing.
    """
    check = follow(test, {"angle": test.given["angle"]})
    check.near("motor torque", torque_N_m, test.bounds.torque_N_m)
    _stated(test, check, push_N)
    finished(check, test)
    check = test.script.check(test.module, "a joint that is none is refused")
    check.call("init_of", which=float(records), **test.at(0)).near(ANSWER, 0.0)
    contact = (*LOST, *FAR)
    check_calls(
        test,
        [
            ("angle", 0, LOST, Status.INPUT_HELD),
            ("angle", 0, FAR, Status.RANGE),
            ("contact", 0, contact, Status.INPUT_HELD),
        ],
    )
    _started(test)
    if test.motors > 1:
        check = test.check("one motor alone does not say where a pair is")
        check.call("observe_one", dt=test.step_s, motor=[0.0, 0.0]).near(ANSWER, float(Status.FAILED), 0.0)
    if observed.angle_rad > 0:
        _observe(test, observed)
        _faults(test, observed)


def _stated(test: DrivenTest, check: Check, push_N: float) -> None:
    """Expect the bits of what happened, and no others."""
    bounds, margin = test.bounds, 1e-6 if test.script.one_rounding < 1e-9 else 1e-3
    known = Status.SPEED_LIMITED | Status.TORQUE_LIMITED | Status.SLACK | Status.WOULD_PUSH
    check.bits("status", none=0xFFFFFFFF & ~int(known))
    for motor, change in enumerate(bounds.change_rad, start=1):
        check.moved(f"command {motor}", change * (1 + margin))
    slow = (1 - margin) * min(bounds.change_rad)
    check.when("command", -slow, slow, lambda c: c.bits("status", none=Status.SPEED_LIMITED), moved=True)
    most = bounds.torque_max_N_m[0]
    low = (1 - margin) * most
    check.when("motor torque", -low, low, lambda c: c.bits("status", none=Status.TORQUE_LIMITED))
    for motor in range(1, test.motors + 1):
        for ends in (((1 + margin) * most, math.inf), (-math.inf, -(1 + margin) * most)):
            check.when(f"motor torque {motor}", *ends, lambda c: c.bits("status", some=Status.TORQUE_LIMITED))
    below = float(np.nextafter(test.script.real(push_N), test.script.real(-np.inf)))

    def loaded(c: Check) -> None:
        c.bits("status", none=Status.SLACK)
        c.when("least tension", -math.inf, below, lambda each: each.bits("status", some=Status.WOULD_PUSH))
        c.when("least tension", push_N, math.inf, lambda each: each.bits("status", none=Status.WOULD_PUSH))

    check.when("slack", 1e-30, math.inf, lambda c: c.bits("status", some=Status.SLACK, none=Status.WOULD_PUSH))
    check.when("slack", -math.inf, 0.0, loaded)


def _started(test: DrivenTest) -> None:
    """Motors that do not start at 0: the same commands from there on."""
    check = test.script.check(test.module, "a start at a motor angle that is no number is refused, and no step is made")
    check.call("init_at", motor=[math.nan, math.nan], **test.at(0)).near(ANSWER, 0.0, 0.0)
    check.call("step").bits("status", exactly=Status.FAILED)
    check = test.check("motors that do not start at 0 have the same commands from there on", 1)
    check.call("init_at", motor=_START_RAD).near(ANSWER, 1.0, 0.0)
    check = test.along(check, slice(test.rows // 4))
    there = _START_RAD if test.motors > 1 else _START_RAD[0]
    check.call("step", 1).apart("command", there, test.bounds.command_rad).same("status")


def _motors(test: DrivenTest, rows: int | slice, beside: float | FloatArray = 0.0) -> FloatArray:
    """Motor angles of the course, the first one beside it [rad]; an array of two, whatever there are."""
    there = np.zeros((*test.motor_rad[rows].shape[:-1], 2))
    there[..., : test.motors] = test.motor_rad[rows]
    there[..., 0] += beside
    return there


def _observe(test: DrivenTest, own: Observed) -> None:
    step, angle = test.times()[0], test.given["angle"]
    check = test.check("the joint is observed where its motors are")
    check = check.then(test.rows - 1)
    rows = slice(1, None)
    check.call("observe", dt=step, motor=_motors(test, rows), **_loads(test, rows)).bits("status", none=_GOOD)
    check.near("angle", angle[rows], own.angle_rad)
    if test.motors > 1:
        check.near("tension", test.tension_N[rows], own.tension_N)


def _loads(test: DrivenTest, rows: int | slice) -> dict[str, FloatArray]:
    """Inputs of an observer beside the motors."""
    return {name: values for name, values in test.at(rows).items() if name != test.reference}


def _faults(test: DrivenTest, own: Observed) -> None:
    """Another instance, whose motors do not start at 0 and whose encoder has faults."""
    script, module, angle = test.script, test.module, test.given["angle"]
    step, part = test.times()[0], float(script.real(0.5 * test.part_s))
    rest, start = float(script.real(step) - script.real(part)), test.rows // 3
    thirds = max(1, start // 3)
    lost = int(max(LOST_S, 10 * test.step_s) / test.step_s) + 1

    def good(check: Check, rows: slice) -> Check:
        check = check.then(len(range(*rows.indices(test.rows))))
        return check.call("observe", dt=step, motor=_motors(test, rows, _BESIDE), **_loads(test, rows))

    check = script.check(module, "parts of a sample are one for the observer too")
    check.call("init_at", motor=[_BESIDE, 0.0], **test.at(0)).near(ANSWER, 1.0, 0.0)
    check = check.then(thirds)
    for k, dts in enumerate(((step,), (part, rest), (step,))):
        rows = slice(1 + k, 1 + 3 * thirds, 3)
        for dt in dts:
            check.call("observe", dt=dt, motor=_motors(test, rows, _BESIDE), **_loads(test, rows))
            if dt == part:
                check.bits("status", exactly=Status.OK)
        check.near("angle", angle[rows], own.angle_rad)
    here = 3 * thirds
    check = script.check(module, "a reading or time that is none moves nothing and is reported")
    reading, nothing = _motors(test, here, _BESIDE), _motors(test, here, _BESIDE)
    nothing[test.motors - 1] = math.nan
    faults: list[tuple[dict[str, ArrayLike], float]]
    faults = [({"motor": nothing}, step), ({}, math.nan), ({}, -step), ({"contact": math.nan}, step)]
    turns = [(_TURN, 0.0), (-_TURN, 0.0), *([(0.0, _TURN)] if test.motors > 1 else [])]  # the second one is asked too
    faults += [({"motor": reading + np.array(turn)}, step) for turn in turns]
    for given, dt in faults:
        check.call("observe", dt=dt, **{"motor": reading, **_loads(test, here), **given})
        check.bits("status", exactly=Status.INPUT_HELD).held("angle").write("missed", 0.0)  # as if no time had passed
    check = script.check(module, "back after a fault, near where it was")
    check.call("observe", dt=step, motor=reading, **_loads(test, here)).bits("status", exactly=Status.OK)
    check.held("angle", _NEAR_RAD)
    check = script.check(
        module, "a fault that stays is reported, and the joint is taken to be at rest after the stated time"
    )
    drifting = reading + np.column_stack([16 * _TURN + own.drift_rad * np.arange(2 * lost), np.zeros(2 * lost)])
    check.write("seen", 0.0)
    for rows in (slice(0, lost - 3), slice(lost - 3, lost + 2)):
        check = check.then(rows.stop - rows.start)
        check.call("observe", motor=drifting[rows]).within("angle", own.least_rad, own.most_rad)
        if rows.start == 0:
            check.within("status", 1.0, 4096.0).bits("status", none=Status.RESTARTED)
    check.then().bits("seen", some=Status.RESTARTED | Status.INPUT_HELD)
    check = script.check(module, "and once more where its motors are when the fault ends")
    check = check.write("seen", 0.0).then(lost + 2)
    check.call("observe", motor=reading)
    check = check.then().bits("seen", some=Status.RESTARTED).near("angle", angle[here], _NEAR_RAD)
    check.call("ahead").near(ANSWER, 0.0, own.ahead_rad)
    check = script.check(module, "the same course after a fault")
    check = good(check, slice(here + 1, None)).bits("status", none=_GOOD)
    check.then().near("angle", angle[-1], _NEAR_RAD)


def check_adaptive(test: DrivenTest, module: ModuleRecord, delay: int, tuned_rad: float) -> None:
    """A joint as modelled teaches nothing, nor does a measurement that is none; a stuck one freezes the factor."""
    script, angle, rows = test.script, test.given["angle"], test.rows
    measured = angle[np.maximum(np.arange(rows) - 1 - delay, 0)]

    def along(name: str, given: FloatArray | float) -> Check:
        check = script.check(module, name).call("init", **test.at(0)).near(ANSWER, 1.0, 0.0).then(rows)
        return check.call("step", measured=given, **test.at(slice(None)))

    check = along("a joint as modelled has the inverse's command, and is not frozen", measured)
    check.near("command", test.command_rad[:, 0], test.bounds.command_rad + tuned_rad)
    check.then().bits("seen", none=Status.FROZEN).call("assume", factor=1.1).near("factor", 1.1, 1e-6)
    along("a measurement that is no number teaches nothing", math.nan).near("factor", 1.0, 0.0)
    check = along("a stuck sensor freezes the factor, and moves it little", float(angle[0]))
    check.near("factor", 1.0, _STUCK).then().bits("seen", some=Status.FROZEN)
