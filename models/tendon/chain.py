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

import math
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.gear import DriveLaw
from tendonff.models.layout import Array, ChainState, StateLayout, fields_of
from tendonff.models.parameters import Transmission
from tendonff.models.path import CutPath, JointMotion, PathRows
from tendonff.models.tendon.assembly import End
from tendonff.models.tendon.elements import Elements, bristle_stiffness_N_per_m, whole_of
from tendonff.models.tendon.friction import FrictionLaw, GearedEnd, LuGreBristle, RubbingEnd
from tendonff.models.tendon.link import LinkLaw

_CELL_MASS_KG = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """A transmission at one fidelity level, cut into N masses.

    Attributes
    ----------
    elements : Elements
        Everything per element.
    level : Level
        That the elements were made for.
    near, far : End
        The actuator's end and the load's end.
    motion : JointMotion or None
        What the joints of a moving path do.
    far_joint : tuple[str, float] or None
        Joint that moves the far end, and its moment arm [m].
    """

    elements: Elements
    level: Level
    near: End
    far: End
    motion: JointMotion | None = None
    far_joint: tuple[str, float] | None = None

    @classmethod
    def of(cls, transmission: Transmission, level: Level, segments: int | None = None) -> "Chain":
        """Chain of a transmission: the actuator acts on the near end, the load's spring or a joint holds the far end.

        Parameters
        ----------
        transmission : Transmission
        level : Level
        segments : int, optional
            Number of masses; default: the path's own.

        Raises
        ------
        ParameterError
            If a section or the load names a joint that does not move, or the path has no meaning under the motion.
        """
        load, motion = transmission.load, transmission.motion
        count = transmission.path.segments if segments is None else segments
        if not count >= 1:
            raise ParameterError(f"segments must be >= 1, got {count}; 6 is a good start")
        if motion is not None and load.joint is not None and load.joint not in motion.names:
            raise ParameterError(f'the load names the joint "{load.joint}", which does not move; give it a motion')
        return cls(
            elements=whole_of(transmission, level).divided(count, motion),
            level=level,
            motion=motion,
            far_joint=None if load.joint is None else (load.joint, load.moment_arm_m or 0.0),
            near=_actuator_end(transmission, level),
            far=End(
                mass_kg=load.mass_kg, damping_N_s_per_m=load.damping_N_s_per_m, stiffness_N_per_m=load.stiffness_N_per_m
            ),
        )

    def led_by_tension(self) -> "Chain":
        """The same chain behind a tension cell: the tension measured there pulls a near end too light to matter."""
        return replace(self, near=End(mass_kg=_CELL_MASS_KG, damping_N_s_per_m=0.0, stiffness_N_per_m=0.0))

    def with_end_stiffness(self, near_N_per_m: float, far_N_per_m: float) -> "Chain":
        """The same chain with other k_c1, k_c2 [N/m]: what a motor that changes between acting and loading needs."""
        return replace(
            self,
            near=replace(self.near, stiffness_N_per_m=near_N_per_m),
            far=replace(self.far, stiffness_N_per_m=far_N_per_m),
        )

    def stiffened(self, factor: float) -> "Chain":
        """The same chain with bristles stiffer by a factor [-]; itself where its friction law has none."""
        e = self.elements
        if not (isinstance(e.contact, LuGreBristle) and isinstance(e.friction, LuGreBristle)):
            return self
        return replace(
            self, elements=replace(e, contact=e.contact.stiffened(factor), friction=e.friction.stiffened(factor))
        )

    @property
    def count(self) -> int:
        """Number N of masses on the path."""
        return self.elements.count

    def at_rest(self, angle_rad: Array | None = None) -> "Chain":
        """Chain with joints at constant angles, shape (joints,), given or those of the start."""
        if self.motion is None:
            return self
        return replace(self, motion=self.motion.held(self.motion.angle_rad[0] if angle_rad is None else angle_rad))

    @property
    def moving(self) -> bool:
        """Whether masses differ from one another or from one instant to the next."""
        return self.motion is not None or not self.elements.uniform or self.far_joint is not None

    @property
    def drive(self) -> DriveLaw:
        """Static law of the actuator's own dry friction."""
        if not isinstance(self.near, RubbingEnd):
            return DriveLaw()
        lost = self.near.lost_share if isinstance(self.near, GearedEnd) else 0.0
        return DriveLaw(coulomb_N=self.near.coulomb_N, lost_share=lost)

    @property
    def link(self) -> LinkLaw:
        """Law of the whole tendon as a link; one of its links is `link.shortened(ratio)`."""
        return self.elements.link

    @property
    def friction(self) -> FrictionLaw:
        """Friction law of one mass on the path, at joint angle zero."""
        return self.elements.friction

    def path_at(self, time_s: Array) -> PathRows:
        """Where the path is at instants, shape (rows,)."""
        return path_at(self.elements.path, self.motion, self.far_joint, time_s)

    @property
    def layout(self) -> StateLayout:
        """Order of the states."""
        return StateLayout(
            count=self.count,
            link_states=self.link.states,
            friction_states=self.friction.states,
            end_states=self.near.states,
        )

    def numbers(self) -> dict[str, float]:
        """Every parameter by name: the one record that generated C and sensitivities follow.

        Where masses differ (`moving`), the largest; `of_masses` has them all.
        """
        e = self.elements
        records = {"piece_": e.piece, "friction_": e.friction, "link_": e.link, "near_": self.near, "far_": self.far}
        every = {name: value for prefix, record in records.items() for name, value in fields_of(record, prefix).items()}
        return {name: np.max(value) if isinstance(value, np.ndarray) else value for name, value in every.items()}

    def of_masses(self) -> dict[str, Array]:
        """Numbers that differ from mass to mass, each of shape (N,), for non-uniform chains."""
        e = self.elements
        known = {
            "piece_mass_kg": e.piece.mass_kg,
            "length_share": e.path.length_share,
            **fields_of(e.contact, "contact_"),
        }
        table = np.empty((len(known), self.count))
        for row, value in zip(table, known.values(), strict=True):
            row[:] = value
        return dict(zip(known, table, strict=True))

    def rest_state(self, tension_N: float, far_rest_position_m: float = 0.0) -> ChainState:
        """At rest under uniform tension T0, where the joints stand at first: f_s = 0, the far spring carries T0.

        q_l = x_c2 + T0/k_c2; x_c2 where k_c2 = 0, a far motor that acts with f_c2 = T0.
        """
        n, k_far = self.count, self.far.stiffness_N_per_m
        ratio = self.path_at(np.zeros(1)).ratio[0]
        stretch, states = self.link.shortened(ratio).rest(tension_N)
        on_spring = k_far > 0 and self.far_joint is None
        q_far = far_rest_position_m + (tension_N / k_far if on_spring else 0.0)
        return ChainState(
            velocity_m_per_s=np.zeros(n + 2),
            elongation_m=stretch,
            link=np.array(states, dtype=np.float64).reshape(len(self.link.states), n + 1),
            friction=np.zeros((len(self.friction.states), n)),
            near_position_m=q_far + math.fsum(stretch),
            far_position_m=q_far,
            near=np.zeros(len(self.near.states)),
        )


