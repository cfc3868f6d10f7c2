"""A tendon of tendonff as a passive force of a MuJoCo model: no loop of one's own, `mj_step` does all.

The exported plant is stepped in MuJoCo's callback for passive forces, to the time and the joint angles there, and each
joint is pulled by the tension behind its own pulley: with friction on the way that is another one at every joint.
"""

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from examples.mujoco_finger.callback import PassiveForces
from examples.mujoco_finger.exported import ExportedPlant
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain

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


class PassiveTendon(PassiveForces):
    """An exported plant that MuJoCo steps; `with PassiveTendon(...)` installs it, and takes it off again.

    Parameters
    ----------
    model : mujoco.MjModel
        Its joints that the tendon crosses are hinges, named as in the transmission.
    data : mujoco.MjData
        Where the joints stand at the start.
    rig : Transmission
        With the joints' names in its motion; its path has as many masses as the plant.
    start_N : float
        Uniform tension of the start.
    force_N : callable
        Actuator's force [N] at a time [s].
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        rig: Transmission,
        *,
        start_N: float,
        force_N: Callable[[float], float],
    ) -> None:
        section_of = Chain.of(rig, Level.PRESLIDING).elements.path.section_of
        parts = [section.name for section in rig.path.parts]
        # the link behind the last mass on a joint's pulley pulls at the bone behind the joint
        self._pulls = [int(np.flatnonzero(section_of == parts.index(name)).max()) + 1 for name in rig.joints]
        self._address = [int(model.joint(name).qposadr[0]) for name in rig.joints]
        self._dofs = [int(model.joint(name).dofadr[0]) for name in rig.joints]
        self._step = float(model.opt.timestep)
        self.plant = ExportedPlant(rig, start_N, self._step)
        self.force_N = force_N
        self.restart(data)

    def restart(self, data: mujoco.MjData) -> None:
        """At rest under the tension of the start, where the joints of the data stand."""
        self._row = 0
        self.plant.start(data.qpos[self._address])

    @property
    def tension_N(self) -> Array:
        """Tension of each link from the actuator on, shape (links,) [N]."""
        return self.plant.tension_N

    def follow(self, data: mujoco.MjData) -> None:
        """Step the plant to the time of the data, where the joints then stand."""
        row = round(data.time / self._step)
        if row <= self._row:
            return
        self._row = row
        self.plant.step(self.force_N(data.time), data.qpos[self._address])

    def torque_N_m(self, model: mujoco.MjModel, data: mujoco.MjData) -> Array:
        """Torques on the joints, shape (joints,)."""
        torque: Array = -tendon_jacobian(model, data, 0)[self._dofs] * self.tension_N[self._pulls]
        return torque

    def add(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Add the joints' torques to MuJoCo's passive forces."""
        data.qfrc_passive[self._dofs] += self.torque_N_m(model, data)
