"""Cores of a runtime: what one step does, for the exported C of one actuator and for the motors of several joints."""

import ctypes
import hashlib
import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.export.host import compile_on_host
from tendonff.compensator.export.modules import accepted_steps
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.runtime.code import RuntimeCode, joint_runtime, tendon_runtime
from tendonff.compensator.runtime.finger import FingerRuntime
from tendonff.compensator.runtime.kinds import RuntimeKind, RuntimeStatus, statuses
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.errors import ParameterError
from tendonff.ocp.codegen.compiler import why_no_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError

Angles: TypeAlias = Mapping[str, float] | Sequence[float] | None


class RuntimeCore(Protocol):
    """Compensator that a runtime runs; see `Runtime` for the attributes and the step."""

    kind: RuntimeKind
    digest: str
    code_digest: str
    step_s: float
    start: float
    joints: tuple[str, ...]
    motors: tuple[str, ...]
    ranges: dict[str, tuple[float, float]]

    @property
    def status(self) -> tuple[RuntimeStatus, ...]:
        """Of the last step."""

    @property
    def factor(self) -> float:
        """On what is tuned."""

    def step(
        self, reference: float | Angles, dt: float | None, measured: float | None, joints: Angles, torque_N_m: Angles
    ) -> float | NDArray[np.float64]:
        """Advance and command."""

    def content(self) -> bytes:
        """Everything that is remembered."""

    def restore(self, content: bytes) -> bool:
        """Go on from what `content` gave; False, and nothing changed, where these are no such bytes."""


class CompiledCore:
    """The exported C of one tendon or one joint.

    Parameters
    ----------
    code : RuntimeCode
    start : float or None
        Reference at rest before the first step; None for the scenario's.
    """

    def __init__(self, code: RuntimeCode, start: float | None) -> None:
        host = compile_on_host(code.sources, code.driver, Precision.DOUBLE, keep=True)
        if host is None:
            raise CodeError(f"a runtime runs the exported C, compiled here, and nothing else; {why_no_compiler()}")
        self.kind, self.step_s, self.joints = code.kind, code.step_s, code.joints
        self.start, self.ranges = code.start if start is None else start, code.ranges
        self.digest, self._driven = code.digest, code.driven
        self.code_digest = hashlib.sha256(repr((sorted(code.sources.items()), code.driver)).encode()).hexdigest()
        self.motors: tuple[str, ...] = ()
        size = host.function("tff_runtime_size", result=ctypes.c_long)()
        self._memory = ctypes.create_string_buffer(size)
        address, real = ctypes.c_void_p, ctypes.c_double
        self._step = host.function(
            "tff_runtime_step", address, real, real, real, address, address, result=ctypes.c_uint
        )
        self._angles = np.array([*code.joints_start_rad, 0.0])  # never empty
        self._command = np.zeros(max(2, code.outputs))
        self._command[1] = 1.0
        self._outputs, self._measures, self._status = code.outputs, code.measures, 0
        self._longest_s, self._paused = accepted_steps(code.step_s)[1], False
        self._places = tuple(ctypes.c_void_p(a.ctypes.data) for a in (self._angles, self._command))
        if not isinstance(self.start, Real):
            raise ParameterError(f"start must be a number, got {self.start!r}; give the reference at rest before")
        init = host.function("tff_runtime_init", address, real, address, result=ctypes.c_int)
        if init(self._memory, self.start, self._places[0]) != 1:
            raise InputError(f"a runtime cannot start at {self.start:g}: it is out of the scenario's range")

    def step(
        self, reference: float | Angles, dt: float | None, measured: float | None, joints: Angles, torque_N_m: Angles
    ) -> float | NDArray[np.float64]:
        """Advance and command; see `Runtime.step`."""
        if torque_N_m is not None:
            raise ParameterError("torque_N_m is for several joints; reference of a torque has the torque itself")
        if measured is not None and not self._measures:
            raise ParameterError(
                f'measured = {measured!r} is for a scenario with [feedback] or [adaptation]; kind "{self.kind}" '
                "would ignore it: leave it out, or add the table"
            )
        for k, angle in enumerate(self._given(joints)):
            self._angles[k] = _number("an angle of joints", angle)
        since_s = self.step_s if dt is None else _number("dt", dt)
        self._paused = since_s > self._longest_s
        self._status = self._step(
            self._memory,
            since_s,
            _number("reference", reference),
            _number("measured", measured),
            *self._places,
        )
        return float(self._command[0]) if self._outputs == 1 else self._command[: self._outputs].copy()

    @property
    def status(self) -> tuple[RuntimeStatus, ...]:
        """Of the last step."""
        pause = (RuntimeStatus.PAUSE,) if self._paused else ()
        return pause + statuses(self._status, driven=self._driven)

    @property
    def factor(self) -> float:
        """Of a driven joint that is tuned; else 1."""
        return float(self._command[1]) if self._driven and self.kind is RuntimeKind.ADAPTIVE else 1.0

    def content(self) -> bytes:
        """Everything that is remembered."""
        return self._memory.raw

    def restore(self, content: bytes) -> bool:
        """Go on from what `content` gave; False where the size is another."""
        if len(content) != len(self._memory):
            return False
        self._memory.raw = content
        return True

    def _given(self, joints: Mapping[str, float] | Sequence[float] | None) -> Sequence[float]:
        if not self.joints and not joints:
            return ()
        if isinstance(joints, Mapping):
            if unknown := [name for name in joints if name not in self.joints]:
                known = ", ".join(self.joints) or "none"
                raise ParameterError(
                    f"joints has {', '.join(map(repr, unknown))}, which no step takes; it takes {known}"
                )
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


