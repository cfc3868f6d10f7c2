"""`identify` of several motors: friction, stiffness and dry friction of each, from their angles and torques."""

import os
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student
from threadpoolctl import threadpool_limits

from tendonff.compensator.compensators.every import problem_of
from tendonff.compensator.compensators.motors.task import ASSUMED_SPREAD
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.answer.result import Estimate, is_known
from tendonff.compensator.identification.constants import TUNED, with_torque_constant
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.motors.law import Lacking, MotorsLaw
from tendonff.compensator.identification.motors.log import MotorsLog, answered_logs, read_logs
from tendonff.compensator.identification.motors.numbers import Number, numbers_of, put_into, scenarios_own
from tendonff.compensator.identification.motors.result import (
    DESCRIBED_PERCENT,
    MotorsComparison,
    MotorsIdentification,
)
from tendonff.compensator.identification.motors.routine import MotorsRoutine, suggest_motors
from tendonff.compensator.scenario.base import with_base
from tendonff.compensator.scenario.driven.finger import FingerScenario, SampledFinger
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.tables import set_keys, to_toml
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.turns import in_turn
from tendonff.ocp.fits.least_squares import Solution

COARSE_MASSES, FINE_MASSES = 6, 12
"""Of each tendon in the first steps of a search, and at the end."""

FIRST_STEPS, STEPS = 8, 12
"""Evaluations of the search with few masses, and with all."""

FINE_PARTS = 2
"""Steps of the last simulation in one row."""


@in_turn
def identify_motors(
    scenario: FingerScenario | JointScenario,
    data: Sequence[str | os.PathLike[str]],
    validate: Sequence[str | os.PathLike[str]] = (),
    *,
    skip_s: float | None = None,
    tare_s: tuple[float, float] | None = None,
    say: Callable[[str], None] = lambda _: None,
    confirm: Callable[[str], bool] = lambda _: False,
) -> MotorsIdentification:
    """Fit a finger or a pair to what its motors felt.

    Parameters
    ----------
    scenario : FingerScenario or JointScenario
        Geometry, inertia and whatever the files do not identify are taken from it; of one joint a pair.
    data : sequence of str or path
        Files with the columns time_s, motor_NAME_rad, motor_torque_NAME_N_m or motor_current_NAME_A of each motor, and
        joint_NAME_rad where there is an encoder. A motor of a pair is called like its tendon.
    validate : sequence of str or path, optional
        Files that judge the law.
    skip_s : float, optional
        Leave out the start of every file [s].
    tare_s : tuple of float, optional
        From and to in every file, while no motor is loaded: torques are set to zero there [s].
    say, confirm : callable, optional
        Callback for messages on the work in progress; asked where a value looks like another unit (the default
        declines).

    Raises
    ------
    InputError
        If a file cannot be used.
    """
    finger, sampled = mechanism_of(scenario)
    start_rad = sampled.angle_rad[0]
    _require_friction(finger, scenario.source.name)
    files, judging = tuple(map(Path, data)), tuple(map(Path, validate))
    with threadpool_limits(limits=1, user_api="blas"):
        logs = read_logs(finger, files, start_rad, skip_s, tare_s)
        judges = read_logs(finger, judging, start_rad, skip_s, tare_s)
        doubts = answered_logs(finger, (*logs, *judges), scenario.run, scenario.source.name, confirm)
        numbers = numbers_of(finger, [log.name for log in logs], _starts(finger, logs))
        coarse = MotorsLaw(finger=finger, logs=logs, numbers=numbers, segments=COARSE_MASSES)
        say("whole mechanism")
        solution = coarse.fit({n.key: n.start for n in numbers}, most=FIRST_STEPS)
        say("finer mechanism")
        law = replace(coarse, segments=FINE_MASSES, refinement=FINE_PARTS)
        solution = law.fit(solution.values, most=STEPS)
        say("intervals")
        answer = _answer(scenario, law, solution, judges, (*files, *judging))
    return replace(answer, warnings=(*doubts, *answer.warnings))


def suggest_motor_routine(scenario: FingerScenario | JointScenario) -> MotorsRoutine:
    """Motor angles for a log that identifies a finger or a pair; InputError where no tensions lead the joints so."""
    return suggest_motors(*mechanism_of(scenario), scenario.source.name)


