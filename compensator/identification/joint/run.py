"""`identify` of a joint: parameters of a loop, with confidence intervals, from angle and torque of its motor."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.joint.alternatives import (
    STEPS,
    WIDER,
    Alternative,
    Tried,
    spanned,
    with_alternatives,
)
from tendonff.compensator.identification.joint.estimates import Found, estimates_of
from tendonff.compensator.identification.joint.first_look import FirstLook, look
from tendonff.compensator.identification.joint.fitted import fitted_text, observer_text
from tendonff.compensator.identification.joint.log import JointLog, answered_logs, read_logs
from tendonff.compensator.identification.joint.mechanism_law import (
    FINE_MASSES,
    MechanismLaw,
    covariance_of,
    gains,
)
from tendonff.compensator.identification.joint.parameters import (
    ANGLE_OR_PUSH,
    EXTRAS,
    PARTNERS,
    JointNumber,
    put_into,
    require_loop,
)
from tendonff.compensator.identification.joint.result import DESCRIBED_PERCENT, JointComparison, JointIdentification
from tendonff.compensator.identification.joint.sensor import SensorFit, fit_sensor
from tendonff.compensator.identification.joint.torque import TorqueFit, fit_torque
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.driven.observer_table import ObserverTable
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.turns import in_turn
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import Solution

N = JointNumber

STOP_STIFFNESS_N_M_PER_RAD = 100.0
"""Of a stop that the scenario does not have, before the fit."""

_BY_REVERSALS = (N.MU, N.TENSION, N.STIFFNESS, N.BRISTLE, N.COULOMB, N.GEAR_SLIP)
"""Numbers that only the slope of the torque at reversals separates, if neither a stop nor an encoder does."""

STEEP_EXPONENT = 1.1
"""mu theta of a second search where the first one found no slack."""

HOPELESS = 2.0
"""A law whose error is larger by this factor after its first steps is given up."""

MOST_EXTRAS = 3
FIRST_STEPS, FINE_STEPS = 5, 4
"""Evaluations of a start, and on the finer mechanism."""

_ONE_FILE = (
    "one file was fitted: the interval of [observer] is that of its parts, and another load may miss the joint's angle "
    "by several times as much; give files of other loads too"
)


@in_turn
def identify_joint(
    scenario: JointScenario,
    data: Sequence[str | os.PathLike[str]],
    validate: Sequence[str | os.PathLike[str]] = (),
    *,
    how: Measurement | None = None,
    say: Callable[[str], None] = lambda _: None,
    confirm: Callable[[str], bool] = lambda _: False,
) -> JointIdentification:
    """Fit the loop of a scenario to what its motor felt.

    Parameters
    ----------
    scenario : JointScenario
        Geometry, inertia and whatever the files do not tell are taken from it.
    data : sequence of str or path
        Files with the columns time_s, motor_rad, motor_torque_N_m or motor_current_A, and where there is an encoder
        joint_rad.
    validate : sequence of str or path, optional
        Files that judge the law.
    how : Measurement, optional
        Other names and scales of the columns: input is the torque, input_position the motor, output_position the joint.
    say, confirm : callable, optional
        Callback for messages on the work in progress; asked where a value looks like another unit (the default
        declines).

    Raises
    ------
    InputError
        If a file cannot be used, or the joint has no loop.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/hand_joint.toml")
    >>> fit = tf.identify(scenario, ["log.csv"])  # doctest: +SKIP
    >>> print(fit.headline)  # doctest: +SKIP
    """
    try:
        require_loop(scenario.mechanism, scenario.source.name)
    except ParameterError as error:
        raise InputError(str(error)) from None
    files, judging = tuple(map(Path, data)), tuple(map(Path, validate))
    given = how or Measurement()
    with threadpool_limits(limits=1, user_api="blas"):
        logs, judges = read_logs(scenario, files, given), read_logs(scenario, judging, given)
        doubts = answered_logs(scenario, (*logs, *judges), confirm)
        _require_motion(logs)
        say("first look")
        looks = [one for log in logs if (one := look(log, scenario.mechanism)) is not None]
        mechanism, touched = _with_stops(scenario.mechanism, looks, logs[0].run.start_rad)
        found = _fitted(mechanism, logs, looks, touched, say)
        sensor, torque = None, None
        if _percent(found) > DESCRIBED_PERCENT and all(log.joint_rad is not None for log in (*logs, *judges)):
            say("virtual sensor")
            if all(log.joint_torque_N_m is not None for log in (*logs, *judges)):
                torque = fit_torque(logs, judges)
            sensor = fit_sensor(logs, judges, None if torque is None else torque.largest_exponents)
        say("intervals")
        answer = _answer(scenario, found, looks, judges, (*files, *judging), sensor, torque)
    return replace(answer, warnings=(*doubts, *answer.warnings))


def _percent(found: Found) -> float:
    """RMS error of the torque in % of its range, the worst of the files."""
    errors = found.law.errors(_values(found.solution))
    pairs = zip(errors, found.law.logs, strict=True)
    return max(100 * float(np.sqrt(np.mean(e[log.counted] ** 2)) / np.ptp(log.torque_N_m)) for (e, _), log in pairs)


def _require_motion(logs: Sequence[JointLog]) -> None:
    for log in logs:
        if not (np.ptp(log.run.motor_rad) > 0 and np.ptp(log.torque_N_m) > 0):
            raise InputError(
                f"{log.name}: angle or torque of the motor never changes, so there is nothing to identify; move it"
            )


def _with_stops(
    mechanism: Mechanism, looks: Sequence[FirstLook], start_rad: float
) -> tuple[Mechanism, tuple[JointNumber, ...]]:
    """The mechanism with those stops alone that were touched, and the numbers of these."""
    ways = {push.way for found in looks for push in found.pushes}
    joint, stops = mechanism.joint, {"stop_low_rad": -1, "stop_high_rad": 1}
    start = next((found.start(mechanism, start_rad) for found in looks if found.pushes), {})
    places = {
        name: (getattr(joint, name) if getattr(joint, name) is not None else start.get(N(name), float(way)))
        if way in ways
        else None
        for name, way in stops.items()
    }
    stiffness = (joint.stop_stiffness_N_m_per_rad or STOP_STIFFNESS_N_M_PER_RAD) if ways else 0.0
    joint = replace(joint, **places, stop_stiffness_N_m_per_rad=stiffness)  # type: ignore[arg-type]
    numbers = tuple(N(name) for name, way in stops.items() if way in ways)
    return replace(mechanism, joints=(joint,)), (*numbers, N.STOP_STIFFNESS) if numbers else ()


def _fitted(
    mechanism: Mechanism,
    logs: Sequence[JointLog],
    looks: Sequence[FirstLook],
    touched: tuple[JointNumber, ...],
    say: Callable[[str], None],
) -> Found:
    """The law that explains the logs best."""
    free = [N.MU, N.TENSION, N.STIFFNESS, N.BRISTLE, N.COULOMB, N.GEAR_SLIP, *touched]
    if mechanism.joint.gravity_N_m:
        free.append(N.GRAVITY)
    kept, note = {}, ""
    if not touched:
        kept, note = {N.MU: N.MU.of(mechanism)}, "no push against a stop in these files"
    not_identifiable: tuple[JointNumber, ...] = ()
    if not touched and all(log.joint_rad is None for log in logs):
        not_identifiable, note = (
            _BY_REVERSALS,
            "neither a push against a stop nor the angle of the joint in these files",
        )
    law = MechanismLaw(mechanism=mechanism, logs=logs, fixed=kept)
    say("whole mechanism")
    if all(log.joint_rad is not None for log in logs) and (poor := _loaded(law, free, looks)) is not None:
        return poor
    some = (N.OFFSET,) if not_identifiable else EXTRAS
    law, solution, tried = _searched(law, free, looks, some, say)
    if touched and not _slack(law, solution):  # or the search went astray: other laws bend a push as well
        steep = [replace(found, exponent=STEEP_EXPONENT) for found in looks]
        again = _searched(replace(law, as_read=False), free, steep, some, say)
        law, solution, tried = min((law, solution, tried), again, key=lambda search: search[1].cost)
    if touched and not _slack(law, solution):
        note = "the pushes end before a tendon is slack"
        law = replace(law, fixed={N.MU: N.MU.of(mechanism)}, as_read=False)
        law, solution, tried = _searched(law, free, looks, some, say)
    alternatives: dict[JointNumber, Alternative] = {}
    if touched and N.MU not in law.fixed:
        solution, tried, alternatives = with_alternatives(law, solution, tried, say)
    say("finer mechanism")
    fine = replace(law, segments=FINE_MASSES, refinement=2)
    before, solution = solution, fine.fit(_values(solution), most=FINE_STEPS)
    covariance = covariance_of(fine, solution)
    reached = {n: spanned(solution, covariance, [each], before) for n, each in alternatives.items()}
    return Found(
        law=fine,
        solution=solution,
        covariance=spanned(solution, covariance, list(alternatives.values()), before),
        tried=tried,
        kept_because=note,
        not_identifiable=not_identifiable,
        alternatives=tuple(
            n for n, wide in reached.items() if (np.diag(wide) > WIDER**2 * np.diag(covariance))[:3].any()
        ),
    )


_Search = tuple[MechanismLaw, Solution, Tried]


def _searched(
    law: MechanismLaw,
    free: Sequence[JointNumber],
    looks: Sequence[FirstLook],
    some: Sequence[JointNumber],
    say: Callable[[str], None],
) -> _Search:
    """The law of a smooth motor or of one that moves in counts, with the effects that the data support."""
    law, solution = in_counts(law, _from_starts(law, free, looks))
    solution, tried = _with_extras(law, solution, some, say)
    return law, solution, tried


def in_counts(law: MechanismLaw, solution: Solution) -> tuple[MechanismLaw, Solution]:
    """The same, or the law of a motor that goes from count to count, where that explains the logs better.

    Such a motor shakes a light joint, and its tendons give friction away wherever it is slow.
    """
    if not any(log.run.in_counts for log in law.logs):
        return law, solution
    counted = replace(law, as_read=True)
    try:
        tried = counted.fit(_values(solution), most=FIRST_STEPS)
        if tried.cost < HOPELESS * solution.cost:
            tried = counted.fit(_values(tried), most=STEPS)
    except SolveError:
        return law, solution
    return (counted, tried) if tried.cost < solution.cost else (law, solution)


def _loaded(law: MechanismLaw, free: Sequence[JointNumber], looks: Sequence[FirstLook]) -> Found | None:
    """A fit of the first file alone, where it shows that no mechanism explains the torque; else None."""
    one = replace(law, logs=law.logs[:1])
    solution = _from_starts(one, free, looks, most=FIRST_STEPS)
    unknown = np.full((len(solution.values),) * 2, np.inf)
    found = Found(law=one, solution=solution, covariance=unknown, tried=(), kept_because="")
    return replace(found, law=law) if _percent(found) > 2 * DESCRIBED_PERCENT else None


def _from_starts(
    law: MechanismLaw, free: Sequence[JointNumber], looks: Sequence[FirstLook], most: int = STEPS
) -> Solution:
    """The best fit from the scenario's own values and from those of the first look."""
    own = {n: n.of(law.mechanism) for n in free if n not in law.fixed}
    if own[N.COULOMB] == 0 and looks:
        own[N.COULOMB] = 0.1 * looks[0].drive_torque_N_m
    starts = [
        own,
        *({**own, **_known(found.start(law.mechanism, law.logs[0].run.start_rad), own)} for found in looks[:1]),
    ]
    tried = []
    for start in starts:
        try:
            tried.append(law.fit(start, most=FIRST_STEPS))
        except SolveError as error:
            failure = error
    if not tried:
        raise SolveError(f"the mechanism cannot follow the log from any start: {failure}")
    best = min(tried, key=lambda s: s.cost)
    return law.fit(_values(best), most=most)


