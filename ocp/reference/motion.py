"""The tension that a motion of the load asks for: the load's own balance under the scheme of the simulation."""

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


def _rate(course: Array, step_s: float) -> Array:
    """Derivative under the scheme, from rest: a first-order step and then second-order ones."""
    rate = np.zeros_like(course)
    if len(course) > 1:
        rate[1] = (course[1] - course[0]) / step_s
    carried = course[1:-1] + BDF2_CARRY * (course[1:-1] - course[:-2])
    rate[2:] = (course[2:] - carried) / (BDF2_WEIGHT * step_s)
    return rate
