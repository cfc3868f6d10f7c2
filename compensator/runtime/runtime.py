"""A compensator in a control loop in Python, step by step: `tf.Runtime`."""

import hashlib
import hmac
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonff._version import __version__
from tendonff.compensator.compensators.every import problem_of
from tendonff.compensator.compensators.expectation import Expectation
from tendonff.compensator.compensators.live import expect_live
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.runtime.core import RuntimeCore
from tendonff.compensator.runtime.kinds import RuntimeKind, RuntimeStatus
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.works import function_of
from tendonff.models.cached import cached_property
from tendonff.models.turns import in_turn

_SEAL_BYTES = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class RuntimeState:
    """Everything that a runtime remembers, to go on from later; can be pickled.

    Attributes
    ----------
    kind : RuntimeKind
    digest : str
        Of the scenario: a state of another one is refused.
    content : bytes
        Checksum, and the memory of the compiled code, for this version and this kind of machine. The checksum finds
        damage, not intent: take states, like programs, only from where you trust.
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
        self._scenario = scenario
        core: RuntimeCore = function_of("runtime", scenario)(scenario, None if kind is None else _kind(kind), start)
        self._core, self.kind, self.step_s, self.start = core, core.kind, core.step_s, core.start
        self.joints, self.motors, self.ranges = core.joints, core.motors, core.ranges

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self._scenario.name!r}: {self.kind}, {self.step_s:g} s a step>"

    def step(
        self,
        reference: float | Mapping[str, float] | Sequence[float] | None,
        dt: float | None = None,
        measured: float | None = None,
        joints: Mapping[str, float] | Sequence[float] | None = None,
        torque_N_m: Mapping[str, float] | Sequence[float] | None = None,
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
            Measurement that the adaptive kind learns from [N, m or rad]; None or NaN teaches nothing. With
            [feedback] what the feedback corrects by [N or rad], taken at every sample of it; None or NaN holds its
            error.
        joints : mapping of str to float, or sequence of float, optional
            Angles [rad] of the joints that `joints` names, by name or in that order.
        torque_N_m : mapping of str to float, or sequence of float, optional
            Of several joints: what they give to what they touch, or their motion needs besides their own numbers, such
            as gravity [N m], by name or in the order of `joints`.

        Returns
        -------
        float or ndarray, shape (motors,)
            Force [N], or position of a position drive [m]; of a joint the angle of its motor since the start [rad],
            of several motors all.

        Raises
        ------
        ParameterError
            If an angle of a joint is missing, something else than a number is given, or nothing uses what is measured.
        """
        return self._core.step(reference, dt, measured, joints, torque_N_m)

    @property
    def status(self) -> tuple[RuntimeStatus, ...]:
        """Status of the last step; empty where nothing is to be said."""
        return self._core.status

    @cached_property
    @in_turn
    def expectation(self) -> Expectation:
        """Expected error over what is uncertain, as `design` and `export-c` state it; simulated at the first use."""
        return expect_live(problem_of(self._scenario))

    @property
    def factor(self) -> float:
        """Factor on the parameters that [adaptation] of a driven joint tunes, as it is used; 1 for other kinds."""
        return self._core.factor

    def state(self) -> RuntimeState:
        """Everything that is remembered, to go on from by `restore`."""
        held = self._core.content()
        return RuntimeState(kind=self.kind, digest=self._core.digest, content=self._seal(held) + held)

    def restore(self, state: RuntimeState) -> None:
        """Go on from a state of the same scenario, version and kind of machine.

        Raises
        ------
        InputError
            If the state is of another scenario, kind or version, or not as it was written; nothing is changed then.
        """
        if not isinstance(state, RuntimeState):
            raise InputError(
                f"state must be a RuntimeState, got {type(state).__name__}; keep what state() gives, whole"
            )
        mine = f'"{self.kind}" and {self._core.digest}'
        if f'"{state.kind}" and {state.digest}' != mine:
            raise InputError(
                f'this is a state of kind "{state.kind}" and scenario {state.digest}, not of {mine}; start a runtime '
                "of that scenario"
            )
        content = bytes(state.content)
        seal, held = content[:_SEAL_BYTES], content[_SEAL_BYTES:]
        if not (hmac.compare_digest(seal, self._seal(held)) and self._core.restore(held)):
            raise InputError("the content of this state is damaged, or of another version or machine; start anew")

    def _seal(self, held: bytes) -> bytes:
        """Checksum of a memory and of the code whose it is."""
        core = self._core
        made = hashlib.sha256(f"{__version__} {core.kind} {core.digest} {core.code_digest}".encode())
        made.update(held)
        return made.digest()


def _kind(kind: RuntimeKind | str) -> RuntimeKind:
    try:
        return RuntimeKind(kind)
    except ValueError:
        known = ", ".join(RuntimeKind)
        raise InputError(f'kind must be one of {known}, got "{kind}"') from None
