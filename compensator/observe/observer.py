"""The output step by step, from what the near end measures: `tf.Observer`."""

import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.observe.estimate import Observation, ObserverStatus
from tendonff.compensator.observe.joint import LoopObserver
from tendonff.compensator.observe.mechanism import MechanismObserver
from tendonff.compensator.observe.pair import PairObserver
from tendonff.compensator.observe.tendon import TendonObserver
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.works import function_of
from tendonff.models.errors import ParameterError
from tendonff.models.joint.parameters import DriveKind
from tendonff.models.turns import in_turn


class ObserverCore(Protocol):
    """Law of an observer: from tension and position of the near end, from two tensions, or angle and torque of a motor.

    `tensions` is how many it takes: 1 of a tendon, 2 of a pair, none where it sees the motor.
    """

    tensions: int
    joints: tuple[str, ...]
    status: tuple[ObserverStatus, ...]

    def step(self, dt: float, first: Any, second: float, joint_rad: Sequence[float], /) -> Observation:
        """Advance; NaN for what is not measured. The first is a sequence of two tensions of a pair."""


class Observer:
    """The output of a tendon or joint, with bounds, from what its near end measures: the exported C, compiled here.

    Of a tendon it is the forward chain of `simulate` under the measured input tension. A measured position of the near
    end shows in addition what moves the far end from outside. Of a joint it is the chain from the motor's angle; the
    motor's torque shows what the joint touches. Of a pair whose joint has a spring it is the mechanism under the
    tensions at its drums, simulated step by step. Starts at rest under the scenario's first tension or angle. Needs a C
    compiler, or the package ziglang.

    Parameters
    ----------
    scenario : str, path, Scenario or JointScenario
        Of one tendon; of a joint with one motor, or on a spring between two; or of a joint with the laws that
        `identify` writes as [observer].
    start : float, optional
        Output tension [N] or angle of the joint [rad] at the start; default: the scenario's first. NaN where the output
        tension is not known: then `given` is needed, and the bounds are those of any history until the tendon has slid.
    given : float, optional
        Input tension at the start [N], of a start in motion; default: at rest, the same tension everywhere.

    Attributes
    ----------
    step_s : float
        Sample time of the scenario, that of a step without `dt` [s].
    joints : tuple of str
        Joints whose angles a step takes.

    Raises
    ------
    InputError
        If the scenario has no observer, or cannot start there.
    CodeError
        If there is no C compiler.

    Examples
    --------
    >>> import tendonff as tf
    >>> far_end = tf.Observer("examples/finger.toml")  # doctest: +SKIP
    >>> seen = far_end.step(tension_N=48.2, position_m=0.0011, dt=0.004)  # doctest: +SKIP
    >>> seen.tension_N.low <= seen.tension_N.value <= seen.tension_N.high  # doctest: +SKIP
    True
    """

    @in_turn
    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario | JointScenario | FingerScenario,
        *,
        start: float | None = None,
        given: float | None = None,
    ) -> None:
        if isinstance(scenario, str | os.PathLike):
            scenario = load_scenario(scenario)
        core: ObserverCore = function_of("observer", scenario)(scenario, start, given)
        self._core, self.joints, self.step_s = core, core.joints, scenario.run.step_s

    def step(
        self,
        *,
        tension_N: float | Sequence[float] | None = None,
        position_m: float | None = None,
        motor_rad: float | None = None,
        motor_torque_N_m: float | None = None,
        joints: Mapping[str, float] | Sequence[float] | None = None,
        dt: float | None = None,
    ) -> Observation:
        """Advance by one step and say what the far end does at its end.

        Parameters
        ----------
        tension_N : float, or sequence of float, optional
            Of a tendon: input tension [N]; of a pair those at both drums, in the order of its tendons. None or NaN for
            one that did not arrive: the last estimate is held.
        position_m : float, optional
            Of a tendon: position of the near end relative to the start [m], positive towards the actuator; None where
            it is not measured.
        motor_rad, motor_torque_N_m : float, optional
            Of a joint: angle and torque of the motor, as they were logged for `identify` [rad, N m].
        joints : mapping of str to float, or sequence of float, optional
            Angles [rad] of the joints that `joints` names, by name or in that order.
        dt : float, optional
            Time since the last call [s]; default: `step_s`.

        Raises
        ------
        ParameterError
            If an angle of a joint is missing.
        """
        length, core = self.step_s if dt is None else dt, self._core
        of_motor, of_tension = (motor_rad, motor_torque_N_m), (tension_N, position_m)
        if not core.tensions and of_tension != (None, None):
            raise ParameterError("an observer of a joint takes motor_rad and motor_torque_N_m, not a tension")
        if core.tensions and of_motor != (None, None):
            raise ParameterError("an observer of a tendon takes tension_N and position_m, not the motor's angle")
        if core.tensions > 1:
            pulls = (math.nan,) * core.tensions if tension_N is None else tuple(np.ravel(np.asarray(tension_N, float)))
            if len(pulls) != core.tensions or position_m is not None:
                raise ParameterError(f"an observer of a pair takes {core.tensions} tensions alone, got {tension_N}")
            return core.step(length, pulls, math.nan, self._given(joints))
        given = of_tension if core.tensions else of_motor
        first, second = (math.nan if x is None else float(x) for x in given)  # type: ignore[arg-type]
        return core.step(length, first, second, self._given(joints))

    @property
    def status(self) -> tuple[ObserverStatus, ...]:
        """Status of the last step; empty where nothing is to be said."""
        return self._core.status

    def _given(self, joints: Mapping[str, float] | Sequence[float] | None) -> Sequence[float]:
        if joints is None:
            joints = ()
        names = self.joints
        missing = [n for n in names if n not in joints] if isinstance(joints, Mapping) else names[len(joints) :]
        if missing or len(joints) > len(names):
            raise ParameterError(f"joints must be the angles of {', '.join(names) or 'none'}, got {joints}")
        return [joints[name] for name in names] if isinstance(joints, Mapping) else joints


def of_tension(scenario: Scenario, start: float | None, given: float | None) -> ObserverCore:
    """The law of one tendon; InputError where it cannot start so."""
    if start is not None and math.isnan(start) and given is None:
        raise InputError("start is NaN, so nothing is known of the output; state the input tension: given")
    core = TendonObserver(scenario, start, given)
    if ObserverStatus.INPUT_HELD in core.status:
        raise InputError(f"an observer cannot start at {core.start:g} N: it is out of the scenario's range")
    return core


def of_joint(scenario: JointScenario, start: float | None, given: float | None) -> ObserverCore:
    """The law of a driven joint: what `identify` wrote, or its mechanism; InputError for a start that it lacks."""
    if given is not None or (scenario.observer is not None and start is not None):
        raise InputError(f"{scenario.source.name}: an observer of a joint takes no {'start' if start else 'given'}")
    if scenario.observer is not None:
        return LoopObserver(scenario.observer)
    pair = scenario.mechanism.drive.kind is DriveKind.PAIR and len(scenario.mechanism.tendons) > 1
    return PairObserver(scenario, start) if pair else MechanismObserver(scenario, start)