class SeveralJoints:
    """The exact inverse of several joints.

    Parameters
    ----------
    scenario : FingerScenario
    """

    kind, start, factor, code_digest = RuntimeKind.JOINT, math.nan, 1.0, ""

    def __init__(self, scenario: FingerScenario) -> None:
        self._inverse = inverse = FingerRuntime(scenario)
        self.digest, self.step_s = scenario.digest(), inverse.step_s
        self.joints, self.motors, self.ranges = inverse.joints, inverse.motors, inverse.ranges
        self.content, self.restore = inverse.content, inverse.restore

    def step(
        self, reference: float | Angles, dt: float | None, measured: float | None, joints: Angles, torque_N_m: Angles
    ) -> NDArray[np.float64]:
        """Advance and command; see `Runtime.step`."""
        if joints or measured is not None or (dt is not None and not math.isclose(dt, self.step_s)):
            raise ParameterError(
                f"several joints advance by step_s = {self.step_s:g} s to their references alone; set [run] step_s "
                "to your cycle, and leave measured and joints out"
            )
        if not isinstance(reference, Mapping | Sequence | np.ndarray | None) or isinstance(reference, str):
            raise ParameterError(f"reference must hold an angle of each of {', '.join(self.joints)}")
        return self._inverse.step(reference, torque_N_m)

    @property
    def status(self) -> tuple[RuntimeStatus, ...]:
        """Of the last step."""
        return self._inverse.status


def of_tension(scenario: Scenario, kind: RuntimeKind | None, start: float | None) -> RuntimeCore:
    """Core of one tendon."""
    return CompiledCore(tendon_runtime(scenario, kind), start)


def of_joint(scenario: JointScenario, kind: RuntimeKind | None, start: float | None) -> RuntimeCore:
    """Core of a driven joint."""
    return CompiledCore(joint_runtime(scenario, kind), start)


def of_several_joints(scenario: FingerScenario, kind: RuntimeKind | None, start: float | None) -> RuntimeCore:
    """Core of several driven joints."""
    if kind not in (None, RuntimeKind.JOINT) or start is not None:
        raise InputError(
            f'{scenario.source.name}: a runtime of several joints has the kind "joint" and starts where their '
            "references do; leave kind and start out"
        )
    return SeveralJoints(scenario)


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
