"""Checks of the modules that estimate: the observer, the inverse that tunes itself, and the certified interval."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.table import accepted_range
from tendonff.compensator.export.observer import ObserverGolden
from tendonff.compensator.export.repeat import Compared
from tendonff.compensator.export.script import ANSWER, Check, Ramp
from tendonff.compensator.export.tension import modules as tested
from tendonff.compensator.export.tension.following import (
    HELD,
    LOST_ROWS,
    Follower,
    Status,
    led_back,
    near_golden,
    refused,
    timed,
)
from tendonff.compensator.export.tension.subject import TensionTest
from tendonff.models.capstan import CapstanLaw
from tendonff.ocp.adaptation.tuning import Sensor
from tendonff.ocp.step.target import plant_limits

_KEPT = 1.125
"""Factor that a controller keeps while it is off, exact in any real type."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverTest:
    """Golden vectors of the observer, and the rows that are compared."""

    golden: ObserverGolden
    compared: Compared
    far: Compared  # of a far end that something moves
    bounds_N: float  # what bounds may be off

    def any_history(self, input_N: float, adhesion_N: float) -> tuple[float, float]:
        """Memories that admit any history [N]."""
        return tuple(any_of * (input_N + adhesion_N) for any_of in (self.golden.any_low, self.golden.any_high))  # type: ignore[return-value]


def check_observer(test: TensionTest, own: ObserverTest) -> None:
    """Golden vectors, bad inputs, starts, times, and a far end that something moves."""
    script, seen, chain = test.script, own.golden, test.problem.chain
    law = CapstanLaw.of(test.problem.transmission)
    plays, adhesion = law.plays is not None, law.adhesion_N
    module = tested.observer(test.prefix, test.joints, 0 if plays else chain.count, seen.friction_at, plays)
    rows, first, last = len(seen.input_N), float(seen.input_N[0]), float(seen.input_N[-1])
    slack = script.rounding(seen.most_N)
    each = Follower(module=module, reference="input", more={"position": math.nan, **test.joint()})
    bad = [*LOST_ROWS, 1.02 * seen.most_N]
    check = script.check(module, f"golden vectors and bounds{own.compared.words}")
    check = each.start(check, first).then(rows)
    check.call("step", input=seen.input_N, **test.joint(slice(rows)))
    near_golden(check, own.compared)
    skipped = np.isnan(own.compared.expected)
    check.near("lower bound", np.where(skipped, np.nan, seen.low_N), own.bounds_N)
    check.near("upper bound", np.where(skipped, np.nan, seen.high_N), own.bounds_N)
    check.then().bits("seen", none=0xFFFFFFFF & ~int(Status.WOULD_PUSH))
    check = script.check(module, "bad inputs hold the last good output, and nothing is known")
    check = check.then(4)
    check.call("step", input=bad).held(ANSWER).bits("status", exactly=Status.INPUT_HELD)
    check.within("lower bound", -math.inf, 0.0).within("upper bound", 0.98 * seen.most_N, math.inf)
    check = check.then(2)
    check.call("step_dt", input=first, dt=[math.nan, -test.times.step_s]).held(ANSWER)
    check.bits("status", exactly=Status.INPUT_HELD).bits("seen", some=Status.INPUT_HELD)
    check = script.check(module, "after lost inputs any history is admitted")
    check.call("step", input=last)
    check = check.then(10).when_bits("status", Status.FAILED, lambda c: c.call("step"))
    low, high = own.any_history(last, adhesion)
    check.then().near("lower memory", low).near("upper memory", high)
    _encloses(check, slack)
    check = script.check(module, "a bad start is replaced and flagged", len(bad))
    check.call("init", input=bad).near("tension", accepted_range(test.problem)[0])
    check.bits("status", exactly=Status.INPUT_HELD).bits("seen", exactly=Status.INPUT_HELD)
    check.call("init_at", input=bad, output=first).bits("status", exactly=Status.INPUT_HELD)
    check.within("lower bound", -math.inf, 0.0)
    _started(test, each, own)
    led_back_input(test, each, first, seen.led_to_N)
    _timed_observer(test, each, plays=plays)
    if len(seen.position_m):
        _moved_far_end(test, each, own, adhesion)
    if not plays:
        _restarted(test, each, first, slack)


