"""Doubts: what is possible but looks like another unit, or is out of the actuator's reach.

They are found from the scenario's numbers alone, before anything is computed; nothing is ever changed by them.
"""

import math
from collections.abc import Iterator

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.scenario.joints import ConstantJoint, CsvJoint, Joint, SineJoint
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.parameters import Load, Transmission

FURTHEST_RAD = 7.0
"""No joint turns further, by a good turn."""
_MOST_WRAP_RAD = 25.0  # four turns
_MOST_LOSS = 5.0  # e^5: 148 N for 1 N
_SLOWEST_RAD_PER_S = 250.0  # sqrt(k/m) of a tendon: 15 m of steel rope have so much
_LONGEST_STEP_S = 0.05  # of a controller
_SMALLEST_N, _BEYOND = 0.1, 100.0  # a tension in kN; reach of the actuator times so much: a tension in mN


def scenario_doubts(scenario: Scenario) -> tuple[str, ...]:
    """Doubts about the numbers of a scenario file, but for its reference: empty for a sound one."""
    step = scenario.run.step_s
    found = [*_of_path_and_tendon(scenario.transmission), *_of_friction(scenario.transmission)]
    found += [*_of_drive(scenario.transmission), *_of_load(scenario.transmission.load)]
    if step > _LONGEST_STEP_S:
        found.append(f"[run] step_s = {step:g}: milliseconds? Then it is {step / 1e3:g}")
    for name, joint in scenario.joints.items():
        found += angle_doubt(f"[joints.{name}]", furthest_rad(joint))
    return tuple(found)


def reference_doubts(
    transmission: Transmission, time_s: FloatArray, tension_N: FloatArray, *, file: str
) -> tuple[str, ...]:
    """Doubts about a reference, shape (n,), as it is sampled or as its file has it; messages name `file`."""
    top = int(np.argmax(tension_N))
    peak, load = float(tension_N[top]), transmission.load
    found = []
    beyond = out_of_reach(transmission, float(time_s[top]), peak)
    if beyond:
        unit = "; mN?" if peak > _BEYOND * transmission.actuator.largest_force_N else ""
        found.append(f"{file} [reference]: {beyond}{unit}")
    elif peak < _SMALLEST_N:
        found.append(f"{file} [reference]: the tension stays below {peak:.3g} N: kN?")
    elif load.joint is None and peak / load.stiffness_N_per_m > 1:
        found.append(
            f"[load] stiffness_N_per_m = {load.stiffness_N_per_m:g}: the reference moves the load by "
            f"{peak / load.stiffness_N_per_m:.3g} m: N/mm?"
        )
    return tuple(found)


def out_of_reach(transmission: Transmission, time_s: float, peak_N: float) -> str:
    """Message on the force needed at the peak of a reference, where the actuator cannot give it; else empty."""
    actuator, most = transmission.actuator, largest_tension(transmission)
    if peak_N <= most:
        return ""
    name, needed = actuator.largest_force_name, needed_force(transmission, peak_N)
    return (
        f"the peak of {peak_N:.4g} N at t = {time_s:g} s needs {needed:.4g} N through the friction, "
        f"{name} = {actuator.largest_force_N:g} delivers at most {most:.4g} N; lower the reference or raise {name}"
    )


def needed_force(transmission: Transmission, peak_N: float) -> float:
    """Force of the actuator for an output tension reached by slow pulling [N]."""
    return float(CapstanLaw.of(transmission).input_for_N(peak_N, Branch.PULL)) + (
        transmission.actuator.coulomb_N or 0.0
    )


def largest_tension(transmission: Transmission) -> float:
    """Largest output tension that the actuator reaches by slow pulling [N]."""
    actuator = transmission.actuator
    return CapstanLaw.of(transmission).largest_output_N(actuator.largest_force_N - (actuator.coulomb_N or 0.0))


def force_doubts(
    transmission: Transmission, force_N: FloatArray, initial_tension_N: float, *, file: str
) -> tuple[str, ...]:
    """Doubts about a force file, shape (n,): beyond the actuator, in another unit, or with a jump at the start."""
    actuator = transmission.actuator
    lowest, highest, first = float(force_N.min()), float(force_N.max()), float(force_N[0])
    found = []
    if highest > actuator.force_max_N:
        unit = "; mN?" if highest > _BEYOND * actuator.force_max_N else ""
        found.append(
            f"{file} asks for {highest:.4g} N where force_max_N is {actuator.force_max_N:g}: simulated as it is{unit}"
        )
    elif highest < _SMALLEST_N:
        found.append(f"{file}: the force stays below {highest:.3g} N: kN?")
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


def angle_doubt(where: str, most_rad: float) -> list[str]:
    """A doubt about the furthest angle of a joint [rad]; none where it may be radians."""
    return [f"{where}: it turns to {most_rad:.4g} rad: degrees?"] if most_rad > FURTHEST_RAD else []


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


