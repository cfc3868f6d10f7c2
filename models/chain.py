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

from tendonff.models.assembly import End, end_force, normal_force, path_force
from tendonff.models.elements import Elements, elements_of
from tendonff.models.fidelity import Level
from tendonff.models.friction import FrictionLaw
from tendonff.models.layout import INPUT_NAMES, ChainState, StateLayout, fields_of
from tendonff.models.link import LinkLaw, tendon_force
from tendonff.models.parameters import Transmission


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
    def link(self) -> LinkLaw:
        """Law of one link."""
        return self.elements.link

    @property
    def friction(self) -> FrictionLaw:
        """Friction law of one mass on the path."""
        return self.elements.friction

    @property
    def layout(self) -> StateLayout:
        """Order of the states."""
        return StateLayout(count=self.count, link_states=self.link.states, friction_states=self.friction.states)

    def numbers(self) -> dict[str, float]:
        """Every parameter by name: the one record that generated C and sensitivities follow."""
        e = self.elements
        records = {"piece_": e.piece, "friction_": e.friction, "link_": e.link, "near_": self.near, "far_": self.far}
        return {name: value for prefix, record in records.items() for name, value in fields_of(record, prefix).items()}

    def rest_state(self, tension_N: float, far_rest_position_m: float = 0.0) -> ChainState:
        """At rest under uniform tension: f_s = 0, e as long as the tension needs, the far spring carries T0.

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
        stretch, states = self.link.rest(tension_N)
        q_far = far_rest_position_m + (tension_N / k_far if k_far > 0 else 0.0)
        return ChainState(
            velocity_m_per_s=np.zeros(n + 2),
            elongation_m=np.full(n + 1, stretch),
            link=np.repeat(np.array(states, dtype=np.float64)[:, None], n + 1, axis=1),
            friction=np.zeros((len(self.friction.states), n)),
            near_position_m=q_far + stretch * (n + 1),
            far_position_m=q_far,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainEquations:
    """The continuous-time chain as CasADi expressions.

    Parameters
    ----------
    state : ca.SX, shape (size, 1)
        In the order of `StateLayout`.
    inputs : ca.SX, shape (4, 1)
        In the order of `INPUT_NAMES`.
    rate : ca.SX, shape (size, 1)
        Time derivative of `state`.
    tension_N : ca.SX, shape (N + 1, 1)
        f_1 .. f_{N+1}.
    """

    state: ca.SX
    inputs: ca.SX
    rate: ca.SX
    tension_N: ca.SX


def chain_equations(chain: Chain) -> ChainEquations:
    """Write the chain of Fig. 2 with laws (4) to (7) as one system of differential equations.

    Parameters
    ----------
    chain : Chain

    Returns
    -------
    ChainEquations
    """
    n, layout, piece, friction, link = chain.count, chain.layout, chain.elements.piece, chain.friction, chain.link
    state = ca.SX.sym("x", layout.size)
    inputs = ca.SX.sym("u", len(INPUT_NAMES))
    f_c1, x_c1, f_c2, x_c2 = ca.vertsplit(inputs)
    v, e, *own, q_a, q_l = ca.vertsplit(state, layout.cuts)
    links, masses = tuple(own[: len(link.states)]), tuple(own[len(link.states) :])

    e_rate = v[:-1] - v[1:]
    f = tendon_force(link.unclipped_force(e, e_rate, links))
    on_path = v[1:-1]
    f_n = normal_force(f[:-1], f[1:], piece.adhesion_N)
    f_f = friction.state_force(masses) + friction.viscous_force(on_path)

    near, far = chain.near, chain.far
    near_force = end_force(v[0], q_a, f[0], -1, f_c1, x_c1, near)
    far_force = end_force(v[n + 1], q_l, f[n], 1, f_c2, x_c2, far)
    masses_rate = path_force(f[:-1], f[1:], f_f) / piece.mass_kg
    return ChainEquations(
        state=state,
        inputs=inputs,
        rate=ca.vertcat(
            *(near_force / near.mass_kg, masses_rate, far_force / far.mass_kg, e_rate),
            *(*link.rate(e, links), *friction.rate(on_path, masses, f_n), v[0], v[n + 1]),
        ),
        tension_N=f,
    )
