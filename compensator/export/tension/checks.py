"""Checks of the modules of a tension: golden vectors, limits, parameters, starts, and what must never happen."""

import math
from dataclasses import replace

import numpy as np

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.table import accepted_range
from tendonff.compensator.export.golden import LONGER, servo_of
from tendonff.compensator.export.script import ANSWER, EACH, ModuleRecord
from tendonff.compensator.export.tension import modules as tested
from tendonff.compensator.export.tension.data import checksum
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
from tendonff.compensator.export.text.table_index import share_index
from tendonff.models.capstan import Branch
from tendonff.ocp.step.target import plant_limits


def check_all(test: TensionTest) -> None:
    """Checks of data, limits and parameters, and of every module but observer and tuner."""
    modules = test.modules()
    _data(test)
    _limits(test)
    _parameters(test)
    for name in (*test.laws, "inverse"):
        if name in modules:
            _follower(test, modules[name])
    if "stream" in modules:
        _stream(test, modules["stream"])
    if "profile" in modules:
        _profile(test, modules["profile"])
    if "plant" in modules:
        _plant(test, modules["plant"])


def _data(test: TensionTest) -> None:
    """Constants of the headers, and checksums of the data."""
    allowed, step = test.allowed, test.problem.reference.step_s
    accepted = accepted_range(test.problem)
    expected = {
        **{bit.name: float(bit) for bit in Status if bit.name and not Status.ENDED < bit < Status.RANGE},
        "OK": 0.0,
        "FORCE_MIN_N": allowed.low_N,
        "FORCE_MAX_N": allowed.high_N,
        "CHANGE_MAX_N": allowed.change_N,
        "REFERENCE_MIN_N": accepted[0],
        "REFERENCE_MAX_N": accepted[1],
        "STEP_S": step,
    }
    expected |= {"PROFILE_LENGTH": float(len(test.profile_N))} if "profile" in test.names else {}
    arrays = dict[str, FloatArray]()
    if "stream" in test.names and test.stream is not None:
        expected["STREAM_LAG_S"] = test.stream.filter.lag_s
    if test.table is not None and "table" in test.names:
        table = test.table
        expected |= {
            "TABLE_MIN_N": float(table.reference_N[0]),
            "TABLE_MAX_N": float(table.reference_N[-1]),
            "TABLE_FIRST_N": float(table.reference_N[0]),
            "TABLE_CELLS_PER_N": table.cells_per_N,
        }
        for branch in Branch:
            shares = table.branch(branch).share
            arrays[f"table_{branch}_share"] = shares
            arrays[f"table_{branch}_ratio"] = table.ratio(branch).ravel()
            arrays[f"table_{branch}_cell"] = np.asarray(share_index(shares, test.script.precision).cell, dtype=float)
    data = tested.constants(test.prefix, list(expected), list(arrays))
    check = test.script.check(data, "status bits, limits, accepted references and sample time")
    for name, value in expected.items():
        check.call(name).near(ANSWER, np.clip(value, -1e30, 1e30))
    for name, values in arrays.items():
        check = test.script.check(data, f"checksum of {name}", len(values))
        check.call(name, index=EACH).checksum(checksum(values, test.script.precision))


