"""`identify` of driven joints: numbers with confidence intervals, from angles and torques of their motors."""

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from tendonff.compensator.compensators.every import problem_of
from tendonff.compensator.compensators.motors.drive import require_stiff_gears
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured.conditions import completed, require_conditions
from tendonff.compensator.identification.motors.estimates import DERIVED, Found, correlation_of, estimates_of
from tendonff.compensator.identification.motors.first_look import look
from tendonff.compensator.identification.motors.fitted import fitted_text, observer_text
from tendonff.compensator.identification.motors.law import MechanismLaw, centred
from tendonff.compensator.identification.motors.log import (
    MotorsLog,
    answered_logs,
    answered_several,
    read_logs,
    read_several,
)
from tendonff.compensator.identification.motors.loop_routine import MotorRoutine, is_loop, suggest_routine
from tendonff.compensator.identification.motors.parameters import ANGLE_OR_PUSH, Values, put_into, require_loop
from tendonff.compensator.identification.motors.result import (
    DESCRIBED_PERCENT,
    MotorsComparison,
    MotorsIdentification,
)
from tendonff.compensator.identification.motors.routine import MotorsRoutine, suggest_motors
from tendonff.compensator.identification.motors.search import (
    FIRST_OF_SEVERAL,
    fit_loop,
    fit_several,
    with_own_stops,
    with_stops,
)
from tendonff.compensator.identification.motors.sensor import UNITS as SENSOR_UNITS
from tendonff.compensator.identification.motors.sensor import fit_sensor
from tendonff.compensator.identification.motors.torque import UNITS as TORQUE_UNITS
from tendonff.compensator.identification.motors.torque import fit_torque
from tendonff.compensator.scenario.driven.finger import FingerScenario, SampledFinger
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.driven.observer_table import ObserverTable
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.turns import in_turn
from tendonff.ocp.fits.mechanism import Several

Driven = JointScenario | FingerScenario

CLEARLY_BETTER = 0.8
"""Share of the error of a fit that one with other stops may leave, to be taken instead."""

_ONE_FILE = (
    "one file was fitted: the interval of [observer] is that of its parts, and another load may miss the joint's angle "
    "by several times as much; give files of other loads too"
)


_BENT_LOOP = (
    "a loop is fitted at one bend: its pre-tension is another wherever {} stands, which one motor does not tell from "
    "friction; fit the files of each bend by themselves, with that wrap angle as angle_rad of the section"
)


@in_turn
def identify_motors(
    scenario: Driven,
    data: Sequence[str | os.PathLike[str]],
    validate: Sequence[str | os.PathLike[str]] = (),
    *,
    how: Measurement | None = None,
    say: Callable[[str], None] = lambda _: None,
    confirm: Callable[[str], bool] = lambda _: False,
) -> MotorsIdentification:
    """Fit a loop, a pair or a finger to what its motors felt.

    Parameters
    ----------
    scenario : JointScenario or FingerScenario
        Geometry, inertia and whatever the files do not identify are taken from it.
    data : sequence of str or path
        Files with time_s and, of a loop, motor_rad, motor_torque_N_m or motor_current_A, and joint_rad where there is
        an encoder. Of several motors motor_NAME_rad, motor_torque_NAME_N_m or motor_current_NAME_A of each, and
        joint_NAME_rad; a motor of a pair is called like its tendon.
    validate : sequence of str or path, optional
        Files that judge the law.
    how : Measurement, optional
        Other names and scales of the columns of a loop: input is the torque, input_position the motor, output_position
        the joint; of several motors what to leave out and what to tare.
    say, confirm : callable, optional
        Callback for messages on the work in progress; asked where a value looks like another unit (the default
        declines).

    Raises
    ------
    InputError
        If a file cannot be used, or the friction of a tendon is zero.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/hand_joint.toml")
    >>> fit = tf.identify(scenario, ["log.csv"])  # doctest: +SKIP
    >>> print(fit.headline)  # doctest: +SKIP
    """
    require_stiff_gears(scenario.source.name, problem_of(scenario).drives, "identify, whose tendons then are as soft")
    files, judging = tuple(map(Path, data)), tuple(map(Path, validate))
    identified = _loop if is_loop(scenario.mechanism) else _several
    with threadpool_limits(limits=1, user_api="blas"):
        return identified(scenario, files, judging, how, say, confirm)  # type: ignore[arg-type]


