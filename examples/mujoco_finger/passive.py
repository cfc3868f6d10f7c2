"""A tendon of tendonff as a passive force of a MuJoCo model: no loop of one's own, `mj_step` does all.

The chain is stepped in MuJoCo's callback for passive forces, to the time and the joint angles there, and each joint is
pulled by the tension behind its own pulley: with friction on the way that is another one at every joint.
"""

from collections.abc import Callable
from types import TracebackType
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs
from tendonff.models.parameters import Transmission
from tendonff.ocp.simulate import Simulator

Array = NDArray[np.float64]


def tendon_jacobian(model: mujoco.MjModel, data: mujoco.MjData, tendon: int) -> Array:
    """Length of a tendon over the degrees of freedom, shape (nv,): sparse rows in newer MuJoCo, dense in older."""
    if data.ten_J.ndim == 2 and data.ten_J.shape == (model.ntendon, model.nv):
        return np.array(data.ten_J[tendon])
    home = model if hasattr(model, "ten_J_rowadr") else data
    begin, count = int(home.ten_J_rowadr[tendon]), int(home.ten_J_rownnz[tendon])
    dense = np.zeros(model.nv)
    dense[np.ravel(home.ten_J_colind)[begin : begin + count]] = np.ravel(data.ten_J)[begin : begin + count]
    return dense


class PassiveTendon:
    """A chain that MuJoCo steps; `with PassiveTendon(...)` installs it, and takes it off again.

    Parameters
    ----------
    model : mujoco.MjModel
        Its joints that the tendon crosses are hinges, named as in the transmission.
    data : mujoco.MjData
        Where the joints stand at the start.
    rig : Transmission
        With a motion of the joints at MuJoCo's time step, as long as the run: it is overwritten as the joints move.
    start_N : float
        Uniform tension of the start.
    force_N : callable
        Actuator's force [N] at a time [s].
    masses : int
        Number of masses of the chain.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        rig: Transmission,
        *,
        start_N: float,
        force_N: Callable[[float], float],
        masses: int,
    ) -> None:
        motion = rig.motion
        assert motion is not None  # noqa: S101 - for type checkers; Chain.of says it to users
        plant = Chain.of(rig, Level.PRESLIDING, masses)
        section_of = plant.elements.path.section_of
        parts = [section.name for section in rig.path.parts]
        # the link behind the last mass on a joint's pulley pulls at the bone behind the joint
        self._pulls = [int(np.flatnonzero(section_of == parts.index(name)).max()) + 1 for name in motion.names]
        self._address = [int(model.joint(name).qposadr[0]) for name in motion.names]
        self._dofs = [int(model.joint(name).dofadr[0]) for name in motion.names]
        self._angles, self._row = motion.angle_rad, 0
        self._step = float(model.opt.timestep)
        self._angles[:] = data.qpos[self._address]
        self.force_N = force_N
        self._tendon = Simulator(
            plant, self._step, plant.rest_state(start_N), ChainInputs.of(1, near_force_N=force_N(0.0))
        )
        self._start = (self._tendon.checkpoint(), np.full(plant.count + 1, start_N), self._tendon.state.near_position_m)
        self.tension_N, self.actuator_m = self._start[1:]

    def restart(self) -> None:
        """Go back to the start; the data must do so too, to where its joints then stood."""
        memory, self.tension_N, self.actuator_m = self._start
        self._tendon.restore(memory)
        self._row, self._angles[:] = 0, self._angles[0]

    def follow(self, data: mujoco.MjData) -> None:
        """Step the chain to the time of the data, where the joints then stand."""
        row = round(data.time / self._step)
        if row <= self._row:
            return
        self._angles[row:] = data.qpos[self._address]
        self._row = row
        rows = self._tendon.advance(ChainInputs.of(1, near_force_N=self.force_N(data.time)))
        self.tension_N, self.actuator_m = rows.tension_N[-1], float(rows.ends_m[-1, 0])

    def torque_N_m(self, model: mujoco.MjModel, data: mujoco.MjData) -> Array:
        """Torques on the joints, shape (joints,)."""
        torque: Array = -tendon_jacobian(model, data, 0)[self._dofs] * self.tension_N[self._pulls]
        return torque

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """MuJoCo's callback: add to the passive forces."""
        self.follow(data)
        data.qfrc_passive[self._dofs] += self.torque_N_m(model, data)

    def __enter__(self) -> Self:
        mujoco.set_mjcb_passive(self)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        mujoco.set_mjcb_passive(None)
