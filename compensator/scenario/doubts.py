"""Doubts: what is possible but looks like another unit, or is out of the actuator's reach.

They are found from the scenario's numbers alone, before anything is computed; nothing is ever changed by them.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tendonff.compensator.files.notices import Danger
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.scenario.joints import ConstantJoint, CsvJoint, Joint, SineJoint
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.settings import Feedback, FeedbackSensor, Run, Stream
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.parameters import Friction, Load, Path, Tendon, Transmission
from tendonff.models.path import FURTHEST_RAD

LARGEST_DRUM_M = 1.0
"""No drum and no moment arm is larger."""
LARGEST_SPEED_RAD_PER_S = 3000.0
"""No motor turns faster: 28 000 turns a minute."""
LONG_RUN = 200_000
"""Steps of a run that takes long."""
_MOST_WRAP_RAD = 25.0  # four turns
_MOST_SEGMENTS = 200  # five times those that a design is verified with
_MOST_LOSS = 5.0  # e^5: 148 N for 1 N
_SLOWEST_RAD_PER_S = 250.0  # sqrt(k/m) of a tendon: 15 m of steel rope have so much
_LONGEST_STEP_S, _LONGEST_RELAXATION_S, _LONGEST_LAG_S = 0.05, 3600.0, 5.0  # of a controller, a tendon, a filter
_LARGEST_FORCE_N = 2e4  # of an actuator: two tonnes on a tendon
_LATEST_S, _FURTHEST_BRISTLE_M = 1.0, 0.05  # a drive behind its command; a contact before it slides
_SMALLEST_N, _BEYOND = 0.1, 100.0  # a tension in kN; reach of the actuator times so much: a tension in mN
_WEAKEST_N = 1.0  # of an actuator, less is in kN
_SHORTEST_REFERENCE_S = 0.1
_LEAST_MARGIN_DEG = 3.0  # less of a phase is in radians
_NOTHING = 1e-3  # of the reference's peak


@dataclass(frozen=True, slots=True)
class UnitDoubt:
    """A value that looks like another unit, which a command refuses until the user accepts it.

    Attributes
    ----------
    key : str
        Dotted key that `accept` of [run] names.
    text : str
        Key, value and the likely unit.
    """

    key: str
    text: str

    def __str__(self) -> str:
        return self.text


def unaccepted(found: Iterable[UnitDoubt], run: Run) -> tuple[UnitDoubt, ...]:
    """Doubts, each once, without those that `accept` of [run] has answered."""
    return tuple(doubt for doubt in dict.fromkeys(found) if doubt.key not in run.accept)


def settle(found: Iterable[UnitDoubt], *, file: str, accept: bool) -> tuple[str, ...]:
    """Doubts as warnings where the user goes on all the same; else InputError with all of them and the way out."""
    doubts = tuple(found)
    texts = tuple(map(str, doubts))
    if doubts and not accept:
        keys = ", ".join(f'"{key}"' for key in dict.fromkeys(doubt.key for doubt in doubts))
        asked = "; ".join(texts)
        end = "" if asked.endswith("?") else "."
        raise InputError(
            f"{file}: {asked}{end} Nothing was computed: correct this, or go on all the same with --yes or, "
            f"for good, with accept = [{keys}] in [run]"
        )
    return texts


def scenario_doubts(scenario: Scenario) -> tuple[UnitDoubt, ...]:
    """Doubts about the numbers of a scenario file, but for its reference: empty for a sound one."""
    given = scenario.transmission
    # An actuator that is doubted itself is no measure of the tendon.
    force_N = given.actuator.force_max_N / (1 if given.actuator.force_max_N <= _LARGEST_FORCE_N else 1e3)
    found = [*rope_doubts(given.path, given.tendon, given.friction, force_N)]
    found += [*_of_drive(given), *_of_load(given.load), *step_doubts(scenario.run), *feedback_doubts(scenario.feedback)]
    stream = scenario.stream or Stream()
    if stream.lag_max_s > _LONGEST_LAG_S:
        found += [_milliseconds("stream.lag_max_s", stream.lag_max_s)]
    if stream.preview_s > 2 * _LONGEST_LAG_S:
        found += [_milliseconds("stream.preview_s", stream.preview_s)]
    for name, joint in scenario.joints.items():
        found += angle_doubt(f"joints.{name}", furthest_rad(joint))
        found += angle_doubt(f"joints.{name}.range_rad", max(map(abs, joint.range_rad or (0.0,))))
    return unaccepted(found, scenario.run)


def scenario_notes(transmission: Transmission) -> tuple[str, ...]:
    """Notes on numbers that contradict each other without being in another unit."""
    motor = transmission.actuator.motor
    if motor is None or not (motor.stall_torque_N_m or math.inf) < motor.torque_max_N_m:
        return ()
    note = (
        f"[actuator.motor] stall_torque_N_m = {motor.stall_torque_N_m:g} is below torque_max_N_m = "
        f"{motor.torque_max_N_m:g}, so the motor never gives that: the torque at standstill?"
    )
    return (note,)


def reference_doubts(transmission: Transmission, tension_N: FloatArray, run: Run) -> tuple[UnitDoubt, ...]:
    """Doubts about a reference, shape (n,), as it is sampled or as its file has it."""
    peak, load, actuator = float(np.max(tension_N)), transmission.load, transmission.actuator
    force_N, name = actuator.largest_force_N, actuator.largest_force_name
    found = []
    if peak > largest_tension(transmission) and peak > _BEYOND * force_N:
        if actuator.motor is None and force_N < _WEAKEST_N:
            text = f"the reference has a peak of {peak:.4g} N; kN? Then it is {1e3 * force_N:g}"
            found.append(value_doubt("actuator.force_max_N", force_N, text))
        else:
            text = f"its peak is {peak:.4g} N where {name} = {force_N:g}: mN?"
            found.append(UnitDoubt("reference.tension_N", f"[reference] {text}"))
    elif peak < max(_SMALLEST_N, 1e-3 * force_N):
        found.append(UnitDoubt("reference.tension_N", f"[reference] the tension stays below {peak:.3g} N: kN?"))
    elif load.joint is None and peak / load.stiffness_N_per_m > 1:
        text = f"the reference moves the load by {peak / load.stiffness_N_per_m:.3g} m: N/mm?"
        found.append(value_doubt("load.stiffness_N_per_m", load.stiffness_N_per_m, text))
    return unaccepted(found, run)


def length_doubts(spec: object, duration_s: float, run: Run) -> tuple[UnitDoubt, ...]:
    """A doubt about so many steps that the times or the step may be in another unit, by the key that has them."""
    steps = duration_s / run.step_s
    if not steps > LONG_RUN:
        return ()
    if duration_s / 1e3 < _SHORTEST_REFERENCE_S:
        text = f"{duration_s:g} s are {steps:.0f} steps, which takes long; a controller's period is 1e-4 to 1e-2 s"
        return unaccepted([value_doubt("run.step_s", run.step_s, text)], run)
    key = next(name for name in ("times_s", "file", "duration_s") if hasattr(spec, name))
    text = (
        f"[reference] {key}: {duration_s:g} s in steps of {run.step_s:g} s are {steps:.0f} steps, which takes long: "
        f"milliseconds? Then it is {duration_s / 1e3:g} s. A larger step_s or a part of the reference takes less"
    )
    return unaccepted([UnitDoubt(f"reference.{key}", text)], run)


def out_of_reach(transmission: Transmission, time_s: float, peak_N: float) -> str:
    """Message on the force needed at the peak of a reference, where the actuator cannot give it; else empty."""
    actuator, most = transmission.actuator, largest_tension(transmission)
    if peak_N <= most:
        return ""
    name, needed = actuator.largest_force_name, needed_force(transmission, peak_N)
    asked = f"the peak of {peak_N:.4g} N at t = {time_s:g} s needs {needed:.4g} N through the friction"
    given = f"{name} = {actuator.largest_force_N:g}"
    if is_nothing(most, peak_N):
        return f"{asked}, of {given} nothing arrives; raise {name} or bend the path less"
    return (
        f"{asked}, {given} delivers at most {most:.4g} N by slow pulling, and more only in passing; lower the "
        f"reference or raise {name}"
    )


def is_nothing(most_N: float, peak_N: float) -> bool:
    """Return True where a tension is none beside the peak of a reference, which lowered to it would ask for nothing."""
    return most_N < _NOTHING * peak_N


def reach_notes(transmission: Transmission, time_s: FloatArray, tension_N: FloatArray, file: str) -> tuple[str, ...]:
    """The same of a reference, shape (n,), as a warning that names `file`."""
    top = int(np.argmax(tension_N))
    beyond = out_of_reach(transmission, float(time_s[top]), float(tension_N[top]))
    return (Danger(f"{file} [reference]: {beyond}"),) if beyond else ()


def needed_force(transmission: Transmission, peak_N: float) -> float:
    """Force of the actuator for an output tension reached by slow pulling [N]."""
    pulled = CapstanLaw.of(transmission).input_for_N(peak_N, Branch.PULL)
    return float(transmission.actuator.law.force_N(pulled, 1.0))


def largest_tension(transmission: Transmission) -> float:
    """Largest output tension that the actuator reaches by slow pulling [N]."""
    actuator = transmission.actuator
    return CapstanLaw.of(transmission).largest_output_N(actuator.law.pulled_N(actuator.largest_force_N))


def force_doubts(transmission: Transmission, force_N: FloatArray, run: Run, *, file: str) -> tuple[UnitDoubt, ...]:
    """Doubts about a force file, shape (n,)."""
    highest, most, found = float(force_N.max()), transmission.actuator.force_max_N, []
    if highest > _BEYOND * most:
        found.append(UnitDoubt("force", f"{file} asks for {highest:.4g} N where force_max_N is {most:g}: mN?"))
    elif highest < 0:
        found.append(UnitDoubt("force", f"{file}: every force is below zero, up to {highest:.3g} N: another sign?"))
    elif highest < _SMALLEST_N:
        found.append(UnitDoubt("force", f"{file}: the force stays below {highest:.3g} N: kN?"))
    return unaccepted(found, run)


def force_notes(
    transmission: Transmission, force_N: FloatArray, initial_tension_N: float, *, file: str
) -> tuple[str, ...]:
    """Notes on a force file, shape (n,): beyond the actuator, or with a jump at the start."""
    actuator = transmission.actuator
    lowest, highest, first = float(force_N.min()), float(force_N.max()), float(force_N[0])
    found = []
    if highest > actuator.force_max_N:
        found.append(
            f"{file} asks for {highest:.4g} N where force_max_N is {actuator.force_max_N:g}: simulated as it is"
        )
    if lowest < actuator.force_min_N:
        found.append(
            f"{file} asks for {lowest:.4g} N where force_min_N is {actuator.force_min_N:g}: simulated as it is"
        )
    if (jump := abs(first - initial_tension_N)) > 1e-6 * max(initial_tension_N, 1.0):
        found.append(
            f"{file} starts at {first:.6g} N, but the run starts at rest at {initial_tension_N:.6g} N: the force jumps "
            f"by {jump:.3g} N at t = 0"
        )
    return tuple(found)


def angle_doubt(key: str, most_rad: float, where: str = "") -> list[UnitDoubt]:
    """A doubt about the furthest angle of a joint or of a key [rad]; none where it may be radians."""
    text = f"{where or f'[{key}]'}: it turns to {most_rad:.4g} rad: degrees? Then it is {math.radians(most_rad):.4g}"
    return [UnitDoubt(key, text)] if most_rad > FURTHEST_RAD else []


def furthest_rad(joint: Joint) -> float:
    """Largest angle that a joint's keys give, either way [rad]; 0 for one whose motion is in a file."""
    match joint:
        case ConstantJoint():
            return abs(joint.angle_rad)
        case SineJoint():
            return max(abs(joint.offset_rad), *(abs(amplitude) for amplitude in joint.amplitudes_rad))
        case CsvJoint():
            return 0.0
        case _:
            return max(abs(angle) for angle in joint.angles_rad)