def _limits(test: TensionTest) -> None:
    """Each branch of the limiter; and narrower limits."""
    script, allowed, cases = test.script, test.allowed, test.limit_cases
    limiter = tested.limiter(test.prefix, len(test.record))
    before, wanted, force, status = (
        np.array([float(getattr(case, name)) for case in cases])
        for name in ("before_N", "wanted_N", "force_N", "status")
    )
    check = script.check(limiter, "forces, status bits, and bits since init", len(cases))
    check.call("init", force=before).within("force", allowed.low_N - test.slack, allowed.high_N + test.slack)
    check.bits("status", exactly=0).bits("seen", exactly=0).write("force", before)
    for port in ("force", ANSWER):
        check.call("set", force=wanted).near(port, force) if port == "force" else check.near(port, force)
    check.near("status", status, 0.0)
    check.call("hold").near(ANSWER, force).bits("status", exactly=Status.INPUT_HELD)
    check.near("seen", status.astype(int) | int(Status.INPUT_HELD), 0.0)
    low, high = test.narrow_N
    rate = 0.5 * test.record["force_rate_max"]
    check = script.check(limiter, "narrower limits hold")
    check.call("init", force=0.5 * (low + high))
    check.call("use", record=test.with_record(force_min=low, force_max=high, force_rate_max=rate)).near(ANSWER, 1.0)
    check.near("least force", low).near("largest force", high)
    check.near("largest change", 0.5 * min(allowed.change_N, 1e30), 1e-5 * min(allowed.change_N, 1e30))
    check.call("set", force=min(allowed.high_N, 1e29) + 1).within("force", -math.inf, high * (1 + 1e-6) + 1e-6)
    check.within("status", 1.0, 1e9)


def _parameters(test: TensionTest) -> None:
    """The record of parameters: the scenario's, what is refused, and what is taken."""
    script, own, allowed = test.script, test.record, test.allowed
    module = tested.record(test.prefix, list(own))
    check = script.check(module, "the scenario's").call("init")
    check.call("are_good").near(ANSWER, 1.0)
    for name, value in own.items():
        check.near(name, value)
    mu, back = own["mu_pull"], own["mu_release"]
    low, high, rate = own["force_min"], own["force_max"], own["force_rate_max"]
    nothing = [math.nan, math.inf, -1.0]
    refusals: list[tuple[str, list[float]]] = []
    for bad in nothing:
        refusals += [("set_mu", [bad, back]), ("set_mu", [mu, bad]), ("set_adhesion", [bad])]
        refusals += [("set_limits", [bad - 1e3, high, rate]), ("set_limits", [low, bad - 1e3, rate])]
    refusals += [("set_limits", [low, high, bad]) for bad in (math.nan, -1.0)]
    if allowed.high_N < 1e29:
        refusals.append(("set_limits", [low, 1.01 * high + 1, rate]))
        refusals.append(("set_limits", [low - 1 - 0.01 * abs(low), high, rate]))
    if rate < 1e25:
        refusals.append(("set_limits", [low, high, 1.01 * rate]))
    refusals.append(("set_limits", [high, low, rate]))
    accepted = accepted_range(test.problem)
    refusals += [("set_references", [accepted[1], accepted[0]]), ("set_references", [accepted[0], 1.01 * accepted[1]])]
    for setter in ("set_mu", "set_adhesion", "set_limits", "set_references"):
        given = np.array([[*row, 0.0, 0.0][:3] for name, row in refusals if name == setter])
        check = script.check(module, f"{setter}: what means nothing is refused and changes nothing", len(given))
        check.call(setter, first=given[:, 0], second=given[:, 1], third=given[:, 2]).near(ANSWER, np.zeros(len(given)))
        for name, value in own.items():
            check.near(name, value)
    low, high = test.narrow_N
    check = script.check(module, "what means something is taken")
    check.call("set_mu", first=0.9 * mu, second=0.8 * back).near(ANSWER, 1.0)
    check.call("set_adhesion", first=0.5).near(ANSWER, 1.0)
    check.call("set_limits", first=low, second=high, third=0.5 * rate).near(ANSWER, 1.0)
    check.call("set_references", first=accepted[0], second=accepted[1]).near(ANSWER, 1.0)
    taken = {"mu_pull": 0.9 * mu, "mu_release": 0.8 * back, "adhesion": 0.5, "force_min": low, "force_max": high}
    for name, value in (taken | {"reference_min": accepted[0], "reference_max": accepted[1]}).items():
        check.near(name, value)


