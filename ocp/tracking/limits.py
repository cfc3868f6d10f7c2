"""Limits of the actuator: a range of force and a largest rate, and the profiles within both."""

import math
from dataclasses import dataclass

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.parameters import Actuator
from tendonff.ocp.step.protocol import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """A bound that a profile breaks, or the one it comes closest to.

    Attributes
    ----------
    name : str
        Bound, as the user writes it.
    time_s : float
        Time of the sample [s].
    value, bound : float
        What was found and what is allowed, in the bound's unit.
    excess : float
        How far beyond the bound, same unit; negative inside.
    """

    name: str
    time_s: float
    value: float
    bound: float
    excess: float

    def __str__(self) -> str:
        """In words."""
        where = f"{self.name} = {self.bound:.6g}: {self.value:.6g} at t = {self.time_s:.6g} s"
        return f"{where}, {self.excess:.3g} beyond" if self.excess > 0 else where


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLimits:
    """Speed and travel of the actuator's end, and the torque-speed line of its motor.

    The line bounds force and speed together, as the supply's voltage does: abs(f + stall_N v/no_load) <= stall_N.

    Attributes
    ----------
    speed_m_per_s : float
        Largest speed, either way [m/s], > 0; infinite for none.
    low_m, high_m : float
        Range of the position relative to the start [m], low <= 0 <= high; infinite for none.
    stall_N, no_load_m_per_s : float
        Ends of the line [N], [m/s], > 0; infinite for none.
    """

    speed_m_per_s: float = math.inf
    low_m: float = -math.inf
    high_m: float = math.inf
    stall_N: float = math.inf
    no_load_m_per_s: float = math.inf

    @property
    def binds(self) -> bool:
        """Some limit is finite."""
        return any(map(math.isfinite, (self.speed_m_per_s, self.low_m, self.high_m, self.stall_N)))

    @property
    def line_N_s_per_m(self) -> float:
        """Force that a speed takes from the motor by the line [N s/m]; 0 without one."""
        return self.stall_N / self.no_load_m_per_s if math.isfinite(self.stall_N) else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceLimits:
    """Range and rate of the actuator's force, and the limits of its motion.

    Parameters
    ----------
    minimum_N, maximum_N : float
        Range [N], minimum < maximum.
    rate_N_per_s : float
        Largest rate of change, either way [N/s], > 0.
    motion : MotionLimits, optional
        Default: none.
    maximum_name : str, optional
        Where the maximum comes from, as the user writes it.
    """

    minimum_N: float
    maximum_N: float
    rate_N_per_s: float
    motion: MotionLimits = MotionLimits()
    maximum_name: str = "force_max_N"

    def __post_init__(self) -> None:
        if not self.minimum_N < self.maximum_N:
            raise ParameterError(
                f"force_min_N must be below {self.maximum_name} = {self.maximum_N:g}, got {self.minimum_N:g}; "
                "no force lies between them"
            )
        if not self.rate_N_per_s > 0:
            raise ParameterError(
                f"force_rate_max_N_per_s must be > 0, got {self.rate_N_per_s}; give a large number for no limit"
            )

    @classmethod
    def of(cls, actuator: Actuator) -> "ForceLimits":
        """Limits of an actuator."""
        motor, stall, no_load = actuator.motor, math.inf, math.inf
        if motor is not None and motor.stall_torque_N_m and motor.no_load_speed_rad_per_s:
            stall = motor.stall_force_N
            no_load = motor.no_load_speed_rad_per_s * motor.travel_per_rad_m
        return cls(
            minimum_N=actuator.force_min_N,
            maximum_N=actuator.largest_force_N,
            maximum_name=actuator.largest_force_name,
            rate_N_per_s=actuator.force_rate_max_N_per_s,
            motion=MotionLimits(
                speed_m_per_s=math.inf if actuator.speed_max_m_per_s is None else actuator.speed_max_m_per_s,
                low_m=-math.inf if actuator.travel_min_m is None else actuator.travel_min_m,
                high_m=math.inf if actuator.travel_max_m is None else actuator.travel_max_m,
                stall_N=stall,
                no_load_m_per_s=no_load,
            ),
        )

    def start(self, tension_N: float) -> float:
        """Force of row 0: what holds the tension T0 at rest, or the nearest force in range [N]."""
        return min(max(tension_N, self.minimum_N), self.maximum_N)

    def apply(self, force_N: Array, step_s: float, start_N: float | None = None) -> Array:
        """Profile as applied by the actuator: clipped, and never faster than its rate.

        Parameters
        ----------
        force_N : ndarray, shape (n,)
            Wanted force at 0, h, 2 h ... [N].
        step_s : float
            h [s].
        start_N : float, optional
            Force of row 0, brought into range [N]; default: the first wanted force.

        Returns
        -------
        ndarray, shape (n,)
        """
        given = np.clip(np.asarray(force_N, dtype=np.float64), self.minimum_N, self.maximum_N)
        given[0] = self.start(float(given[0]) if start_N is None else start_N)
        return _slowed(given, self.rate_N_per_s * step_s)

    def worst(self, force_N: Array, step_s: float) -> Violation:
        """The bound that a profile, shape (n,) [N], breaks most, relative to its size, or comes closest to."""
        force = np.asarray(force_N, dtype=np.float64)
        rate = np.diff(force) / step_s
        low, high = int(np.argmin(force)), int(np.argmax(force))
        found = [
            self._violation("force_min_N", low * step_s, float(force[low]), self.minimum_N, -1.0),
            self._violation(self.maximum_name, high * step_s, float(force[high]), self.maximum_N, 1.0),
        ]
        if rate.size:
            fast = int(np.argmax(np.abs(rate)))
            name, bound = "force_rate_max_N_per_s", self.rate_N_per_s
            found.append(self._violation(name, fast * step_s, float(abs(rate[fast])), bound, 1.0))
        return max(found, key=lambda v: v.excess / self._size(v.name))

    def admits(self, force_N: Array, step_s: float, tolerance: float = 1e-6) -> bool:
        """Whether a profile, shape (n,) [N], respects range and rate, each to a share of its size."""
        worst = self.worst(force_N, step_s)
        return worst.excess <= tolerance * self._size(worst.name)

    def _size(self, name: str) -> float:
        size = self.rate_N_per_s if name == "force_rate_max_N_per_s" else self.maximum_N - self.minimum_N
        return size if size < math.inf else 1.0

    @staticmethod
    def _violation(name: str, time_s: float, value: float, bound: float, side: float) -> Violation:
        return Violation(name=name, time_s=time_s, value=value, bound=bound, excess=side * (value - bound))


_ROUNDING = 1e-12


def _slowed(wanted: Array, most: float) -> Array:
    """Series that follows given values in bounded steps from the first one; applied twice it changes nothing."""
    fast = (np.flatnonzero(np.abs(np.diff(wanted)) > (1 + _ROUNDING) * most) + 1).tolist()
    given: list[float] = wanted.tolist()
    row = 0
    for start in fast:
        if start < row:  # still on the way since an earlier one
            continue
        now = given[start - 1]
        for row in range(start, len(given)):
            target = given[row]
            given[row] = now = min(max(target, now - most), now + most)
            if now == target:
                break
    return np.array(given)