def suggest_motor_routine(scenario: Driven) -> MotorRoutine | MotorsRoutine:
    """Motor angles for a log that identifies a mechanism; InputError where none lead the joints so."""
    if is_loop(scenario.mechanism):
        return suggest_routine(scenario)  # type: ignore[arg-type]
    return suggest_motors(*mechanism_of(scenario), scenario.source.name)


def mechanism_of(scenario: Driven) -> tuple[Finger, SampledFinger]:
    """Joints, tendons and motors of a scenario, and its reference."""
    found: tuple[Finger, SampledFinger] = problem_of(scenario).by_motor()
    return found


def _loop(
    scenario: JointScenario,
    files: tuple[Path, ...],
    judging: tuple[Path, ...],
    how: Measurement | None,
    say: Callable[[str], None],
    confirm: Callable[[str], bool],
) -> MotorsIdentification:
    """A loop by its motor, or a virtual sensor where something else loads its joint."""
    try:
        require_loop(scenario.mechanism, scenario.source.name)
    except ParameterError as error:
        raise InputError(str(error)) from None
    given = how or Measurement()
    named = (s for tendon in scenario.mechanism.tendons for s in tendon.path.sections if s.moves)
    others = [joint for section in named for joint in section.joints if joint != scenario.mechanism.joint.name]
    if others or given.conditions:
        raise InputError(
            f"{scenario.source.name}: {_BENT_LOOP.format(others[0] if others else given.conditions_of_files[0][1])}"
        )
    logs, judges = read_logs(scenario, files, given), read_logs(scenario, judging, given)
    doubts = answered_logs(scenario, (*logs, *judges), confirm)
    for log in logs:
        if not (np.ptp(log.run.motor_rad) > 0 and np.ptp(log.torque_N_m) > 0):
            raise InputError(
                f"{log.name}: angle or torque of the motor never changes, so there is nothing to identify; move it"
            )
    say("first look")
    looks = tuple(one for log in logs if (one := look(log, scenario.mechanism)) is not None)
    mechanism, touched = with_stops(scenario.mechanism, looks, float(logs[0].run.start_rad[0]))
    found = fit_loop(mechanism, logs, looks, touched, say)
    poor = _percent(found) > DESCRIBED_PERCENT
    own, stated = with_own_stops(scenario.mechanism, logs)
    if not set(stated) <= set(touched) or (poor and stated != touched):  # the look has overlooked a push, or seen one
        say("the scenario's own stops")
        again = fit_loop(own, logs, looks, stated, say)
        if _percent(again) < CLEARLY_BETTER * _percent(found):
            found, poor = again, _percent(again) > DESCRIBED_PERCENT
    observed = poor and all(log.encoders.all() for log in (*logs, *judges))
    say("intervals")
    answer = replace(_answer(scenario, scenario.mechanism, found, judges, (*files, *judging), observed), looks=looks)
    if observed:
        say("virtual sensor")
        answer = _observed(scenario, answer, logs, judges)
    return replace(answer, warnings=(*doubts, *answer.warnings))


def _percent(found: Found) -> float:
    """RMS error of a torque in % of its range."""
    return found.law.percent(found.solution.values)