def step_doubts(run: Run) -> Iterator[UnitDoubt]:
    """A doubt about the step of a controller."""
    if run.step_s > _LONGEST_STEP_S:
        yield _milliseconds("run.step_s", run.step_s)


def feedback_doubts(feedback: Feedback | None) -> Iterator[UnitDoubt]:
    """Doubts about a feedback's times, its margin and the steps of its encoder."""
    if feedback is None:
        return
    for key in ("delay_s", "sample_s"):
        if (time := getattr(feedback, key) or 0.0) > _LATEST_S:
            yield _milliseconds(f"feedback.{key}", time)
    if (margin := feedback.phase_margin_deg) < _LEAST_MARGIN_DEG:
        yield value_doubt("feedback.phase_margin_deg", margin, f"radians? Then it is {math.degrees(margin):.4g}")
    if feedback.sensor is not FeedbackSensor.OUTPUT_TENSION and (step := feedback.resolution) > FURTHEST_RAD:
        yield value_doubt("feedback.resolution", step, f"steps a turn? Then it is {math.tau / step:.4g}")


def gear_doubts(key: str, ratio: float) -> Iterator[UnitDoubt]:
    """A doubt about a gear that makes the drum faster than the motor."""
    if ratio < 1:
        text = f"the drum would turn faster than the motor; drum over motor? Then it is {1 / ratio:.4g}"
        yield value_doubt(key, ratio, text)


