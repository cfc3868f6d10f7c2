"""Identification of driven joints, from angles and torques of their motors."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from tendonff.compensator.compensators.every import problem_of
from tendonff.compensator.compensators.motors.drive import require_stiff_gears
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.answer.records import Channel, Effect, FileResult
from tendonff.compensator.identification.answer.result import Identification
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.identify import Request
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.conditions import completed, require_conditions
from tendonff.compensator.identification.motors.estimates import Found, correlation_of, estimates_of
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
from tendonff.compensator.identification.motors.numbers import Values, put_into, require_loop
from tendonff.compensator.identification.motors.routine import MotorsRoutine, suggest_motors
from tendonff.compensator.identification.motors.search import (
    FIRST_OF_SEVERAL,
    fit_loop,
    fit_several,
    with_own_stops,
    with_stops,
)
from tendonff.compensator.identification.motors.sensor import SensorFit, fit_sensor
from tendonff.compensator.identification.motors.torque import TorqueFit, fit_torque
from tendonff.compensator.identification.parameters import ANGLE_OR_PUSH
from tendonff.compensator.scenario.driven.finger import FingerScenario, SampledFinger
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.driven.observer_table import ObserverTable
from tendonff.compensator.scenarios import parse_any
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.joint.parameters.finger import Finger
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


def fit_motors(asked: Request[Any]) -> Identification[Any]:
    """A loop, a pair or a finger by what its motors felt; InputError if a file cannot be used."""
    drives, name = problem_of(asked.scenario).drives, asked.scenario.source.name
    require_stiff_gears(name, drives, "identify, whose tendons then are as soft")
    return _loop(asked) if is_loop(asked.scenario.mechanism) else _several(asked)


def suggest_motor_routine(scenario: Driven) -> MotorRoutine | MotorsRoutine:
    """Motor angles for a log that identifies a mechanism; InputError where none lead the joints so."""
    if is_loop(scenario.mechanism):
        return suggest_routine(scenario)  # type: ignore[arg-type]
    return suggest_motors(*mechanism_of(scenario), scenario.source.name)


def mechanism_of(scenario: Driven) -> tuple[Finger, SampledFinger]:
    """Joints, tendons and motors of a scenario, and its reference."""
    found: tuple[Finger, SampledFinger] = problem_of(scenario).by_motor()
    return found


def _loop(asked: Request[JointScenario]) -> Identification[JointScenario]:
    """A loop by its motor, or a virtual sensor where something else loads its joint."""
    scenario, given, say = asked.scenario, asked.how, asked.say
    try:
        require_loop(scenario.mechanism, scenario.source.name)
    except ParameterError as error:
        raise InputError(str(error)) from None
    named = (s for tendon in scenario.mechanism.tendons for s in tendon.path.sections if s.moves)
    others = [joint for section in named for joint in section.joints if joint != scenario.mechanism.joint.name]
    if others or given.conditions:
        raise InputError(
            f"{scenario.source.name}: {_BENT_LOOP.format(others[0] if others else given.conditions_of_files[0][1])}"
        )
    logs, judges = (read_logs(scenario, some, given) for some in (asked.files, asked.judging))
    doubts = answered_logs(scenario, (*logs, *judges), asked.confirm)
    for log in logs:
        if not (np.ptp(log.run.motor_rad) > 0 and np.ptp(log.torque_N_m) > 0):
            raise InputError(
                f"{log.name}: angle or torque of the motor never changes, so there is nothing to identify; move it"
            )
    say("first look")
    looks = tuple(one for log in logs if (one := look(log, scenario.mechanism)) is not None)
    mechanism, touched = with_stops(scenario.mechanism, looks, float(logs[0].run.start_rad[0]))
    found = fit_loop(mechanism, logs, looks, touched, say)
    poor = _percent(found) > TUNED.poor_percent
    own, stated = with_own_stops(scenario.mechanism, logs)
    if not set(stated) <= set(touched) or (poor and stated != touched):  # the look has overlooked a push, or seen one
        say("the scenario's own stops")
        again = fit_loop(own, logs, looks, stated, say)
        if _percent(again) < CLEARLY_BETTER * _percent(found):
            found, poor = again, _percent(again) > TUNED.poor_percent
    observed = poor and all(log.encoders.all() for log in (*logs, *judges))
    say("intervals")
    answer = _answer(asked, scenario.mechanism, found, judges, observed)
    if observed:
        say("virtual sensor")
        answer = _observed(scenario, answer, logs, judges)
    return replace(answer, looks=looks, warnings=(*doubts, *answer.warnings))


def _percent(found: Found) -> float:
    """RMS error of a torque in % of its range."""
    return found.law.percent(found.solution.values)


def _observed(
    scenario: JointScenario, answer: Identification[Any], logs: Sequence[MotorsLog], judges: Sequence[MotorsLog]
) -> Identification[Any]:
    """The answer with a virtual sensor: estimates of a mechanism that explains nothing say nothing."""
    torque = None
    if all(log.joint_torque_N_m is not None for log in (*logs, *judges)):
        torque = fit_torque(logs, judges)
    sensor = fit_sensor(logs, judges, None if torque is None else torque.largest_exponents)
    forward, band = (None, 0.0) if torque is None else (torque.law, torque.band_N_m or 0.0)
    text = observer_text(scenario, ObserverTable.of(sensor.sensor, sensor.band_rad, forward, band))
    return replace(
        answer,
        law="virtual sensor of a loop",
        scenario=parse_any(text, scenario.source),
        estimates=(*sensor.estimates, *(() if torque is None else torque.estimates)),
        channels=(*answer.channels, *_sensed(sensor), *(() if torque is None else _felt(torque))),
        sensor=sensor,
        torque=torque,
        warnings=(*answer.warnings, *((_ONE_FILE,) if len(logs) == 1 else ())),
    )


def _sensed(sensor: SensorFit) -> Iterator[Channel]:
    for file in sensor.files:
        measured, model, low, high = map(np.degrees, (file.joint_rad, file.model_rad, file.low_rad, file.high_rad))
        of_file = partial(Channel, file=file.name, role=file.role, time_s=file.time_s)
        yield of_file(figure="sensor", name="joint angle", unit="deg", measured=measured, model=model, band=(low, high))


def _felt(fit: TorqueFit) -> Iterator[Channel]:
    reach = fit.band_N_m
    for file in fit.files:
        measured, model = file.joint_N_m, file.model_N_m
        band = None if reach is None else (model - reach, model + reach)
        of_file = partial(Channel, file=file.name, role=file.role, time_s=file.time_s)
        yield of_file(
            figure="torque_at_joint", name="joint torque", unit="N m", measured=measured, model=model, band=band
        )


def _several(asked: Request[Any]) -> Identification[Any]:
    """Several motors, each of which feels its own tendons."""
    scenario, given = asked.scenario, asked.how
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
    require_conditions(
        given, finger.others, [each.name for each in (*asked.files, *asked.judging)], scenario.source.name
    )
    logs, judges = (read_several(finger, some, sampled.angle_rad[0], given) for some in (asked.files, asked.judging))
    logs, judges = _standing(logs, judges, sampled, finger.others, scenario.source.name)
    doubts = answered_several(finger, (*logs, *judges), scenario.run, scenario.source.name, asked.confirm)
    found = fit_several(finger, logs, asked.say)
    asked.say("intervals")
    answer = _answer(asked, found.law.mechanism, found, judges)
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
    asked: Request[Any],
    system: Mechanism | Finger,
    found: Found,
    judges: Sequence[MotorsLog],
    observed: bool = False,
) -> Identification[Any]:
    """Result of a fit of a scenario's mechanism."""
    scenario = asked.scenario
    law, values = found.law, found.solution.values
    joints = [joint.name for joint in system.joints]
    compared = [_compared(log, "fit", joints, law, values) for log in law.logs]
    compared += [_judged(log, joints, found) for log in judges]
    files, channels = zip(*compared, strict=True)
    fit, judged = ([_worst_percent(file) for file in files if file.role == role] for role in ("fit", "validate"))
    described = max(fit) <= TUNED.poor_percent
    estimates = estimates_of(system, found, described=described)
    kept = {e.name: e.value for e in estimates if e.identifiable} if found.apart else found.identified
    effects = [n.spec.effect for n, _, taken in found.tried if taken]
    effects += ["motor that moves in counts"] if law.as_read else []
    fitted: Mechanism | Finger = put_into(system, kept)  # type: ignore[type-var]
    text = fitted_text(scenario, fitted, estimates) if described else scenario.text
    return Identification(
        asked=scenario,
        how=asked.how,
        scenario=parse_any(text, scenario.source),
        explain=None,
        law=", ".join(("whole mechanism" if found.apart else "loop with presliding", *effects)),
        described=described,
        estimates=estimates,
        correlation_names=found.names,
        correlation=correlation_of(found),
        files=files,
        channels=tuple(channel for own in channels for channel in own),
        fit_percent=max(fit),
        validation_percent=max(judged, default=None),
        warnings=tuple(warnings_of(found, described=described, observed=observed)),
        inputs=asked.every,
        suggests=described and not found.apart,
        effects=tuple(
            Effect(name=n.spec.effect, gain_of_log_likelihood=gain, taken_up=taken) for n, gain, taken in found.tried
        ),
    )