def _follower(test: TensionTest, module: ModuleRecord) -> None:
    """Capstan law, table or exact inverse."""
    script, golden, allowed, slack = test.script, test.golden, test.allowed, test.slack
    course, jumps, name = golden.course, golden.jumps, module.name
    rows, servo = len(course.reference_N), servo_of(test.problem) is not None
    low, high = accepted_range(test.problem)
    if name == "table" and test.table is not None:
        low, high = float(test.table.reference_N[0]), float(test.table.reference_N[-1])
    each = Follower(module=module, more=test.joint())
    bad = [*LOST_ROWS, -1.0, 0.98 * low, 1.02 * high]
    compared = test.compared["course"][name]
    check = script.check(module, f"golden vectors{compared.words}")
    check = each.start(check, test.first).then(rows)
    near_golden(check.call("step", reference=course.reference_N, **test.joint(slice(None))), compared)
    allowed.stated(allowed.checked(check, slack), slack)
    check.same(ANSWER, other=0, versus="command" if servo else "force", tolerance=script.rounding(compared.expected))
    last = test.joint(-1)
    check = script.check(module, "bad references hold the last good output and say so")
    check = check.copy(1, 0).then(6)
    check.call("step", reference=bad, **last).held(ANSWER, slack)
    check.near("status", [float(Status.INPUT_HELD)] * 3 + [float(Status.RANGE)] * 3, 0.0)
    if test.joints:
        missing = np.where(np.eye(test.joints, dtype=bool), math.nan, test.joint_rad[-1])
        check = check.then(test.joints)
        check.call("step", reference=test.first, joint=missing).held(ANSWER, slack)
        check.bits("status", exactly=Status.INPUT_HELD)
    check.then().bits("seen", some=HELD)
    check = script.check(module, "bad references leave the state alone", 20)
    end = float(course.reference_N[-1])
    check.call("step", reference=end, **last).call("step", 1).same(ANSWER, slack).same("status")
    inside = 1e-3 * (high - low)
    check = script.check(module, "the ends of the accepted range are accepted")
    check.call("step", reference=low + inside).bits("status", none=HELD)
    each.start(check, test.first).call("step", reference=high - inside).bits("status", none=HELD)
    refused(script, each, bad, allowed, (0.999 * low, 1.001 * high))
    if test.led_to_N is not None:
        led_back(script, each, test.first, test.led_to_N, test.times)
        timed(script, each, test.first, test.led_to_N, test.times, splits=False)
    compared = test.compared["jumps"][name]
    check = script.check(module, f"golden vectors of jumps{compared.words}")
    check = each.start(check, float(jumps.reference_N[0])).then(len(jumps.reference_N))
    at = {"joint": jumps.joint_rad} if test.joints else {}
    near_golden(check.call("step", reference=jumps.reference_N, **at), compared)
    allowed.stated(allowed.checked(check, slack), slack)
    check = script.check(module, "limits that bind are flagged, what did not happen is not")
    check.bits("seen", some=test.jump_bits[name], none=HELD | Status.FAILED | Status.ENDED)
    if name == "inverse":
        _inverse(test, each)
    else:
        _law(test, each)
    _use(test, each)