def _observed(
    scenario: JointScenario, answer: MotorsIdentification, logs: Sequence[MotorsLog], judges: Sequence[MotorsLog]
) -> MotorsIdentification:
    """The answer with a virtual sensor: estimates of a mechanism that explains nothing say nothing."""
    torque = None
    if all(log.joint_torque_N_m is not None for log in (*logs, *judges)):
        torque = fit_torque(logs, judges)
    sensor = fit_sensor(logs, judges, None if torque is None else torque.largest_exponents)
    forward, band = (None, 0.0) if torque is None else (torque.law, torque.band_N_m or 0.0)
    return replace(
        answer,
        law="virtual sensor of a loop",
        text=observer_text(scenario, ObserverTable.of(sensor.sensor, sensor.band_rad, forward, band)),
        estimates=(*sensor.estimates, *(() if torque is None else torque.estimates)),
        units={f"sensor_{n}": u for n, u in SENSOR_UNITS.items()} | {f"torque_{n}": u for n, u in TORQUE_UNITS.items()},
        sensor=sensor,
        torque=torque,
        warnings=(*answer.warnings, *((_ONE_FILE,) if len(logs) == 1 else ())),
    )


def _several(
    scenario: Driven,
    files: tuple[Path, ...],
    judging: tuple[Path, ...],
    how: Measurement | None,
    say: Callable[[str], None],
    confirm: Callable[[str], bool],
) -> MotorsIdentification:
    """Several motors, each of which feels its own tendons."""
    given = how or scenario.measurement
    taken = {"skip_s": None, "tare_s": None, "channels": None, "conditions": None}
    if replace(given, **taken) != replace(scenario.measurement, **taken):  # type: ignore[arg-type]
        raise InputError(
            f"{scenario.source.name}: of several motors every column has its name (motor_NAME_rad, "
            "motor_torque_NAME_N_m, joint_NAME_rad); of options on the files --channel, --condition, --skip and "
            "--tare go"
        )
    finger, sampled = mechanism_of(scenario)
    for tendon in finger.tendons:
        if not tendon.friction.mu_dynamic > 0:
            raise InputError(
                f'{scenario.source.name}: mu_dynamic of tendon "{tendon.name}" must be > 0 to begin with, got '
                f"{tendon.friction.mu_dynamic:g}; 0.15 is a usual value"
            )
    require_conditions(given, finger.others, [each.name for each in (*files, *judging)], scenario.source.name)
    logs, judges = (read_several(finger, some, sampled.angle_rad[0], given) for some in (files, judging))
    logs, judges = _standing(logs, judges, sampled, finger.others, scenario.source.name)
    doubts = answered_several(finger, (*logs, *judges), scenario.run, scenario.source.name, confirm)
    found = fit_several(finger, logs, say)
    say("intervals")
    answer = _answer(scenario, found.law.mechanism, found, judges, (*files, *judging))
    return replace(answer, warnings=(*doubts, *answer.warnings))


def _standing(
    logs: Sequence[MotorsLog], judges: Sequence[MotorsLog], sampled: SampledFinger, joints: Sequence[str], file: str
) -> Iterator[list[MotorsLog]]:
    """Logs with the angles of all joints that stand, where a file states none those of the scenario."""
    usual = dict.fromkeys(joints, math.nan)
    for name, angle in sampled.motion.by_joint.items():
        if name in joints and np.ptp(angle) == 0:
            usual[name] = float(angle[0])
    known = completed({log.name: log.run.standing_rad for log in (*logs, *judges)}, usual, file)
    for some in (logs, judges):
        yield [replace(log, run=replace(log.run, standing_rad=known[log.name])) for log in some]


