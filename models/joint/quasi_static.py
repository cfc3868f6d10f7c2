"""The quasi-static law of a joint between tendons: Coulomb friction, no inertia of the tendons, no relaxation.

Wherever the joint turns, both tendons slide in full, so what the motor does is known from the place, the torque and
the way it turns alone; at a reversal the motor has to cross the lost motion at once. A tendon whose drum acts and whose
joint only follows remembers its history as plays of ln(T + p), and its elongation is that memory summed along the path:
the elongation operator.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.capstan import CapstanLaw, held_within
from tendonff.models.joint.closed_form import GrossSliding
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.layout import Array

_PLACES = 40
_SHARES = (np.arange(_PLACES) + 0.5) / _PLACES
_FLOOR = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopSensor:
    """Joint angle of a loop from what its drum feels: angle and signed torque, friction's memory included.

    q = gain theta + compliance T + elongation mean(T along the path) + zero, with the profile of T along the path the
    play memory of ln(T + p): the elongation operator.

    Parameters
    ----------
    law : CapstanLaw
        Exponents pulling and releasing, and p, for a loop its pre-tension, in the unit of the torque.
    gain : float
        Joint angle over drum angle [-].
    compliance : float
        What the torque at the drum alone does [rad per unit of torque].
    elongation : float
        What the mean along the path does [rad per unit of torque].
    zero_rad : float
        Joint angle at a motor angle of zero and a torque of zero [rad].
    """

    law: CapstanLaw
    gain: float
    compliance: float
    elongation: float
    zero_rad: float = 0.0

    def angle_rad(self, drum_rad: Array, drum_torque: Array) -> Array:
        """Joint angle for a history of the drum that starts at uniform tension, shape (rows,) [rad]."""
        lifted = self._lifted(drum_torque)
        held = self._held(lifted, np.full(_PLACES, lifted[0]))
        return self._angle(drum_rad, drum_torque, held)

    def follow(self, drum_rad: Array, drum_torque: Array, memory: Array | None = None) -> "Followed":
        """The same with its range, from a memory on; None where nothing is known of the history before."""
        lifted = self._lifted(drum_torque)
        if memory is None:
            pull, release = self.law.pull_exponent, self.law.release_exponent
            memory = float(lifted[0]) * np.exp(np.array([0.0, -pull, release])[:, None] * _SHARES)
        held = self._held(lifted, memory)
        angle, *ends = self._angle(drum_rad[:, None], drum_torque[:, None], held).T
        return Followed(angle_rad=angle, low_rad=np.minimum(*ends), high_rad=np.maximum(*ends), memory=held[-1])

    def _lifted(self, drum_torque: Array) -> Array:
        return np.maximum(drum_torque + self.law.adhesion_N, _FLOOR)

    def _held(self, lifted: Array, memory: Array) -> Array:
        """Tension and p along the path by the tension at its drum, shape (rows, ..., places)."""
        ways = -self.law.pull_exponent, self.law.release_exponent
        rows = lifted.reshape(-1, *[1] * memory.ndim)
        low, high = (rows * np.exp(way * _SHARES) for way in ways)
        return held_within(memory, low, high)

    def _angle(self, drum_rad: Array, drum_torque: Array, held: Array) -> Array:
        """Joint angle; the mean of the tension along the path is its elongation times its stiffness."""
        mean = held.mean(axis=-1) - self.law.adhesion_N
        angle: Array = self.gain * drum_rad + self.compliance * drum_torque + self.elongation * mean + self.zero_rad
        return angle


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Followed:
    """Joint angle by a sensor.

    Attributes
    ----------
    angle_rad, low_rad, high_rad : ndarray, shape (rows,)
        From uniform tension at the start, and the range over all histories before it: a play never lets two histories
        cross, so the range lies between the least and the largest tension that friction admits. It closes as the
        torque swings.
    memory : ndarray, shape (3, places)
        Tension and p along the path at the end: of the likely history, of the least and of the largest tension.
    """

    angle_rad: Array
    low_rad: Array
    high_rad: Array
    memory: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Slid:
    """Memory of a play at the end of a path.

    Attributes
    ----------
    lifted : float
        Tension and p there.
    low_rad, high_rad : float
        Drum angles that were reached.
    known : bool
        Whether the drum has turned so far one way that the history before no longer matters.
    """

    lifted: float
    low_rad: float
    high_rad: float
    known: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTorque:
    """Torque at the joint of a loop from angle and signed torque of its drum, whatever loads the joint.

    T_joint = play(T + p) - p + spring theta + offset: the capstan law with the pre-tension p, behind a drive that is
    sprung. The friction at the start is not known: tension is taken as uniform there, until the drum has turned one
    way by `slid_rad` and the loop slides that way.

    Parameters
    ----------
    law : CapstanLaw
        Exponents pulling and releasing, and p, in the unit of the torque.
    spring : float
        Of the drive [unit of the torque per rad of the drum].
    offset : float
        In the unit of the torque.
    slid_rad : float
        Turn of the drum after which the loop slides.
    """

    law: CapstanLaw
    spring: float
    offset: float
    slid_rad: float

    def torque(self, drum_rad: Array, drum_torque: Array) -> Array:
        """Torque at the joint for a history of the drum, shape (rows,)."""
        return self.follow(drum_rad, drum_torque)[0]

    def follow(self, drum_rad: Array, drum_torque: Array, slid: Slid | None = None) -> tuple[Array, Slid]:
        """The same from a memory on, and the memory at its end; None where nothing is known."""
        lifted = np.maximum(drum_torque + self.law.adhesion_N, _FLOOR)
        low, high = lifted * math.exp(-self.law.pull_exponent), lifted * math.exp(self.law.release_exponent)
        if slid is None:
            at = float(drum_rad[0])
            slid = Slid(lifted=float(lifted[0]), low_rad=at, high_rad=at, known=False)
        lowest = np.minimum(np.minimum.accumulate(drum_rad), slid.low_rad)
        highest = np.maximum(np.maximum.accumulate(drum_rad), slid.high_rad)
        row, up = 0, drum_rad - lowest > self.slid_rad
        held = np.empty(0)
        start = slid.lifted
        turned = up | (highest - drum_rad > self.slid_rad)
        if not slid.known:
            row = int(np.argmax(turned)) if turned.any() else len(turned)
            held = held_within(start, low[:row], high[:row]) if row else held
            if row < len(turned):
                start = float(low[row] if up[row] else high[row])
        if row < len(turned):
            held = np.concatenate([held, held_within(start, low[row:], high[row:])])
        torque: Array = held - self.law.adhesion_N + self.spring * drum_rad + self.offset
        known = slid.known or bool(turned.any())
        end = Slid(lifted=float(held[-1]), low_rad=float(lowest[-1]), high_rad=float(highest[-1]), known=known)
        return torque, end

    def range_at(self, drum_rad: float, drum_torque: float) -> tuple[float, float]:
        """Least and largest torque at the joint that any history admits."""
        rest = self.spring * drum_rad + self.offset
        low, high = self.law.output_bounds_N(max(drum_torque, _FLOOR - self.law.adhesion_N))
        return float(low) + rest, float(high) + rest


def static_motor_rad(
    mechanism: Mechanism,
    angle_rad: Array,
    torque_N_m: Array,
    others: dict[str, Array] | None = None,
    direction: Array | None = None,
) -> Array:
    """Motor angles, shape (rows, motors), under which a joint turns as wanted if every tendon slides in full [rad].

    Parameters
    ----------
    mechanism : Mechanism
    angle_rad, torque_N_m : ndarray, shape (rows,)
        Wanted angle, and the torque that the tendons give there.
    others : dict of ndarray, optional
        Angles of the other joints that sections name, shape (rows,) each.
    direction : ndarray, shape (rows,), optional
        Way the joint turns in each row, +1 or -1; 0 before it has moved. Default: that of the angle, kept while it
        stands.
    """
    angle, torque = np.asarray(angle_rad, dtype=np.float64), np.asarray(torque_N_m, dtype=np.float64)
    ways = directions(angle) if direction is None else np.array(direction, dtype=np.float64)
    ways[:1] = 0.0  # a run starts at rest, where tensions are uniform
    start, others = float(angle[0]), others or {}
    travels = [
        tendon.path_travel_m(angle, others)
        - tendon.path_travel_m(angle[:1], {name: values[:1] for name, values in others.items()})
        for tendon in mechanism.tendons
    ]
    radii = mechanism.drum_radius_m
    longer: Array = -radii[0] * np.sum([travel / radius for travel, radius in zip(travels, radii, strict=True)], axis=0)
    fixed = all(section.joint is None for tendon in mechanism.tendons for section in tendon.path.sections)
    fixed = fixed and all(tendon.arm.lengths is None for tendon in mechanism.tendons)
    law = GrossSliding.of(mechanism, start, {name: float(values[0]) for name, values in others.items()})
    rest = _rest_elongations(law, float(torque[0]))
    out, drum = np.empty((len(angle), len(travels))), np.empty((len(angle), len(travels)))
    for row, (q, tau, way) in enumerate(zip(angle, torque, ways, strict=True)):
        if not fixed:
            law = GrossSliding.of(mechanism, float(q), {name: float(values[row]) for name, values in others.items()})
        now = law if way else _frictionless(law)
        found = now.slide(float(tau), int(way) or 1, float(longer[row]) if law.loop else 0.0)
        drum[row] = found.drum_N
        for k, (travel, stretch) in enumerate(zip(travels, found.elongation_m, strict=True)):
            out[row, k] = travel[row] + stretch - rest[k]
        if law.loop:  # a tendon that hangs says nothing about the drum
            tight = law.tight(float(tau))
            turn = out[row, tight] / radii[tight] * math.copysign(1.0, law.tendons[tight].arm_m)
            out[row] = [turn * math.copysign(radius, t.arm_m) for radius, t in zip(radii, law.tendons, strict=True)]
    motor = mechanism.motor_rad(out, start)
    each = drum * np.array(radii) * np.array(mechanism.windings(start)) / mechanism.drive.gear_ratio
    held = each.sum(axis=1, keepdims=True) if law.loop else each
    turned: Array = (motor[:, :1] if law.loop else motor) + (held - held[:1]) * mechanism.drive.gives_rad_per_N_m
    return turned


def directions(angle_rad: Array) -> Array:
    """Way an angle turns in each row, +1 or -1: kept while it stands, 0 before it has moved."""
    change = np.sign(np.gradient(angle_rad)) if len(angle_rad) > 1 else np.zeros(len(angle_rad))
    known = np.where(change != 0, np.arange(len(change)), -1)
    last = np.maximum.accumulate(known)
    ways: Array = np.where(last >= 0, change[np.maximum(last, 0)], 0.0)
    return ways


def _frictionless(law: GrossSliding) -> GrossSliding:
    """The same tendons without friction: how they stand at rest at the start."""
    smooth = tuple(
        replace(
            t,
            adhesion_N=0.0,
            sections=tuple(replace(s, pull_exponent=0.0, release_exponent=0.0) for s in t.sections),
        )
        for t in law.tendons
    )
    return replace(law, tendons=smooth)


def _rest_elongations(law: GrossSliding, torque_N_m: float) -> tuple[float, ...]:
    """Elongations that travels count from: the start's, with tensions that are uniform along each tendon."""
    return _frictionless(law).slide(torque_N_m, 1).elongation_m
