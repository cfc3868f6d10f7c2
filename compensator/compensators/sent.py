"""Commands of a drive that is not ideal: what it adds to them is taken back, as far as the reference is known ahead."""

from dataclasses import replace

import numpy as np

from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import FloatArray, Profile
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.models.parameters.drive import Drive
from tendonff.models.servo import CommandHold
from tendonff.ocp.tracking.held import MOVES, improve_samples

_MOST_SAMPLES = 400  # of held commands that are improved on the plant, with a simulation for each
_FINE_MOVES = 2  # of the search at half the step: a third does nothing
_NUDGE = 1e-3  # of a command's range, for slopes


def sent(plant: Plant, profile: Profile, reference: Reference, *, live: bool, improve: bool) -> Profile:
    """A profile with the command whose answer is its force or its position.

    Live, the time that `Servo.lag_s` states remains. Held commands that are to be improved are those whose output on
    the plant is nearest to that of the force.
    """
    drive, servo = plant.transmission.actuator.drive, plant.transmission.actuator.servo
    ideal = profile.setpoint(drive)
    if live or not reference.periodic:
        command = servo.command(ideal, reference.step_s, live=live)
    else:
        cycles = np.concatenate([ideal[:-1], ideal[:-1], ideal])  # the middle one knows what comes before and after
        command = servo.command(cycles, reference.step_s)[len(ideal) - 1 : 2 * len(ideal) - 1].copy()
        command[-1] = command[0]
    interval = servo.command_interval_s or 0.0
    held = servo.command_hold is CommandHold.HOLD and interval > reference.step_s
    if improve and held and not live and not reference.periodic:
        command = _improved(plant, profile, command, interval, reference)
    return _with_command(profile, command, drive)


def _with_command(profile: Profile, command: FloatArray, drive: Drive) -> Profile:
    if drive is Drive.POSITION:
        return replace(profile, command_m=command)
    return replace(profile, command_N=command)


def _improved(
    plant: Plant, profile: Profile, command: FloatArray, interval_s: float, reference: Reference
) -> FloatArray:
    drive, time = plant.transmission.actuator.drive, np.arange(len(command)) * reference.step_s
    at = np.arange(0.0, time[-1] + interval_s, interval_s)
    if len(at) > _MOST_SAMPLES:
        return command
    force = Plant.by_force(plant.transmission, plant.level, plant.joints)
    samples, nudge = np.interp(at, time, command), _NUDGE * float(np.ptp(command))
    # A step of the command rings within a step of the design, which shorter steps show: from near the answer only, for
    # from afar their error is rougher.
    for refinement, moves in ((plant.refinement, MOVES), (2 * plant.refinement, _FINE_MOVES)):
        judge = replace(plant, refinement=refinement)
        free = replace(force, refinement=refinement)
        wanted = free.respond(replace(profile, command_m=None, command_N=None), reference).require().output_N

        def respond(samples: FloatArray, judge: Plant = judge) -> FloatArray:
            tried = _with_command(profile, np.interp(time, at, samples), drive)
            return judge.respond(tried, reference).require().output_N

        samples = improve_samples(respond, samples, wanted, nudge, moves)
    line: FloatArray = np.interp(time, at, samples)
    return line
