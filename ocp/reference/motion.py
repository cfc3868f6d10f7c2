"""Tension and motion of the load, one from the other: its own balance under the scheme of the simulation."""

import numpy as np

from tendonff.models.parameters import Load
from tendonff.models.tendon.assembly import End, end_force
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT


def tension_of_motion(
    load: Load, position_m: Array, step_s: float, initial_tension_N: float, *, periodic: bool = False
) -> Array:
    """Output tension under which the load takes a course, x_c2 and f_c2 at rest [N], shape (n,).

    m dv/dt = f - k q - b v, counted from the rest under the initial tension [N]. The derivatives are those of the
    simulation, so that the chain, driven by the inverse of this tension, moves its load as requested to rounding.

    The position, shape (n,), is relative to the start [m], positive towards the actuator, at 0, h, 2 h ... A periodic
    course is one period of a cycle, its last row the first of the next.
    """
    course = np.asarray(position_m, dtype=np.float64)
    if periodic:
        course = np.concatenate([course[:-1], course[:-1], course])
    velocity = _rate(course, step_s)
    acceleration = _rate(velocity, step_s)
    end = End(mass_kg=load.mass_kg, damping_N_s_per_m=load.damping_N_s_per_m, stiffness_N_per_m=load.stiffness_N_per_m)
    without_tension = end_force(velocity, course, 0.0, 1.0, 0.0, 0.0, end)
    tension: Array = initial_tension_N + load.mass_kg * acceleration - without_tension
    return tension[-len(position_m) :] if periodic else tension


def motion_of_tension(
    load: Load, tension_N: Array, step_s: float, initial_tension_N: float, *, periodic: bool = False
) -> Array:
    """Position of the load under a tension, shape (n,), relative to the start [m]; inverse of `tension_of_motion`.

    A periodic course is one period of the steady cycle, its last row the first of the next.
    """
    pull = np.asarray(tension_N, dtype=np.float64) - initial_tension_N
    m, b, k = load.mass_kg, load.damping_N_s_per_m, load.stiffness_N_per_m
    if periodic:
        shift = np.exp(-2j * np.pi * np.fft.rfftfreq(len(pull) - 1))
        rate = (1 - (1 + BDF2_CARRY) * shift + BDF2_CARRY * shift**2) / (BDF2_WEIGHT * step_s)
        cycle = np.fft.irfft(np.fft.rfft(pull[:-1]) / (m * rate**2 + b * rate + k), len(pull) - 1)
        return np.append(cycle, cycle[0])
    position, velocity = np.zeros_like(pull), np.zeros_like(pull)
    for n in range(1, len(pull)):
        carry, step = (0.0, step_s) if n == 1 else (BDF2_CARRY, BDF2_WEIGHT * step_s)
        x, v = (rows[n - 1] + carry * (rows[n - 1] - rows[n - 2]) for rows in (position, velocity))
        # m (v' - v)/step + b v' + k x' = pull with x' = x + step v'
        velocity[n] = (pull[n] - k * x + m / step * v) / (m / step + b + k * step)
        position[n] = x + step * velocity[n]
    return position


def _rate(course: Array, step_s: float) -> Array:
    """Derivative under the scheme, from rest: a first-order step and then second-order ones."""
    rate = np.zeros_like(course)
    if len(course) > 1:
        rate[1] = (course[1] - course[0]) / step_s
    carried = course[1:-1] + BDF2_CARRY * (course[1:-1] - course[:-2])
    rate[2:] = (course[2:] - carried) / (BDF2_WEIGHT * step_s)
    return rate
