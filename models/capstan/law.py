"""The static Coulomb capstan law, with its exact memory.

::

        T_in <---- (  wrap angle theta, mu  ) <---- T_out        pulling: T_in + p = (T_out + p) e^{+mu theta}
                                                                 releasing: T_in + p = (T_out + p) e^{-mu theta}

For a tendon that is driven at one end, without inertia, bristles and creep, the law holds for any history: the output
is the play of the input, ln(T_out + p) = Play[ln(T_in + p)] with deadband mu_pull theta + mu_release theta. Plays
compose along the path, so the tension profile is the memory of the input. Eq. (4) of Palli, Borghesan, Melchiorri
(ICRA 2010) for one-way slip; the play law is derived in the same notation. With spread bounds several plays act, and
slip sets in gradually: `spread_bounds`. Friction that falls with the load obeys the same in L(T + p) in the place of
T + p: `models.tendon.load_dependence`.

Where both ends act see `two_ended`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from tendonff.models.capstan.spread_bounds import SpreadPlays
from tendonff.models.choice import Choice
from tendonff.models.errors import ParameterError, require
from tendonff.models.gear import DriveLaw
from tendonff.models.layout import Array
from tendonff.models.parameters.transmission import Transmission
from tendonff.models.tendon.load_dependence import lifted_N, lowered_N, mean_tension_in_slip_N

NO_JOINTS: Mapping[str, float] = MappingProxyType({})

_LARGEST_EXPONENT = 100.0  # e^100 newtons for one: beyond any tendon, and far below overflow


class Branch(Choice):
    """Direction in which the tendon slips on the whole path.

    Attributes
    ----------
    PULL
        Towards the actuator: the output tension rises.
    RELEASE
        Towards the load: the output tension falls.
    """

    PULL = "pull"
    RELEASE = "release"


def held_within(start: float | Array, low: Array, high: Array) -> Array:
    """Play operator over a history, the first axis: each value is the one before, clipped to the bounds of its instant.

    Clips compose to clips, so all histories up to 1, 2, 4 ... instants are composed at once; nothing is rounded.
    """
    low, high = low.copy(), high.copy()
    span = 1
    while span < len(low):
        least, most = low[span:], high[span:]
        composed = [np.minimum(np.maximum(of, least), most) for of in (low[:-span], high[:-span])]
        low[span:], high[span:] = composed
        span *= 2
    held: Array = np.clip(start, low, high)
    return held


def behind_drive_N(drive: DriveLaw, force_N: ArrayLike, start_N: float) -> Array:
    """Tension at the tendon's end for any history of the drive's force, shape (n,): the play of its friction."""
    force = np.asarray(force_N, dtype=np.float64)
    return force if drive.is_ideal else held_within(start_N, drive.pulled_N(force), drive.released_N(force))


def _angles(transmission: Transmission, joint_rad: Mapping[str, float]) -> list[float]:
    """Wrap angle of each section where the joints stand [rad]."""
    return [float(part.angle_at(joint_rad)) for part in transmission.path.parts]


def section_exponents(
    transmission: Transmission, joint_rad: Mapping[str, float] = NO_JOINTS
) -> tuple[list[float], list[float]]:
    """Mu phi of each section when pulling and when releasing, by the dynamic coefficients; joints are at zero by
    default.
    """
    parts, angles = transmission.path.parts, _angles(transmission, joint_rad)
    usual = transmission.friction.mu_dynamic, transmission.friction.release_dynamic
    both = [part.dynamic_coefficients(*usual) for part in parts]
    pull, release = ([mus[k] * phi for mus, phi in zip(both, angles, strict=True)] for k in (0, 1))
    return pull, release


@dataclass(frozen=True, slots=True, kw_only=True)
class ExponentLine:
    """Mu theta of the whole path over the common coefficient, mu theta = mu angle + held, in one direction."""

    angle_rad: float  # wrap angle of the sections on which the common coefficient acts
    held: float  # what bearings and sections with a coefficient of their own add [-]

    def exponent(self, mu: float) -> float:
        """Mu theta at a coefficient."""
        return self.angle_rad * mu + self.held

    def mu(self, exponent: float) -> float:
        """The common coefficient that gives an exponent, >= 0."""
        return max(exponent - self.held, 0.0) / self.angle_rad


def exponent_lines(
    transmission: Transmission, joint_rad: Mapping[str, float] = NO_JOINTS
) -> tuple[ExponentLine, ExponentLine]:
    """Lines when pulling and when releasing; joints are at zero by default."""
    angles = _angles(transmission, joint_rad)
    pull, release = (
        ExponentLine(
            angle_rad=math.fsum(phi for own, phi in zip(mus, angles, strict=True) if own is None),
            held=math.fsum(own * phi for own, phi in zip(mus, angles, strict=True) if own is not None),
        )
        for mus in zip(*(part.own_dynamic() for part in transmission.path.parts), strict=True)
    )
    return pull, release


def _shape(exponent: float) -> float:
    """(1 - e^{-a})/a, 1 at a = 0: mean of e^{-a s} over s in [0, 1]."""
    return 1.0 if exponent == 0 else -math.expm1(-exponent) / exponent


@dataclass(frozen=True, slots=True, kw_only=True)
class CapstanLaw:
    """Static law of the whole path.

    Parameters
    ----------
    pull_exponent, release_exponent : float
        mu theta when pulling and when releasing [-], >= 0.
    adhesion_N : float
        Load-independent tension p [N], >= 0.
    pull_spread, release_spread : float
        Of the plays' bounds around mu theta [-], 0 (one play) to 1.
    load_exponent, reference_tension_N : float
        n [-] and T_0 [N] of mu(T) = mu (T/T_0)^-n; mu theta holds at T_0.
    """

    pull_exponent: float
    release_exponent: float
    adhesion_N: float = 0.0
    pull_spread: float = 0.0
    release_spread: float = 0.0
    load_exponent: float = 0.0
    reference_tension_N: float = 1.0

    def __post_init__(self) -> None:
        for name in ("pull_exponent", "release_exponent", "adhesion_N"):
            require(name, getattr(self, name), least=0, hint="use 0 for none")
        for name in ("pull_exponent", "release_exponent"):
            value = getattr(self, name)
            if value > _LARGEST_EXPONENT:
                raise ParameterError(
                    f"{name} = mu theta must be at most {_LARGEST_EXPONENT:g}, got {value:g}: no tension gets through; "
                    "check the friction coefficients, and total_angle_rad, which is in radians"
                )
        for name in ("pull_spread", "release_spread"):
            if not 0 <= getattr(self, name) <= 1:
                raise ParameterError(f"{name} must be from 0 to 1, got {getattr(self, name)}; use 0 for one play")

    @classmethod
    def of(cls, transmission: Transmission, joint_rad: Mapping[str, float] = NO_JOINTS) -> "CapstanLaw":
        """Law of a transmission: dynamic coefficients over the whole wrap angle; joints are at zero by default."""
        pull, release = section_exponents(transmission, joint_rad)
        exponent, reference = transmission.friction.load_dependence
        return cls(
            pull_exponent=math.fsum(pull),
            release_exponent=math.fsum(release),
            adhesion_N=transmission.friction.adhesion_N,
            pull_spread=transmission.friction.pull_spread or 0.0,
            release_spread=transmission.friction.release_spread or 0.0,
            load_exponent=exponent,
            reference_tension_N=reference,
        )

    def lifted_N(self, tension_N: ArrayLike) -> Array:
        """L(T + p) [N], which slip of the whole path multiplies by e^{mu theta}: T + p where mu does not know T."""
        lifted = np.asarray(tension_N, dtype=np.float64) + self.adhesion_N
        found: Array = lifted_N(lifted, self.load_exponent, self.reference_tension_N)
        return found

    def lowered_N(self, lifted_N: ArrayLike) -> Array:
        """Tension T of an L(T + p) [N]."""
        lowered: Array = lowered_N(lifted_N, self.load_exponent, self.reference_tension_N) - self.adhesion_N
        return lowered

    @property
    def plays(self) -> SpreadPlays | None:
        """The plays with spread bounds; None where one play is the law."""
        if self.pull_spread == 0 and self.release_spread == 0:
            return None
        return SpreadPlays.of(self.pull_exponent, self.release_exponent, self.pull_spread, self.release_spread)

    def part(self, share: float) -> "CapstanLaw":
        """Law of the first `share` (0 to 1) of the wrap angle: plays compose."""
        return replace(self, pull_exponent=share * self.pull_exponent, release_exponent=share * self.release_exponent)

    def output_bounds_N(self, input_N: ArrayLike) -> tuple[Array, Array]:
        """Least and largest output tension that an input tension T_in admits [N].

        They are (T_in + p) e^{-mu_pull theta} - p and (T_in + p) e^{mu_release theta} - p.
        """
        lifted = self.lifted_N(input_N)
        return (
            self.lowered_N(lifted * math.exp(-self.pull_exponent)),
            self.lowered_N(lifted * math.exp(self.release_exponent)),
        )

    def output_history_N(self, input_N: ArrayLike, initial_output_N: float | None = None) -> Array:
        """Output tension for any input history, by the play law, shape (n,).

        A tendon cannot push: the output does not fall below zero.

        Parameters
        ----------
        input_N : array_like, shape (n,)
            T_in at successive instants [N].
        initial_output_N : float, optional
            Output before the first of them [N]; default: the first input (uniform tension).
        """
        history = np.asarray(input_N, dtype=np.float64)
        start = history[0] if initial_output_N is None else initial_output_N
        if self.plays is None:
            lows, highs = self.output_bounds_N(history)
            return np.maximum(held_within(start, lows, highs), 0.0)
        p = self.adhesion_N
        held = [
            held_within(start + p, (history + p) * low, (history + p) * high)
            for low, high in zip(self.plays.low, self.plays.high, strict=True)
        ]
        output: Array = np.maximum(np.mean(held, axis=0) - p, 0.0)
        return output

    def profile_history_N(self, input_N: ArrayLike, shares: ArrayLike, initial_N: float | None = None) -> Array:
        """Tension along the path for any input history, started from uniform tension, shape (n, m).

        Parameters
        ----------
        input_N : array_like, shape (n,)
            T_in at successive instants [N].
        shares : array_like, shape (m,)
            Places on the path as shares of the wrap angle, 0 (actuator) to 1 (load).
        initial_N : float, optional
            Uniform tension before the first instant [N]; default: the first input.
        """
        places = np.asarray(shares, dtype=np.float64)
        return np.stack([self.part(float(s)).output_history_N(input_N, initial_N) for s in places], axis=1)

    def input_for_N(self, output_N: ArrayLike, branch: Branch) -> Array:
        """Input tension that holds an output tension in slip, the right inverse on one branch [N]."""
        exponent = self.pull_exponent if branch is Branch.PULL else -self.release_exponent
        return self.lowered_N(self.lifted_N(output_N) * math.exp(exponent))

    def input_history_N(self, output_N: ArrayLike, initial_input_N: float | None = None) -> Array:
        """Input tension for a reference of the output: the branch of its last change, held while it is constant.

        At each reversal the answer jumps by the factor e^{(mu_pull + mu_release) theta} in T + p; an actuator's rate
        limit decides what is left of that. With spread bounds it jumps by the band of the narrowest play alone. The
        answer is not clipped: negative values ask for a push.

        Parameters
        ----------
        output_N : array_like, shape (n,)
            T_out at successive instants [N].
        initial_input_N : float, optional
            Input before the first change [N]; default: the first output (uniform tension).
        """
        wanted = np.asarray(output_N, dtype=np.float64)
        start = float(wanted[0] if initial_input_N is None else initial_input_N)
        if self.plays is not None:
            p = self.adhesion_N
            return self.plays.inputs(wanted + p, start=float(wanted[0]) + p, held=start + p) - p
        change = np.sign(np.diff(wanted, prepend=wanted[0]))
        moved = change != 0
        last_move = np.maximum.accumulate(np.where(moved, np.arange(len(wanted)), -1))
        answer = np.where(change > 0, self.input_for_N(wanted, Branch.PULL), self.input_for_N(wanted, Branch.RELEASE))
        return np.where(last_move >= 0, answer[np.maximum(last_move, 0)], start)

    def force_history_N(self, output_N: ArrayLike, drive: DriveLaw, initial_input_N: float | None = None) -> Array:
        """The same of the force of a drive that rubs: against the last change of the reference, none before the first.

        Parameters
        ----------
        output_N : array_like, shape (n,)
            T_out at successive instants [N].
        drive : DriveLaw
        initial_input_N : float, optional
            Input before the first change [N]; default: the first output (uniform tension).
        """
        tension = self.input_history_N(output_N, initial_input_N)
        if drive.is_ideal:
            return tension
        change = np.sign(np.diff(np.asarray(output_N, dtype=np.float64), prepend=np.asarray(output_N).flat[0]))
        last = np.maximum.accumulate(np.where(change != 0, np.arange(len(change)), 0))
        return drive.force_N(tension, change[last])

    def largest_output_N(self, force_max_N: ArrayLike) -> float:
        """Largest output tension that a force pulls through the friction, (F + p) e^{-mu_pull theta} - p, >= 0 [N]."""
        return max(float(self.output_bounds_N(force_max_N)[0]), 0.0)

    def smallest_output_N(self, force_min_N: ArrayLike) -> float:
        """Smallest output tension that releasing down to a force leaves, (F + p) e^{mu_release theta} - p [N]."""
        return float(self.output_bounds_N(force_min_N)[1])

    def _signed(self, branch: Branch) -> float:
        return self.pull_exponent if branch is Branch.PULL else -self.release_exponent

    def _mean_in_slip_N(self, input_N: ArrayLike, branch: Branch) -> Array:
        """Mean of T + p over the path in slip [N]."""
        lifted = np.asarray(input_N, dtype=np.float64) + self.adhesion_N
        if self.load_exponent == 0:
            return lifted * _shape(self._signed(branch))
        mean: Array = mean_tension_in_slip_N(lifted, self._signed(branch), self.load_exponent, self.reference_tension_N)
        return mean

    def stiffness_N_per_m(self, tendon_stiffness_N_per_m: float, branch: Branch) -> float:
        """dT_in/d(elongation) in slip: k a/(1 - e^{-a}) pulling, k a/(e^a - 1) releasing, a = mu theta, k = EA/L."""
        return tendon_stiffness_N_per_m / _shape(self._signed(branch))

    def elongation_m(self, input_N: ArrayLike, tendon_stiffness_N_per_m: float, branch: Branch) -> Array:
        """Elongation of the tendon in slip [m], the mean tension over the path divided by k = EA/L."""
        return (self._mean_in_slip_N(input_N, branch) - self.adhesion_N) / tendon_stiffness_N_per_m

    def deadband_m(self, input_N: float, tendon_stiffness_N_per_m: float, branch: Branch) -> float:
        """Travel of the near end after a reversal at T_in, where a branch ends, before the output moves [m], > 0.

        With mu_pull = mu_release and p = 0 it is (R T_in/(EA mu)) (1 - e^{-a})^2 when pulling ends, k = EA/L.
        """
        other, way = (Branch.RELEASE, -1) if branch is Branch.PULL else (Branch.PULL, 1)
        # What the input takes back until the output slips the other way, from the same output tension.
        both = self.pull_exponent + self.release_exponent
        turned = float(self.lowered_N(self.lifted_N(input_N) * math.exp(way * both)))
        before, after = self._mean_in_slip_N(input_N, branch), self._mean_in_slip_N(turned, other)
        return abs(float(before - after)) / tendon_stiffness_N_per_m
