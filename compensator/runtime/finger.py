"""The exact inverse of a finger in a control loop, step by step."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.runtime.kinds import RuntimeStatus
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters.finger import Motor
from tendonff.ocp.mechanism.compiled import CompiledMechanism
from tendonff.ocp.mechanism.problem import rest
from tendonff.ocp.mechanism.response import ahead_of_drums, efforts_of, motors_of


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
    ranges : dict of str to (float, float)
        Angles of each joint that are accepted [rad].
    status : tuple of RuntimeStatus
        Of the last step; empty where nothing is to be said.

    Raises
    ------
    InputError
        If the mechanism cannot rest at its start.
    CodeError
        If no C compiler works here.
    """

    def __init__(self, scenario: FingerScenario) -> None:
        task = FingerTask.of(scenario)
        if scenario.joints:
            raise InputError(
                f"{scenario.source.name}: a runtime of several joints knows driven ones alone, not "
                f'{", ".join(scenario.joints)}; give them kind = "driven", or design for a known motion'
            )
        self._problem = problem = task.problem(task.finger)
        memory, start = rest(problem), problem.start[: problem.known]
        engine = CompiledMechanism(problem, task.step_s)
        self._call = call = engine.inverse_call(memory, np.tile(start, (2, 1)), np.zeros((2, problem.known)))
        self._answer = _DriveAnswer(task.finger.motors, task.step_s)
        self._state = (*memory.x, *memory.x_old, memory.worth, call.z, call.z_old, call.tension_N)
        self._whole = (*self._state, call.position[0], call.effort[0], *self._answer.memory)
        self._before = [each.copy() for each in self._state]
        self.step_s, self.joints = task.step_s, task.finger.names[: scenario.wanted]
        self.motors = tuple(motor.name for motor in task.finger.motors)
        self.ranges = _ranges(task, self.joints)
        self.status: tuple[RuntimeStatus, ...] = ()

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
            command is held, and `status` says so.
        torque_N_m : mapping of str to float, or sequence of float, optional
            What the joints give to what they touch, or their motion needs besides their own numbers [N m].

        Raises
        ------
        ParameterError
            If an angle of a joint is missing.
        """
        wanted = None if reference is None else self._by_joint("reference", reference)
        effort = [0.0] * len(self.joints) if torque_N_m is None else self._by_joint("torque_N_m", torque_N_m)
        if wanted is None or not all(map(math.isfinite, (*wanted, *effort))):
            self.status = (RuntimeStatus.INPUT_HELD,)
        elif any(not low <= q <= high for q, (low, high) in zip(wanted, self.ranges.values(), strict=True)):
            self.status = (RuntimeStatus.RANGE,)
        else:
            self._advance(wanted, effort)
        return self._answer.command.copy()

    def content(self) -> bytes:
        """Everything that is remembered, in this machine's byte order."""
        return bytes([self._call.fresh.value]) + b"".join(each.tobytes() for each in self._whole)

    def restore(self, held: bytes) -> bool:
        """Go on from what `content` gave; False, and nothing changed, where these are no such bytes."""
        sizes = [each.nbytes for each in self._whole]
        if len(held) != 1 + sum(sizes):
            return False
        values = np.frombuffer(held, dtype=np.float64, offset=1)
        if held[0] > 1 or not np.isfinite(values).all():
            return False
        for part, each in zip(np.split(values, np.cumsum(sizes)[:-1] // values.itemsize), self._whole, strict=True):
            each[...] = part.reshape(each.shape)
        self._call.fresh.value = held[0]
        return True

    def _advance(self, wanted: Sequence[float], effort: Sequence[float]) -> None:
        call, known = self._call, len(self.joints)
        for kept, now in zip(self._before, self._state, strict=True):
            kept[:] = now
        call.position[1, :known], call.effort[1, :known] = wanted, effort
        if not call():  # no tensions give the torques there: the mechanism stays where it was
            for kept, now in zip(self._before, self._state, strict=True):
                now[:] = kept
            self.status = (RuntimeStatus.FAILED,)
            return
        call.position[0], call.effort[0] = call.position[1], call.effort[1]
        drums = motors_of(self._problem, call.travel_m, call.slack_m)
        limited = self._answer.to(ahead_of_drums(self._problem, drums, efforts_of(self._problem, call.drum_N))[0])
        said = {
            RuntimeStatus.SPEED_LIMITED: limited,
            RuntimeStatus.WOULD_PUSH: call.lowest_N[0] <= 0,
            RuntimeStatus.SLACK: bool(call.slack_m.any()),
        }
        self.status = tuple(each for each, holds in said.items() if holds)

    def _by_joint(self, name: str, given: Mapping[str, float] | Sequence[float]) -> list[float]:
        if isinstance(given, Mapping):
            missing = [joint for joint in self.joints if joint not in given]
            if missing:
                raise ParameterError(f"{name} must hold a number for each joint, got none of {', '.join(missing)}")
            given = [given[joint] for joint in self.joints]
        if isinstance(given, str | float | int) or len(given) != len(self.joints):
            raise ParameterError(f"{name} must hold {len(self.joints)} numbers ({', '.join(self.joints)})")
        if text := [value for value in given if isinstance(value, str)]:
            raise ParameterError(f"{name} must hold numbers, got {text[0]!r}; convert text by float() where it arrives")
        return [math.nan if value is None else float(value) for value in given]


def _ranges(task: FingerTask, joints: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Angles that are accepted, by joint."""
    wanted = zip(joints, task.finger.joints, task.wanted_rad.T, strict=False)
    return {name: joint.accepted_rad(float(angle.min()), float(angle.max())) for name, joint, angle in wanted}


class _DriveAnswer:
    """Commands whose answer is the wanted angle, step by step; see `joint.drive.commanded`, live."""

    def __init__(self, motors: Sequence[Motor], step_s: float) -> None:
        drives = [motor.drive for motor in motors]
        self._lag, self._play, self._turning, most = (
            np.array(each)
            for each in zip(
                *((d.servo.servo_time_s, d.play_rad, d.turning_rad, d.speed_max_rad_per_s or math.inf) for d in drives),
                strict=True,
            )
        )
        self._step_s, self._most = step_s, most * step_s
        self._plain = not (self._lag.any() or self._play.any() or np.isfinite(most).any())
        self.command, self._last, self._change, self._furthest, self._side = (np.zeros(len(drives)) for _ in range(5))
        self.memory = (self.command, self._last, self._change, self._furthest, self._side)

    def to(self, drum_rad: FloatArray) -> bool:
        """Set the commands for drums at these angles at the end of a step; whether a limit of the speed binds."""
        if self._plain:
            self.command[:] = drum_rad
            return False
        ahead = (drum_rad - self._furthest) * self._side > 0
        turned = np.abs(drum_rad - self._furthest) > self._turning
        back = turned & ~ahead
        self._side[back] = np.sign(drum_rad - self._furthest)[back]
        self._furthest[ahead | turned] = drum_rad[ahead | turned]
        change = drum_rad - self._last
        rate = (1.5 * change - 0.5 * self._change) / self._step_s
        self._last[:], self._change[:] = drum_rad, change
        asked = drum_rad + self._side * self._play / 2 + self._lag * rate - self.command
        taken = np.clip(asked, -self._most, self._most)
        self.command += taken
        return bool((taken != asked).any())
