"""A mechanism of bodies and tendons for the compiled engine: its order of bodies, its start, and its state."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tendonff.models.cached import cached_property
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.balance import JointLaw
from tendonff.models.mechanism import (
    Arm,
    Body,
    Damper,
    DryFriction,
    Force,
    Gravity,
    Mechanism,
    Servo,
    Spring,
    Stops,
    Tendon,
)
from tendonff.models.mechanism.geometry import moment_arms
from tendonff.models.mechanism.loads import NOWHERE, LoadLaw
from tendonff.models.mechanism.sharing import Sharing
from tendonff.models.path import JointMotion
from tendonff.models.tendon.assembly import End
from tendonff.models.tendon.chain import Chain

Array = NDArray[np.float64]

_LED = End(mass_kg=1.0, damping_N_s_per_m=0.0, stiffness_N_per_m=0.0)
"""An end whose motion is given: its own numbers have no effect."""


@dataclass(frozen=True, kw_only=True, eq=False)  # without slots: what is computed once is kept in the instance
class MechanismProblem:
    """A mechanism at a level, from a start at rest.

    Attributes
    ----------
    mechanism : Mechanism
        Its bodies in this order: those whose balance decides tensions, those whose motion is known, motors.
    level : Level
    segments : int or None
        Number of masses of each tendon; None: each path's own.
    driven, motors : int
        Number of bodies of the first kind and of the last.
    wanted : int
        Number of driven bodies whose motion is wanted, which come first; the others follow from their balances. With
        some of those, tensions and their positions must be as many as balances and closures of shared drums.
    start : ndarray, shape (bodies,)
        Coordinates at the start [rad or m]; motors count from there.
    tension_N : ndarray, shape (tendons,)
        At the start, the same along each tendon.
    sharing : Sharing
    """

    mechanism: Mechanism
    level: Level
    segments: int | None
    driven: int
    wanted: int
    motors: int
    start: Array
    tension_N: Array
    sharing: Sharing = field(default_factory=Sharing)

    @property
    def bodies(self) -> int:
        """Number of bodies."""
        return len(self.mechanism.bodies)

    @property
    def known(self) -> int:
        """Number of bodies that are no motors."""
        return self.bodies - self.motors

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies in their order."""
        return tuple(body.name for body in self.mechanism.bodies)

    @cached_property
    def leads(self) -> tuple[bool, ...]:
        """Whether a drive leads each body."""
        led = {drive.body for drive in self.mechanism.drives if drive.leads}
        return tuple(name in led for name in self.names)

    @cached_property
    def stiffness(self) -> Array:
        """Of the servo or gear of each motor, shape (motors,) [N m/rad or N/m]; infinite of those that are led."""
        known = {drive.body: float(drive.stiffness) for drive in self.mechanism.drives if isinstance(drive, Servo)}
        return np.array([known.get(name, np.inf) for name in self.names[self.known :]])

    @cached_property
    def held(self) -> Array:
        """Effort of the tendons on each motor at the start, positive where they pull it back, shape (motors,)."""
        found = np.zeros(self.motors)
        np.add.at(found, np.array(self.motor_of), self.tension_N * self.winding_m)
        return found

    @cached_property
    def motor_of(self) -> tuple[int, ...]:
        """Motor that winds each tendon, counted from the first motor."""
        return tuple(self.names.index(winding(tendon).body) - self.known for tendon in self.mechanism.tendons)

    @cached_property
    def wound_by(self) -> tuple[list[int], ...]:
        """Tendons on each motor."""
        return tuple([t for t, own in enumerate(self.motor_of) if own == motor] for motor in range(self.motors))

    @cached_property
    def winding_m(self) -> Array:
        """Travel of each tendon at its drum per unit of its motor, with its sign, shape (tendons,)."""
        return np.array([winding(tendon).metres_per_unit for tendon in self.mechanism.tendons])

    @cached_property
    def partner(self) -> tuple[int, ...]:
        """Tendon before each on the same drum; -1: none."""
        motors = self.motor_of
        return tuple(max((k for k in range(t) if motors[k] == motor), default=-1) for t, motor in enumerate(motors))

    @cached_property
    def alone(self) -> tuple[bool, ...]:
        """Whether each tendon is alone on its drum, so that its tension can be chosen."""
        return tuple(self.motor_of.count(motor) == 1 for motor in self.motor_of)

    def starting(self, tension_N: Array) -> "MechanismProblem":
        """The same with tensions at the start, shape (tendons,)."""
        return replace(self, tension_N=tension_N)

    def forced(self) -> "MechanismProblem":
        """The same with motors that are given their torque or force, and not their motion."""
        motors = self.names[self.known :]
        drives = (Force(body=drive.body) if drive.body in motors else drive for drive in self.mechanism.drives)
        return replace(self, mechanism=replace(self.mechanism, drives=tuple(drives)))

    def chains(self) -> tuple[Chain, ...]:
        """A chain for each tendon, with all bodies where they stand at the start and both ends led."""
        return self._chains

    @cached_property
    def _chains(self) -> tuple[Chain, ...]:
        names = self.names[: self.known]
        motion = JointMotion(names=names, time_s=np.zeros(1), angle_rad=self.start[None, : self.known])
        cut = self.mechanism.cut(self.level, self.segments)
        return tuple(
            Chain(elements=tendon.elements, level=self.level, motion=motion, near=_LED, far=_LED)
            for tendon in cut.tendons
        )

    def laws(self) -> tuple[JointLaw, ...]:
        """Numbers of each body's balance."""
        laws = [_law_of(body.at(self.level)) for body in self.mechanism.bodies]
        for k in np.flatnonzero(np.isfinite(self.stiffness)).tolist():  # a servo is a spring to where its motor is
            motor = self.known + k
            laws[motor] = replace(laws[motor], stiffness_N_m_per_rad=float(self.stiffness[k]))
        return tuple(laws)

    def scale_m(self) -> Array:
        """A moment arm of each body, shape (bodies,): torques over it are compared with forces."""
        arms = np.abs(moment_arms(self.mechanism.tendons, self.names[: self.known], self.start[: self.known]))
        largest = arms.max(axis=0)
        drums = np.zeros(self.motors)
        np.maximum.at(drums, np.array(self.motor_of), np.abs(self.winding_m))
        return np.where((scale := np.concatenate([largest, drums])) > 0, scale, 1.0)


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
    fresh : bool
        There is no earlier state; the next step is implicit Euler.
    """

    x: list[Array]
    x_old: list[Array]
    z: Array
    z_old: Array
    start_m: Array
    tension_N: Array
    worth: Array = field(default_factory=lambda: np.zeros(MOST_EQUATIONS))
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
            fresh=self.fresh,
        )


def winding(tendon: Tendon) -> Arm:
    """Drum that winds a tendon; ParameterError unless it is one, with a constant radius."""
    arms = tendon.near.arms
    if len(arms) != 1 or not isinstance(arms[0], Arm):
        raise ParameterError(f'tendon "{tendon.name}": its near end needs one drum of constant radius, got {len(arms)}')
    return arms[0]


def rest(problem: MechanismProblem, loose_rad: float = 0.0) -> MechanismMemory:
    """At rest at the start; a tendon without tension hangs loose by so much of its motor."""
    places = dict(zip(problem.names, problem.start.tolist(), strict=True))
    states = [
        chain.rest_state(float(tension), float(tendon.far.travel_m(places)))
        for chain, tendon, tension in zip(problem.chains(), problem.mechanism.tendons, problem.tension_N, strict=True)
    ]
    if loose_rad > 0:
        loose = np.where(problem.tension_N == 0, loose_rad * np.abs(problem.winding_m), 0.0)
        states = [state.hanging(float(each)) for state, each in zip(states, loose, strict=True)]
    z = np.column_stack([np.zeros(problem.bodies), problem.start, np.zeros(problem.bodies)])
    return MechanismMemory(
        x=[state.vector() for state in states],
        x_old=[state.vector() for state in states],
        z=z,
        z_old=z.copy(),
        start_m=np.array([state.near_position_m for state in states]),
        tension_N=np.array(problem.tension_N, dtype=np.float64),
    )


MOST_EQUATIONS = 2 * 24 + 16
"""Of bodies.c.j2."""


def _law_of(body: Body) -> JointLaw:
    """The loads of a body in one record; ParameterError where it has one that the compiled engine does not know."""
    numbers = dict.fromkeys(JointLaw.__dataclass_fields__, 0.0)
    numbers |= {"inertia_kg_m2": body.inertia, "stop_low_rad": -NOWHERE, "stop_high_rad": NOWHERE}
    numbers["bristle_N_m_per_rad"] = 1.0
    known: list[type] = []
    for load in body.loads:
        numbers |= _numbers(body.name, load)
        if type(load) in known:
            raise ParameterError(f'"{body.name}" has two loads of one kind; the compiled engine takes one of each')
        known.append(type(load))
    return JointLaw(**numbers)


def _numbers(name: str, load: LoadLaw) -> dict[str, float]:
    match load:
        case Damper():
            return {"damping_N_m_s_per_rad": load.damping}
        case Spring():
            return {"stiffness_N_m_per_rad": load.stiffness, "rest_rad": load.rest}
        case Gravity():
            return {"gravity_N_m": load.amplitude_N_m, "gravity_zero_rad": load.zero_rad}
        case Stops():
            return {"stop_low_rad": load.low, "stop_high_rad": load.high, "stop_stiffness_N_m_per_rad": load.stiffness}
        case DryFriction() if not load.lost_share:
            return {"coulomb_N_m": load.coulomb, "bristle_N_m_per_rad": load.bristle_stiffness}
        case DryFriction():
            raise ParameterError(
                f'"{name}" has a DryFriction of lost_share = {load.lost_share:g}, which grows with its load; the '
                "compiled engine takes constant friction of a body: give gear_efficiency to the drive that leads "
                'the motor, or use method="idas"'
            )
        case _:
            raise ParameterError(
                f'"{name}" has a load {type(load).__name__}, which the compiled engine does not know; use method="idas"'
            )
