"""Checks of every inverse of driven joints: golden vectors, bad inputs, times between calls, and jumps."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.export.script import ANSWER, Check, ModuleRecord, Port, Script
from tendonff.compensator.files.reading import FloatArray


class Status(IntFlag):
    """Status bits of driven joints."""

    OK = 0
    INPUT_HELD = 1
    TORQUE_LIMITED = 2
    SPEED_LIMITED = 4
    WOULD_PUSH = 8
    FAILED = 16
    SLACK = 32
    FROZEN = 64
    RANGE = 1024
    RESTARTED = 2048


HELD = Status.INPUT_HELD | Status.RANGE
LOST = (math.nan, math.inf, -math.inf)
FAR = (1e9, -1e9)
_JUMPS, _PLACE = 200, 40  # rows of a course that jumps, and how many it stays at a place
_FINITE_RAD = 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Differences from the model that are allowed, and limits that never may be passed.

    Attributes
    ----------
    motor_rad, command_rad, tension_N, torque_N_m : float
        Largest differences that pass.
    change_rad : tuple of float
        Largest change of each motor's command in a sample; 1e30 for none.
    torque_max_N_m : tuple of float
        Of each motor; 1e30 for none.
    back_rad : float
        What friction may leave of a motor angle after a way back.
    pause_rad : float
        Jump that passes after a pause.
    seen : int
        Bits that the course must set.
    """

    motor_rad: float
    command_rad: float
    tension_N: float
    torque_N_m: float
    change_rad: tuple[float, ...]
    torque_max_N_m: tuple[float, ...]
    back_rad: float
    pause_rad: float
    seen: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenTest:
    """A joint or finger under test.

    Attributes
    ----------
    script : Script
    module : ModuleRecord
    start : str
        Call that starts at rest; it returns 1.
    reference, load : str
        Inputs that are the angles and what the joints give.
    given : dict of str to ndarray
        Inputs of the course by name, a row a sample; exact in the real type.
    motor_rad, command_rad, tension_N : ndarray
        Answers of the model, shape (rows, motors) and (rows, tendons).
    bounds : Bounds
    step_s, part_s : float
        Time of a sample, and one too short for a step of its own.
    re_entry : int
        Samples of a way back.
    alike_rad : float
        By how much parts of a sample may differ from it.
    steady : int or None
        Rows before a load that steps of any length need not bear; None for all.
    """

    script: Script
    module: ModuleRecord
    start: str
    reference: str
    load: str
    given: Mapping[str, FloatArray]
    motor_rad: FloatArray
    command_rad: FloatArray
    tension_N: FloatArray
    bounds: Bounds
    step_s: float
    part_s: float
    re_entry: int
    alike_rad: float
    steady: int | None = None

    @property
    def rows(self) -> int:
        """Samples of the course."""
        return len(self.motor_rad)

    @property
    def motors(self) -> int:
        """Motors of the joint or finger."""
        return int(self.motor_rad.shape[1])

    def at(self, row: int | slice | NDArray[np.int_]) -> dict[str, FloatArray]:
        """Inputs of one row or of some."""
        return {name: values[row] for name, values in self.given.items()}

    def check(self, name: str, *slots: int) -> Check:
        """A check that begins at rest."""
        check = self.script.check(self.module, name)
        for slot in slots or (0,):
            check.call(self.start, slot, **self.at(0)).near(ANSWER, 1.0, 0.0, slot)
        return check

    def along(self, check: Check, rows: slice) -> Check:
        """Steps through rows of the course."""
        check = check.then(len(range(*rows.indices(self.rows))))
        return check.call("step", **self.at(rows))

    def times(self) -> tuple[float, float, float]:
        """A sample, a part of it, and the rest, in the real type [s]."""
        real = self.script.real
        step, part = real(self.step_s), real(self.part_s)
        return float(step), float(part), float(real(step - part))

    def slowly(self, check: Check, slack_rad: float) -> Check:
        """Expect changes of commands within the speed limits."""
        for motor, change in enumerate(self.bounds.change_rad, start=1):
            check.moved(f"command {motor}", change * 1.000001 + slack_rad)
        return check


def motor_ports(motors: int, tendons: int) -> tuple[Port, ...]:
    """Outputs of every inverse of driven joints."""
    single = [
        Port(name=f"{name} {k + 1} [{unit}]", member=f"{member}[{k}]")
        for name, member, unit in (("command", "command_rad", "rad"), ("motor torque", "motor_torque_N_m", "N m"))
        for k in range(motors)
    ]
    return (
        Port(name="command [rad]", member="command_rad", count=motors),
        Port(name="motor angle [rad]", member="motor_rad", count=motors),
        Port(name="motor torque [N m]", member="motor_torque_N_m", count=motors),
        Port(name="tension [N]", member="tension_N", count=tendons),
        Port(name="least tension [N]", member="least_N"),
        Port(name="slack [m]", member="slack_m"),
        Port(name="status", member="status", kind="u"),
        Port(name="seen", member="seen", kind="u"),
        Port(name="evaluations", member="evaluations", kind="i"),
        *single,
    )