def speed_doubts(key: str, speed_rad_per_s: float | None) -> Iterator[UnitDoubt]:
    """A doubt about the speed of a motor."""
    if (speed_rad_per_s or 0.0) > LARGEST_SPEED_RAD_PER_S:
        text = f"turns a minute? Then it is {(speed_rad_per_s or 0.0) * math.pi / 30:.4g}"
        yield value_doubt(key, speed_rad_per_s or 0.0, text)


class LateDrive(Protocol):
    """Times between a command and a drive of any kind."""

    @property
    def servo_time_s(self) -> float | None:
        """Lag."""

    @property
    def delay_s(self) -> float | None:
        """Dead time."""

    @property
    def command_interval_s(self) -> float | None:
        """Time between two commands."""


def late_doubts(table: str, drive: LateDrive) -> Iterator[UnitDoubt]:
    """Doubts about what lies between a command and the drive of a table."""
    times = {
        "servo_time_s": drive.servo_time_s,
        "delay_s": drive.delay_s,
        "command_interval_s": drive.command_interval_s,
    }
    for key, time in times.items():
        if (time or 0.0) > _LATEST_S:
            yield _milliseconds(f"{table}.{key}", time or 0.0)


def radius_doubts(key: str, radius_m: float) -> Iterator[UnitDoubt]:
    """A doubt about a drum's radius or a moment arm, of either sign."""
    if abs(radius_m) > LARGEST_DRUM_M:
        yield value_doubt(key, radius_m, f"millimetres? Then it is {radius_m / 1e3:g}")