def _known(values: Mapping[JointNumber, float], names: Mapping[JointNumber, float]) -> dict[JointNumber, float]:
    return {n: v for n, v in values.items() if n in names}


def _values(solution: Solution) -> dict[JointNumber, float]:
    return {N(name): value for name, value in solution.values.items()}


def _slack(law: MechanismLaw, solution: Solution) -> bool:
    return any(law.respond(log, _values(solution)).slack for log in law.logs)


def _with_extras(
    law: MechanismLaw, solution: Solution, some: Sequence[JointNumber], say: Callable[[str], None]
) -> tuple[Solution, Tried]:
    """Take up effects one by one as long as the data support another."""
    tried: dict[JointNumber, tuple[float, bool]] = {}
    for _ in range(MOST_EXTRAS):
        extras = [n for n in some if n not in solution.values]
        if not extras:
            break
        blocks = len(np.unique(solution.residuals.blocks))
        worth = {n: gain * blocks / 2 for n, gain in gains(law, solution, extras).items()}
        tried |= {n: (gain, False) for n, gain in worth.items()}
        best = max(worth, key=lambda n: worth[n])
        if worth[best] < TUNED.worth_a_constant:
            break
        say(f"with {best.spec.effect}")
        start = law.fixed.get(best, best.of(law.mechanism))
        nudged = start - best.spec.step / 2 if start >= best.spec.high else start + best.spec.step / 10
        partners = {n: n.of(law.mechanism) for n in PARTNERS.get(best, ())}
        more = law.fit({**_values(solution), best: nudged, **partners}, most=STEPS)
        if blocks / 2 * np.log(solution.cost / more.cost) < TUNED.worth_a_constant:
            break
        solution, tried[best] = more, (worth[best], True)
    return solution, tuple((n, gain, taken) for n, (gain, taken) in tried.items())