def follow(test: DrivenTest, more: Mapping[str, FloatArray]) -> Check:
    """The golden course; `more` are further outputs of the model, which agree to the bit. Lines can be added."""
    bounds = test.bounds
    check = test.along(test.check("golden vectors"), slice(None))
    check.same(ANSWER, other=0, versus="status")
    check.near("motor angle", test.motor_rad, bounds.motor_rad)
    check.near("command", test.command_rad, bounds.command_rad)
    check.near("tension", test.tension_N, bounds.tension_N)
    for port, values in more.items():
        check.near(port, values, 0.0)
    return check


def finished(check: Check, test: DrivenTest) -> None:
    """Bits that the course sets, and those that it does not."""
    check.then().bits("seen", some=test.bounds.seen, none=HELD | Status.FAILED)


def check_calls(test: DrivenTest, bad: Sequence[tuple[str, int, Sequence[float], Status]]) -> None:
    """All checks that joints and fingers share; `bad` are inputs, places in them, values, and the bit that they set."""
    _repeats(test)
    _lost(test, bad)
    _timed(test)
    _jumps(test)


def _repeats(test: DrivenTest) -> None:
    check = test.script.check(test.module, "the same again gives the same whatever the memory held").fill(0, 0)
    check.fill(1, 0xFF)
    for slot in (0, 1):
        check.call(test.start, slot, **test.at(0))
    check = test.along(check, slice(None))
    check.call("step", 1).same("command").same("status")


def _with(test: DrivenTest, row: int, name: str, place: int, values: Sequence[float]) -> dict[str, FloatArray]:
    """Inputs of a row in which one number is another, one row for each value."""
    given = {each: np.repeat(value[row][None], len(values), axis=0) for each, value in test.given.items()}
    changed = given[name].copy()
    changed.reshape(len(values), -1)[:, place] = values
    return given | {name: changed}


def _lost(test: DrivenTest, bad: Sequence[tuple[str, int, Sequence[float], Status]]) -> None:
    script, start, bounds = test.script, test.rows // 3, test.bounds
    check = script.check(test.module, "a bad start is refused, and no step is made from there")
    for name, place, values, bit in bad:
        if bit is Status.INPUT_HELD or name == test.reference:
            check = check.then(len(values))
            check.call(test.start, **_with(test, 0, name, place, values)).near(ANSWER, 0.0, 0.0)
            check.call("step", **test.at(0)).bits("status", exactly=Status.FAILED)
    check = test.along(test.check("a bad input holds and is reported"), slice(start))
    for name, place, values, bit in bad:
        check = check.then(len(values))
        check.call("step", **_with(test, start, name, place, values)).held("command")
        check.bits("status", some=bit, none=HELD & ~bit)
    check = script.check(test.module, "the way back is within the speed limits, and ends on the course")
    led = start + 3 * test.re_entry
    for rows in (slice(start, start + 1), slice(start + 1, led), slice(led, None)):
        if rows.start < test.rows:
            test.slowly(check := test.along(check, rows), 1e-6)
            if rows.start == start:
                check.held("command", bounds.pause_rad)
            if rows.start == led:
                check.near("motor angle", test.motor_rad[rows], bounds.back_rad)
    check.then().bits("seen", none=Status.FAILED)


def _timed(test: DrivenTest) -> None:
    step, part, rest = test.times()
    start = test.rows // 9
    check = test.check("parts of a sample are one", 0, 1).then(start)
    for k, dts in enumerate(((step,), (part, rest), (step,))):
        row = slice(k, 3 * start, 3)
        check.call("step", 1, **test.at(row))
        for dt in dts:
            check.call("step_dt", 0, dt=dt)
            if dt == part:
                check.bits("status", exactly=Status.OK)
        check.same("command", test.alike_rad)
    last = test.at(3 * start)
    check = test.script.check(test.module, "a time that is no number or negative is reported", 2)
    check.call("step_dt", dt=[math.nan, -step], **last).bits("status", some=Status.INPUT_HELD)
    check = test.script.check(test.module, "no jump after a pause")
    check.call("step_dt", dt=0.5, **last).same("command", test.bounds.pause_rad)
    rows = np.arange(2, test.rows if test.steady is None else test.steady, 2)
    check = test.check("steps that differ have answers").call("step", **test.at(0)).then(len(rows))
    check.call("step_dt", dt=np.where(rows % 4 == 0, 2.5, 1.5) * step, **test.at(rows))
    check.within("command", -_FINITE_RAD, _FINITE_RAD)
    check.then().bits("seen", none=HELD | Status.FAILED)


def _jumps(test: DrivenTest) -> None:
    check = test.check("jumps are within the speed limits and finite")
    for k in range(_JUMPS // _PLACE):
        check = check.then(_PLACE)
        check.call("step", **test.at((k % 2) * (test.rows // 2))).within("command", -_FINITE_RAD, _FINITE_RAD)
        test.slowly(check, 1e-6)
