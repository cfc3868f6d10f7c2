"""Closed forms of a loop and a pair that slide in full one way, quasi-static: what a data sheet of the joint says.

Along a tendon that its drum pulls in, ln(T + p) falls by a = mu theta from the drum to the joint; along one that its
drum pays out it rises. So its elongation is ((T + p) phi(a) - p)/k with T the tension at the joint and

    phi(a) = (e^a - 1)/a pulled,  (1 - e^-a)/a paid out.

summed over sections where the path has several. The drum of a loop keeps the sum of both elongations over the drum
radii; the torque is the other equation. For equal tendons, with D the torque over the moment arm and T the tension
after tensioning (T + p where p > 0):

    least tension T a/sinh a; lost motion +-(T/k) tanh(a/2) at the drum;
    drive force D +- 2 a T while the loose side is taut;
    slack from D > 2 a T/(e^a - 1) pulling against the load, 2 a T/(1 - e^-a) paying out.

Friction that falls with the load acts with the coefficient that it has at the pre-tension or the least tension.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import DriveKind, JointTendon, Mechanism
from tendonff.models.layout import Array
from tendonff.models.path import cut_path
from tendonff.models.tendon.elements import whole_of

RECOMMENDED_MARGIN = 1.25
"""Pre-tension that is recommended, over the least one at which no tendon goes slack [-]."""

_LEAST_OF_REFERENCE = 1e-3  # of T_0, below which coefficients that fall with the load do not rise further here [-]


def elongation_factor(exponent: float) -> float:
    """(e^a - 1)/a: elongation over what the tension at one end alone would cause; a < 0 where it falls from there."""
    return math.expm1(exponent) / exponent if exponent else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingSection:
    """A stretch of a tendon's path.

    Attributes
    ----------
    length_share : float
        Of the whole length [-].
    pull_exponent, release_exponent : float
        Mu phi pulling and releasing [-].
    gained_per_rad_m : float
        What it gets longer per radian of the driven joint [m].
    """

    length_share: float
    pull_exponent: float
    release_exponent: float
    gained_per_rad_m: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingTendon:
    """Numbers of a tendon at a joint angle.

    Attributes
    ----------
    stiffness_N_per_m : float
        k of the whole tendon.
    sections : tuple of SlidingSection
        From the drum to the joint.
    adhesion_N : float
        Load-independent tension p.
    far_arm_m : float
        Moment arm of the far end alone, with its sign.
    drum_m : float
        Drum radius, > 0.
    """

    stiffness_N_per_m: float
    sections: tuple[SlidingSection, ...]
    adhesion_N: float
    far_arm_m: float
    drum_m: float

    @property
    def arm_m(self) -> float:
        """Moment arm with a tension that is the same along the path, with its sign."""
        return self.far_arm_m - math.fsum(section.gained_per_rad_m for section in self.sections)

    def signed_exponent(self, direction: int) -> float:
        """Logarithm of the tension at the drum over that at the joint, while the joint turns that way [-]."""
        pulled = direction * self.arm_m > 0
        return math.fsum(s.pull_exponent if pulled else -s.release_exponent for s in self.sections)

    def section_means(self, direction: int) -> tuple[float, ...]:
        """Mean of T + p over each section, over that at the joint [-]."""
        pulled, total, means = direction * self.arm_m > 0, 0.0, []
        for section in reversed(self.sections):
            own = section.pull_exponent if pulled else -section.release_exponent
            means.append(math.exp(total) * elongation_factor(own))
            total += own
        return tuple(reversed(means))

    def factor(self, direction: int) -> float:
        """Mean of T + p over the whole length, over that at the joint [-]."""
        means = self.section_means(direction)
        return math.fsum(s.length_share * mean for s, mean in zip(self.sections, means, strict=True))

    def torque_line(self, direction: int) -> tuple[float, float]:
        """Torque on the joint as a straight line of the tension at the joint: slope [m] and value at none [N m].

        Local tensions make the torque of sections that follow the joint.
        """
        means = self.section_means(direction)
        local = math.fsum(s.gained_per_rad_m * mean for s, mean in zip(self.sections, means, strict=True))
        alike = math.fsum(s.gained_per_rad_m for s in self.sections)
        return self.far_arm_m - local, self.adhesion_N * (alike - local)

    def tension_for_N(self, torque_N_m: float, direction: int) -> float:
        """Tension at the joint that gives it a torque [N]."""
        slope, value = self.torque_line(direction)
        return (torque_N_m - value) / slope

    def torque_N_m(self, tension_N: float, direction: int) -> float:
        """Torque on the joint for a tension there [N m]."""
        slope, value = self.torque_line(direction)
        return value + slope * tension_N

    def drum_tension_N(self, tension_N: float, direction: int) -> float:
        """Tension at the drum for one at the joint [N]."""
        return (tension_N + self.adhesion_N) * math.exp(self.signed_exponent(direction)) - self.adhesion_N

    def elongation_m(self, tension_N: float, direction: int) -> float:
        """Elongation of the whole tendon for a tension at the joint [m]."""
        return ((tension_N + self.adhesion_N) * self.factor(direction) - self.adhesion_N) / self.stiffness_N_per_m

    def loose_tension_N(self, direction: int) -> float:
        """Tension at the joint while the other end hangs loose, or 0 where this end does [N]."""
        return max(self.adhesion_N * math.expm1(-self.signed_exponent(direction)), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sliding:
    """Result of one-way sliding at a joint angle.

    Attributes
    ----------
    tension_N, drum_N : tuple of float
        At the joint and at the drum.
    elongation_m : tuple of float
    slack : bool
        A tendon hangs loose.
    """

    tension_N: tuple[float, ...]
    drum_N: tuple[float, ...]
    elongation_m: tuple[float, ...]
    slack: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class GrossSliding:
    """The law of a mechanism that slides in full.

    Parameters
    ----------
    tendons : tuple of SlidingTendon
    tension_N : float
        Of a loop: after tensioning; of a pair: least tension at the joint.
    loop : bool
    """

    tendons: tuple[SlidingTendon, ...]
    tension_N: float
    loop: bool

    @classmethod
    def of(cls, mechanism: Mechanism, angle_rad: float, others: dict[str, float] | None = None) -> "GrossSliding":
        """Law of a mechanism where its joint stands, and others that sections name."""
        mechanism.arms_at(angle_rad)  # refuses arms that cannot hold the joint
        drive = mechanism.drive
        loop = drive.kind is DriveKind.LOOP
        tension = drive.pretension_N if loop else drive.least_tension_N
        tendons = [
            SlidingTendon(
                stiffness_N_per_m=tendon.tendon.stiffness_N_per_m,
                sections=_sections(tendon, {mechanism.joint.name: angle_rad} | (others or {}), tension or 0.0),
                adhesion_N=tendon.friction.adhesion_N,
                far_arm_m=float(tendon.arm.arm_at(np.array(angle_rad))),
                drum_m=drum,
            )
            for tendon, drum in zip(mechanism.tendons, mechanism.drum_radius_m, strict=True)
        ]
        return cls(tendons=tuple(tendons), tension_N=tension or 0.0, loop=loop)

    def slide(self, torque_N_m: float, direction: int, shift_m: float = 0.0) -> Sliding:
        """Tensions while the joint turns one way (+1, -1) under a torque.

        `shift_m` is what both paths together have got longer since tensioning, drum radius for drum radius: the sum of
        each tendon's gain over its drum radius, times the first drum radius.
        """
        tensions, slack = self._tensions(torque_N_m, direction, shift_m)
        return Sliding(
            tension_N=tensions,
            drum_N=tuple(t.drum_tension_N(f, direction) for t, f in zip(self.tendons, tensions, strict=True)),
            elongation_m=tuple(t.elongation_m(f, direction) for t, f in zip(self.tendons, tensions, strict=True)),
            slack=slack,
        )

    def _tensions(self, torque: float, direction: int, shift_m: float) -> tuple[tuple[float, ...], bool]:
        tendons = self.tendons
        if len(tendons) == 1:
            return (tendons[0].tension_for_N(torque, direction),), False
        if not self.loop:
            own = [tendon.torque_N_m(self.tension_N, direction) for tendon in tendons]
            tight = self.tight(torque - math.fsum(own))
            found = [self.tension_N, self.tension_N]
            found[tight] = tendons[tight].tension_for_N(torque - own[1 - tight], direction)
            return (found[0], found[1]), False
        first, second = self._taut(torque, direction, shift_m)
        floors = [t.loose_tension_N(direction) for t in tendons]
        if first >= floors[0] and second >= floors[1]:
            return (first, second), False
        loose = 0 if first - floors[0] < second - floors[1] else 1
        found = [floors[0], floors[1]]
        carried = torque - tendons[loose].torque_N_m(floors[loose], direction)
        found[1 - loose] = tendons[1 - loose].tension_for_N(carried, direction)
        return (found[0], found[1]), True

    def tight(self, torque_N_m: float) -> int:
        """Which tendon carries a torque."""
        return 0 if len(self.tendons) == 1 or (torque_N_m > 0) == (self.tendons[0].arm_m > 0) else 1

    def net_drum_N(self, torque_N_m: float, direction: int) -> float:
        """Force that the drum of a loop gives, as one at its first tendon's radius, positive towards +q [N]."""
        found = self.slide(torque_N_m, direction)
        ways = [math.copysign(t.drum_m / self.tendons[0].drum_m, t.arm_m) for t in self.tendons]
        return math.fsum(way * drum for way, drum in zip(ways, found.drum_N, strict=True))

    def slack_torque_N_m(self, direction: int, sign: int) -> float:
        """Torque of a sign at which a tendon of a loop goes slack while the joint turns one way [N m], its size."""
        if not self.loop or len(self.tendons) != 2:
            raise ParameterError("a slack torque belongs to a loop: a pair keeps its least tension")
        return max(self._signed_slack(direction, sign), 0.0)

    def _signed_slack(self, direction: int, sign: int) -> float:
        """The loose tendon's tension falls in a straight line with the torque: where it reaches what it has slack."""
        loose = 1 - self.tight(sign)
        floor = self.tendons[loose].loose_tension_N(direction)
        at = [self._taut(sign * x, direction)[loose] - floor for x in (0.0, 1.0)]
        return at[0] / (at[0] - at[1])

    def least_pretension_N(self, torque_N_m: float) -> float:
        """Tension after tensioning at which a torque of that size just makes no tendon slack, either way [N]."""
        size = abs(torque_N_m)
        least = 0.0
        for sign in (1, -1):  # pulling against the load is the worse way; the torque rises in a line with the tension
            zero, one = (replace(self, tension_N=tension)._signed_slack(sign, sign) for tension in (0.0, 1.0))
            least = max(least, (size - zero) / (one - zero))
        return least

    def _taut(self, torque: float, direction: int, shift_m: float = 0.0) -> tuple[float, float]:
        """Tensions of a loop as if tendons could push: both elongations keep their sum, and the torque is carried."""
        tendons = self.tendons
        factors = [t.factor(direction) for t in tendons]
        lines = [t.torque_line(direction) for t in tendons]
        compliance = [1 / (t.stiffness_N_per_m * t.drum_m) for t in tendons]
        left = shift_m / tendons[0].drum_m + math.fsum(
            c * (self.tension_N + t.adhesion_N * (1 - f)) for c, t, f in zip(compliance, tendons, factors, strict=True)
        )
        rows = np.array([[c * f for c, f in zip(compliance, factors, strict=True)], [slope for slope, _ in lines]])
        first, second = np.linalg.solve(rows, np.array([left, torque - math.fsum(value for _, value in lines)]))
        return float(first), float(second)

    def stop_slope_N_per_m(self, direction: int, *, slack: bool) -> float:
        """Slope of the drum's force over its travel against a hard stop of the joint [N/m].

        While both tendons are taut, or after the loose one hangs.
        """
        total = 0.0
        for k, tendon in enumerate(self.tendons):
            if slack and k != self.tight(direction):
                continue
            ratio = (tendon.drum_m / self.tendons[0].drum_m) ** 2
            factor = tendon.factor(direction) * math.exp(-tendon.signed_exponent(direction))  # seen from the drum
            total += ratio * tendon.stiffness_N_per_m / factor
        return total


