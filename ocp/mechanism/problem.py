"""A mechanism of bodies and tendons cut into chains, and its state."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tendonff.models.joint.balance import JointLaw
from tendonff.models.joint.parameters.tendon import LengthTable
from tendonff.models.tendon.chain import Chain

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Effect:
    """Effect of a body on a tendon, per unit of the body.

    Attributes
    ----------
    near_m : float
        Travel of the near end: the radius of a drum, negative where the tendon is wound the other way.
    per : ndarray, shape (3 N + 3,), or None
        Change of a row of the path: wrap angles, shares of the links in the length, gained lengths, far end's travel.
    lengths : LengthTable or None
        Of the far end's travel, instead of the last element of `per`.
    """

    near_m: float = 0.0
    per: Array | None = None
    lengths: LengthTable | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Strand:
    """A tendon cut into a chain, both of whose ends are led.

    Attributes
    ----------
    chain : Chain
        Its motion is that of what no body of the mechanism is.
    effects : tuple of Effect
        One for each body.
    """

    chain: Chain
    effects: tuple[Effect, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sharing:
    """Rule by which tendons share torques that they could share in many ways.

    Attributes
    ----------
    least_tension_N : float
        Tension at the far end that each tendon alone on its motor keeps [N], > 0.
    smooth_N : float
        Width of the barrier above it [N], > 0: at rest the looser tendons keep the sum of both.
    change_weight : float
        Price of a change of `smooth_N` within a millisecond, over that of one newton [-], >= 0.
    """

    least_tension_N: float = 2.0
    smooth_N: float = 1.0
    change_weight: float = 20.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MechanismProblem:
    """Bodies, tendons and drums, from a start at rest.

    Attributes
    ----------
    names : tuple of str
        Of the bodies: joints first, then motors.
    laws : tuple of JointLaw
        One for each body.
    joints : int
        Number of joints.
    strands : tuple of Strand
        One for each tendon.
    motor_of : tuple of int
        Motor that each tendon is wound on, counted from 0.
    winding_m : tuple of float
        Travel of each tendon at its drum per radian of its motor, with its sign [m].
    scale : tuple of float
        A moment arm of each body: torques over it are compared with forces [m].
    start : ndarray, shape (bodies,)
        Where the bodies stand at the start; motors at zero.
    tension_N : ndarray, shape (tendons,)
        At the start, the same along each tendon.
    sharing : Sharing
    """

    names: tuple[str, ...]
    laws: tuple[JointLaw, ...]
    joints: int
    strands: tuple[Strand, ...]
    motor_of: tuple[int, ...]
    winding_m: tuple[float, ...]
    scale: tuple[float, ...]
    start: Array
    tension_N: Array
    sharing: Sharing = field(default_factory=Sharing)

    @property
    def bodies(self) -> int:
        """Number of bodies."""
        return len(self.laws)

    @property
    def partner(self) -> tuple[int, ...]:
        """Tendon before each on the same drum; -1: none."""
        return tuple(
            max((k for k in range(t) if self.motor_of[k] == motor), default=-1) for t, motor in enumerate(self.motor_of)
        )

    @property
    def alone(self) -> tuple[bool, ...]:
        """Whether each tendon is alone on its drum, so that its tension can be chosen."""
        return tuple(self.motor_of.count(motor) == 1 for motor in self.motor_of)


@dataclass(slots=True, kw_only=True)
class MechanismMemory:
    """State of a mechanism, advanced in place.

    Attributes
    ----------
    x, x_old : list of ndarray
        State of each chain, now and one step earlier.
    z, z_old : ndarray, shape (bodies, 3)
        Speed, position and dry friction of each body.
    start_m : ndarray, shape (tendons,)
        Position of each near end where the motors stand at zero.
    tension_N : ndarray, shape (tendons,)
        At the far ends.
    worth : ndarray, shape (64,)
        What it would save to ask for less of each torque and closure [-].
    time_s : float
        When that is.
    fresh : bool
        There is no earlier state; the next step is implicit Euler.
    """

    x: list[Array]
    x_old: list[Array]
    z: Array
    z_old: Array
    start_m: Array
    tension_N: Array
    worth: Array
    time_s: float = 0.0
    fresh: bool = True

    def copy(self) -> "MechanismMemory":
        """The same, that may be advanced by itself."""
        return MechanismMemory(
            x=[each.copy() for each in self.x],
            x_old=[each.copy() for each in self.x_old],
            z=self.z.copy(),
            z_old=self.z_old.copy(),
            start_m=self.start_m.copy(),
            tension_N=self.tension_N.copy(),
            worth=self.worth.copy(),
            time_s=self.time_s,
            fresh=self.fresh,
        )


def far_m(problem: MechanismProblem, strand: Strand, position: Array) -> float:
    """Far end's position of a tendon for positions of the bodies [m]."""
    found = 0.0
    for effect, at in zip(strand.effects, position, strict=True):
        if effect.lengths is not None:
            found -= float(effect.lengths.length_at(np.array(at)))
        elif effect.per is not None:
            found += float(effect.per[-1] * at)
    return found


def rest(problem: MechanismProblem) -> MechanismMemory:
    """At rest at the start."""
    states = [
        _posed(strand.chain, problem).rest_state(float(tension), far_m(problem, strand, problem.start))
        for strand, tension in zip(problem.strands, problem.tension_N, strict=True)
    ]
    z = np.column_stack([np.zeros(problem.bodies), problem.start, np.zeros(problem.bodies)])
    return MechanismMemory(
        x=[state.vector() for state in states],
        x_old=[state.vector() for state in states],
        z=z,
        z_old=z.copy(),
        start_m=np.array([state.near_position_m for state in states]),
        tension_N=np.array(problem.tension_N, dtype=np.float64),
        worth=np.zeros(64),
    )


def _posed(chain: Chain, problem: MechanismProblem) -> Chain:
    """The chain with the bodies where they stand at the start, which decides the lengths of its links."""
    motion = chain.motion
    if motion is None:
        return chain
    at = dict(zip(motion.names, motion.at(np.zeros(1))[0], strict=True)) | dict(
        zip(problem.names[: problem.joints], problem.start, strict=False)
    )
    return replace(chain, motion=motion.held(np.array([at[name] for name in motion.names])))