def _inverse(test: TensionTest, each: Follower) -> None:
    """Starts in motion, friction that is set, longer steps."""
    script, golden, module, own = test.script, test.golden, each.module, test.record
    servo = servo_of(test.problem) is not None
    _pushes(test, each)
    if golden.longer is not None and "inverse" in test.compared["longer"]:
        longer, compared = golden.longer, test.compared["longer"]["inverse"]
        check = script.check(module, "golden vectors of longer steps")
        check = each.start(check, test.first).then(len(longer.reference_N))
        at = {"joint": longer.joint_rad} if test.joints else {}
        step = LONGER * test.problem.reference.step_s
        near_golden(check.call("step_dt", dt=step, reference=longer.reference_N, **at), compared)
    if test.joints and not servo:
        check = script.check(module, "rest wherever the joints are")
        check = each.start(check, test.first).then(10)
        check.call("step", reference=test.first, **test.joint(len(golden.course.reference_N) // 2))
        check.near(ANSWER, test.first, 1e2 * script.rounding(test.first)).bits("status", exactly=0)
    if test.start_force_N is not None:
        tension, force = test.start_force_N
        check = script.check(
            module, "a start in motion takes force less tension for friction, and the tendon hangs together"
        )
        check.call("init_at", reference=tension, force=force, **each.more).near("force", force)
        check.bits("status", exactly=0).near("tension at the start", tension)
        check.call("friction").near(ANSWER, force - tension, 1e2 * script.rounding(force))
        if script.one_rounding < 1e-9 and not test.joints:
            check.call("stretch").near(ANSWER, 0.0, 1e2 * script.one_rounding)
        check.same("states", script.one_rounding, other=0, versus="states before")
        check = script.check(module, "a start in motion without friction is one at rest")
        check.call("init_at", 1, reference=tension, force=tension).call("init", reference=tension)
        check.same("states", script.one_rounding).near("lost", 0.0, slot=1)
    _no_force(test, each)
    mu, back, high = own["mu_pull"], own["mu_release"], test.narrow_N[1]
    record = test.with_record(adhesion=own["adhesion"] + 0.5, force_max=high)
    check = script.check(module, "another mu scales friction both ways and leaves the other parameters")
    each.start(check, test.first).call("use", record=record).near(ANSWER, 1.0)
    check.call("set_mu", mu=0.9 * mu).call("mu").near(ANSWER, 0.9 * mu)
    check.near("adhesion", own["adhesion"] + 0.5).near("largest force", high)
    record = test.with_record(adhesion=own["adhesion"] + 0.5, force_max=high, mu_pull=0.9 * mu, mu_release=0.9 * back)
    each.start(check, test.first, 1).call("use", 1, record=record).near(ANSWER, 1.0, slot=1)
    for member in test.settable["inverse"]:
        check.same(member, script.rounding(1.0))
    check.call("set_mu", mu=math.nan).call("mu").near(ANSWER, 0.9 * mu)


def _pushes(test: TensionTest, each: Follower) -> None:
    """A fall that no tendon follows."""
    if test.push_N is None:
        return
    high, low, row = test.push_N
    check = test.script.check(each.module, "a fall that no tendon follows is flagged")
    each.start(check, high).call("step", reference=low)
    if row:
        check.call("step")
    check.bits("status", some=Status.WOULD_PUSH).bits("seen", some=Status.WOULD_PUSH)


def _no_force(test: TensionTest, each: Follower) -> None:
    forces, allowed = [math.nan, -1e9, 1e9], test.allowed
    check = test.script.check(each.module, "a start in motion with a force that means nothing is flagged", 3)
    check.call("init_at", reference=test.first, force=forces, **each.more)
    check.within("force", allowed.low_N - test.slack, allowed.high_N + test.slack)
    if test.binds:
        check.bits("status", some=Status.INPUT_HELD)


def _law(test: TensionTest, each: Follower) -> None:
    """Starts in motion of what has no states of the chain."""
    _no_force(test, each)
    force = 0.5 * sum(test.narrow_N)
    check = test.script.check(each.module, "a start in motion goes on from its force")
    if each.module.name == "table":
        check.write("branch", 1.0)
    check.call("init_at", reference=test.first, force=force, **each.more).near("force", force).bits("status", exactly=0)
    if each.module.name == "table":
        check.near("branch", 0.0)
    check.call("step").near(ANSWER, force).within("samples left", 1e-9, math.inf)


def _use(test: TensionTest, each: Follower) -> None:
    """Parameters that are handed over."""
    script, module, high = test.script, each.module, test.narrow_N[1]
    members = test.settable.get(module.name, ())
    if members:
        check = script.check(module, "the scenario's parameters are those of init")
        each.start(check, test.first, 0, 1).call("use", record=test.with_record()).near(ANSWER, 1.0)
        for member in members:
            check.same(member, script.rounding(1.0))
    check = script.check(module, "valid parameters are accepted, others refused")
    each.start(check, test.first).call("use", record=test.with_record(force_max=high)).near(ANSWER, 1.0)
    check.near("largest force", high).copy(1, 0)
    bad = test.with_record(force_max=math.nan, adhesion=test.record["adhesion"] + 1)
    check.call("use", record=bad).near(ANSWER, 0.0)
    for port in ("largest force", "least force", "largest change", *members):
        check.same(port)
    other = test.golden.other
    if other is None or module.name not in other.course.columns:
        return
    reference = other.course.reference_N
    compared = test.compared["other"][module.name]
    check = script.check(module, f"golden vectors of other friction{compared.words}")
    record = test.with_record(mu_release=other.mu_release, adhesion=other.adhesion_N)
    each.start(check, float(reference[0])).call("use", record=record).near(ANSWER, 1.0)
    near_golden(check.then(len(reference)).call("step", reference=reference), compared)


def _stream(test: TensionTest, module: ModuleRecord) -> None:
    """The inverse behind a filter, with a reference that arrives live."""
    script, allowed, slack, live, own = test.script, test.allowed, test.slack, test.golden.live, test.record
    if live is None or test.stream is None:
        return
    servo = servo_of(test.problem) is not None
    at = {"joint": live.joint_rad} if test.joints else {}
    first = float(live.reference_N[0])
    each = Follower(module=module, more={"joint": live.joint_rad[0]} if test.joints else {})
    compared = test.compared["live"]["stream"]
    check = script.check(module, f"golden vectors of a live reference{compared.words}")
    check = each.start(check, first).then(len(live.reference_N))
    allowed.checked(near_golden(check.call("step", reference=live.reference_N, **at), compared), slack)
    check.same(ANSWER, other=0, versus="command" if servo else "force", tolerance=script.rounding(compared.expected))
    check = script.check(module, "a reference that is not a number is flagged, and a rate limit with ramps ahead of it")
    ramps = Status.RATE_LIMITED if test.live_ramps else Status.OK
    check.bits("seen", some=Status.INPUT_HELD | ramps, none=Status.RANGE)
    lost = np.isnan(live.reference_N)
    check = each.start(check, first).then(2)
    each.step(check, [first, math.nan], 0).near("status", [0.0, float(Status.INPUT_HELD)], 0.0) if lost.any() else check
    check = script.check(module, "references out of range are clamped and flagged")
    check = each.start(check, first)
    for value, end in ((1.5 * accepted_range(test.problem)[1], "reference_max"), (-1.0, "reference_min")):
        check = check.then(4)
        each.step(check, value).near("followed", own[end]).bits("status", some=Status.RANGE, none=Status.INPUT_HELD)
        allowed.checked(check, slack)
    check = script.check(module, "a bad start is replaced and flagged")
    each.start(check, math.nan).bits("status", exactly=Status.INPUT_HELD)
    check.within("force", allowed.low_N - slack, allowed.high_N + slack)
    if test.led_to_N is not None:
        each = replace(each, more=test.joint())
        led_back(script, each, test.first, test.led_to_N, test.times)
        timed(script, each, test.first, test.led_to_N, test.times, splits=True)
    _stream_use(test, each)


def _stream_use(test: TensionTest, each: Follower) -> None:
    script, own, re_entry = test.script, test.record, float(test.times.re_entry)
    high, (least, most) = test.narrow_N[1], accepted_range(test.problem)
    changed = {"force_max": high, "adhesion": own["adhesion"] + 0.5}
    check = script.check(each.module, "valid parameters are accepted, others refused")
    each.start(check, test.first).call("use", record=test.with_record(**changed)).near(ANSWER, 1.0)
    check.near("load-independent friction", changed["adhesion"])
    each.step(check, test.first).near("largest force", high)
    changed |= {"reference_min": least, "reference_max": most}
    check.call("use", record=test.with_record(**changed)).near(ANSWER, 1.0)
    check.near("largest reference", most).near("least reference", least)
    changed |= {"reference_min": 0.5 * (own["reference_min"] + own["reference_max"])}
    changed |= {"reference_max": own["reference_max"]}
    check.write("followed", own["reference_min"]).write("lost", 0.0)
    check.call("use", record=test.with_record(**changed)).near(ANSWER, 1.0).near("lost", re_entry, 0.0)
    check.call("use", record=test.with_record(force_max=math.nan)).near(ANSWER, 0.0)
    check.near("least reference", changed["reference_min"])
    check = script.check(each.module, "a start in motion keeps the force and is led to the reference")
    force = 0.5 * sum(test.narrow_N)
    check.call("init_at", reference=test.first, force=force).near("force", force).near("followed", test.first)
    check.near("lost", re_entry, 0.0)


def _profile(test: TensionTest, module: ModuleRecord) -> None:
    """The profile: its data, sample by sample, and its end."""
    script, rows = test.script, len(test.profile_N)
    first, last = float(test.profile_N[0]), float(test.profile_N[-1])
    expected = checksum(test.profile_N, script.precision)
    script.check(module, "checksum of the profile", rows).call("at", index=EACH).checksum(expected)
    check = script.check(module, "its steps give its samples").call("init").near("force", first).bits("seen", exactly=0)
    check = check.then(rows)
    check.call("step").same(ANSWER, other=0, versus="force").bits("status", exactly=0).checksum(expected)
    if test.problem.reference.periodic:
        check = script.check(module, "begins again")
        check.call("step").near(ANSWER, first).call("last").near(ANSWER, last)
        return
    check = script.check(module, "holds its last sample and reports its end", 3)
    check.call("step").near(ANSWER, last).bits("status", exactly=Status.ENDED).bits("seen", some=Status.ENDED)
    check.call("last").near(ANSWER, last)


def _plant(test: TensionTest, module: ModuleRecord) -> None:
    """The chain itself."""
    script, course, compared = test.script, test.golden.course, test.compared["course"]["plant"]
    rows, first = len(course.columns["plant"]), test.first
    last = test.joint(-1)
    check = script.check(module, f"golden vectors{compared.words}").call("init", tension=first).then(rows)
    near_golden(check.call("step", given=course.plant_force_N[:rows], **test.joint(slice(rows))), compared)
    check = script.check(module, "positions of the ends")
    check.call("actuator_position").near(ANSWER, test.plant_ends_m[0], max(test.position_m, 1e-300))
    check.call("load_position").near(ANSWER, test.plant_ends_m[1], max(test.position_m, 1e-300))
    if test.joints and servo_of(test.problem) is None:
        check = script.check(module, "rest wherever the joints are").call("init", 1, tension=first).then(10)
        check.call("step", 1, given=first, **test.joint(len(course.reference_N) // 2))
        check.near(ANSWER, first, 1e2 * script.rounding(first), 1).bits("status", exactly=0, slot=1)
    check = script.check(module, "bad forces hold the last tension and say so", 2)
    check.call("step", given=[math.nan, math.inf], **last).held("tension").same(ANSWER, other=0, versus="tension")
    check.bits("status", exactly=Status.INPUT_HELD).bits("seen", some=Status.INPUT_HELD)
    check = script.check(module, "a step without a solution holds the last tension and says so").write(
        "states", math.nan
    )
    check.call("step", given=float(course.plant_force_N[0])).held("tension").same(ANSWER, other=0, versus="tension")
    check.bits("status", exactly=Status.FAILED)
    check.near("evaluations", 2.0 * (1 + plant_limits(script.precision).halvings), 0.0)
    check = script.check(module, "a bad start is replaced and flagged").call("init", tension=math.nan)
    check.bits("status", exactly=Status.INPUT_HELD).near("tension", accepted_range(test.problem)[0])
    if test.slack_rows:
        check = script.check(module, "a slack tendon is flagged, or that it was not reached")
        check = check.call("init", tension=first).then(test.slack_rows)
        check.call("step", given=test.slack_drive, **test.joint())
        check.then().within("seen", float(Status.WOULD_PUSH), float(Status.WOULD_PUSH | Status.FAILED))
