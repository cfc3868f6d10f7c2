"""A compensator in a control loop in Python, step by step: `tf.Runtime`."""

import ctypes
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.export.host import compile_on_host
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.finger.runtime import FingerRuntime
from tendonff.compensator.finger.scenario import FingerScenario
from tendonff.compensator.joint.scenario.scenario import JointScenario
from tendonff.compensator.runtime.code import joint_runtime, tendon_runtime
from tendonff.compensator.runtime.kinds import RuntimeKind, RuntimeStatus, statuses
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
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
    scenario : str, path, Scenario, JointScenario or FingerScenario
        Of one tendon, of a driven joint, or of several.
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
        Joints whose angles a step takes; of several driven joints those that a reference holds.
    motors : tuple of str
        Of several driven joints, in the order of the commands; else empty.
    ranges : dict of str to (float, float)
        Values that are accepted, low and high: of "reference" [N or rad], and of joints by name [rad]. Others have the
        status RANGE. Set by `range_N` of [reference] and `range_rad` of [joints.NAME].

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
        scenario: str | os.PathLike[str] | Scenario | JointScenario | FingerScenario,
        *,
        kind: RuntimeKind | str | None = None,
        start: float | None = None,
    ) -> None:
        if isinstance(scenario, str | os.PathLike):
            scenario = load_scenario(scenario)
        wanted = None if kind is None else _kind(kind)
        self._finger: FingerRuntime | None = None
        self.motors: tuple[str, ...] = ()
        if isinstance(scenario, FingerScenario):
            if wanted not in (None, RuntimeKind.JOINT) or start is not None:
                raise InputError(
                    f'{scenario.source.name}: a runtime of several joints has the kind "joint" and starts where their '
                    "references do; leave kind and start out"
                )
            self._finger = finger = FingerRuntime(scenario)
            self.kind, self.step_s, self.joints = RuntimeKind.JOINT, finger.step_s, finger.joints
            self.motors, self.start, self._digest = finger.motors, math.nan, scenario.digest()
            self.ranges = finger.ranges
            return
        if isinstance(scenario, JointScenario):
            code = joint_runtime(scenario, wanted)
        else:
            code = tendon_runtime(scenario, wanted)
        host = compile_on_host(code.sources, code.driver, Precision.DOUBLE, keep=True)
        if host is None:
            raise CodeError(f"a runtime runs the exported C, compiled here, and nothing else; {why_no_compiler()}")
        self.kind, self.step_s, self.joints = code.kind, code.step_s, code.joints
        self.start, self.ranges = code.start if start is None else start, code.ranges
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
        reference: float | Mapping[str, float] | Sequence[float] | None,
        dt: float | None = None,
        measured: float | None = None,
        joints: Mapping[str, float] | Sequence[float] | None = None,
    ) -> float | NDArray[np.float64]:
        """Advance by one step and give the command of the actuator.

        Parameters
        ----------
        reference : float, mapping of str to float, sequence of float, or None
            Wanted at the end of this step: tension [N], angle [rad] or torque of the joint [N m]; of several joints
            their angles [rad], by name or in the order of `joints`. None or NaN for one that did not arrive: the last
            good command is held, and the next reference is led to without a jump.
        dt : float, optional
            Time since the last call [s]; default: `step_s`, and no other of several joints. A longer one than 30 ms
            (1.5 steps, if those are longer) is a pause: the rig is taken to stand where it was.
        measured : float, optional
            Measurement that the adaptive kind learns from [N, m or rad]; None or NaN teaches nothing.
        joints : mapping of str to float, or sequence of float, optional
            Angles [rad] of the joints that `joints` names, by name or in that order.

        Returns
        -------
        float or ndarray, shape (motors,)
            Force [N], or position of a position drive [m]; of a joint the angle of its motor since the start [rad],
            of several motors all.

        Raises
        ------
        ParameterError
            If an angle of a joint is missing, or something else than a number is given.
        """
        if self._finger is not None:
            if joints or measured is not None or (dt is not None and not math.isclose(dt, self.step_s)):
                raise ParameterError(
                    f"several joints advance by step_s = {self.step_s:g} s to their references alone; set [run] step_s "
                    "to your cycle, and leave measured and joints out"
                )
            if not isinstance(reference, Mapping | Sequence | np.ndarray | None) or isinstance(reference, str):
                raise ParameterError(f"reference must hold an angle of each of {', '.join(self.joints)}")
            return self._finger.step(reference)
        for k, angle in enumerate(self._given(joints)):
            self._angles[k] = _number("an angle of joints", angle)
        self._status = self._step(
            self._memory,
            self.step_s if dt is None else _number("dt", dt),
            _number("reference", reference),
            _number("measured", measured),
            *self._places,
        )
        return float(self._command[0]) if self._outputs == 1 else self._command[: self._outputs].copy()

    @property
    def status(self) -> tuple[RuntimeStatus, ...]:
        """Status of the last step; empty where nothing is to be said."""
        if self._finger is not None:
            return self._finger.status
        return statuses(self._status, driven=self._driven)

    @property
    def factor(self) -> float:
        """Factor on the parameters that [adaptation] of a driven joint tunes, as it is used; 1 for other kinds."""
        if self._finger is not None:
            return 1.0
        return float(self._command[1]) if self._driven and self.kind is RuntimeKind.ADAPTIVE else 1.0

    def state(self) -> RuntimeState:
        """Everything that is remembered, to go on from by `restore`."""
        content = self._memory.raw if self._finger is None else self._finger.content()
        return RuntimeState(kind=self.kind, digest=self._digest, content=content)

    def restore(self, state: RuntimeState) -> None:
        """Go on from a state of the same scenario.

        Raises
        ------
        InputError
            If the state is of another scenario, kind or version.
        """
        same = (state.kind, state.digest) == (self.kind, self._digest)
        if same and self._finger is not None:
            if not self._finger.restore(state.content):
                raise InputError("the content of this state is damaged, or of another version or machine; start anew")
            return
        if not same or len(state.content) != len(self._memory):
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


def _number(name: str, value: object) -> float:
    """A value as a number, NaN for None; text is refused, that of a number too."""
    if value is None:
        return math.nan
    try:
        if not isinstance(value, str | bytes):
            return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        pass
    raise ParameterError(f"{name} must be a number, got {value!r}; convert text by float() where it arrives")


def _kind(kind: RuntimeKind | str) -> RuntimeKind:
    try:
        return RuntimeKind(kind)
    except ValueError:
        known = ", ".join(RuntimeKind)
        raise InputError(f'kind must be one of {known}, got "{kind}"') from None