def _started(test: TensionTest, each: Follower, own: ObserverTest) -> None:
    """Starts in motion."""
    script, module, seen, adhesion = (
        test.script,
        each.module,
        own.golden,
        CapstanLaw.of(test.problem.transmission).adhesion_N,
    )
    first, slack = float(seen.input_N[0]), script.rounding(seen.most_N)
    check = script.check(module, "a start in motion takes what is known")
    check.call("init_at", input=first, output=math.nan).near("lower memory", own.any_history(first, adhesion)[0])
    check.bits("status", exactly=0).call("init_at", output=first).call("init", 1)
    for port in ("tension", "lower bound", "upper bound"):
        check.same(port, slack)
    if test.start_force_N is not None and seen.knows_friction:
        tension, force = test.start_force_N
        check = script.check(module, "a start in motion takes the difference for friction")
        check.call("init_at", input=force, output=tension)
        check.call("friction").near(ANSWER, force - tension, 1e2 * script.rounding(force))
        check.within("lower bound", -math.inf, tension + slack).within("upper bound", tension - slack, math.inf)


def _encloses(check: Check, slack: float) -> None:
    """Expect the estimate within its bounds."""
    for bound, low, high in (("lower bound", -slack, math.inf), ("upper bound", -math.inf, slack)):
        check.apart_within("tension", low, high, other=0, versus=bound)


def led_back_input(test: TensionTest, each: Follower, start: float, to: float) -> None:
    """Inputs that were missed are led back, unless a step without a solution begins the way anew."""
    script, re_entry = test.script, test.times.re_entry
    slack = 10 * script.rounding(max(start, to))
    low, high = min(start, to) - slack, max(start, to) + slack

    def solved(lines: Any) -> Any:
        return lambda check: check.when("seen", 0.0, float(Status.FAILED) - 1, lines)

    check = script.check(each.module, "what was lost or missed is led back")
    each.step(each.start(check, start), start).call("missed", samples=re_entry)
    each.step(check, to)
    solved(lambda c: c.near("followed", start, slack))(check)
    check = check.then(re_entry)
    each.step(check, to)
    solved(lambda c: c.within("followed", low, high))(check)
    check = check.then()
    solved(lambda c: c.near("followed", to, slack))(check)
    each.step(check, start, 0, test.times.pause_s)
    solved(lambda c: c.near("followed", to, slack))(check)


def _timed_observer(test: TensionTest, each: Follower, *, plays: bool) -> None:
    """Parts of a sample, and several samples in one call."""
    script, step, part = test.script, test.times.step_s, test.times.part_s
    real, first = script.real, test.first
    step, part = float(real(step)), float(real(part))
    rest, slope, slack = float(real(real(step) - real(part))), 5e-4 * first, script.rounding(first)
    for name, dts in (
        ("parts of a sample are one", (part, rest)),
        ("so are steps with and without a time", (0.25 * step, None)),
    ):
        check = script.check(each.module, name)
        check = each.start(check, first, 0, 1).then(13)
        for k, own in enumerate(((step,), dts, (step,))):
            target = Ramp(first + k * slope, 3 * slope)
            for dt in own:
                if dts[1] is not None:
                    each.step(check, target, 0, dt)
                elif dt is not None:
                    each.step(each.step(check, target, 0, dt), target, 1, dt)
                else:
                    each.step(each.step(check, target, 0), target, 1, step)
            if dts[1] is not None:
                each.step(check, target, 1)
            check.same(ANSWER, slack).same("status")
    if not plays:
        check = script.check(each.module, "samples between two calls are on the straight line")
        check = each.start(check, first, 0, 1).then(20)
        for k in (1, 2):
            each.step(check, Ramp(first + k * slope, 2 * slope), 1)
        each.step(check, Ramp(first + 2 * slope, 2 * slope), 0, 2.0 * step).same(ANSWER, 1e3 * slack)
    check = script.check(each.module, "what is left of a time waits")
    each.step(each.start(check, first), first, 0, 2.25 * step).near("waiting", 0.25 * step, 1e-4 * step)