def _answer(
    scenario: JointScenario,
    found: Found,
    looks: Sequence[FirstLook],
    judges: Sequence[JointLog],
    inputs: tuple[Path, ...],
    sensor: SensorFit | None,
    torque: TorqueFit | None,
) -> JointIdentification:
    law, values = found.law, _values(found.solution)
    comparisons = [
        _compared(log, role, law, values) for role, some in (("fit", law.logs), ("validate", judges)) for log in some
    ]
    described = all(c.torque_percent <= DESCRIBED_PERCENT for c in comparisons if c.role == "fit")
    estimates, correlation_names, correlation = estimates_of(scenario, found, described=described)
    if sensor is not None:
        estimates = (
            *sensor.estimates,
            *(() if torque is None else torque.estimates),
        )  # those of a mechanism that explains nothing say nothing
    taken = [n.spec.effect for n, _, taken in found.tried if taken]
    taken += ["motor that moves in counts"] if law.as_read else []
    name = ", ".join(("loop with presliding", *taken)) if sensor is None else "virtual sensor of a loop"
    encoder = any(log.joint_rad is not None for log in law.logs)
    warnings = list(warnings_of(found, described=described, joint=encoder, observed=sensor is not None))
    if sensor is not None and len(law.logs) == 1:
        warnings.append(_ONE_FILE)
    mechanism = put_into(scenario.mechanism, found.identified)
    text = fitted_text(scenario, mechanism, estimates) if described else scenario.text
    if sensor is not None:
        bands = sensor.band_rad, 0.0 if torque is None else torque.band_N_m or 0.0
        forward = None if torque is None else torque.law
        text = observer_text(scenario, ObserverTable.of(sensor.sensor, bands[0], forward, bands[1]))
    return JointIdentification(
        asked=scenario,
        text=text,
        law=name,
        sensor=sensor,
        torque=torque,
        described=described,
        estimates=estimates,
        looks=tuple(looks),
        comparisons=tuple(comparisons),
        laws=tuple((n.spec.effect, gain, taken) for n, gain, taken in found.tried),
        correlation_names=correlation_names,
        correlation=correlation,
        values=values,
        warnings=tuple(warnings),
        inputs=inputs,
    )