def rope_doubts(path: Path, tendon: Tendon, friction: Friction, force_N: float) -> Iterator[UnitDoubt]:
    """Doubts about one tendon, its path and its friction, with a force of the size that pulls it [N]."""
    angle, stiffness = path.total_angle_rad, tendon.stiffness_N_per_m
    if angle > _MOST_WRAP_RAD:
        turns = angle / (2 * math.pi)
        text = f"is {turns:.3g} turns: degrees? Then it is {math.radians(angle):.4g}"
        yield UnitDoubt("path.total_angle_rad", f"[path] total_angle_rad = {angle:g} {text}")
    if path.segments > _MOST_SEGMENTS:
        text = f"[path] segments = {path.segments}: so many masses take long, and 3 to 12 are usual"
        yield UnitDoubt("path.segments", text)
    if path.radius_m is not None and path.radius_m > 5:
        yield value_doubt("path.radius_m", path.radius_m, f"millimetres? Then it is {path.radius_m / 1e3:g}")
    for section in path.sections:
        if (length := section.length_m or 0.0) > 50:
            text = f'[path] section "{section.name}": length_m = {length:g}: millimetres? Then it is {length / 1e3:g}'
            yield UnitDoubt("path.sections.length_m", text)
    stretch = force_N / stiffness
    softer = f"N/mm? Then it is {1e3 * stiffness:g}"
    if stiffness < 300:
        yield value_doubt("tendon.stiffness_N_per_m", stiffness, f"softer than a rubber band; {softer}")
    elif stretch > 1:
        text = f"{force_N:.3g} N stretch the tendon by {stretch:.2g} m; {softer}"
        yield value_doubt("tendon.stiffness_N_per_m", stiffness, text)
    elif stiffness > 1e8:
        text = "stiffer than a steel bar; a diameter in millimetres?"
        yield value_doubt("tendon.stiffness_N_per_m", stiffness, text)
    if tendon.mass_kg > 1 or (stiffness >= 300 and stiffness / tendon.mass_kg < _SLOWEST_RAD_PER_S**2):
        yield value_doubt(
            "tendon.mass_kg", tendon.mass_kg, f"{_grams(tendon.mass_kg)}. Where it follows from length_m, metres?"
        )
    if (time := tendon.relaxation_time_s or 0.0) > _LONGEST_RELAXATION_S:
        yield _milliseconds("tendon.relaxation_time_s", time)
    yield from _of_friction(friction, angle, force_N)


def value_doubt(key: str, value: float, text: str) -> UnitDoubt:
    """Doubt about the value of a dotted key."""
    table, _, name = key.rpartition(".")
    return UnitDoubt(key, f"[{table}] {name} = {value:g}: {text}")