def _moved_far_end(test: TensionTest, each: Follower, own: ObserverTest, adhesion_N: float) -> None:
    seen, script, first = own.golden, test.script, float(own.golden.input_N[0])
    rows = len(seen.position_m)
    given = seen.input_N[:rows]
    check = script.check(each.module, f"golden vectors of a far end that is moved{own.far.words}")
    check = each.start(check, first).then(rows)
    check.call("step", input=given, position=seen.position_m, **test.joint(slice(rows)))
    near_golden(check, own.far)
    memory = seen.any_low * (given + adhesion_N)
    check.when_bits("status", Status.FAR_MOVED, lambda c: c.near("lower memory", memory))
    check.then().bits("seen", some=Status.FAR_MOVED)


def _restarted(test: TensionTest, each: Follower, first: float, slack: float) -> None:
    script = test.script
    check = script.check(each.module, "a step without a solution holds the last tension, says so, and starts over")
    each.step(each.start(check, first), first).write("states", math.nan)
    each.step(check, first).held(ANSWER, slack).bits("status", exactly=Status.FAILED)
    check.near("evaluations", 2.0 * (1 + plant_limits(script.precision).halvings), 0.0)
    check.within("lower bound", -math.inf, 0.0)
    check = check.then(8)  # a start that is far from the tension before may fail once more
    check.call("step")
    check = check.then().bits("status", none=Status.FAILED).within("lower bound", 1e-30, math.inf)
    _encloses(check, slack)


def check_bounds(test: TensionTest, own: Mapping[str, Any]) -> None:
    """The certified interval."""
    golden, most, script = own["golden"], own["bounds_tolerance_N"], test.script
    module, force = tested.bounds(test.prefix), test.golden.course.plant_force_N
    check = script.check(module, "golden vectors").call("init", given=test.first).then(len(force))
    check.call("step", given=force).near("lower bound", golden.low_N, most).near("upper bound", golden.high_N, most)
    check.bits("status", exactly=0)
    check = script.check(module, "bad forces change nothing and are flagged", 3)
    check.call("step", given=LOST_ROWS).held("lower bound").held("upper bound").bits(
        "status", exactly=Status.INPUT_HELD
    )
    check = script.check(module, "a bad start is replaced and flagged", 3)
    check.call("init", given=LOST_ROWS).bits("status", exactly=Status.INPUT_HELD)
    check.apart_within("lower bound", -math.inf, 0.0, other=0, versus="upper bound")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tuned:
    """The inverse that tunes itself, and the course that it follows."""

    test: TensionTest
    own: Mapping[str, Any]
    each: Follower

    @property
    def ahead(self) -> dict[str, FloatArray]:
        """Joint angles at the ends of the samples."""
        return {"joint": self.own["golden"].joint_rad} if self.test.joints else {}

    def begun(self, name: str) -> Check:
        """A check that starts at rest."""
        return self.each.start(self.test.script.check(self.each.module, name), self.test.first)

    def along(self, check: Check, measured: ArrayLike, rows: slice = slice(None)) -> Check:
        """Follow some rows of the course."""
        reference = self.test.golden.course.reference_N[rows]
        joint = {name: angle[rows] for name, angle in self.ahead.items()}
        return check.then(len(reference)).call("step", reference=reference, measured=measured, **joint)