def _sections(tendon: JointTendon, joints: dict[str, float], tension_N: float) -> tuple[SlidingSection, ...]:
    """Exponents and lengths of a tendon's sections where the joints stand, with the coefficients at a tension."""
    exponent, reference = tendon.friction.load_dependence
    fallen = (max(tension_N, reference * _LEAST_OF_REFERENCE) / reference) ** -exponent if exponent else 1.0
    cut = cut_path(tendon.path.parts, max(len(tendon.path.parts), 1), tendon.path.radius_m)
    law, lengths = whole_of(tendon, Level.ELASTIC).friction, cut.lengths
    found = []
    for section, share in zip(tendon.path.parts, lengths, strict=True):
        angle = 0.0 if section.joint is None else joints.get(section.joint, 0.0)
        length = float(share) + (0.0 if cut.length_m is None else section.length_per_rad_m * angle / cut.length_m)
        pull, release = law.in_section(section).slip_coefficients
        wrap = float(section.angle_at({section.joint or "": angle}))
        follows = section.joint == tendon.arm.joint
        found.append(
            SlidingSection(
                length_share=length,
                pull_exponent=pull * wrap * fallen,
                release_exponent=release * wrap * fallen,
                gained_per_rad_m=section.length_per_rad_m if follows else 0.0,
            )
        )
    return tuple(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class DataSheet:
    """Closed forms of a loop, sliding in full and quasi-static.

    Attributes
    ----------
    least_tension_N : float
        Tension of the looser tendon at the joint, while the joint turns without load.
    lost_motion_rad : float
        Half the angle by which the joint lags when the motor turns back, without load: the motor turns twice that
        (times the ratio) before the joint moves.
    drive_force_N : float
        Friction that the drum feels either way beside the load, as a force at the drum.
    drive_torque_N_m : float
        The same at the drum's shaft.
    slack_torque_N_m : float
        Torque at the joint from which a tendon goes slack, pulling against the load; the smaller of both ways.
    slack_torque_paying_out_N_m : float
        The same while the joint gives way to the load.
    least_pretension_N : float
        Tension after tensioning below which the largest torque of the reference makes a tendon slack.
    recommended_pretension_N : float
        That with a margin: lost motion and drive friction both rise with the pre-tension, so no more is worth it.
    largest_torque_N_m : float
        The torque that both are for.
    stop_ratio : float
        Slope of the drum's torque against a hard stop while both are taut over that after one is slack: 1 + e^-a.
    """

    least_tension_N: float
    lost_motion_rad: float
    drive_force_N: float
    drive_torque_N_m: float
    slack_torque_N_m: float
    slack_torque_paying_out_N_m: float
    least_pretension_N: float
    recommended_pretension_N: float
    largest_torque_N_m: float
    stop_ratio: float


def data_sheet(law: GrossSliding, largest_torque_N_m: float) -> DataSheet:
    """Data sheet of a loop for the largest torque of a reference [N m]; ParameterError for a pair."""
    if not law.loop or len(law.tendons) != 2:
        raise ParameterError("the data sheet of lost motion and slack is for a loop; a pair keeps its least tension")
    ways = [law.slide(0.0, direction) for direction in (1, -1)]
    first = law.tendons[0]
    angles = [way.elongation_m[0] * math.copysign(1 / abs(first.arm_m), first.arm_m) for way in ways]
    force = (law.net_drum_N(0.0, 1) - law.net_drum_N(0.0, -1)) / 2
    pulling = min(law.slack_torque_N_m(sign, sign) for sign in (1, -1))
    paying = min(law.slack_torque_N_m(-sign, sign) for sign in (1, -1))
    least = law.least_pretension_N(largest_torque_N_m)
    slopes = [law.stop_slope_N_per_m(1, slack=slack) for slack in (False, True)]
    return DataSheet(
        least_tension_N=min(min(way.tension_N) for way in ways),
        lost_motion_rad=abs(angles[0] - angles[1]) / 2,
        drive_force_N=abs(force),
        drive_torque_N_m=abs(force) * first.drum_m,
        slack_torque_N_m=pulling,
        slack_torque_paying_out_N_m=paying,
        least_pretension_N=least,
        recommended_pretension_N=RECOMMENDED_MARGIN * least,
        largest_torque_N_m=abs(largest_torque_N_m),
        stop_ratio=slopes[0] / slopes[1],
    )


def sweep_pretension(law: GrossSliding, largest_torque_N_m: float, pretension_N: Array) -> list[DataSheet]:
    """Data sheets over pre-tensions [N]: what a higher one costs in lost motion and friction of the drive."""
    return [data_sheet(replace(law, tension_N=float(tension)), largest_torque_N_m) for tension in pretension_N]
