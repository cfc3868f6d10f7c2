"""Friction of the tendon on its path: what a friction law offers, and the paper's, a LuGre bristle without damping.

A law is a record: its fields are its parameters (numbers or CasADi scalars), its methods the law itself, so that
simulation, inverse, linearisation, identification and exported C all use the same expressions. Its states are its own;
a law with others than the bristle force needs nothing but this interface. Equation numbers are those of Palli,
Borghesan, Melchiorri, "Friction and Visco-Elasticity Effects in Tendon-based Transmission Systems" (ICRA 2010).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, Self

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.models.gear import slip_friction
from tendonff.models.layout import fields_of
from tendonff.models.path import Section, SectionKind
from tendonff.models.tendon.assembly import NORMAL_FORCE_FLOOR_N, End
from tendonff.models.tendon.bounds import at_least

COEFFICIENT_FLOOR = 1e-12
"""Least equivalent coefficient in the bristle law [-]: lets a frictionless path run through the same expression."""

_NEWTON_MOVES = 12
_LOAD_MOVES = 3
_LARGE_NORMAL_FORCE_N = 1e12

States = tuple[ca.SX, ...]

_LARGEST_COEFFICIENT = 1 - 1e-9  # of an element: tanh rounds to 1


def at_load(coefficient: ca.SX, tension_N: ca.SX, exponent: ca.SX, reference_N: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Equivalent coefficient of an element at its mean tension, and minus its logarithmic slope over that [-].

    mu phi of the element scales by (T/T_0)^-n, and the coefficient is tanh(mu phi/2), eqs. (8), (9), so that the law
    does not depend on which T_0 it is stated at.

    Parameters
    ----------
    coefficient : ca.SX
        tanh(mu phi/2) at T_0 [-], >= 0.
    tension_N : ca.SX
        Mean tension of the element [N], > 0.
    exponent, reference_N : ca.SX
        n [-] and T_0 [N], > 0.
    """
    half = ca.atanh(ca.fmin(coefficient, _LARGEST_COEFFICIENT)) * (tension_N / reference_N) ** -exponent
    there = ca.tanh(half)
    return there, exponent * half * (1 - there * there) / there


class FrictionLaw(Protocol):
    """Friction of one mass on the path: f_f = state_force(states) + viscous_force(v).

    What an implementer owes: (1) a frozen dataclass whose fields are its parameters, of the whole tendon or, after
    `on_piece`, of one element; (2) `states`; (3) their rate; (4) the same states under the implicit rule
    x = base + H dx/dt for a known normal force, in closed form; (5) either the closed form for f_n = A + state_force
    and the balance that it solves, or None twice; then each state's share of the force must lie between zero and its
    value for a large normal force.
    """

    states: ClassVar[tuple[str, ...]]

    @property
    def slip_coefficients(self) -> tuple[Any, Any]:
        """Friction over normal force in fast steady slip, pulling and releasing [-]; arrays where masses differ."""

    @property
    def weakening_speed_m_per_s(self) -> float | None:
        """Speed about which friction falls, so that slow sliding may be unstable [m/s]; None where it does not."""

    def in_section(self, section: Section) -> Self:
        """The whole's law with the coefficients of one section."""

    def on_piece(self, angle_rad: ca.SX, angle_share: ca.SX, length_share: ca.SX) -> Self:
        """The law of one element: its wrap angle phi, and its shares of the whole's angle and length."""

    def aliases(self) -> Mapping[str, str]:
        """Fields that equal another, by name: code for them can be left out; empty where there are none."""

    def rate(self, v: ca.SX, states: States, f_n: ca.SX) -> States:
        """Time derivatives of the states at sliding speed v [m/s] under a normal force f_n [N]."""

    def state_force(self, states: States) -> ca.SX:
        """Part of the friction force that the states carry [N], positive when it opposes pulling."""

    def viscous_force(self, v: ca.SX) -> ca.SX:
        """Part that the speed alone decides [N]."""

    def implicit(self, v: ca.SX, base: States, step_s: ca.SX, f_n: ca.SX) -> States:
        """States at the end of a step of weight H."""

    def implicit_from_far_side(self, v: ca.SX, base: States, step_s: ca.SX, far_sum: ca.SX) -> States | None:
        """The same where f_n = A + state_force(states) with A = `far_sum` known; None without a closed form."""

    def far_side_balance(self, v: ca.SX, base: States, step_s: ca.SX, far_sum: ca.SX, states: States) -> States | None:
        """Balance that is zero at the states of `implicit_from_far_side`; None without a closed form."""