def check_adaptive(test: TensionTest, own: Mapping[str, Any]) -> None:
    """The inverse that tunes itself: what it learns, what teaches nothing, and its limits."""
    script, measured, tuning, allowed = test.script, own["golden"].measured, own["tuning"], test.allowed
    chain, slack = test.problem.chain, test.slack
    module = tested.adaptive(
        test.prefix, len(test.record), test.joints, chain, len(tuning.parameters), own["mu_dynamic"], own["mu_index"],
        other=own["mu_release"] is not None,
    )  # fmt: skip
    each = Follower(module=module, more={"measured": math.nan, **test.joint()})
    tuned, (low, high) = _Tuned(test=test, own=own, each=each), accepted_range(test.problem)
    bad = [*LOST_ROWS, 0.98 * low, 1.02 * high]
    position = tuning.sensor is Sensor.ACTUATOR_POSITION
    tuned.begun("what is measured at rest is known").near("prediction", 0.0 if position else test.first)
    check = tuned.along(tuned.begun(f"golden vectors{own['compared'].words}"), measured)
    allowed.checked(near_golden(check, own["compared"]), slack).same(ANSWER, slack, other=0, versus="force")
    check = script.check(module, "bad references hold the last good output and say so")
    for given, why in ((bad[:3], Status.INPUT_HELD), (bad[3:], Status.RANGE)):
        check = check.then(len(given))
        check.call("step", reference=given).held(ANSWER, slack).bits("status", some=why, none=HELD & ~why)
    check.then().bits("seen", some=HELD)
    refused(script, each, bad, allowed, (allowed.low_N, allowed.high_N))
    jumps = test.golden.jumps.reference_N
    check = each.start(script.check(module, "every force of jumps is within the limits"), float(jumps[0]))
    check = allowed.checked(check.then(len(jumps)).call("step", reference=jumps, **test.joint()), slack)
    check.then().bits("seen", some=test.jump_bits.get("inverse", 0))
    if test.push_N is not None:
        check = each.start(script.check(module, "a fall that no tendon follows is flagged"), test.push_N[0]).then(2)
        check.call("step", reference=test.push_N[1]).then().bits("seen", some=Status.WOULD_PUSH)
    _unteachable(tuned)
    _frozen(tuned)
    _bounded(tuned)
    check = tuned.begun("a model that fails is flagged, and the force goes on").write("model", math.nan)
    check.call("step", reference=test.first, measured=float(measured[0]))
    allowed.checked(check, slack).bits("status", some=Status.FAILED, none=Status.INPUT_HELD)
    _kept(test, each, own)
    _starts(test, each)
    if test.led_to_N is not None:
        led_back(script, each, test.first, test.led_to_N, test.times)
        timed(script, each, test.first, test.led_to_N, test.times, splits=True)


def _unteachable(tuned: _Tuned) -> None:
    """Inputs that teach nothing: no measurement, one that is stuck, and any right after missed calls or angles."""
    test, own, tuning = tuned.test, tuned.own, tuned.own["tuning"]
    measured, reference, mu = own["golden"].measured, test.golden.course.reference_N, own["mu_dynamic"]
    half, module = len(reference) // 2, tuned.each.module
    check = tuned.along(tuned.begun("a measurement that is no number teaches nothing"), math.nan, slice(half))
    check.near("error", 0.0, 0.0).call("mu").near(ANSWER, mu, 1e-6 * mu)

    def taught(check: Check) -> None:
        for ends in ((1e-30, math.inf), (-math.inf, -1e-30)):  # at most back to the safe value
            check.when("factor", *ends, lambda c: c.same("factor", other=0, versus="safe factor"), moved=True)

    check = test.script.check(module, "a sensor that is stuck is said and teaches nothing")
    check = tuned.along(check, float(measured[0]), slice(half, None))
    check.when("stale", 1.001 * tuning.deviation, math.inf, taught)
    check.then().bits("seen", some=Status.FROZEN, none=Status.AT_BOUND)
    check = tuned.begun("after missed calls nothing is learnt").then(len(reference))
    check.call("missed", samples=1).write("lost", 0.0)  # but for the way back: there nothing could be learnt
    check.call("step", reference=reference, measured=measured, **tuned.ahead).near("factor", 1.0, 0.0)
    if test.joints:
        check = test.script.check(
            module, "angles that are missing are flagged, and teach nothing for as long as they are late"
        )
        end = {"reference": reference[-1], "measured": measured[-1], "joint": np.full(test.joints, np.nan)}
        check.call("step", **end).bits("status", some=Status.INPUT_HELD)
        check.near("blind", tuning.delay_samples + 2, 0.0).near("open", 1.0, 0.0)
        check.call("step", **test.joint(-1)).bits("status", none=Status.INPUT_HELD)
        check.near("blind", tuning.delay_samples + 1, 0.0).near("open", 1.0, 0.0)