def path_at(path: CutPath, motion: JointMotion | None, far_joint: tuple[str, float] | None, time_s: Array) -> PathRows:
    """Where a path is at instants, shape (rows,), under the motion of its joints."""
    if motion is None:
        if len(time_s) == 1:
            return path.at_zero
        still = fields_of(path.at_zero)
        return PathRows(**{name: np.repeat(value, len(time_s), axis=0) for name, value in still.items()})
    joints = dict(zip(motion.names, motion.at(time_s).T, strict=True))
    far = None if far_joint is None else -far_joint[1] * joints[far_joint[0]]
    return path.at(joints, far)


def _actuator_end(transmission: Transmission, level: Level) -> End:
    """The actuator as an end that acts; its dry friction has the bristle of the level."""
    actuator = transmission.actuator
    end = {"mass_kg": actuator.mass_kg, "damping_N_s_per_m": actuator.damping_N_s_per_m, "stiffness_N_per_m": 0.0}
    law = actuator.law
    if law.is_ideal:
        return End(**end)
    rubbing = end | {
        "coulomb_N": law.coulomb_N,
        "bristle_stiffness_N_per_m": bristle_stiffness_N_per_m(transmission.friction, level),
    }
    return GearedEnd(**rubbing, lost_share=law.lost_share) if law.lost_share else RubbingEnd(**rubbing)


def laws_at(chain: Chain, place: ca.SX) -> tuple[FrictionLaw, LinkLaw]:
    """Laws of the masses and of the links for a pose of the path; fields are numbers, or one for each mass and link.

    The place, shape (3 N + 3, 1), is a row of `PathRows.table`; without use where nothing moves.
    """
    n = chain.count
    return chain.elements.laws_at(place[:n], place[n : 2 * n + 1]) if chain.moving else chain.elements.laws
