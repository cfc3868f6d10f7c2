"""Inertia and torques of a model's joints: what a motion needs besides their springs, damping, friction."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.mjcf.model import Hand, mujoco_package

_OFF = ("mjDSBL_CONSTRAINT", "mjDSBL_SPRING", "mjDSBL_DAMPER", "mjDSBL_PASSIVE", "mjDSBL_ACTUATION")


@dataclass(frozen=True, slots=True, kw_only=True)
class JointNumbers:
    """Numbers of one joint in a model.

    Attributes
    ----------
    inertia_kg_m2 : float
        In the middle of all ranges, with all other joints locked.
    damping_N_m_s_per_rad, stiffness_N_m_per_rad, rest_rad, coulomb_N_m : float
    """

    inertia_kg_m2: float
    damping_N_m_s_per_rad: float
    stiffness_N_m_per_rad: float
    rest_rad: float
    coulomb_N_m: float


class Dynamics:
    """Inverse dynamics of a model, its joints free of springs, damping, friction, limits and contacts."""

    def __init__(self, hand: Hand) -> None:
        self._mujoco = mujoco = mujoco_package()
        import copy

        self._hand, self._model = hand, copy.copy(hand.model)
        for name in _OFF:
            if hasattr(mujoco.mjtDisableBit, name):
                self._model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, name))
        self._data = mujoco.MjData(self._model)
        self._address = [joint.address for joint in hand.joints]
        self._dofs = [joint.dof for joint in hand.joints]

    def torque_N_m(self, angle_rad: FloatArray, speed: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Torques of the joints for motions, shape (rows, joints): inertia, Coriolis and gravity [N m]."""
        data, found = self._data, np.empty_like(angle_rad)
        for row in range(len(angle_rad)):
            data.qpos[:], data.qvel[:], data.qacc[:] = self._model.qpos0, 0.0, 0.0
            data.qpos[self._address], data.qvel[self._dofs] = angle_rad[row], speed[row]
            data.qacc[self._dofs] = acceleration[row]
            self._mujoco.mj_inverse(self._model, data)
            found[row] = data.qfrc_inverse[self._dofs]
        return found

    def holding_N_m(self, angle_rad: FloatArray) -> FloatArray:
        """Torques that tendons must give at rest, springs of the joints counted, shape (rows, joints)."""
        still = np.zeros_like(angle_rad)
        springs = [(n.stiffness_N_m_per_rad, n.rest_rad) for n in self.numbers()]
        stiffness, rest = np.array(springs).T
        held: FloatArray = self.torque_N_m(angle_rad, still, still) + stiffness * (angle_rad - rest)
        return held

    def numbers(self) -> tuple[JointNumbers, ...]:
        """Numbers of each joint."""
        middle = np.array([[0.5 * (joint.low_rad + joint.high_rad) for joint in self._hand.joints]])
        still, model = np.zeros_like(middle), self._hand.model
        weight = self.torque_N_m(middle, still, still)[0]
        found = []
        for k, joint in enumerate(self._hand.joints):
            turned = still.copy()
            turned[0, k] = 1.0
            inertia = float(self.torque_N_m(middle, still, turned)[0, k] - weight[k])
            found.append(
                JointNumbers(
                    inertia_kg_m2=inertia,
                    damping_N_m_s_per_rad=_of(model.dof_damping, joint.dof),
                    stiffness_N_m_per_rad=_of(model.jnt_stiffness, joint.index),
                    rest_rad=_of(model.qpos_spring, joint.address),
                    coulomb_N_m=_of(model.dof_frictionloss, joint.dof),
                )
            )
        return tuple(found)


def _of(values: Any, index: int) -> float:
    return float(np.ravel(values[index])[0])
