"""A force profile within the limits of the actuator's motion: its speed, its travel and its torque-speed line.

The actuator's end is moved by a force, so its motion can be limited only through the transmission. As the speed limiter
of a drive does, the force is taken back, step by step on the design model, as far as it must be and no further.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tendonff.models.layout import ChainInputs, ChainState
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.simulate import Simulator
from tendonff.ocp.tracking.limits import ForceLimits

INSIDE = 5e-3
"""Share of speed, way and line that is left, so that other plants than the model keep them too."""

APPROACH_S = 0.01
"""Time constant of the approach to a limit of the speed: faster, other masses than the model's overshoot."""

_SAME = 1e-6  # of a limit
_TRIALS = 20
_CHUNK = 64  # rows that are tried together where nothing binds


def limit_motion(
    chain: Chain,
    force_N: Array,
    step_s: float,
    limits: ForceLimits,
    initial_tension_N: float,
    state: ChainState | None = None,
) -> Array:
    """The force closest to a wanted one whose motion keeps the limits.

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
        As wanted where no limit of the motion binds, and from where the simulation fails.
    """
    if not limits.motion.binds:
        return force_N
    rest = chain.rest_state(initial_tension_N)
    governor = _Governor(
        simulator=Simulator(chain, step_s, state or rest, ChainInputs.of_force(force_N[:1])),
        limits=limits,
        step_s=step_s,
        mass_kg=chain.near.mass_kg,
        origin_m=rest.near_position_m,
        position_m=(state or rest).near_position_m - rest.near_position_m,
        speed_m_per_s=float((state or rest).vector()[chain.layout.part("v")][0]),
    )
    given, row, size = np.array(force_N, dtype=np.float64), 1, _CHUNK
    while row < len(given):
        done = governor.free_rows(given[row : row + size]) if size > 1 else 0
        size = min(2 * size, 64 * _CHUNK) if done else 1
        row += done
        if not done:
            before, slew = given[row - 1], limits.rate_N_per_s * step_s
            low, high = max(before - slew, limits.minimum_N), min(before + slew, limits.maximum_N)
            force = governor.step(min(max(force_N[row], low), high), low, high, 2 * before - given[max(row - 2, 0)])
            if force is None:
                return given
            given[row], row = force, row + 1
            size = _CHUNK if force == force_N[row - 1] else 1
    return given


@dataclass(slots=True, kw_only=True)
class _Governor:
    """The chain as it moves, and what force the limits admit next."""

    simulator: Simulator
    limits: ForceLimits
    step_s: float
    mass_kg: float
    origin_m: float
    position_m: float
    speed_m_per_s: float

    def free_rows(self, force_N: Array) -> int:
        """Move on for as long as no limit is reached, and say for how many rows."""
        start = self.simulator.checkpoint()
        moved = self.simulator.advance(ChainInputs.of_force(force_N)).ends_m[:, 0] - self.origin_m
        speed = np.diff(moved, prepend=self.position_m) / self.step_s
        before = np.concatenate([[self.speed_m_per_s], speed[:-1]])
        beyond = np.maximum(*self._beyond(force_N[: len(moved)], moved, speed, before))
        reached = np.flatnonzero(beyond > 0)
        done = int(reached[0]) if reached.size else len(moved)
        if done < len(force_N):
            self.simulator.restore(start)
            if done:
                self.simulator.advance(ChainInputs.of_force(force_N[:done]))
        if done:
            self.position_m, self.speed_m_per_s = float(moved[done - 1]), float(speed[done - 1])
        return done

    def step(self, wanted_N: float, low_N: float, high_N: float, guess_N: float) -> float | None:
        """Move on by one row with the force closest to the wanted one that the limits admit; None where it fails."""
        start = self.simulator.checkpoint()

        def beyond(force: float) -> tuple[float, float] | None:
            self.simulator.restore(start)
            ends = self.simulator.advance(ChainInputs.of_force(np.array([force]))).ends_m
            if not len(ends):
                return None
            moved = ends[:, 0] - self.origin_m
            speed = (moved - self.position_m) / self.step_s
            pulling, releasing = self._beyond(np.array([force]), moved, speed, np.array([self.speed_m_per_s]))
            found.append((force, float(moved[0]), float(speed[0])))
            return float(pulling[0]), float(releasing[0])

        found: list[tuple[float, float, float]] = []
        first = beyond(wanted_N)
        if first is None:
            return None
        if max(first) > 0:
            side = int(first[1] > first[0])
            bound_N = high_N if side else low_N
            tried = functools.partial(_one_side, beyond, side)
            if not _root(tried, wanted_N, first[side], bound_N, self._tolerance, guess_N):
                return None
        force, self.position_m, self.speed_m_per_s = found[-1]
        return force

    @property
    def _tolerance(self) -> float:
        motion = self.limits.motion
        way = (motion.high_m - motion.low_m) / APPROACH_S
        return _SAME * min(x for x in (motion.speed_m_per_s, motion.no_load_m_per_s, way, 1.0))

    def _beyond(self, force_N: Array, moved_m: Array, speed: Array, before: Array) -> tuple[Array, Array]:
        """Excess of the speed that the end is about to reach, pulling and releasing [m/s]."""
        motion, change = self.limits.motion, (speed - before) / self.step_s
        inside = 1 - INSIDE
        found = []
        for side, end in ((1.0, motion.high_m), (-1.0, -motion.low_m)):
            v, a, room = side * speed, np.maximum(side * change, 0.0), inside * end - side * moved_m
            # What is coming within the time of approach, or until the rate of the force has stopped the mass.
            coming = v + np.maximum(a * APPROACH_S, self.mass_kg * a**2 / (2 * self.limits.rate_N_per_s))
            most = np.minimum(inside * motion.speed_m_per_s, room / max(APPROACH_S, 2 * self.step_s))
            if motion.line_N_s_per_m:
                most = np.minimum(most, (inside * motion.stall_N - side * force_N) / motion.line_N_s_per_m)
            found.append(coming - most - self._tolerance)
        return found[0], found[1]


def _one_side(beyond: Callable[[float], tuple[float, float] | None], side: int, force_N: float) -> float | None:
    found = beyond(force_N)
    return None if found is None else found[side]


def _root(
    beyond: Callable[[float], float | None], wanted_N: float, excess: float, bound_N: float, near: float, guess_N: float
) -> bool:
    """Try forces until the excess just vanishes, or stop at the bound where it never does: secants, or halves.

    Returns False where a trial fails; else the last one tried is the answer.
    """
    outside, inside, before = wanted_N, None, (wanted_N, excess)
    force = guess_N if min(wanted_N, bound_N) < guess_N < max(wanted_N, bound_N) else bound_N
    for trial in range(_TRIALS):
        found = beyond(force)
        if found is None or -2 * near <= found <= 0 or (force == bound_N and found > 0):
            return found is not None
        outside, inside = (force, inside) if found > 0 else (outside, force)
        rise = (found - before[1]) / (force - before[0]) if force != before[0] else 0.0
        before, last = (force, found), bound_N if inside is None else inside
        force -= (found + near) / rise if rise else 0.0  # to the middle of what is accepted
        if not min(outside, last) < force < max(outside, last) or trial % 4 == 3:
            force = last if inside is None else 0.5 * (outside + last)
    return True
