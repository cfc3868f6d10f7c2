"""A force profile within the limits of the actuator's motion: its speed and its travel.

The actuator's end is moved by a force, so its motion can be limited only through the transmission. The travel that a
force makes is clipped and slowed down, the end is led along it by a stiff spring, and the spring's force is the
profile: played on the same chain it moves the end alike.
"""

import numpy as np

from tendonff.models.chain import Chain
from tendonff.ocp.simulate import Outcome, simulate
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.limits import ForceLimits

_LEAD = 300.0  # stiffness of the leading spring over that of tendon and load in series
_TRIALS = 4
_NEAR = 1e-3  # of the speed: what is this close keeps it


def limit_motion(chain: Chain, force_N: Array, step_s: float, limits: ForceLimits, initial_tension_N: float) -> Array:
    """The force whose motion keeps the limits and is otherwise that of a wanted one.

    Parameters
    ----------
    chain : Chain
        Its near end must act.
    force_N : ndarray, shape (n,)
        Wanted force within range and rate [N].
    step_s : float
        Time between rows [s].
    limits : ForceLimits
    initial_tension_N : float
        Uniform tension of the start at rest [N].

    Returns
    -------
    ndarray, shape (n,)
        The same array where no limit of the motion binds; else the best of a few tries, which range and rate of the
        force may keep from being exact.
    """
    motion = limits.motion
    if not motion.binds:
        return force_N
    travel = travel_of(chain, force_N, step_s, initial_tension_N)
    if travel is None or _within(limits, travel, step_s):
        return force_N
    rest = chain.rest_state(initial_tension_N).near_position_m
    stiffness = _LEAD * max(initial_tension_N, 1e-9) / rest
    led = chain.with_end_stiffness(stiffness, chain.far.stiffness_N_per_m)
    best, least, share = force_N, np.inf, 1.0
    for _ in range(_TRIALS):
        slower = type(motion)(speed_m_per_s=share * motion.speed_m_per_s, low_m=motion.low_m, high_m=motion.high_m)
        wanted = slower.apply(travel, step_s)
        run = simulate(
            led, initial_tension_N + stiffness * (wanted + rest), step_s, initial_tension_N=initial_tension_N
        )
        if run.outcome is Outcome.FAILED:
            break
        force = initial_tension_N + stiffness * (wanted - (run.near_position_m - rest))
        force = limits.apply(force, step_s, initial_tension_N)
        found = travel_of(chain, force, step_s, initial_tension_N)
        if found is None:
            break
        excess = float(np.max(motion.excess(found, step_s)[0]) / motion.speed_m_per_s)
        if excess < least:
            best, least = force, excess
        if _within(limits, found, step_s):
            break
        share /= 1 + max(excess, _NEAR)
    return best


def travel_of(chain: Chain, force_N: Array, step_s: float, initial_tension_N: float) -> Array | None:
    """Travel of the actuator's end from rest under a force [m]; None where the simulation fails.

    Parameters
    ----------
    chain : Chain
    force_N : ndarray, shape (n,)
    step_s : float
    initial_tension_N : float
    """
    run = simulate(chain, force_N, step_s, initial_tension_N=initial_tension_N)
    if run.outcome is Outcome.FAILED:
        return None
    travel: Array = run.near_position_m - run.near_position_m[0]
    return travel


def _within(limits: ForceLimits, travel_m: Array, step_s: float) -> bool:
    speed, beyond = limits.motion.excess(travel_m, step_s)
    slack = _NEAR * max(float(np.ptp(travel_m)), 1e-9)
    return bool(np.max(speed) <= _NEAR * limits.motion.speed_m_per_s and np.max(beyond) <= slack)
