r"""The lumped chain: two end masses, N masses on the path, N + 1 links.

::

    actuator                 tendon: N masses on the curved path, N+1 links                    load
    f_c1 -> [m_a] ~~f_1~~ (m_1) ~~f_2~~ (m_2) ~~ ... ~~ (m_N) ~~f_{N+1}~~ [m_l] -> f_c2
             |q_a            q_1          q_2               q_N              q_l|
     x_c1 --/\/\ k_c1                                                 k_c2 /\/\-- x_c2
    <------ pulling, positive                                        output tension = f_{N+1}

Positions and velocities are positive towards the actuator, tensions are positive. The ends are symmetric: each may
act (force f_c, k_c = 0) or load (k_c > 0 towards the rest position x_c). Fig. 2 of Palli, Borghesan, Melchiorri (ICRA
2010).
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.models.elements import Elements, elements_of
from tendonff.models.fidelity import Level
from tendonff.models.friction import BristleParameters, bristle_rate, friction_force, normal_force
from tendonff.models.link import LinkParameters, relaxation_rate, tendon_force, unclipped_force
from tendonff.models.parameters import Transmission

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """One end of the chain: a mass with a damper, what drives it and what it leans on.

    Parameters
    ----------
    mass_kg : float
        Moving mass [kg], > 0.
    damping_N_s_per_m : float
        Viscous damping [N s/m].
    stiffness_N_per_m : float
        k_c [N/m]; 0 for an actuator.
    """

    mass_kg: float
    damping_N_s_per_m: float
    stiffness_N_per_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """A transmission at one fidelity level, cut into N masses.

    Parameters
    ----------
    elements : Elements
        Everything per element.
    level : Level
        Fidelity level the elements were made for.
    near, far : End
        The actuator's end and the load's end.
    """

    elements: Elements
    level: Level
    near: End
    far: End

    @classmethod
    def of(cls, transmission: Transmission, level: Level, segments: int | None = None) -> "Chain":
        """Chain of a transmission: the actuator acts on the near end, the load's spring holds the far end.

        Parameters
        ----------
        transmission : Transmission
        level : Level
        segments : int, optional
            Number of masses; default: the path's own.
        """
        actuator, load = transmission.actuator, transmission.load
        return cls(
            elements=elements_of(transmission, level, segments),
            level=level,
            near=End(mass_kg=actuator.mass_kg, damping_N_s_per_m=actuator.damping_N_s_per_m, stiffness_N_per_m=0.0),
            far=End(
                mass_kg=load.mass_kg, damping_N_s_per_m=load.damping_N_s_per_m, stiffness_N_per_m=load.stiffness_N_per_m
            ),
        )

    def with_end_stiffness(self, near_N_per_m: float, far_N_per_m: float) -> "Chain":
        """The same chain with other k_c1, k_c2 [N/m]: what a motor that changes between acting and loading needs."""
        return replace(
            self,
            near=replace(self.near, stiffness_N_per_m=near_N_per_m),
            far=replace(self.far, stiffness_N_per_m=far_N_per_m),
        )

    @property
    def count(self) -> int:
        """Number N of masses on the path."""
        return self.elements.count

    @property
    def link(self) -> LinkParameters:
        """Parameters of one link."""
        e = self.elements
        return LinkParameters(
            stiffness_N_per_m=e.stiffness_N_per_m,
            relaxing_stiffness_N_per_m=e.relaxing_stiffness_N_per_m,
            relaxation_time_s=e.relaxation_time_s,
            damping_N_s_per_m=e.damping_N_s_per_m,
        )

    @property
    def bristle(self) -> BristleParameters:
        """Parameters of one bristle."""
        e = self.elements
        return BristleParameters(
            bristle_stiffness_N_per_m=e.bristle_stiffness_N_per_m,
            mu_dynamic_pull=e.mu_dynamic_pull,
            mu_static_pull=e.mu_static_pull,
            mu_dynamic_release=e.mu_dynamic_release,
            mu_static_release=e.mu_static_release,
            stribeck_velocity_m_per_s=e.stribeck_velocity_m_per_s,
        )

    def rest_state(self, tension_N: float, far_rest_position_m: float = 0.0) -> "ChainState":
        """At rest under uniform tension: f_s = 0, z = e = T0/(k1 (N+1)), the far spring carries T0.

        Parameters
        ----------
        tension_N : float
            T0 [N].
        far_rest_position_m : float
            x_c2 [m].

        Returns
        -------
        ChainState
            With q_l = x_c2 + T0/k_c2 (0 offset where k_c2 = 0, a far motor that acts with f_c2 = T0).
        """
        n, k_far = self.count, self.far.stiffness_N_per_m
        stretch = tension_N / self.elements.stiffness_N_per_m
        q_far = far_rest_position_m + (tension_N / k_far if k_far > 0 else 0.0)
        return ChainState(
            velocity_m_per_s=np.zeros(n + 2),
            elongation_m=np.full(n + 1, stretch),
            relaxed_m=np.full(n + 1, stretch),
            bristle_N=np.zeros(n),
            near_position_m=q_far + stretch * (n + 1),
            far_position_m=q_far,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainState:
    """State of the chain at one instant.

    Parameters
    ----------
    velocity_m_per_s : ndarray, shape (N + 2,)
        v_a, v_1 .. v_N, v_l.
    elongation_m, relaxed_m : ndarray, shape (N + 1,)
        e and z of each link.
    bristle_N : ndarray, shape (N,)
        f_s of each mass.
    near_position_m, far_position_m : float
        q_a, q_l. The positions between them follow from the elongations, whose differences keep full precision.
    """

    velocity_m_per_s: Array
    elongation_m: Array
    relaxed_m: Array
    bristle_N: Array
    near_position_m: float
    far_position_m: float

    def vector(self) -> Array:
        """All states in one array, shape (4 N + 6,): v, e, z, f_s, q_a, q_l."""
        ends = [self.near_position_m, self.far_position_m]
        return np.concatenate([self.velocity_m_per_s, self.elongation_m, self.relaxed_m, self.bristle_N, ends])

    @classmethod
    def from_vector(cls, x: Array) -> "ChainState":
        """Inverse of `vector`.

        Parameters
        ----------
        x : ndarray, shape (4 N + 6,)
        """
        n = (len(x) - 6) // 4
        v, e, z, f_s, ends = np.split(np.array(x, dtype=np.float64), np.cumsum([n + 2, n + 1, n + 1, n]))
        return cls(
            velocity_m_per_s=v,
            elongation_m=e,
            relaxed_m=z,
            bristle_N=f_s,
            near_position_m=float(ends[0]),
            far_position_m=float(ends[1]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainEquations:
    """The continuous-time chain as CasADi expressions.

    Parameters
    ----------
    state : ca.SX, shape (4 N + 6, 1)
        In the order of `ChainState.vector`.
    inputs : ca.SX, shape (4, 1)
        f_c1 [N], x_c1 [m], f_c2 [N], x_c2 [m].
    rate : ca.SX, shape (4 N + 6, 1)
        Time derivative of `state`.
    tension_N : ca.SX, shape (N + 1, 1)
        f_1 .. f_{N+1}.
    """

    state: ca.SX
    inputs: ca.SX
    rate: ca.SX
    tension_N: ca.SX


def end_force(v: ca.SX, q: ca.SX, tension: ca.SX, pull: ca.SX, f_c: ca.SX, x_c: ca.SX, end: End) -> ca.SX:
    """Sum of the forces on an end mass, positive towards the actuator [N].

    Parameters
    ----------
    v, q : ca.SX
        Velocity [m/s], position [m].
    tension : ca.SX
        Tension of the adjacent link [N].
    pull : ca.SX
        Direction in which the tension pulls the mass: -1 at the near end, +1 at the far end.
    f_c, x_c : ca.SX
        Motor force away from the tendon [N], rest position of the end's spring [m].
    end : End
        Numbers or CasADi scalars.
    """
    return pull * (tension - f_c) - end.damping_N_s_per_m * v - end.stiffness_N_per_m * (q - x_c)


def chain_equations(chain: Chain) -> ChainEquations:
    """Write the chain of Fig. 2 with laws (4) to (7) as one system of differential equations.

    Parameters
    ----------
    chain : Chain

    Returns
    -------
    ChainEquations
    """
    n, elements = chain.count, chain.elements
    v, e, z = ca.SX.sym("v", n + 2), ca.SX.sym("e", n + 1), ca.SX.sym("z", n + 1)
    f_s, ends = ca.SX.sym("f_s", n), ca.SX.sym("q", 2)
    inputs = ca.SX.sym("u", 4)
    f_c1, x_c1, f_c2, x_c2 = ca.vertsplit(inputs)
    link, bristle = chain.link, chain.bristle

    e_rate = v[:-1] - v[1:]
    f = tendon_force(unclipped_force(e, e_rate, z, link))
    z_rate = relaxation_rate(e, z, link)

    on_path = v[1:-1]
    f_n = normal_force(f[:-1], f[1:], elements.adhesion_N)
    f_s_rate = bristle_rate(on_path, f_s, f_n, bristle)
    f_f = friction_force(on_path, f_s, elements.viscous_N_s_per_m)

    near, far = chain.near, chain.far
    near_force = end_force(v[0], ends[0], f[0], -1, f_c1, x_c1, near)
    far_force = end_force(v[n + 1], ends[1], f[n], 1, f_c2, x_c2, far)
    path_force = f[:-1] - f[1:] - f_f
    acceleration = ca.vertcat(near_force / near.mass_kg, path_force / elements.mass_kg, far_force / far.mass_kg)
    return ChainEquations(
        state=ca.vertcat(v, e, z, f_s, ends),
        inputs=inputs,
        rate=ca.vertcat(acceleration, e_rate, z_rate, f_s_rate, v[0], v[n + 1]),
        tension_N=f,
    )
