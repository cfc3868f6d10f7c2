"""Checks of every module that follows a reference: bad inputs, what was lost or missed, and times between calls."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntFlag

import numpy as np
from numpy.typing import ArrayLike

from tendonff.compensator.export.repeat import Compared
from tendonff.compensator.export.script import ANSWER, Check, ModuleRecord, Ramp, Script


class Status(IntFlag):
    """Status bits of the exported modules."""

    OK = 0
    INPUT_HELD = 1
    FORCE_LIMITED = 2
    RATE_LIMITED = 4
    WOULD_PUSH = 8
    FAILED = 16
    ENDED = 32
    FROZEN = 64
    AT_BOUND = 128
    DOUBT = 256
    FAR_MOVED = 512
    RANGE = 1024


HELD = Status.INPUT_HELD | Status.RANGE
LOST_ROWS = (math.nan, math.inf, -math.inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class Times:
    """Times between calls [s], and samples of a way back."""

    step_s: float
    part_s: float  # too short for a step of its own
    pause_s: float
    re_entry: int
    re_entry_share: int  # samples of the way back for each that was lost


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowed:
    """Bounds that no output may leave: of the force and of its change in a sample [N]."""

    low_N: float
    high_N: float
    change_N: float

    def clip(self, values: ArrayLike) -> np.ndarray:
        """Forces within the range."""
        return np.clip(values, self.low_N, self.high_N)

    def checked(self, check: Check, slack: float) -> Check:
        """Expect a force within its bounds."""
        check.within("force", self.low_N - slack, self.high_N + slack)
        return check.moved("force", self.change_N + slack)

    def stated(self, check: Check, slack: float) -> Check:
        """Expect the bits of what happened: a rate that binds, a force that is no longer inside, WOULD_PUSH."""
        limits = Status.FORCE_LIMITED | Status.RATE_LIMITED

        def inside(c: Check) -> None:
            c.bits("status", none=Status.RATE_LIMITED)
            low, high = self.low_N + slack, self.high_N - slack
            c.when("force", low, high, lambda each: each.bits("status", none=Status.FORCE_LIMITED))

        check.bits("status", none=0xFFFFFFFF & ~int(limits | Status.WOULD_PUSH))
        most = self.change_N - slack
        return check.when("force", -most, most, inside, moved=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Follower:
    """A module that follows a reference, and what its steps take beside it.

    Attributes
    ----------
    module : ModuleRecord
    reference : str
        Input that is the reference.
    more : dict of str to array
        Further inputs of a step, constant.
    """

    module: ModuleRecord
    reference: str = "reference"
    more: Mapping[str, ArrayLike] = field(default_factory=dict)

    def start(self, check: Check, value: ArrayLike, *slots: int) -> Check:
        """Start at rest."""
        for slot in slots or (0,):
            check.call("init", slot, **{self.reference: value}, **self.more)
        return check

    def step(self, check: Check, value: ArrayLike | Ramp, slot: int = 0, dt_s: ArrayLike | None = None) -> Check:
        """Step, with a time between calls or without."""
        given = {self.reference: value}
        if dt_s is None:
            return check.call("step", slot, **given)
        return check.call("step_dt", slot, dt=dt_s, **given)


def near_golden(check: Check, compared: Compared, port: str = ANSWER) -> Check:
    """Compare with what the Python model answers."""
    return check.near(port, compared.expected, compared.tolerance, mean=compared.mean_of > 1)


def led_back(script: Script, each: Follower, start: float, to: float, times: Times) -> None:
    """After a reference that was lost or missed: at first where it was, then in between, at last there."""
    slack = 10 * script.one_rounding * (1.0 + abs(to) + abs(start))
    check = script.check(each.module, "a reference that was lost or missed is led back")
    each.step(each.start(check, start, 1), start, 1)
    each.step(check, to, 1)  # a slot that lost nothing
    way = (0.0, math.inf) if to > start else (-math.inf, 0.0)
    for lost in (times.re_entry, 0, 1):
        span = min(times.re_entry_share, times.re_entry) if lost == 1 else times.re_entry
        check = check.then()
        each.step(each.start(check, start), start)
        if lost:
            check = check.then(lost)
            each.step(check, math.nan).bits("status", some=Status.INPUT_HELD)
        else:
            check.call("missed", samples=times.re_entry)
        check = check.then()
        each.step(check, to).near("followed", start, slack)
        check = check.then(span)
        each.step(check, to).within("followed", start + way[0] - slack, start + way[1] + slack)
        check.apart_within("followed", -way[1] - slack, -way[0] + slack)
        check.then().same("followed", slack)


def timed(script: Script, each: Follower, start: float, to: float, times: Times, *, splits: bool) -> None:
    """Times between calls: the usual one, parts of it, none, and a pause.

    `splits` where a longer one is several steps.
    """
    real, slack = script.real, script.one_rounding * (1.0 + abs(start) + abs(to))
    step, part = float(real(times.step_s)), float(real(times.part_s))
    rest = float(real(real(step) - real(part)))
    slope = (to - start) / 400
    check = script.check(each.module, "parts of a sample are one")
    check = each.start(check, start, 0, 1).then(13)
    for k, dts in enumerate(((step,), (part, rest), (step,))):
        target = Ramp(start + k * slope, 3 * slope)
        each.step(check, target, 1)
        for dt in dts:
            each.step(check, target, 0, dt)
            if dt == part and not splits:
                check.bits("status", exactly=Status.OK)
        check.same(ANSWER, slack)
    check = script.check(each.module, "no time, no change", 2)
    each.step(check, to, 0, [math.nan, -step]).held(ANSWER, slack).bits("status", exactly=Status.INPUT_HELD)
    check = script.check(each.module, "the way back after a pause begins where it was")
    each.step(check, to, 0, times.pause_s).held("followed", slack)
    check = script.check(each.module, "steps without a time are of one sample, among others too")
    check = each.start(check, start, 0, 1).then(9)
    for k, dt in enumerate((step, 0.75 * step, 1.25 * step, step, part)):
        target = Ramp(start + k * slope, 5 * slope)
        each.step(check, target, 1, dt)
        each.step(check, target, 0, None if dt == step else dt)
        check.same(ANSWER, slack).same("status").same("seen")
    if splits:
        check = script.check(each.module, "samples between two calls are on the straight line")
        check, slope = each.start(check, start, 0, 1).then(20), (to - start) / 400
        for last, samples in ((2, (1, 2)), (5, (3, 4, 5))):
            for at in samples:
                each.step(check, Ramp(start + slope * at, 5 * slope), 1)
            place = 2.5 * (1 if last == 2 else 2)
            each.step(check, Ramp(start + slope * place, 5 * slope), 0, 2.5 * step).same("followed", 1e2 * slack)
        return
    narrow = 1e-3 * abs(to - start)
    check = script.check(each.module, "a longer step has its share of the rate limit, the next one that of a sample")
    each.step(each.start(check, start), start)
    check.write("largest change", narrow)
    each.step(check, to, 0, 1.5 * step).moved("force", 1.5 * narrow + slack).near(
        "largest change", narrow, 1e-6 * narrow
    )


def refused(script: Script, each: Follower, bad: ArrayLike, allowed: Allowed, start: tuple[float, float]) -> None:
    """Bad starts are replaced by one in a range, and flagged."""
    check = script.check(each.module, "a bad start is replaced and flagged", len(np.asarray(bad)))
    each.start(check, bad)
    check.bits("status", exactly=Status.INPUT_HELD).bits("seen", exactly=Status.INPUT_HELD)
    check.within("force", *allowed.clip(np.array(start)))
