"""Interface of an engine that inverts or advances a joint between tendons."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tendonff.models.joint.balance import JointLaw
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.models.tendon.chain import Chain

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class JointProblem:
    """A mechanism cut into chains, from a start.

    Attributes
    ----------
    mechanism : Mechanism
    chains : tuple of Chain
        One for each tendon.
    law : JointLaw
    start_rad : float
        Where the joint stands at the start.
    scale_m : float
        A moment arm: torques over it are compared with forces.
    """

    mechanism: Mechanism
    chains: tuple[Chain, ...]
    law: JointLaw
    start_rad: float
    scale_m: float

    @property
    def loop(self) -> bool:
        """Whether one drum winds both tendons."""
        return self.mechanism.drive.kind is DriveKind.LOOP

    @property
    def windings_m(self) -> tuple[float, ...]:
        """Travel of each tendon per radian of its drum, with its sign [m]."""
        mechanism = self.mechanism
        return tuple(
            radius * way
            for radius, way in zip(mechanism.drum_radius_m, mechanism.windings(self.start_rad), strict=True)
        )


@dataclass(slots=True, kw_only=True)
class JointMemory:
    """State of a mechanism, advanced in place.

    Attributes
    ----------
    x, x_old : list of ndarray
        State of each chain, now and one step earlier.
    z, z_old : ndarray, shape (3,)
        Speed [rad/s], angle [rad] and dry friction [N m] of the joint.
    time_s : float
        When that is.
    fresh : bool
        There is no earlier state; the next step is implicit Euler.
    start_m : ndarray, shape (tendons,)
        Position of each near end from which travels count.
    tension_N : ndarray, shape (tendons,)
        At the joint.
    rest_N : ndarray, shape (tendons,)
        At the start, the same along each tendon.
    closure_rad : float
        Of a loop: by how much more tendon the drum holds at the start than there is, as an angle of the drum.
    """

    x: list[Array]
    x_old: list[Array]
    z: Array
    z_old: Array
    time_s: float
    fresh: bool
    start_m: Array
    tension_N: Array
    rest_N: Array
    closure_rad: float

    def copy(self) -> "JointMemory":
        """The same, that may be advanced by itself."""
        return JointMemory(
            x=[x.copy() for x in self.x],
            x_old=[x.copy() for x in self.x_old],
            z=self.z.copy(),
            z_old=self.z_old.copy(),
            time_s=self.time_s,
            fresh=self.fresh,
            start_m=self.start_m.copy(),
            tension_N=self.tension_N.copy(),
            rest_N=self.rest_N.copy(),
            closure_rad=self.closure_rad,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class JointInverseRows:
    """Result of an inverse for angles at the ends of successive steps; fewer rows where a step has no solution.

    Attributes
    ----------
    travel_m, tension_N, drum_N : ndarray, shape (rows, tendons)
        Travel of each tendon at its drum since the start, tension at the joint, and at the drum; negative where the
        tendon would have to push.
    slack_m, lowest_N : ndarray, shape (rows,)
        Length of tendon that hangs loose in a loop; smallest tension along any tendon.
    evaluations : int
        Of the recursion through all tendons.
    """

    travel_m: Array
    tension_N: Array
    drum_N: Array
    slack_m: Array
    lowest_N: Array
    evaluations: int


@dataclass(frozen=True, slots=True, kw_only=True)
class JointRows:
    """Result of a run of steps; fewer rows where a step fails for good.

    Attributes
    ----------
    angle_rad, torque_N_m, lowest_N : ndarray, shape (rows,)
        Of the joint; sum of the tendons' torques; smallest tension along any tendon.
    tension_N, drum_N : ndarray, shape (rows, tendons)
    iterations, splits : int
    residual_N : float
        Largest balance of the last step.
    reason : str or None
        Why an integrator gave up.
    """

    angle_rad: Array
    torque_N_m: Array
    lowest_N: Array
    tension_N: Array
    drum_N: Array
    iterations: int
    splits: int
    residual_N: float
    reason: str | None = None


class JointRunner(Protocol):
    """Forward simulation of a given problem."""

    def run(self, memory: JointMemory, travel_m: Array, contact_N_m: Array, angle_rad: Array | None) -> JointRows:
        """Advance over travels, shape (rows + 1, tendons), the first at the present instant; the joint led or free."""


class JointEngine(JointRunner, Protocol):
    """Engine for a given problem and step."""

    def invert(
        self, memory: JointMemory, angle_rad: Array, contact_N_m: Array, least_tension_N: float
    ) -> JointInverseRows:
        """Motor travels for angles at the present instant and the ends of the steps that follow, shape (rows + 1,)."""