def _frozen(tuned: _Tuned) -> None:
    """Safe values while a measurement is stuck or not explained."""
    measured, tuning = tuned.own["golden"].measured, tuned.own["tuning"]
    quarter, rows = len(measured) // 4, np.arange(len(measured))
    stuck = np.where(rows < quarter, measured, measured[quarter])
    check = tuned.along(tuned.begun("while frozen the last safe values count"), stuck).call("mu ratio")
    check.when_bits("status", Status.FROZEN, lambda c: c.same(ANSWER, 1e-6, other=0, versus="safe factor of mu"))
    name = "what is not explained counts for nothing and is flagged"
    check = tuned.along(tuned.begun(name), measured + tuned.own["far"])
    lost = 1.001 * tuning.lost_level
    check.when("level", lost, math.inf, lambda c: c.held("correction").bits("status", some=Status.FROZEN))
    check.then().bits("seen", some=Status.FROZEN | Status.DOUBT)


def _bounded(tuned: _Tuned) -> None:
    """Bounds of factors, their rate, and integral action."""
    tuning, most = tuned.own["tuning"], 1.001 * tuned.own["tuning"].slew + 1e-6
    check = tuned.begun("a bound is flagged, and no factor jumps").then(2)
    for port in ("factor", "safe factor"):
        check.write(port, [tuning.highest, tuning.lowest])
    check.write("factor of the inverse", 1.0)
    check.call("step", reference=tuned.test.first).bits("status", some=Status.AT_BOUND)
    check.within("factor of the inverse", 1 - most, 1 + most)
    if tuning.integral_gain:
        _integral(tuned.test, tuned.each, tuned.test.first)


def _integral(test: TensionTest, each: Follower, first: float) -> None:
    """At the actuator's limits it integrates nothing, and never beyond a factor of 2."""
    check, slack = test.script.check(each.module, "integral action within its limits"), test.script.one_rounding
    cases = ((1.63, 0.0, 1.0, 0.1, 0.0, 0.0), (1.63, 1.0, 0.0, 0.1, 0.0, 1.0), (-0.62, -0.5, 0.0, 1.9, -0.5, 1.0))
    for drift, correction, limited, measured, low, high in cases:
        each.start(check, first)
        check.write("drift", drift).write("correction", correction).write("limited", limited)
        check.call("step", reference=first, measured=measured * first).within("correction", low - slack, high + slack)


def _kept(test: TensionTest, each: Follower, own: Mapping[str, Any]) -> None:
    """Estimates over a time without power, and limits that are set."""
    mu, back, high = own["mu_dynamic"], own["mu_release"], test.narrow_N[1]
    check = each.start(test.script.check(each.module, "estimates are kept and restored, others refused"), test.first)
    check.call("restore", factor=_KEPT, second_factor=_KEPT).call("mu").near(ANSWER, _KEPT * mu, 1e-5 * mu)
    check.call("restore", factor=math.nan).call("mu").near(ANSWER, _KEPT * mu, 1e-5 * mu)
    check.call("save").near(ANSWER, _KEPT, 1e-5)
    if back:
        check.call("mu_release").near(ANSWER, _KEPT * back, 1e-5 * back)
    check = test.script.check(each.module, "valid limits are accepted, others refused")
    check.call("use", record=test.with_record(force_max=high)).near(ANSWER, 1.0).near("largest force", high)
    check.call("use", record=test.with_record(force_max=math.nan)).near(ANSWER, 0.0).near("largest force", high)


def _starts(test: TensionTest, each: Follower) -> None:
    if test.start_force_N is None:
        return
    (tension, force), script = test.start_force_N, test.script
    check = script.check(each.module, "a start in motion takes force less tension for friction")
    most = 1e2 * script.rounding(force)
    check.call("init_at", reference=tension, force=force, **each.more).near("force", force).bits("status", exactly=0)
    check.near("lost", test.times.re_entry, 0.0)
    for name in ("friction", "friction of the inverse"):
        check.call(name).near(ANSWER, force - tension, most)
    check.call("init_at", force=tension).call("init", 1)
    check.same("force", script.rounding(force)).near("lost", 0.0, 0.0)
    check.call("init_at", force=math.nan).bits("status", some=Status.INPUT_HELD).near("lost", 0.0, 0.0)
    check.same("force", script.rounding(force)).same("force of the model", script.rounding(force))
