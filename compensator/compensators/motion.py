"""What a force means for the drive: the travel of the actuator's end, and the command of a position servo.

A force F and a command x_c1 behind the servo's stiffness k_c1 are two names of one motion: x_c1 = q_a + F/k_c1. So
every compensator answers with a force, and here it becomes the command, relative to the start at rest.
"""

from dataclasses import replace

from tendonff.compensator.compensators.base import FloatArray, Problem, Profile
from tendonff.models.chain import Chain
from tendonff.models.parameters import Actuator
from tendonff.models.parameters.drive import Drive
from tendonff.ocp.periodic import steady_response
from tendonff.ocp.tracking.motion import travel_of


def with_motion(problem: Problem, name: str, profile: Profile) -> Profile:
    """A profile with the travel on the design model and, for a position drive, the command.

    Parameters
    ----------
    name : str
        Of the compensator. "none" knows of no friction: its command is that of springs in series.
    """
    reference, actuator = problem.reference, problem.transmission.actuator
    start = reference.initial_tension_N
    travel = profile.travel_m
    if travel is None and reference.periodic:
        run, _ = steady_response(problem.chain, profile.force_N, reference.step_s, initial_tension_N=start)
        travel = run.near_position_m - problem.chain.rest_state(start).near_position_m
    elif travel is None:
        travel = travel_of(problem.chain, profile.force_N, reference.step_s, start)
    if actuator.drive is not Drive.POSITION or actuator.servo_stiffness_N_per_m is None or travel is None:
        return replace(profile, travel_m=travel)
    moved = travel
    if name == "none":
        moved = (profile.force_N - start) * problem.chain.rest_state(1.0).near_position_m
    command = moved + (profile.force_N - start) / actuator.servo_stiffness_N_per_m
    return replace(profile, travel_m=travel, command_m=command)


def servo(
    chain: Chain, actuator: Actuator, initial_tension_N: float, command_m: FloatArray
) -> tuple[Chain, FloatArray]:
    """The chain behind the servo of a position drive, and the force on it that stands for a command: k_c1 x_c1.

    The command x_c1, shape (n,), counts from the rest under the initial tension [m].
    """
    stiffness = actuator.servo_stiffness_N_per_m or 0.0
    rest = chain.rest_state(initial_tension_N).near_position_m
    drive: FloatArray = initial_tension_N + stiffness * (rest + command_m)
    return chain.with_end_stiffness(stiffness, chain.far.stiffness_N_per_m), drive