def _answer(
    scenario: Driven,
    system: Mechanism | Finger,
    found: Found,
    judges: Sequence[MotorsLog],
    inputs: tuple[Path, ...],
    observed: bool = False,
) -> MotorsIdentification:
    """Result of a fit of a scenario's mechanism."""
    law, values = found.law, found.solution.values
    compared = [_compared(log, "fit", law, values) for log in law.logs]
    compared += [_judged(log, found) for log in judges]
    described = max(float(c.torque_percent.max()) for c in compared if c.role == "fit") <= DESCRIBED_PERCENT
    estimates = estimates_of(system, found, described=described)
    kept = {e.name: e.value for e in estimates if e.identifiable} if found.apart else found.identified
    effects = [n.spec.effect for n, _, taken in found.tried if taken]
    effects += ["motor that moves in counts"] if law.as_read else []
    fitted: Mechanism | Finger = put_into(system, kept)  # type: ignore[type-var]
    return MotorsIdentification(
        asked=scenario,
        text=fitted_text(scenario, fitted, estimates) if described else scenario.text,
        law=", ".join(("whole mechanism" if found.apart else "loop with presliding", *effects)),
        motors=law.logs[0].motors,
        joints=tuple(joint.name for joint in system.joints),
        described=described,
        estimates=estimates,
        units={n.name: n.spec.unit for n in law.numbers.values()} | DERIVED | {"torque_scale": "-"},
        comparisons=tuple(compared),
        correlation_names=found.names,
        correlation=correlation_of(found),
        warnings=tuple(warnings_of(found, described=described, observed=observed)),
        inputs=inputs,
        laws=tuple((n.spec.effect, gain, taken) for n, gain, taken in found.tried),
    )


def _judged(log: MotorsLog, found: Found) -> MotorsComparison:
    """A file that the fit did not see: only tensions at its start are found."""
    law = replace(found.law, logs=[log], fixed={**found.law.fixed, **found.solution.values})
    start = {n.name: n.start for n in law.numbers.values() if n.of_start}
    return _compared(log, "validate", law, law.fit(start, most=FIRST_OF_SEVERAL).values if start else {})


def _compared(log: MotorsLog, role: str, law: MechanismLaw, values: Values) -> MotorsComparison:
    answer = law.respond(log, values)
    _, off = law.errors(log, answer)
    rig, felt, exponents = law.rig(log, values), np.full_like(log.joint_rad, np.nan), {}
    if isinstance(rig, Several):
        felt = rig.joints_rad(log.run, log.torque_N_m, segments=law.segments)
        places = {**log.run.standing_rad, **dict(zip(rig.mechanism.names, log.run.start_rad.tolist(), strict=True))}
        exponents = {tendon.name: tendon.exponent_at(places) for tendon in rig.mechanism.tendons}
    return MotorsComparison(
        name=log.name,
        role=role,
        time_s=log.time_s,
        motor_rad=log.run.motor_rad,
        torque_N_m=log.torque_N_m,
        model_N_m=answer.torque_N_m,
        joint_rad=log.joint_rad,
        model_rad=log.joint_rad + off,
        felt_rad=np.where(np.isfinite(log.joint_rad), log.joint_rad + centred(felt - log.joint_rad, log), felt),
        standing_rad=log.run.standing_rad,
        exponents=exponents,
        counted=log.counted,
        findings=log.findings,
    )


def warnings_of(found: Found, *, described: bool = True, observed: bool = False) -> Iterator[str]:
    """Sentences on what a fit rests on, for the user."""
    if not described:
        yield (
            "the mechanism does not explain the torque: something else loads a joint, or signs, units, moment_arm_m, "
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
    for effect in found.lacking:
        yield (
            f"{effect.spec.effect} would explain the log better; it is not fitted for several motors, and the "
            "intervals are wider by what it would change: measure it on one tendon, and state it in the scenario"
        )
    bounds = [n for n in found.solution.at_bound if n in found.names and n not in found.not_identifiable]
    if bounds and not found.apart:
        yield f"{', '.join(bounds)} ended at a bound of the search; check the scenario's value"
    encoders = [log.encoders.all() for log in found.law.logs]
    if not (all(encoders) if found.apart else any(encoders)):
        yield (
            "no encoder at some joint: its angle counts from where the reference of the scenario starts, and stiffness "
            "of several motors is known by torques alone; log joint_NAME_rad for a better one"
            if found.apart
            else "no encoder at the joint: its angles count from where the reference of the scenario starts"
        )