def _compared(log: JointLog, role: str, law: MechanismLaw, values: Mapping[JointNumber, float]) -> JointComparison:
    answer = law.respond(log, values)
    model = None
    if log.joint_rad is not None:
        off = (answer.angle_rad - log.joint_rad)[log.counted].mean()
        model = answer.angle_rad - off
    return JointComparison(
        name=log.name,
        role=role,
        time_s=log.time_s,
        motor_rad=log.run.motor_rad,
        torque_N_m=log.torque_N_m,
        model_N_m=answer.torque_N_m,
        joint_rad=log.joint_rad,
        model_rad=model,
        counted=log.counted,
        findings=log.findings,
    )


def warnings_of(found: Found, *, described: bool = True, joint: bool = True, observed: bool = False) -> Iterator[str]:
    """Sentences on what a fit rests on, for the user."""
    if not described:
        yield (
            "the mechanism does not explain the torque: something else loads the joint, or signs, units, moment_arm_m, "
            "drum_radius_m or gear_ratio are wrong; fitted.toml is the scenario"
            + (", with the virtual sensor as [observer]" if observed else "")
        )
        return
    if found.not_identifiable:
        yield (
            f"{found.kept_because}: the friction of the gear hides what reversals tell of the lost motion, so only "
            "friction at the motor and gravity are identified, and fitted.toml keeps the scenario's lost motion, "
            f"friction and pre-tension; {ANGLE_OR_PUSH}"
        )
    elif found.kept_because:
        known = "2 mu theta T by the motor are" if found.pushed else "friction at the motor are"
        yield (
            f"{found.kept_because}: only (T/k) tanh(mu theta/2) and {known} identified; "
            "mu_dynamic is the scenario's, and pretension_N and stiffness_N_per_m belong to it"
        )
    for alternative in found.alternatives:
        yield (
            f"{alternative.spec.effect} would explain the log about as well: the intervals reach its values too; "
            f"{alternative.spec.advice}"
        )
    if bound := [n for n in found.solution.at_bound if n not in found.not_identifiable]:
        yield f"{', '.join(bound)} ended at a bound of the search; check the scenario's value"
    if not joint:
        yield ("no encoder at the joint: its angles count from where the reference of the scenario starts")
