"""The self-tuning inverse of a joint, sample by sample: what the exported module computes at its usual sample time."""

import functools
import math
from dataclasses import astuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.models.errors import ParameterError
from tendonff.ocp.adaptation.joint import JointTuning, between_law, tuning_law

Array = NDArray[np.float64]

# Inputs of the law that belong to a sample and come first, the places of two of them, and outputs behind the state.
_INPUTS, _TAUGHT, _AIMED, _FLAGS = 9, 4, 5, 2


class JointTuner:
    """Run beside a loop whose reference is known.

    Parameters
    ----------
    tuning : JointTuning
    angle_rad : ndarray, shape (n,)
        Reference from rest on, at 0, h, 2 h ...
    motor_rad, command_rad : ndarray, shape (n, 3)
        Motor angles of the exact inverse with the factor at its lower bound, at 1 and at its upper bound, and their
        commands.
    change_rad : float, optional
        Largest change of a command in a sample. Default: any.

    Attributes
    ----------
    factor : float
        Factor in use [-].
    frozen : bool
        Whether the model fails to explain the measurements.
    """

    def __init__(
        self, tuning: JointTuning, angle_rad: Array, motor_rad: Array, command_rad: Array, change_rad: float = np.inf
    ) -> None:
        if motor_rad.shape != (len(angle_rad), 3) or command_rad.shape != motor_rad.shape:
            raise ParameterError(
                f"motor_rad and command_rad must have shape ({len(angle_rad)}, 3), got {motor_rad.shape} and "
                f"{command_rad.shape}"
            )
        state = tuning.start() | {"last": float(angle_rad[0])}
        self._used, self._frozen = (list(state).index(name) for name in ("used", "frozen"))
        self._state, numbers = np.array(list(state.values())), np.array(astuple(tuning)[:-1])
        self._given = [np.zeros(_INPUTS), self._state, numbers, np.zeros(6), np.zeros(1)]
        self._told = [np.zeros(len(state)), np.zeros(1), np.zeros(1)]
        buffer, self._evaluate = _sample().buffer()  # without copies: ten times as quick
        for k, given in enumerate(self._given):
            buffer.set_arg(k, given.data)
        for k, told in enumerate(self._told):
            buffer.set_res(k, told.data)
        self._buffer = buffer
        self._delay, self._nodes = tuning.delay_samples, np.hstack([motor_rad, command_rad])
        limited = np.abs(np.diff(command_rad[:, 1], prepend=command_rad[:1, 1])) > change_rad * (1 - 1e-9)
        moved, taught = np.abs(np.diff(angle_rad, prepend=angle_rad[:1])), np.where(limited, 0.0, 1.0)
        one, aimed = np.ones(len(angle_rad)), np.zeros(len(angle_rad))
        self._samples = np.column_stack([aimed, angle_rad, moved, one, taught, aimed, motor_rad])
        self._row, self._command, self._change = 0, float(command_rad[0, 1]), change_rad

    @property
    def factor(self) -> float:
        """Factor in use [-]."""
        return float(self._state[self._used])

    @property
    def frozen(self) -> bool:
        """Whether the model fails to explain the measurements."""
        return bool(self._state[self._frozen] > 0)

    def step(self, measured_rad: float) -> float:
        """Command of the next sample [rad], with what the joint's encoder said at its beginning."""
        self._row += 1
        row, arrived = self._row, self._row - 1 - self._delay
        sample, _, _, nodes, learns = self._given
        sample[:], nodes[:], learns[0] = self._samples[max(arrived, 0)], self._nodes[row], arrived > 0
        sample[0] = measured_rad
        self._evaluate()
        self._state[:] = self._told[0]
        self._samples[row, _AIMED] = self._told[1][0]
        change = float(self._told[2][0]) - self._command
        if abs(change) > self._change:
            change, self._samples[row, _TAUGHT] = math.copysign(self._change, change), 0.0
        self._command += change
        return self._command


@functools.cache
def _sample() -> ca.Function:
    """State after a sample, and motor and command of the next, of whose inverses both are given.

    Inputs are sample, state, numbers, motors and commands, and whether to learn.
    """
    law = tuning_law()
    states = len(law.outputs) - _FLAGS
    places = (slice(0, _INPUTS), slice(_INPUTS, _INPUTS + states), slice(_INPUTS + states, None))
    sample, state, numbers = (ca.vertcat(*law.inputs[each]) for each in places)
    nodes, learns = ca.SX.sym("nodes", 6), ca.SX.sym("learns")
    after = ca.if_else(learns, ca.vertcat(*list(law.outputs.values())[:states]), state)
    names = [symbol.name() for symbol in law.inputs]
    bounds = after[names.index("used") - _INPUTS], *(law.inputs[names.index(name)] for name in ("low", "high"))
    between = between_law().function()
    told = [between(*bounds, *ca.vertsplit(each)) for each in (nodes[:3], nodes[3:])]
    return ca.Function("sample", [sample, state, numbers, nodes, learns], [after, *told], {"cse": True})
