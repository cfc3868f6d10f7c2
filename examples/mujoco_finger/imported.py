"""Tendons of any imported model as a passive force of MuJoCo: `mj_step` moves the bones, tendonff pulls them.

    with ImportedTendons(model, data, scenario, motor_rad) as tendons:
        mujoco.mj_step(model, data)

Each joint is pulled by the tension next to it, with friction on the way; motors follow their commands.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from examples.mujoco_finger.callback import PassiveForces
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.ocp.mechanism.compiled import CompiledMechanism
from tendonff.ocp.mechanism.problem import rest

Array = NDArray[np.float64]


class ImportedTendons(PassiveForces):
    """Tendons, joints led by MuJoCo and motors led by a command, stepped in MuJoCo's callback for passive forces.

    Parameters
    ----------
    model : mujoco.MjModel
        The model that the scenario was imported from; its own actuators must do nothing.
    data : mujoco.MjData
        Put where the scenario's reference starts.
    scenario : FingerScenario
        From `tf.import_mjcf`; another one, with other numbers of friction and stiffness, is a plant that differs.
    motor_rad : callable
        Angles of the motors since the start, shape (motors,) [rad], at a time [s].
    masses : int, optional
        On each tendon; default: 40.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        scenario: FingerScenario,
        motor_rad: Callable[[float], Array],
        masses: int | None = 40,
    ) -> None:
        task = FingerTask.of(scenario)
        self._problem = problem = task.problem(task.finger, masses=masses)
        joints = [model.joint(name) for name in problem.names[: problem.known]]
        self.address = [int(joint.qposadr[0]) for joint in joints]
        self._dofs = [int(joint.dofadr[0]) for joint in joints]
        self._step, self.motor_rad = float(model.opt.timestep), motor_rad
        self._engine = CompiledMechanism(problem, self._step)
        self._led = np.ones(problem.bodies)
        places = dict(zip(problem.names, problem.start, strict=True))
        self._arms = task.finger.moment_arm_m(np.array([[places[name] for name in task.finger.names]]))[0]
        stiffness = [tendon.tendon.stiffness_N_per_m for tendon in task.finger.tendons]
        self.stored_J = float(np.sum(problem.tension_N**2 / np.array(stiffness)) / 2)
        """In the tendons at the start."""
        self.restart(data)

    def restart(self, data: Any) -> None:
        """Put joints and tendons at rest where the reference starts."""
        problem = self._problem
        self._memory, self._row, self._before = rest(problem), 0, problem.start.copy()
        data.time, data.qvel[:], data.qpos[self.address] = 0.0, 0.0, problem.start[: problem.known]
        self.torque_N_m: Array = self._arms.T @ problem.tension_N
        self.tension_N: Array = problem.tension_N.copy()
        self.motor_N_m: Array = self._of_motors(problem.tension_N)

    def follow(self, data: Any) -> None:
        """Step the tendons to the time of the data, where the joints then stand."""
        row = round(data.time / self._step)
        if row <= self._row:
            return
        self._row, known = row, self._problem.known
        now = np.concatenate([data.qpos[self.address], self.motor_rad(data.time)])
        rows = np.vstack([self._before, now])
        run = self._engine.run(self._memory, rows, np.zeros_like(rows), self._led)
        if not len(run.torque):
            raise RuntimeError(f"the tendons have no state at t = {data.time:g} s; use a smaller timestep")
        self.torque_N_m, self.tension_N, self._before = run.torque[-1, :known], run.tension_N[-1], now
        self.motor_N_m = self._of_motors(run.drum_N[-1])

    def _of_motors(self, drum_N: Array) -> Array:
        """Torques by which the motors pull, shape (motors,) [N m]."""
        found = np.zeros(self._problem.motors)
        np.add.at(found, list(self._problem.motor_of), drum_N * np.asarray(self._problem.winding_m))
        return found

    def add(self, model: Any, data: Any) -> None:  # noqa: ARG002 - MuJoCo's signature
        """Add the joints' torques to MuJoCo's passive forces."""
        data.qfrc_passive[self._dofs] += self.torque_N_m