def _milliseconds(key: str, value_s: float) -> UnitDoubt:
    return value_doubt(key, value_s, f"milliseconds? Then it is {value_s / 1e3:g}")


def _grams(mass_kg: float) -> str:
    return f"grams? Then it is {mass_kg / 1e3:g}"


def _of_friction(friction: Friction, angle_rad: float, force_N: float) -> Iterator[UnitDoubt]:
    mu = friction.mu_dynamic
    if mu > 1.5:
        yield value_doubt("friction.mu_dynamic", mu, f"per cent? Then it is {mu / 100:g}")
    elif angle_rad <= _MOST_WRAP_RAD and mu * angle_rad > _MOST_LOSS:
        yield UnitDoubt(
            "friction.mu_dynamic",
            f"[friction] mu_dynamic = {mu:g} over {angle_rad:g} rad: 1 N at the far end needs "
            f"{math.exp(min(mu * angle_rad, 100.0)):.3g} N; is the angle in radians, the sum of all bends?",
        )
    for key in ("soft_bristle_stiffness_N_per_m", "bristle_stiffness_N_per_m"):
        if (stiffness := getattr(friction, key)) * _FURTHEST_BRISTLE_M < force_N:
            bent = f"{force_N:.3g} N bend the contact by {force_N / stiffness:.2g} m"
            yield value_doubt(f"friction.{key}", stiffness, f"{bent}; N/mm? Then it is {1e3 * stiffness:g}")


def _of_drive(transmission: Transmission) -> Iterator[UnitDoubt]:
    actuator = transmission.actuator
    motor, mass, servo = actuator.motor, actuator.mass_kg, actuator.servo_stiffness_N_per_m
    yield from late_doubts("actuator", actuator)
    is_heavy = mass > 200 or (mass > 5 and actuator.force_max_N / mass < 3)
    if motor is None:
        if is_heavy:
            yield value_doubt("actuator.mass_kg", mass, _grams(mass))
        if actuator.force_max_N > _LARGEST_FORCE_N:
            likely = f"mN? Then it is {actuator.force_max_N / 1e3:g}"
            yield value_doubt("actuator.force_max_N", actuator.force_max_N, likely)
    else:
        table = "actuator.motor"
        yield from gear_doubts(f"{table}.gear_ratio", motor.gear_ratio)
        if motor.drum_radius_m > LARGEST_DRUM_M:
            yield from radius_doubts(f"{table}.drum_radius_m", motor.drum_radius_m)
        elif mass > 5000 or (mass > 5 and actuator.force_max_N / mass < 0.3):
            text = f"is {mass:.3g} kg at the drum: g cm2? Then it is {1e-7 * motor.inertia_kg_m2:g}"
            yield UnitDoubt(f"{table}.inertia_kg_m2", f"[{table}] inertia_kg_m2 = {motor.inertia_kg_m2:g} {text}")
        if motor.force_max_N > _LARGEST_FORCE_N:
            text = f"is {motor.force_max_N:.3g} N at the drum: mN m? Then it is {motor.torque_max_N_m / 1e3:g}"
            yield UnitDoubt(f"{table}.torque_max_N_m", f"[{table}] torque_max_N_m = {motor.torque_max_N_m:g} {text}")
        yield from speed_doubts(f"{table}.speed_max_rad_per_s", motor.speed_max_rad_per_s)
    if servo is not None and actuator.force_max_N / servo > 0.3:
        moved = f"force_max_N moves the servo by {actuator.force_max_N / servo:.2g} m"
        yield value_doubt("actuator.servo_stiffness_N_per_m", servo, f"{moved}; N/mm? Then it is {1e3 * servo:g}")


def _of_load(load: Load) -> Iterator[UnitDoubt]:
    if load.joint is not None:  # its mass and spring have no effect
        yield from radius_doubts("load.moment_arm_m", load.moment_arm_m or 0.0)
        return
    if load.stiffness_N_per_m < 1:
        text = f"N/mm? Then it is {1e3 * load.stiffness_N_per_m:g}"
        yield value_doubt("load.stiffness_N_per_m", load.stiffness_N_per_m, text)
    if load.mass_kg > 500 or (load.mass_kg > 5 and load.stiffness_N_per_m / load.mass_kg < (2 * math.pi * 4) ** 2):
        yield value_doubt("load.mass_kg", load.mass_kg, _grams(load.mass_kg))
