"""A force profile within the limits of the actuator's motion: its speed and its travel.

The actuator's end is moved by a force, so its motion can be limited only through the transmission. The travel that a
force makes is clipped and slowed down, the end is led along it by a stiff spring, and the spring's force is the
profile: played on the same chain it moves the end alike.
"""

from dataclasses import replace

import numpy as np

from tendonff.models.chain import Chain
from tendonff.models.layout import ChainState
from tendonff.ocp.simulate import Outcome, simulate
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.limits import ForceLimits

_LEAD = 300.0  # stiffness of the leading spring over that of tendon and load in series
_TRIALS = 4
_SAME = 1e-4  # of the force's range: where the limits change no more than this they change nothing
_CORNER_S = 0.004  # half the time in which the mass may change its speed at a limit
_NEAR = 1e-3  # of the speed, or of the way: what is this close keeps it


def limit_motion(
    chain: Chain,
    force_N: Array,
    step_s: float,
    limits: ForceLimits,
    initial_tension_N: float,
    state: ChainState | None = None,
) -> Array:
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
        Uniform tension of the rest that travel counts from [N].
    state : ChainState, optional
        Where the run starts; default: that rest.

    Returns
    -------
    ndarray, shape (n,)
        The same array where no limit of the motion binds; else the best of a few tries, which range and rate of the
        force may keep from being exact.
    """
    motion = limits.motion
    if not motion.binds:
        return force_N
    travel = travel_of(chain, force_N, step_s, initial_tension_N, state)
    if travel is None or _beyond(limits, travel, step_s) <= _NEAR:
        return force_N
    start, rest = initial_tension_N, chain.rest_state(initial_tension_N).near_position_m
    stiffness = _LEAD * max(start, 1e-9) / rest
    led = chain.with_end_stiffness(stiffness, chain.far.stiffness_N_per_m)
    best, least, share = force_N, np.inf, 1.0
    for _ in range(_TRIALS):
        kept = replace(motion, speed_m_per_s=share * motion.speed_m_per_s).apply(travel, step_s)
        wanted = travel + _rounded_off(kept - travel, step_s)
        drive = start + stiffness * (wanted + rest)
        run = simulate(led, drive, step_s, initial_tension_N=start, state=state)
        if run.outcome is Outcome.FAILED:
            break
        force = start + stiffness * (wanted - (run.near_position_m - rest))
        force[0] = force_N[0]
        force = limits.apply(force, step_s, float(force_N[0]))
        found = travel_of(chain, force, step_s, start, state)
        if found is None:
            break
        beyond = _beyond(limits, found, step_s)
        force = np.where(np.abs(force - force_N) < _SAME * float(np.ptp(force_N)), force_N, force)
        if beyond < least:
            best, least = force, beyond
        if beyond <= _NEAR:
            break
        share /= 1 + beyond
    return best


def _rounded_off(change_m: Array, step_s: float) -> Array:
    """The change of a travel without the corners of the limits, where the mass would need an impulse."""
    rows = max(round(_CORNER_S / step_s), 1)
    box = np.full(2 * rows + 1, 1 / (2 * rows + 1))
    for _ in range(2):
        change_m = np.convolve(np.pad(change_m, rows, mode="edge"), box, "valid")
    return change_m


def _beyond(limits: ForceLimits, travel_m: Array, step_s: float) -> float:
    """Largest excess of speed and travel, as a share of the speed and of the way."""
    motion, way = limits.motion, max(float(np.ptp(travel_m)), 1e-9)
    speed, beyond = motion.excess(travel_m, step_s)
    fast = float(np.max(speed)) / motion.speed_m_per_s if np.isfinite(motion.speed_m_per_s) else 0.0
    return max(fast, float(np.max(beyond)) / way, 0.0)


def travel_of(
    chain: Chain, force_N: Array, step_s: float, initial_tension_N: float, state: ChainState | None = None
) -> Array | None:
    """Travel of the actuator's end from rest under a force [m]; None where the simulation fails.

    Parameters
    ----------
    chain : Chain
    force_N : ndarray, shape (n,)
    step_s : float
    initial_tension_N : float
        Of the rest that travel counts from [N].
    state : ChainState, optional
        Where the run starts; default: that rest.
    """
    run = simulate(chain, force_N, step_s, initial_tension_N=initial_tension_N, state=state)
    if run.outcome is Outcome.FAILED:
        return None
    travel: Array = run.near_position_m - chain.rest_state(initial_tension_N).near_position_m
    return travel
