"""A compensator in a control loop in Python, step by step: `tf.Runtime`."""

import ctypes
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.export.host import compile_on_host
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.joint.scenario.detect import is_joint_file
from tendonff.compensator.joint.scenario.scenario import JointScenario, load_joint_scenario
from tendonff.compensator.runtime.code import joint_runtime, tendon_runtime
from tendonff.compensator.runtime.kinds import RuntimeKind, RuntimeStatus, statuses
from tendonff.compensator.scenario.scenario import Scenario, load_scenario
from tendonff.models.errors import ParameterError
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.compiler import why_no_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError


@dataclass(frozen=True, slots=True, kw_only=True)
class RuntimeState:
    """Everything that a runtime remembers, to go on from later; can be pickled.

    Attributes
    ----------
    kind : RuntimeKind
    digest : str
        Of the scenario: a state of another one is refused.
    content : bytes
        Memory of the compiled code, for this version and this kind of machine.
    """

    kind: RuntimeKind
    digest: str
    content: bytes


class Runtime:
    """A compensator of a scenario in a control loop: the exported C, compiled here, so that its numbers are those of
    the controller. Starts at rest under the scenario's first reference. Needs a C compiler; `pip install
    "tendonff[compiler]"` brings one.

    Parameters
    ----------
    scenario : str, path, Scenario or JointScenario
        Of one tendon or of a driven joint.
    kind : RuntimeKind or str, optional
        Which compensator; default: "adaptive" where the scenario has [adaptation], else "inverse" of one tendon and
        "joint" of a driven joint.
    start : float, optional
        Reference at rest before the first step [N, rad or N m]; default: the scenario's first.

    Attributes
    ----------
    kind : RuntimeKind
    step_s : float
        Sample time of the scenario, that of a step without `dt` [s].
    start : float
        Reference at rest before the first step [N, rad or N m].
    joints : tuple of str
        Joints whose angles a step takes.

    Raises
    ------
    InputError
        If the scenario has no such compensator, or cannot start there.
    CodeError
        If there is no C compiler.

    Examples
    --------
    >>> import tendonff as tf
    >>> knuckle = tf.Runtime("examples/hand_joint.toml")  # doctest: +SKIP
    >>> motor_rad = knuckle.step(0.1, dt=0.012)  # doctest: +SKIP
    """

    @in_turn
    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario | JointScenario,
        *,
        kind: RuntimeKind | str | None = None,
        start: float | None = None,
    ) -> None:
        if isinstance(scenario, str | os.PathLike):
            path = Path(scenario)
            scenario = load_joint_scenario(path) if is_joint_file(path) else load_scenario(path)
        wanted = None if kind is None else _kind(kind)
        if isinstance(scenario, JointScenario):
            code = joint_runtime(scenario, wanted)
        else:
            code = tendon_runtime(scenario, wanted)
        host = compile_on_host(code.sources, code.driver, Precision.DOUBLE, keep=True)
        if host is None:
            raise CodeError(f"a runtime runs the exported C, compiled here, and nothing else; {why_no_compiler()}")
        self.kind, self.step_s, self.joints = code.kind, code.step_s, code.joints
        self.start = code.start if start is None else start
        self._digest, self._driven = code.digest, code.driven
        size = host.function("tff_runtime_size", result=ctypes.c_long)()
        self._memory = ctypes.create_string_buffer(size)
        address, real = ctypes.c_void_p, ctypes.c_double
        self._step = host.function(
            "tff_runtime_step", address, real, real, real, address, address, result=ctypes.c_uint
        )
        self._angles = np.array([*code.joints_start_rad, 0.0])  # never empty
        self._command = np.zeros(max(2, code.outputs))
        self._command[1] = 1.0
        self._outputs, self._status = code.outputs, 0
        self._places = tuple(ctypes.c_void_p(a.ctypes.data) for a in (self._angles, self._command))
        init = host.function("tff_runtime_init", address, real, address, result=ctypes.c_int)
        if init(self._memory, self.start, self._places[0]) != 1:
            raise InputError(f"a runtime cannot start at {self.start:g}: it is out of the scenario's range")

    def step(
        self,
        reference: float | None,
        dt: float | None = None,
        measured: float | None = None,
        joints: Mapping[str, float] | Sequence[float] | None = None,
    ) -> float | NDArray[np.float64]:
        """Advance by one step and give the command of the actuator.

        Parameters
        ----------
        reference : float or None
            Wanted at the end of this step: tension [N], angle [rad] or torque of the joint [N m]. None or NaN for one
            that did not arrive: the last good command is held, and the next reference is led to without a jump.
        dt : float, optional
            Time since the last call [s]; default: `step_s`. A longer one than 30 ms (1.5 steps, if those are longer)
            is a pause: the rig is taken to stand where it was.
        measured : float, optional
            Measurement that the adaptive kind learns from [N, m or rad]; None or NaN teaches nothing.
        joints : mapping of str to float, or sequence of float, optional
            Angles [rad] of the joints that `joints` names, by name or in that order.

        Returns
        -------
        float or ndarray, shape (motors,)
            Force [N], or position of a position drive [m]; of a joint the angle of its motor since the start [rad],
            of a pair of motors both.

        Raises
        ------
        ParameterError
            If an angle of a joint is missing.
        """
        for k, angle in enumerate(self._given(joints)):
            self._angles[k] = angle
        self._status = self._step(
            self._memory,
            self.step_s if dt is None else dt,
            math.nan if reference is None else reference,
            math.nan if measured is None else measured,
            *self._places,
        )
        return float(self._command[0]) if self._outputs == 1 else self._command[: self._outputs].copy()

    @property
    def status(self) -> tuple[RuntimeStatus, ...]:
        """Status of the last step; empty where nothing is to be said."""
        return statuses(self._status, driven=self._driven)

    @property
    def factor(self) -> float:
        """Factor on the parameters that [adaptation] of a driven joint tunes, as it is used; 1 for other kinds."""
        return float(self._command[1]) if self._driven and self.kind is RuntimeKind.ADAPTIVE else 1.0

    def state(self) -> RuntimeState:
        """Everything that is remembered, to go on from by `restore`."""
        return RuntimeState(kind=self.kind, digest=self._digest, content=self._memory.raw)

    def restore(self, state: RuntimeState) -> None:
        """Go on from a state of the same scenario.

        Raises
        ------
        InputError
            If the state is of another scenario, kind or version.
        """
        same = (state.kind, state.digest, len(state.content)) == (self.kind, self._digest, len(self._memory))
        if not same:
            raise InputError(
                f'this is a state of kind "{state.kind}" and scenario {state.digest}, not of "{self.kind}" and '
                f"{self._digest}; start a runtime of that scenario"
            )
        self._memory.raw = state.content

    def _given(self, joints: Mapping[str, float] | Sequence[float] | None) -> Sequence[float]:
        if not self.joints and not joints:
            return ()
        if isinstance(joints, Mapping):
            if missing := [name for name in self.joints if name not in joints]:
                raise ParameterError(f"joints must hold an angle of each joint, got none of {', '.join(missing)}")
            return [joints[name] for name in self.joints]
        if joints is None or len(joints) != len(self.joints):
            count = 0 if joints is None else len(joints)
            raise ParameterError(
                f"joints must be {len(self.joints)} angles ({', '.join(self.joints) or 'none'}), got {count}; pass a "
                "mapping by name"
            )
        return joints


def _kind(kind: RuntimeKind | str) -> RuntimeKind:
    try:
        return RuntimeKind(kind)
    except ValueError:
        known = ", ".join(RuntimeKind)
        raise InputError(f'kind must be one of {known}, got "{kind}"') from None
