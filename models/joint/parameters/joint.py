"""The joint that tendons turn."""

import math
from dataclasses import dataclass

import numpy as np

from tendonff.models.errors import LARGEST, ParameterError, require, require_given, require_range
from tendonff.models.layout import Array
from tendonff.models.mechanism.loads import NOWHERE, Damper, DryFriction, Gravity, LoadLaw, Spring, Stops
from tendonff.models.parameters import Friction

QUARTER_TURN_RAD = math.pi / 2


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenJoint:
    """A joint that tendons turn.

    Parameters
    ----------
    name : str
        The NAME of its table.
    inertia_kg_m2 : float
        Moving inertia J about the joint [kg m2], > 0.
    damping_N_m_s_per_rad : float, optional
        Viscous damping b [N m s/rad], >= 0.
    stiffness_N_m_per_rad : float, optional
        Spring k towards `rest_rad` [N m/rad], >= 0.
    rest_rad : float, optional
        Angle at which the spring is relaxed [rad].
    gravity_N_m : float, optional
        Amplitude g of a torque g sin(q - gravity_zero_rad) that tendons hold [N m].
    gravity_zero_rad : float, optional
        Angle at which gravity asks for no torque [rad].
    coulomb_N_m : float, optional
        Dry friction of the joint itself [N m], >= 0.
    stop_low_rad, stop_high_rad : float, optional
        Angles at which the joint touches a stop [rad]; default: none.
    stop_stiffness_N_m_per_rad : float, optional
        Stiffness of the stops beyond them [N m/rad], > 0 where there is one.
    range_rad : tuple of float, optional
        Angles that a live reference may have [rad]: low and high, at most to the stops. Default: the stops; where
        there is none, a quarter turn beyond the reference.
    """

    name: str
    inertia_kg_m2: float
    damping_N_m_s_per_rad: float = 0.0
    stiffness_N_m_per_rad: float = 0.0
    rest_rad: float = 0.0
    gravity_N_m: float = 0.0
    gravity_zero_rad: float = 0.0
    coulomb_N_m: float = 0.0
    stop_low_rad: float | None = None
    stop_high_rad: float | None = None
    stop_stiffness_N_m_per_rad: float = 0.0
    range_rad: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        require("inertia_kg_m2", self.inertia_kg_m2, above=0, hint="a finger's last bone has about 1e-5 kg m2")
        for name in ("damping_N_m_s_per_rad", "stiffness_N_m_per_rad", "coulomb_N_m"):
            require(name, getattr(self, name), least=0, hint="leave it out for none")
        for name in ("rest_rad", "gravity_N_m", "gravity_zero_rad"):
            value = getattr(self, name)
            if not (math.isfinite(value) and abs(value) <= LARGEST):
                raise ParameterError(f"{name} must be a finite number, got {value}; leave it out for 0")
        self._check_stops()

    def _check_stops(self) -> None:
        require("stop_stiffness_N_m_per_rad", self.stop_stiffness_N_m_per_rad, least=0, hint="60 to 200 for a finger")
        for name in ("stop_low_rad", "stop_high_rad"):
            require_given(name, getattr(self, name), hint="leave it out where there is no stop")
        if self.has_stop and self.stop_stiffness_N_m_per_rad == 0:
            raise ParameterError("a stop needs stop_stiffness_N_m_per_rad > 0, got 0; 60 to 200 for a finger")
        low, high = self.stops_rad
        if not low < high:
            raise ParameterError(f"stop_low_rad must be below stop_high_rad, got {low:g} and {high:g}; swap them")
        require_range("range_rad", self.range_rad)

    @property
    def has_stop(self) -> bool:
        """Whether there is a stop."""
        return self.stop_low_rad is not None or self.stop_high_rad is not None

    @property
    def stops_rad(self) -> tuple[float, float]:
        """Angles of both stops, far away where there is none [rad]."""
        low, high = self.stop_low_rad, self.stop_high_rad
        return -NOWHERE if low is None else low, NOWHERE if high is None else high

    def accepted_rad(self, least_rad: float, most_rad: float) -> tuple[float, float]:
        """Angles that a live reference may have, where the design's goes from `least_rad` to `most_rad` [rad].

        Raises
        ------
        ParameterError
            If `range_rad` does not hold the design's reference.
        """
        stops = self.stops_rad
        low, high = self.range_rad or stops
        low, high = max(low, stops[0]), min(high, stops[1])
        if self.range_rad is not None and not (low <= least_rad and most_rad <= high):
            raise ParameterError(
                f"range_rad = [{low:g}, {high:g}] of the joint {self.name} does not hold the reference, which goes "
                f"from {least_rad:.4g} to {most_rad:.4g} rad; widen it"
            )
        return (
            least_rad - QUARTER_TURN_RAD if low <= -NOWHERE else min(low, least_rad),
            most_rad + QUARTER_TURN_RAD if high >= NOWHERE else max(high, most_rad),
        )

    def loads(self, bristles: Friction, arm_m: float) -> tuple[LoadLaw, ...]:
        """Torques that oppose the joint; its dry friction has the bristles of a tendon at a moment arm."""
        loads: list[LoadLaw] = [
            Damper(damping=self.damping_N_m_s_per_rad),
            Spring(stiffness=self.stiffness_N_m_per_rad, rest=self.rest_rad),
            Gravity(amplitude_N_m=self.gravity_N_m, zero_rad=self.gravity_zero_rad),
        ]
        if self.has_stop:
            low, high = self.stops_rad
            loads.append(Stops(stiffness=self.stop_stiffness_N_m_per_rad, low=low, high=high))
        if self.coulomb_N_m > 0:
            loads.append(
                DryFriction(
                    coulomb=self.coulomb_N_m,
                    bristle_stiffness=bristles.bristle_stiffness_N_per_m * arm_m**2,
                    soft_bristle_stiffness=bristles.soft_bristle_stiffness_N_per_m * arm_m**2,
                )
            )
        return tuple(loads)

    def static_torque_N_m(self, angle_rad: Array) -> Array:
        """Torque that tendons hold at rest at an angle: spring, gravity and stops [N m]."""
        angle = np.asarray(angle_rad, dtype=np.float64)
        low, high = self.stops_rad
        held: Array = self.stiffness_N_m_per_rad * (angle - self.rest_rad)
        pushed = self.stop_stiffness_N_m_per_rad * (np.maximum(angle - high, 0.0) - np.maximum(low - angle, 0.0))
        return held + pushed + self.gravity_N_m * np.sin(angle - self.gravity_zero_rad)