def mechanism_of(scenario: FingerScenario | JointScenario) -> tuple[Finger, SampledFinger]:
    """Joints, tendons and motors of a scenario, and its reference."""
    found: tuple[Finger, SampledFinger] = problem_of(scenario).by_motor()
    return found


def _require_friction(finger: Finger, file: str) -> None:
    for tendon in finger.tendons:
        if not tendon.friction.mu_dynamic > 0:
            raise InputError(
                f'{file}: mu_dynamic of tendon "{tendon.name}" must be > 0 to begin with, got '
                f"{tendon.friction.mu_dynamic:g}; 0.15 is a usual value"
            )


def _starts(finger: Finger, logs: Sequence[MotorsLog]) -> dict[tuple[str, str], float]:
    """About the tension of each tendon that is alone on its motor, at the start of each log."""
    return {
        (log.name, motor.winds[0]): abs(float(np.median(log.torque_N_m[:5, k])) / motor.winding_m[0])
        for log in logs
        for k, motor in enumerate(finger.motors)
        if len(motor.winds) == 1
    }


def _answer(
    scenario: FingerScenario | JointScenario,
    law: MotorsLaw,
    solution: Solution,
    judges: Sequence[MotorsLog],
    inputs: tuple[Path, ...],
) -> MotorsIdentification:
    finger, covariance = law.finger, law.covariance(solution)
    lacking = [each for each in law.lacking(solution) if each.gain >= TUNED.worth_a_constant]
    reach = float(student.ppf(0.975, max(solution.degrees, 1)))
    for each in lacking:  # the intervals reach the values with it too
        covariance = covariance + np.outer(each.shift, each.shift) / reach**2
    compared = [_compared(log, "fit", law, solution.values) for log in law.logs]
    compared += [_judged(log, law, solution) for log in judges]
    worst = max(float(c.torque_percent.max()) for c in compared if c.role == "fit")
    described = worst < DESCRIBED_PERCENT
    kept = [n for n in law.numbers if not n.is_nuisance]
    estimates = tuple(_estimate(finger, n, solution, covariance, k, described=described) for k, n in enumerate(kept))
    own = slice(0, len(kept))
    deviation = np.sqrt(np.diag(covariance)[own])
    safe = np.where(np.isfinite(deviation) & (deviation > 0), deviation, np.inf)
    correlation = np.where(np.isfinite(covariance[own, own]), covariance[own, own], 0.0) / np.outer(safe, safe)
    np.fill_diagonal(correlation, 1.0)
    values = {e.name: e.value for e in estimates if e.identifiable} if described else {}
    return MotorsIdentification(
        asked=scenario,
        text=fitted_text(scenario, put_into(finger, values), estimates) if described else scenario.text,
        motors=tuple(m.name for m in finger.motors),
        joints=finger.names,
        described=described,
        estimates=estimates,
        units=tuple(n.unit for n in kept),
        comparisons=tuple(compared),
        correlation_names=tuple(n.key for n in kept),
        correlation=correlation,
        warnings=tuple(_warnings(law, lacking, described=described)),
        inputs=inputs,
    )


def _judged(log: MotorsLog, law: MotorsLaw, solution: Solution) -> MotorsComparison:
    """A file that the fit did not see: only the tensions at its start are found."""
    finger = put_into(law.finger, solution.values)
    nuisance = tuple(n for n in numbers_of(finger, [log.name], _starts(finger, [log])) if n.is_nuisance)
    own = MotorsLaw(finger=finger, logs=[log], numbers=nuisance, segments=law.segments, refinement=law.refinement)
    found = own.fit({n.key: n.start for n in nuisance}, most=FIRST_STEPS).values if nuisance else {}
    return _compared(log, "validate", own, found)


def _compared(log: MotorsLog, role: str, law: MotorsLaw, values: dict[str, float]) -> MotorsComparison:
    found = law.predict(log, values)
    _, angle = law.errors(log, found)
    return MotorsComparison(
        name=log.name,
        role=role,
        time_s=log.time_s,
        torque_N_m=log.torque_N_m,
        model_N_m=found.torque_N_m,
        joint_rad=log.joint_rad,
        model_rad=log.joint_rad + angle,
        counted=log.counted,
        findings=log.findings,
    )