def _worst_percent(file: FileResult) -> float:
    return max(percent or 0.0 for percent in file.named("torque_percent_of_range").values())


_Compared = tuple[FileResult, list[Channel]]


def _judged(log: MotorsLog, joints: Sequence[str], found: Found) -> _Compared:
    """A file that the fit did not see: only tensions at its start are found."""
    law = replace(found.law, logs=[log], fixed={**found.law.fixed, **found.solution.values})
    start = {n.name: n.start for n in law.numbers.values() if n.of_start}
    values = law.fit(start, most=FIRST_OF_SEVERAL).values if start else {}
    return _compared(log, "validate", joints, law, values)


def _compared(log: MotorsLog, role: str, joints: Sequence[str], law: MechanismLaw, values: Values) -> _Compared:
    """Errors of a file; torques of its motors, and angles of joints with an encoder, zeros of these taken in."""
    answer = law.respond(log, values)
    torque_off, off = law.errors(log, answer)
    rms = _rms(torque_off, log)
    percent = 100 * rms / np.maximum(np.ptp(log.torque_N_m, axis=0), 1e-300)
    numbers = {
        "torque_rms_N_m": _named(log.motors, rms),
        "torque_percent_of_range": _named(log.motors, percent),
        "joint_rms_deg": _named(joints, np.degrees(_rms(off, log))),
    }
    rig = law.rig(log, values)
    if isinstance(rig, Several):
        felt = rig.joints_rad(log.run, log.torque_N_m, segments=law.segments)
        places = {**log.run.standing_rad, **dict(zip(rig.mechanism.names, log.run.start_rad.tolist(), strict=True))}
        numbers |= {
            "joint_by_torques_rms_deg": _named(joints, np.degrees(_rms(centred(felt - log.joint_rad, log), log))),
            "condition_rad": dict(log.run.standing_rad),
            "mu_theta": {tendon.name: tendon.exponent_at(places) for tendon in rig.mechanism.tendons},
        }
    channel = partial(Channel, file=log.name, role=role, time_s=log.time_s)
    channels = [
        channel(
            figure="torque",
            name=f"torque of {name}",
            unit="N m",
            measured=log.torque_N_m[:, k],
            model=answer.torque_N_m[:, k],
            over=log.run.motor_rad[:, k],
            over_name="motor angle",
            over_unit="rad",
            percent=float(percent[k]),
        )
        for k, name in enumerate(log.motors)
    ]
    for name, measured, error in zip(joints, np.degrees(log.joint_rad).T, np.degrees(off).T, strict=True):
        if np.isfinite(measured).all():
            model = measured + error
            channels.append(channel(figure="joint", name=name, unit="deg", measured=measured, model=model))
    return FileResult(name=log.name, role=role, numbers=numbers, findings=log.findings), channels


def _rms(rows: Array, log: MotorsLog) -> Array:
    """RMS over the rows of a log that count: friction has forgotten what was before the file."""
    return np.asarray(np.sqrt((rows[log.counted] ** 2).mean(axis=0)))


def _named(names: Sequence[str], values: Array) -> dict[str, float | None]:
    return {name: float(v) if np.isfinite(v) else None for name, v in zip(names, values, strict=True)}


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
            f"{alternative.motors.advice}"
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
