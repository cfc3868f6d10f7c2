"""Balance of torques at a driven joint, stated once: simulation and inverse share it.

    sum of the tendons' torques = J dw/dt + b w + k (q - rest) + g sin(q - zero) + dry friction
                                  + k_stop (max(q - high, 0) - max(low - q, 0)) + torque on what it touches

The power of a tendon's links is their force times their rate of elongation, and a joint's angle stands in the rate of
every link whose path gets longer with it. So a tendon's torque is the sum over its links of force times what the joint
takes off the link's length per radian: local tensions, not the one at the far end, wherever the path follows the joint.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import DrivenJoint
from tendonff.models.layout import Array, fields_of
from tendonff.models.mechanism.loads import beyond_stops, gravity_torque, spring_force
from tendonff.models.parameters import Friction
from tendonff.models.tendon.bounds import at_least
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.elements import bristle_stiffness_N_per_m
from tendonff.models.tendon.friction import implicit_dry_friction

COULOMB_FLOOR_N_M = 1e-12
"""Least dry friction in the bristle law [N m]: lets a joint without any run through the same expression."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointLaw:
    """A joint's numbers, or CasADi scalars in their place.

    Attributes
    ----------
    inertia_kg_m2, damping_N_m_s_per_rad, stiffness_N_m_per_rad, rest_rad, gravity_N_m, gravity_zero_rad, coulomb_N_m
        As in `DrivenJoint`.
    stop_low_rad, stop_high_rad, stop_stiffness_N_m_per_rad
        The same; far away where there is no stop.
    bristle_N_m_per_rad
        Stiffness of its dry friction before it slips [N m/rad].
    """

    inertia_kg_m2: ca.SX
    damping_N_m_s_per_rad: ca.SX
    stiffness_N_m_per_rad: ca.SX
    rest_rad: ca.SX
    gravity_N_m: ca.SX
    gravity_zero_rad: ca.SX
    coulomb_N_m: ca.SX
    stop_low_rad: ca.SX
    stop_high_rad: ca.SX
    stop_stiffness_N_m_per_rad: ca.SX
    bristle_N_m_per_rad: ca.SX

    @classmethod
    def of(cls, joint: DrivenJoint, friction: Friction, level: Level, arm_m: float) -> "JointLaw":
        """Law of a joint; its dry friction has the bristles of a tendon, at that tendon's moment arm."""
        stiffness = bristle_stiffness_N_per_m(friction, level) * arm_m**2
        own = {k: v for k, v in fields_of(joint).items() if k not in ("name", "range_rad")}
        own |= dict(zip(("stop_low_rad", "stop_high_rad"), joint.stops_rad, strict=True))
        return cls(**own, bristle_N_m_per_rad=stiffness)

    def torque(self, q: ca.SX, w: ca.SX, acceleration: ca.SX, dry_N_m: ca.SX) -> ca.SX:
        """Torque that the tendons give the joint where it touches nothing [N m]."""
        moving = self.inertia_kg_m2 * acceleration + self.damping_N_m_s_per_rad * w + dry_N_m
        stopped = self.stop_stiffness_N_m_per_rad * beyond_stops(q, self.stop_low_rad, self.stop_high_rad)
        held = spring_force(self.stiffness_N_m_per_rad, q, self.rest_rad) + stopped
        return moving + held + gravity_torque(self.gravity_N_m, q, self.gravity_zero_rad)

    def dry_friction(self, w: ca.SX, base: ca.SX, step_s: ca.SX) -> ca.SX:
        """Dry friction at the end of a step of weight H that ends at the speed w [N m]."""
        most = at_least(self.coulomb_N_m, COULOMB_FLOOR_N_M)
        return implicit_dry_friction(self.bristle_N_m_per_rad, most, w, base, step_s)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Followed:
    """Effect of the driven joint on a chain's path, per radian, apart from its far end.

    Attributes
    ----------
    angle_per_rad : ndarray, shape (N,)
        Change of each mass's wrap angle before it is cut off at zero [-].
    length_per_rad : ndarray, shape (N + 1,)
        Change of each link's share of the whole length [1/rad].
    gained_per_rad_m : ndarray, shape (N + 1,)
        What the path gains between the ends of each link [m/rad].
    """

    angle_per_rad: Array
    length_per_rad: Array
    gained_per_rad_m: Array

    @classmethod
    def of(cls, chain: Chain, joint: str) -> "Followed":
        """That of one chain."""
        path = chain.elements.path
        on_it = np.array([section.joint == joint for section in path.sections], float)
        bends = on_it * np.array([section.angle_per_rad for section in path.sections])
        grows = on_it * np.array([section.length_per_rad_m for section in path.sections])
        gained = path.parts @ grows
        return cls(
            angle_per_rad=bends[path.section_of] / path.pieces,
            length_per_rad=np.zeros_like(gained) if path.length_m is None else gained / path.length_m,
            gained_per_rad_m=gained,
        )

    @property
    def any(self) -> bool:
        """Whether anything follows the joint."""
        return bool(self.angle_per_rad.any() or self.gained_per_rad_m.any())