def _estimate(
    finger: Finger, number: Number, solution: Solution, covariance: Array, k: int, *, described: bool
) -> Estimate:
    value, error = solution.values[number.key], float(np.sqrt(covariance[k, k]))
    at_bound = number.key in solution.at_bound
    size = max(abs(value), number.step) if not number.logarithmic else abs(value)
    known = described and not at_bound and is_known(error, size)
    reach = float(student.ppf(0.975, max(solution.degrees, 1)))
    why = "fit of the whole mechanism"
    if at_bound:
        why = f"it ended at a bound of its search; {number.advice}"
    elif not known:
        why = f"its standard error is {error:.2g} {number.unit}; {number.advice}"
    elif number.of_force:
        why += ", as measured by the motors: its interval counts 10 % for their torque constants"
    before = scenarios_own(finger, number.key)
    whole, half = with_torque_constant(value, error, reach) if number.of_force else (error, reach * error)
    return Estimate(
        name=number.key,
        value=value if known else (before if before is not None else value),
        standard_error=whole if np.isfinite(error) else None,
        interval=(value - half, value + half) if known else None,
        interval_as_measured=(value - reach * error, value + reach * error) if known and number.of_force else None,
        identifiable=known,
        why=why,
        scenario=before,
        fitted=known,
    )


def _warnings(law: MotorsLaw, lacking: Sequence[Lacking], *, described: bool) -> Iterator[str]:
    if not described:
        yield (
            "the mechanism does not explain the torques: something else loads a joint, or signs, units, moment arms or "
            "drum radii are wrong; fitted.toml is the scenario"
        )
        return
    for each in lacking:
        yield (
            f"{each.name} of the tendons would explain the log better; it is not fitted for several motors, and the "
            "intervals are wider by what it would change: measure it on one tendon, and state it in the scenario"
        )
    if not all(log.encoders.all() for log in law.logs):
        yield (
            "without encoders at all joints their angles count from where the reference starts, and stiffness is known "
            "by torques alone; log joint_NAME_rad for a better one"
        )


def fitted_text(scenario: FingerScenario | JointScenario, finger: Finger, estimates: Sequence[Estimate]) -> str:
    """Text of the scenario with the mechanism's numbers, and its intervals as [robust.spread]."""
    raw: dict[str, Any] = with_base(tomllib.loads(scenario.text), scenario.source, [])
    raw["name"] = f"{scenario.name}, fitted"
    for row, tendon in zip(raw["tendons"], finger.tendons, strict=True):
        row["name"] = tendon.name
        for part in ("tendon", "friction"):
            row[part] = set_keys(getattr(tendon, part))
    for joint in finger.joints:
        if joint.gravity_N_m:
            raw["joints"][joint.name]["gravity_N_m"] = joint.gravity_N_m
    known = {e.name: e for e in estimates}
    scenario.put_motors(raw, finger.motors)
    raw["robust"] = _robust(finger, known, raw.get("robust", {}))
    raw["run"]["level"] = "presliding"
    return to_toml(raw)


def _robust(finger: Finger, known: dict[str, Estimate], stated: dict[str, Any]) -> dict[str, Any]:
    """[robust] with the widest interval of friction and of stiffness; what is not identified has the assumed width."""

    def widest(suffix: str) -> float:
        rows = [e for key, e in known.items() if key.startswith("tendons.") and key.endswith(suffix)]
        return max(_half_width(e) for e in rows)

    spread = {
        key: value for key, value in stated.get("spread", {}).items() if not key.endswith(("mu_dynamic", "N_per_m"))
    }
    for motor in finger.motors:
        if len(motor.winds) > 1:
            key = f"motors.{motor.name}.drive.pretension_N"
            spread[key] = _half_width(known[key])
    found = {**{k: v for k, v in stated.items() if k != "spread"}, "mu": widest(".mu_dynamic")}
    found["stiffness"] = widest(".stiffness_N_per_m")
    return {**found, "spread": spread} if spread else found


def _half_width(estimate: Estimate) -> float:
    """Half of the interval over the value; the assumed width of one that is not identified.

    Without the torque constants: where all forces are off alike, the joints stand where they did.
    """
    half = estimate.own_half_width
    return ASSUMED_SPREAD if half is None else round(min(max(half, 1e-4), 0.99), 4)
