"""Links: what a link law offers, and the tendon between two masses, elastic (6) or visco-elastic (7).

Elongation e = q_near - q_far is positive when the link is stretched; the force f > 0 pulls both masses together::

    [ near ]--<--f--~~~~ link ~~~~--f-->--[ far ]        e = q_near - q_far        a tendon cannot push: f >= 0

As in `models.friction`, a law is a record with methods. Equation numbers are those of Palli, Borghesan, Melchiorri
(ICRA 2010).
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, Self

import casadi as ca

from tendonff.models.layout import fields_of
from tendonff.models.tendon.bounds import at_least

States = tuple[ca.SX, ...]


class LinkLaw(Protocol):
    """Tension of one link between two masses.

    What an implementer owes: (1) a frozen dataclass whose fields are its parameters, of the whole tendon or, after
    `shortened`, of a link; (2) `states`; (3) their rate; (4) the same states under the implicit rule
    x = base + H dx/dt; (5) a force that is then affine in the rate of elongation, and beside it `explicit_force`;
    (6) the state at rest.
    """

    states: ClassVar[tuple[str, ...]]

    def shortened(self, ratio: ca.SX) -> Self:
        """The law of a link, of which `ratio` make the whole tendon."""

    def rate(self, e: ca.SX, states: States) -> States:
        """Time derivatives of the states at elongation e [m]."""

    def unclipped_force(self, e: ca.SX, e_rate: ca.SX, states: States) -> ca.SX:
        """Tension of a link that also carries compression [N]."""

    def explicit_force(self, e: ca.SX) -> ca.SX | float:
        """Part that is not affine in the elongation [N]; an implicit step takes it where it goes on from."""

    def implicit(self, e: ca.SX, base: States, step_s: ca.SX) -> States:
        """States at the end of a step of weight H that ends at elongation e."""

    def rest(self, tension_N: ca.SX) -> tuple[ca.SX, States]:
        """Elongation [m] and states under a lasting tension."""


def tendon_force(unclipped_N: ca.SX) -> ca.SX:
    """Force of a link that cannot push [N]: zero where `unclipped_force` is negative (slack)."""
    return at_least(unclipped_N, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ZenerLink:
    """Eqs. (6), (7): a Zener element (standard linear solid) with a damper beside it."""

    states: ClassVar[tuple[str, ...]] = ("z",)

    # stiffness_N_per_m, relaxing_stiffness_N_per_m: k1, k2 [N/m]; k2 = 0 is the elastic link (6)
    stiffness_N_per_m: ca.SX
    relaxing_stiffness_N_per_m: ca.SX
    relaxation_time_s: ca.SX  # tau = b_k/k2 [s]
    damping_N_s_per_m: ca.SX  # c [N s/m]

    @property
    def branches(self) -> tuple[tuple[ca.SX, ca.SX], ...]:
        """Stiffness [N/m] and time [s] of each relaxing branch, one for each state."""
        return ((self.relaxing_stiffness_N_per_m, self.relaxation_time_s),)

    def shortened(self, ratio: ca.SX) -> Self:
        """The link of which `ratio` make the whole: all but times are that much higher."""
        higher = {name: value * ratio for name, value in fields_of(self).items() if not name.endswith("_time_s")}
        return replace(self, **higher)

    def rate(self, e: ca.SX, states: States) -> States:
        """dz/dt = (e - z)/tau [m/s], eq. (7) in the time domain; z is the elongation of a relaxing branch's damper."""
        return tuple((e - z) / time for z, (_, time) in zip(states, self.branches, strict=True))

    def unclipped_force(self, e: ca.SX, e_rate: ca.SX, states: States) -> ca.SX:
        """k1 e + k2 (e - z) + c de/dt [N], eqs. (6), (7), with z of each relaxing branch."""
        force = self.stiffness_N_per_m * e
        for z, (stiffness, _) in zip(states, self.branches, strict=True):
            force = force + stiffness * (e - z)
        return force + self.damping_N_s_per_m * e_rate

    def explicit_force(self, _e: ca.SX) -> ca.SX | float:
        """None [N]."""
        return 0.0

    def implicit(self, e: ca.SX, base: States, step_s: ca.SX) -> States:
        """Each relaxing branch over an implicit step, solved from its own `rate`, which contains no other."""
        z = ca.SX.sym("z")
        rates = self.rate(e, (z,) * len(base))
        return tuple(
            (old + step_s * ca.substitute(rate, z, ca.SX(0))) / (1 - step_s * ca.jacobian(rate, z))
            for old, rate in zip(base, rates, strict=True)
        )

    def rest(self, tension_N: ca.SX) -> tuple[ca.SX, States]:
        """Every branch at T/k1 [m]."""
        stretch = tension_N / self.stiffness_N_per_m
        return stretch, (stretch,) * len(self.states)


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoTimesLink(ZenerLink):
    """Eq. (7) with a second relaxing branch, for tendons that relax on two time scales.

    Stretched to e at once and held, it carries k1 e + k2 e exp(-t/tau) + k3 e exp(-t/tau3).
    """

    states: ClassVar[tuple[str, ...]] = ("z", "z_second")

    second_relaxing_stiffness_N_per_m: ca.SX  # k3 [N/m]
    second_relaxation_time_s: ca.SX  # tau3 [s]

    @property
    def branches(self) -> tuple[tuple[ca.SX, ca.SX], ...]:
        """Stiffness [N/m] and time [s] of each relaxing branch."""
        first = self.relaxing_stiffness_N_per_m, self.relaxation_time_s
        return first, (self.second_relaxing_stiffness_N_per_m, self.second_relaxation_time_s)