def _of_path_and_tendon(transmission: Transmission) -> Iterator[str]:
    path, tendon = transmission.path, transmission.tendon
    angle, stiffness = path.total_angle_rad, tendon.stiffness_N_per_m
    if angle > _MOST_WRAP_RAD:
        yield f"[path] total_angle_rad = {angle:g} is {angle / (2 * math.pi):.3g} turns: degrees?"
    if path.radius_m is not None and path.radius_m > 5:
        yield f"[path] radius_m = {path.radius_m:g}: millimetres?"
    for section in path.sections:
        if (section.length_m or 0.0) > 50:
            yield f'[path] section "{section.name}": length_m = {section.length_m:g}: millimetres?'
    stretch = transmission.actuator.force_max_N / stiffness
    if stiffness < 300:
        yield (
            f"[tendon] stiffness_N_per_m = {stiffness:g}: softer than a rubber band; N/mm? Then it is "
            f"{1e3 * stiffness:g}"
        )
    elif stretch > 1:
        yield f"[tendon] stiffness_N_per_m = {stiffness:g}: force_max_N stretches the tendon by {stretch:.2g} m; N/mm?"
    elif stiffness > 1e8:
        yield f"[tendon] stiffness_N_per_m = {stiffness:g}: stiffer than a steel bar; a diameter in millimetres?"
    if tendon.mass_kg > 1 or (stiffness >= 300 and stiffness / tendon.mass_kg < _SLOWEST_RAD_PER_S**2):
        yield (
            f"[tendon] mass_kg = {tendon.mass_kg:g}: grams? Then it is {tendon.mass_kg / 1e3:g}. Where it follows from "
            "length_m, metres?"
        )


def _of_friction(transmission: Transmission) -> Iterator[str]:
    friction, angle = transmission.friction, transmission.path.total_angle_rad
    if friction.mu_dynamic > 1.5:
        yield f"[friction] mu_dynamic = {friction.mu_dynamic:g}: per cent?"
    elif angle <= _MOST_WRAP_RAD and friction.mu_dynamic * angle > _MOST_LOSS:
        yield (
            f"[friction] mu_dynamic = {friction.mu_dynamic:g} over {angle:g} rad: 1 N at the far end needs "
            f"{math.exp(min(friction.mu_dynamic * angle, 100.0)):.3g} N; is the angle in radians, the sum of all bends?"
        )
    most = transmission.actuator.force_max_N
    for key in ("soft_bristle_stiffness_N_per_m", "bristle_stiffness_N_per_m"):
        if (stiffness := getattr(friction, key)) < most:
            yield f"[friction] {key} = {stiffness:g}: force_max_N bends the contact by {most / stiffness:.2g} m; N/mm?"


def _of_drive(transmission: Transmission) -> Iterator[str]:
    actuator = transmission.actuator
    motor, mass, servo = actuator.motor, actuator.mass_kg, actuator.servo_stiffness_N_per_m
    is_heavy = mass > 200 or (mass > 5 and actuator.force_max_N / mass < 3)
    if motor is None:
        if is_heavy:
            yield f"[actuator] mass_kg = {mass:g}: grams? Then it is {mass / 1e3:g}"
    else:
        if motor.drum_radius_m > 1:
            yield f"[actuator.motor] drum_radius_m = {motor.drum_radius_m:g}: millimetres?"
        elif mass > 5000 or (mass > 5 and actuator.force_max_N / mass < 0.3):
            yield f"[actuator.motor] inertia_kg_m2 = {motor.inertia_kg_m2:g} is {mass:.3g} kg at the drum: g cm2?"
        if (motor.stall_torque_N_m or math.inf) < motor.torque_max_N_m:
            yield (
                f"[actuator.motor] stall_torque_N_m = {motor.stall_torque_N_m:g} is below torque_max_N_m = "
                f"{motor.torque_max_N_m:g}, so the motor never gives that: the torque at standstill?"
            )
        if motor.force_max_N > 1e5:
            yield (
                f"[actuator.motor] torque_max_N_m = {motor.torque_max_N_m:g} is {motor.force_max_N:.3g} N at the drum: "
                "mN m?"
            )
        if motor.speed_max_rad_per_s > 3000:
            yield f"[actuator.motor] speed_max_rad_per_s = {motor.speed_max_rad_per_s:g}: turns a minute?"
    if servo is not None and actuator.force_max_N / servo > 0.3:
        yield (
            f"[actuator] servo_stiffness_N_per_m = {servo:g}: force_max_N moves the servo by "
            f"{actuator.force_max_N / servo:.2g} m; N/mm?"
        )


def _of_load(load: Load) -> Iterator[str]:
    if load.joint is not None:  # its mass and spring have no effect
        return
    if load.stiffness_N_per_m < 1:
        yield f"[load] stiffness_N_per_m = {load.stiffness_N_per_m:g}: N/mm?"
    if load.mass_kg > 500 or (load.mass_kg > 5 and load.stiffness_N_per_m / load.mass_kg < (2 * math.pi * 4) ** 2):
        yield f"[load] mass_kg = {load.mass_kg:g}: grams? Then it is {load.mass_kg / 1e3:g}"
