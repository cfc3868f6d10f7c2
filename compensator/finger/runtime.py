"""The exact inverse of a finger in a control loop, step by step."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.finger.compensators import FingerTask
from tendonff.compensator.finger.scenario import FingerScenario
from tendonff.models.errors import ParameterError
from tendonff.ocp.mechanism.compiled import CompiledMechanism
from tendonff.ocp.mechanism.problem import rest
from tendonff.ocp.mechanism.response import motors_of


class FingerRuntime:
    """Motor angles for wanted joint angles, in compiled C on this machine. Starts at rest at the reference's start.

    Parameters
    ----------
    scenario : FingerScenario

    Attributes
    ----------
    step_s : float
        Time of a step [s].
    joints, motors : tuple of str
        In the order of what a step takes and gives.

    Raises
    ------
    InputError
        If the mechanism cannot rest at its start.
    CodeError
        If no C compiler works here.
    """

    def __init__(self, scenario: FingerScenario) -> None:
        task = FingerTask.of(scenario)
        if scenario.others:
            raise InputError(
                f"{scenario.source.name}: a runtime of several joints knows driven ones alone, not "
                f'{", ".join(scenario.others)}; give them kind = "driven", or design for a known motion'
            )
        self._problem = problem = task.problem(task.finger)
        memory, start = rest(problem), problem.start[: problem.known]
        engine = CompiledMechanism(problem, task.step_s)
        self._call = call = engine.inverse_call(memory, np.tile(start, (2, 1)), np.zeros((2, problem.known)))
        self._state = (*memory.x, *memory.x_old, memory.worth, call.z, call.z_old, call.tension_N)
        self._before = [each.copy() for each in self._state]
        self._command = np.zeros(problem.motors)
        self.step_s, self.joints = task.step_s, task.finger.names
        self.motors = tuple(motor.name for motor in task.finger.motors)
        self._at_rest = [0.0] * problem.known
        self.held = False

    def step(
        self,
        reference: Mapping[str, float] | Sequence[float] | None,
        torque_N_m: Mapping[str, float] | Sequence[float] | None = None,
    ) -> FloatArray:
        """Advance by `step_s` and give the angles of the motors since the start, shape (motors,) [rad].

        Parameters
        ----------
        reference : mapping of str to float, or sequence of float, or None
            Angles of the joints wanted at the end of this step [rad]. None, or an angle that is not finite: the last
            command is held, and `held` says so.
        torque_N_m : mapping of str to float, or sequence of float, optional
            What the joints give to what they touch, or their motion needs besides their own numbers [N m].

        Raises
        ------
        ParameterError
            If an angle of a joint is missing.
        """
        wanted = None if reference is None else self._by_joint("reference", reference)
        effort = self._at_rest if torque_N_m is None else self._by_joint("torque_N_m", torque_N_m)
        self.held = wanted is None or not all(map(math.isfinite, (*wanted, *effort)))
        if not self.held:
            self._advance(wanted, effort)
        return self._command.copy()

    def _advance(self, wanted: Sequence[float] | None, effort: Sequence[float]) -> None:
        call = self._call
        for kept, now in zip(self._before, self._state, strict=True):
            kept[:] = now
        call.position[1], call.effort[1] = wanted, effort
        if call():
            call.position[0], call.effort[0] = wanted, effort
            self._command = motors_of(self._problem, call.travel_m, call.slack_m)[0]
            return
        self.held = True  # no tensions give the torques there: the mechanism stays where it was
        for kept, now in zip(self._before, self._state, strict=True):
            now[:] = kept

    def _by_joint(self, name: str, given: Mapping[str, float] | Sequence[float]) -> list[float]:
        if isinstance(given, Mapping):
            missing = [joint for joint in self.joints if joint not in given]
            if missing:
                raise ParameterError(f"{name} must hold a number for each joint, got none of {', '.join(missing)}")
            given = [given[joint] for joint in self.joints]
        if isinstance(given, str) or len(given) != len(self.joints):
            raise ParameterError(f"{name} must hold {len(self.joints)} numbers ({', '.join(self.joints)})")
        return [math.nan if value is None else float(value) for value in given]
