"""Loads of a body: what resists or drives it besides tendons and drives.

A load is a record whose `force` opposes the body's motion: inertia dw/dt = efforts on the body - sum of its loads.
Newtons and metres, or newton metres and radians. Its states are its own, as those of a friction law.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, Self

import casadi as ca

from tendonff.models.errors import ParameterError, require
from tendonff.models.fidelity import Level
from tendonff.models.gear import slip_friction
from tendonff.models.tendon.assembly import NORMAL_FORCE_FLOOR_N
from tendonff.models.tendon.bounds import at_least
from tendonff.models.tendon.friction import bristle_rate

States = tuple[ca.SX, ...]

NOWHERE = 1e3
"""Where a stop is that is not there [m or rad]: no body goes so far."""


def spring_force(stiffness: ca.SX, q: ca.SX, rest: ca.SX) -> ca.SX:
    """K (q - rest) [N or N m]."""
    return stiffness * (q - rest)


def gravity_torque(amplitude: ca.SX, q: ca.SX, zero: ca.SX) -> ca.SX:
    """Torque g sin(q - zero) that holds a weight [N m]."""
    return amplitude * ca.sin(q - zero)


def beyond_stops(q: ca.SX, low: ca.SX, high: ca.SX) -> ca.SX:
    """max(q - high, 0) - max(low - q, 0) [m or rad]."""
    return at_least(q - high, 0.0) - at_least(low - q, 0.0)


def require_number(
    name: str, value: ca.SX, *, above: float | None = None, least: float | None = None, hint: str
) -> None:
    """Refuse a number outside its range; a symbol of CasADi's may be any number."""
    if not isinstance(value, ca.SX):
        require(name, value, above=above, least=least, hint=hint)


class LoadLaw(Protocol):
    """Load of a body with the coordinate q and the speed w."""

    states: ClassVar[tuple[str, ...]]

    def at(self, level: Level) -> "LoadLaw":
        """The law at a fidelity level."""

    def force(self, q: ca.SX, w: ca.SX, states: States) -> ca.SX:
        """Force or torque against the motion [N or N m]."""

    def rate(self, w: ca.SX, states: States, effort: ca.SX) -> States:
        """Time derivatives of its states, under the effort of the tendons on the body [N or N m]."""


class _Stateless:
    """A load without memory, alike at all levels."""

    __slots__ = ()

    states: ClassVar[tuple[str, ...]] = ()

    def at(self, level: Level) -> Self:  # noqa: ARG002
        """Itself."""
        return self

    def rate(self, w: ca.SX, states: States, effort: ca.SX) -> States:  # noqa: ARG002
        """None."""
        return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Damper(_Stateless):
    """Viscous damping: b w, b = `damping` >= 0 [N s/m or N m s/rad]."""

    damping: ca.SX

    def __post_init__(self) -> None:
        require_number("damping", self.damping, least=0, hint="leave the damper out for none")

    def force(self, q: ca.SX, w: ca.SX, states: States) -> ca.SX:  # noqa: ARG002
        """Force against the motion [N or N m]."""
        return self.damping * w


@dataclass(frozen=True, slots=True, kw_only=True)
class Spring(_Stateless):
    """Spring to the frame: k (q - rest), k = `stiffness` >= 0 [N/m or N m/rad], rest in the body's unit."""

    stiffness: ca.SX
    rest: ca.SX = 0.0

    def __post_init__(self) -> None:
        require_number("stiffness", self.stiffness, least=0, hint="leave the spring out for none")
        require_number("rest", self.rest, hint="leave it out for 0")

    def force(self, q: ca.SX, w: ca.SX, states: States) -> ca.SX:  # noqa: ARG002
        """Force towards the rest position [N or N m]."""
        return spring_force(self.stiffness, q, self.rest)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gravity(_Stateless):
    """Weight of a body that turns: g sin(q - zero), amplitude g [N m], `zero_rad` where it needs no torque."""

    amplitude_N_m: ca.SX
    zero_rad: ca.SX = 0.0

    def __post_init__(self) -> None:
        require_number("amplitude_N_m", self.amplitude_N_m, hint="leave gravity out for none")
        require_number("zero_rad", self.zero_rad, hint="leave it out for 0")

    def force(self, q: ca.SX, w: ca.SX, states: States) -> ca.SX:  # noqa: ARG002
        """Torque that holds it [N m]."""
        return gravity_torque(self.amplitude_N_m, q, self.zero_rad)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stops(_Stateless):
    """Elastic stops: k (max(q - high, 0) - max(low - q, 0)), k = `stiffness` > 0; far away where there is none."""

    stiffness: ca.SX
    low: float = -NOWHERE
    high: float = NOWHERE

    def __post_init__(self) -> None:
        require_number("stiffness", self.stiffness, above=0, hint="60 to 200 N m/rad for a finger")
        if not self.low < self.high:
            raise ParameterError(f"a stop's low must be below its high, got {self.low:g} and {self.high:g}; swap them")

    def force(self, q: ca.SX, w: ca.SX, states: States) -> ca.SX:  # noqa: ARG002
        """Force back from the stops [N or N m]."""
        return self.stiffness * beyond_stops(q, self.low, self.high)


@dataclass(frozen=True, slots=True, kw_only=True)
class DryFriction:
    """Dry friction of the body itself and of a gear on it, eq. (5a) with the friction of slip in the place of f_n mu.

    Parameters
    ----------
    coulomb : float
        Friction of steady slip without load [N or N m], > 0, or 0 where a share is lost.
    bristle_stiffness, soft_bristle_stiffness : float
        Before it slips [N/m or N m/rad], > 0: of the stiff levels, and of `presliding`.
    lost_share : float, optional
        Share of what the tendons take that a gear loses [-], 1 - efficiency, 0 to 1; default: none.
    """

    states: ClassVar[tuple[str, ...]] = ("dry",)

    coulomb: ca.SX
    bristle_stiffness: ca.SX
    soft_bristle_stiffness: ca.SX
    lost_share: float = 0.0

    def __post_init__(self) -> None:
        bound = {"least": 0.0} if self.lost_share else {"above": 0.0}
        require_number("coulomb", self.coulomb, **bound, hint="leave dry friction out for none")
        for name in ("bristle_stiffness", "soft_bristle_stiffness"):
            require_number(name, getattr(self, name), above=0, hint="1e3 to 1e7 N/m are usual")

    def at(self, level: Level) -> "DryFriction":
        """The law with the level's bristle."""
        if not level.soft_bristle:
            return self
        soft = self.soft_bristle_stiffness
        return replace(self, bristle_stiffness=soft, soft_bristle_stiffness=soft)

    def force(self, q: ca.SX, w: ca.SX, states: States) -> ca.SX:  # noqa: ARG002
        """The bristle's force [N or N m]."""
        return states[0]

    def rate(self, w: ca.SX, states: States, effort: ca.SX) -> States:
        """Rate of the bristle's force."""
        most = self.coulomb
        if self.lost_share:
            most = at_least(slip_friction(self.coulomb, self.lost_share, ca.fabs(effort)), NORMAL_FORCE_FLOOR_N)
        return (bristle_rate(self.bristle_stiffness, w, states[0], most),)