def equivalent_coefficient(mu: ca.SX, angle_rad: ca.SX) -> ca.SX:
    """Coefficient of one lumped element of angle phi, (1 - e^{-mu phi})/(1 + e^{-mu phi}) = tanh(mu phi/2) [-].

    Eqs. (8), (9): with it N elements in one-way slip give e^{mu theta} exactly.
    """
    half = mu * angle_rad / 2
    return np.tanh(half) if isinstance(half, np.ndarray) else ca.tanh(half)


def equivalent_exponent(coefficient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mu phi of elements, the inverse of `equivalent_coefficient` [-]."""
    return 2 * np.arctanh(coefficient)


def _ratio(static: ca.SX, dynamic: ca.SX) -> ca.SX:
    return static / dynamic if isinstance(dynamic, ca.SX) or dynamic > 0 else 1.0


def from_far_side(law: FrictionLaw, v: ca.SX, base: States, step_s: ca.SX, far_sum: ca.SX) -> States:
    """States at the end of a step where f_n = A + state_force(states): closed form, or a guarded scalar Newton.

    `base` is what the scheme adds the rates times H = `step_s` to, `far_sum` is A = 2 f_{i+1} + 2 p + b v + m dv/dt.
    """
    closed = law.implicit_from_far_side(v, base, step_s, far_sum)
    if closed is not None:
        return closed
    f_n = ca.SX.sym("f_n")
    excess = f_n - far_sum - law.state_force(law.implicit(v, base, step_s, f_n))
    slope = ca.jacobian(excess, f_n)
    ends = law.implicit(v, base, step_s, ca.SX(_LARGE_NORMAL_FORCE_N))
    alone = [tuple(end if k == j else ca.SX(0) for j, end in enumerate(ends)) for k in range(len(ends))]
    most = [law.state_force(states) for states in alone]
    low = at_least(far_sum + sum(ca.if_else(force < 0, force, 0) for force in most), NORMAL_FORCE_FLOOR_N)
    high = at_least(far_sum + sum(at_least(force, 0) for force in most), NORMAL_FORCE_FLOOR_N)
    x = ca.if_else(sum(most) > 0, high, low)  # from there Newton's method approaches a saturating law steadily
    # Unrolled, so that every engine and the exported code take the same moves in the same, bounded time.
    for _ in range(_NEWTON_MOVES):
        now, by_x = ca.substitute([excess, slope], [f_n], [x])
        low, high = ca.if_else(now < 0, x, low), ca.if_else(now > 0, x, high)
        newton = x - now / by_x
        inside = (newton >= low) * (newton <= high)  # a Newton move that leaves the bracket becomes a bisection
        x = ca.if_else(inside, newton, (low + high) / 2)
    return law.implicit(v, base, step_s, x)


def far_side_balance(law: FrictionLaw, v: ca.SX, base: States, step_s: ca.SX, far_sum: ca.SX, states: States) -> States:
    """Balance that is zero at the states of `from_far_side`: its slopes give theirs without those of a root."""
    closed = law.far_side_balance(v, base, step_s, far_sum, states)
    if closed is not None:
        return closed
    f_n = at_least(far_sum + law.state_force(states), NORMAL_FORCE_FLOOR_N)
    return tuple(x - end for x, end in zip(states, law.implicit(v, base, step_s, f_n), strict=True))


def bristle_rate(stiffness_N_per_m: ca.SX, v: ca.SX, f_s: ca.SX, most_N: ca.SX) -> ca.SX:
    """df_s/dt = sigma0 (v - f_s abs(v)/F) [N/s], eq. (5a), with F the friction of steady slip [N]."""
    return stiffness_N_per_m * (v - f_s * ca.fabs(v) / most_N)


def _affine(rate: Callable[[ca.SX], ca.SX], base: ca.SX, step_s: ca.SX) -> tuple[ca.SX, ca.SX]:
    """B = base + H rate(0) and g = -H drate/df_s of a rate that is affine in f_s: f_s (1 + g) = B."""
    f_s = ca.SX.sym("f_s")
    of_state = rate(f_s)
    drive = base + step_s * ca.substitute(of_state, f_s, ca.SX(0))
    return drive, -step_s * ca.jacobian(of_state, f_s)


def implicit_dry_friction(stiffness: ca.SX, most: ca.SX, v: ca.SX, base: ca.SX, step_s: ca.SX) -> ca.SX:
    """Bristle force of dry friction whose slip value `most` > 0 does not change, at the end of a step of weight H.

    Forces and metres, or torques and radians.
    """
    unit = ca.SX(1)
    drive, resistance = _affine(lambda f: bristle_rate(stiffness, v, f, unit), base, step_s)
    return drive * most / (most + resistance)


@dataclass(frozen=True, slots=True, kw_only=True)
class RubbingEnd(End):
    """An end with dry friction of its own: an element without wrap."""

    states: ClassVar[tuple[str, ...]] = ("f_d",)

    coulomb_N: float  # friction of steady slip [N], > 0
    bristle_stiffness_N_per_m: float  # sigma0 [N/m]

    def slip_friction_N(self, tension: ca.SX) -> ca.SX:  # noqa: ARG002
        """Friction of steady slip under the tension of its link [N]: constant."""
        return self.coulomb_N

    def rate(self, v: ca.SX, states: States, tension: ca.SX) -> States:
        """df_d/dt [N/s], eq. (5a) with the friction of slip in the place of f_n mu."""
        return (bristle_rate(self.bristle_stiffness_N_per_m, v, states[0], self.slip_friction_N(tension)),)

    def implicit(self, v: ca.SX, base: States, step_s: ca.SX, tension: ca.SX) -> States:
        """f_d [N] at the end of a step of weight H."""
        most = self.slip_friction_N(tension)
        return (implicit_dry_friction(self.bristle_stiffness_N_per_m, most, v, base[0], step_s),)


@dataclass(frozen=True, slots=True, kw_only=True)
class GearedEnd(RubbingEnd):
    """An end behind a gear, which loses a share of the tension as well: `coulomb_N` may be 0."""

    lost_share: float  # 1 - efficiency [-], 0 to 1

    def slip_friction_N(self, tension: ca.SX) -> ca.SX:
        """Friction of steady slip under the tension of its link [N]; at least the floor, for a slack tendon."""
        return at_least(slip_friction(self.coulomb_N, self.lost_share, tension), NORMAL_FORCE_FLOOR_N)


@dataclass(frozen=True, slots=True, kw_only=True)
class LuGreBristle:
    """Eqs. (5a) to (5c): a LuGre bristle without damping of its own, which is Dahl's law where mu does not fall."""

    states: ClassVar[tuple[str, ...]] = ("f_s",)

    bristle_stiffness_N_per_m: ca.SX  # sigma0 [N/m]
    # mu_dynamic_pull, mu_static_pull, mu_dynamic_release, mu_static_release: coefficients of tendon on path; on a piece
    # the equivalent ones, eqs. (8), (9) [-]
    mu_dynamic_pull: ca.SX
    mu_static_pull: ca.SX
    mu_dynamic_release: ca.SX
    mu_static_release: ca.SX
    stribeck_velocity_m_per_s: ca.SX  # omega [m/s]
    viscous_N_s_per_m: ca.SX  # b [N s/m]

    @property
    def slip_coefficients(self) -> tuple[Any, Any]:
        """The dynamic coefficients."""
        return self.mu_dynamic_pull, self.mu_dynamic_release

    @property
    def weakening_speed_m_per_s(self) -> float | None:
        """The Stribeck velocity, where static and dynamic coefficients differ in some direction."""
        same = np.all(self.mu_static_pull == self.mu_dynamic_pull) and np.all(
            self.mu_static_release == self.mu_dynamic_release
        )
        return None if same else float(np.mean(self.stribeck_velocity_m_per_s))

    def aliases(self) -> Mapping[str, str]:
        """The static coefficients, where friction does not fall with speed: an exponential takes most of a step."""
        if self.weakening_speed_m_per_s is not None:
            return {}
        return {"mu_static_pull": "mu_dynamic_pull", "mu_static_release": "mu_dynamic_release"}

    def in_section(self, section: Section) -> "LuGreBristle":
        """The section's own coefficients where it has any; a pulley's bearing has one for both directions."""
        pull, release = section.dynamic_coefficients(*self.slip_coefficients)
        if section.kind is SectionKind.PULLEY:
            return self._with_coefficients(pull, pull, release, release)
        # The static excess of the whole stays where a section has none.
        stick = pull * _ratio(self.mu_static_pull, self.mu_dynamic_pull)
        stick_release = release * _ratio(self.mu_static_release, self.mu_dynamic_release)
        return self._with_coefficients(
            pull,
            stick if section.mu_static is None else section.mu_static,
            release,
            stick_release if section.mu_static_release is None else section.mu_static_release,
        )

    def _with_coefficients(self, pull: ca.SX, stick: ca.SX, release: ca.SX, stick_release: ca.SX) -> "LuGreBristle":
        return replace(
            self,
            mu_dynamic_pull=pull,
            mu_static_pull=stick,
            mu_dynamic_release=release,
            mu_static_release=stick_release,
        )

    def on_piece(self, angle_rad: ca.SX, angle_share: ca.SX, length_share: ca.SX) -> "LuGreBristle":
        """The bristle of one element: stiffness by contact, viscous friction by length."""
        mus = (self.mu_dynamic_pull, self.mu_static_pull, self.mu_dynamic_release, self.mu_static_release)
        return replace(
            self._with_coefficients(*(equivalent_coefficient(mu, angle_rad) for mu in mus)),
            bristle_stiffness_N_per_m=self.bristle_stiffness_N_per_m * angle_share,
            viscous_N_s_per_m=self.viscous_N_s_per_m * length_share,
        )

    def stiffened(self, factor: float) -> "LuGreBristle":
        """The same law with a bristle stiffer by a factor [-]."""
        return replace(self, bristle_stiffness_N_per_m=factor * self.bristle_stiffness_N_per_m)

    def coefficient(self, v: ca.SX) -> ca.SX:
        """mu(v) = mu_d + (mu_c - mu_d) exp(-abs(v)/omega) [-], eq. (5b), with the coefficients of the direction of v.

        First power of abs(v) as in the paper; much of the literature squares it. Extension: pulling (v >= 0) and
        releasing (v < 0) may have different coefficients; at v = 0 the bristle law does not use mu.
        """
        pulling = v >= 0
        low = ca.if_else(pulling, self.mu_dynamic_pull, self.mu_dynamic_release)
        # Differences inside: with equal coefficients the exponential vanishes from the expression.
        excess = ca.if_else(
            pulling, self.mu_static_pull - self.mu_dynamic_pull, self.mu_static_release - self.mu_dynamic_release
        )
        mu = low + excess * ca.exp(-ca.fabs(v) / self.stribeck_velocity_m_per_s)
        return at_least(mu, COEFFICIENT_FLOOR)

    def rate(self, v: ca.SX, states: States, f_n: ca.SX) -> States:
        """df_s/dt = sigma0 (v - f_s abs(v)/(f_n mu(v))) [N/s], eq. (5a), f_n > 0."""
        (f_s,) = states
        return (bristle_rate(self.bristle_stiffness_N_per_m, v, f_s, f_n * self.coefficient(v)),)

    def state_force(self, states: States) -> ca.SX:
        """f_s [N], eq. (5c)."""
        return states[0]

    def viscous_force(self, v: ca.SX) -> ca.SX:
        """Viscous part b v [N], eq. (5c)."""
        return self.viscous_N_s_per_m * v

    def _rational(self, v: ca.SX, base: ca.SX, step_s: ca.SX) -> tuple[ca.SX, ca.SX]:
        """B = base + H sigma0 v and g = H sigma0 abs(v)/mu(v), both [N], of f_s (1 + g/f_n) = B, from `rate` itself."""
        return _affine(lambda f_s: self.rate(v, (f_s,), ca.SX(1))[0], base, step_s)

    def implicit(self, v: ca.SX, base: States, step_s: ca.SX, f_n: ca.SX) -> States:
        """f_s [N] for a known normal force: the rate is affine in f_s, and its slope inverse to f_n."""
        drive, resistance = self._rational(v, base[0], step_s)
        return (drive * f_n / (f_n + resistance),)

    def implicit_from_far_side(self, v: ca.SX, base: States, step_s: ca.SX, far_sum: ca.SX) -> States:
        """f_s [N] when f_n = A + f_s, the root of f_s^2 + (A + g - B) f_s - A B = 0 with f_n > 0."""
        drive, resistance = self._rational(v, base[0], step_s)
        return (_from_far_side(drive, resistance, far_sum),)

    def far_side_balance(self, v: ca.SX, base: States, step_s: ca.SX, far_sum: ca.SX, states: States) -> States:
        """That quadratic [N^2]."""
        return (_far_side_balance(*self._rational(v, base[0], step_s), far_sum, states[0]),)


def _far_side_balance(drive: ca.SX, resistance: ca.SX, far_sum: ca.SX, f_s: ca.SX) -> ca.SX:
    """f_s (A + f_s + g) - B (A + f_s) [N^2] with B = `drive`, g = `resistance`, A = `far_sum`."""
    return f_s * (f_s + (far_sum + resistance - drive)) - far_sum * drive


def _from_far_side(drive: ca.SX, resistance: ca.SX, far_sum: ca.SX) -> ca.SX:
    """f_s [N] of f_s (1 + g/(A + f_s)) = B with B = `drive`, g = `resistance`, A = `far_sum`."""
    half = (far_sum + resistance - drive) / 2
    product = far_sum * drive
    root = ca.sqrt(at_least(half * half + product, 0))
    # Two forms of the same root; each cancels on the other's side.
    return ca.if_else(half > 0, product / at_least(root + half, NORMAL_FORCE_FLOOR_N), root - half)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedBristle(LuGreBristle):
    """The same bristle whose coefficient falls with the tension, mu(T) = mu (T/T_0)^-n; see `load_dependence`.

    The tension of an element is the mean of its two sides, f_n/2.
    """

    load_exponent: ca.SX  # n [-]
    reference_tension_N: ca.SX  # T_0 [N], > 0

    def in_section(self, section: Section) -> "LoadedBristle":
        """The section's own coefficients where it has any; a pulley's bearing does not know the load."""
        own = fields_of(LuGreBristle.in_section(self, section))
        return LoadedBristle(**(own | {"load_exponent": 0.0} if section.kind is SectionKind.PULLEY else own))

    def _at_load(self, v: ca.SX, f_n: ca.SX) -> tuple[ca.SX, ca.SX]:
        """mu(v) at a normal force, and minus its logarithmic slope over that [-]."""
        return at_load(self.coefficient(v), f_n / 2, self.load_exponent, self.reference_tension_N)

    def rate(self, v: ca.SX, states: States, f_n: ca.SX) -> States:
        """df_s/dt = sigma0 (v - f_s abs(v)/(f_n mu(v, f_n/2))) [N/s], eq. (5a), f_n > 0."""
        (f_s,) = states
        return (bristle_rate(self.bristle_stiffness_N_per_m, v, f_s, f_n * self._at_load(v, f_n)[0]),)

    def _drive(self, v: ca.SX, base: ca.SX, step_s: ca.SX) -> tuple[ca.SX, ca.SX]:
        """B and g mu of f_s (1 + g/f_n) = B."""
        return _affine(lambda f: bristle_rate(self.bristle_stiffness_N_per_m, v, f, ca.SX(1)), base, step_s)

    def implicit(self, v: ca.SX, base: States, step_s: ca.SX, f_n: ca.SX) -> States:
        """f_s [N] for a known normal force, as without load dependence: mu is a number then."""
        return (
            implicit_dry_friction(self.bristle_stiffness_N_per_m, f_n * self._at_load(v, f_n)[0], v, base[0], step_s),
        )

    def implicit_from_far_side(self, v: ca.SX, base: States, step_s: ca.SX, far_sum: ca.SX) -> States:
        """f_s [N] when f_n = A + f_s: the root at a frozen coefficient, and three Newton moves on f_n.

        The map from f_n to A + f_s at mu(f_n) is a contraction by at most n abs(f_s)/f_n, so that this ends at
        round-off; exactly so for any load exponent in its bounds.
        """
        drive, sliding = self._drive(v, base[0], step_s)
        x = at_least(far_sum, NORMAL_FORCE_FLOOR_N)
        mu, _ = self._at_load(v, x)
        x = at_least(far_sum + _from_far_side(drive, sliding / mu, far_sum), NORMAL_FORCE_FLOOR_N)
        for _ in range(_LOAD_MOVES):
            mu, fall = self._at_load(v, x)
            f_s = _from_far_side(drive, sliding / mu, far_sum)
            slip = sliding / (x * mu)  # 0 where it sticks, large in full slip
            slope = -fall * (f_s / x) * slip / (1 + slip * (1 - f_s / x))
            x = at_least(x - (x - far_sum - f_s) / (1 - slope), NORMAL_FORCE_FLOOR_N)
        mu, _ = self._at_load(v, x)
        return (_from_far_side(drive, sliding / mu, far_sum),)

    def far_side_balance(self, v: ca.SX, base: States, step_s: ca.SX, far_sum: ca.SX, states: States) -> States:
        """The quadratic of the plain bristle with the coefficient at this f_s [N^2]."""
        drive, sliding = self._drive(v, base[0], step_s)
        mu, _ = self._at_load(v, at_least(far_sum + states[0], NORMAL_FORCE_FLOOR_N))
        return (_far_side_balance(drive, sliding / mu, far_sum, states[0]),)
