"""Simulation and inverse of any system: one tendon, a joint between tendons, or a mechanism of several joints."""

from collections.abc import Callable, Mapping
from numbers import Real
from typing import Any, overload

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.layout import ChainState
from tendonff.models.parameters import Transmission
from tendonff.models.path import JointMotion
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.joint.invert import JointInversion, invert_joint
from tendonff.ocp.joint.protocol import JointMemory, JointProblem
from tendonff.ocp.joint.simulate import JointSimulation, simulate_joint
from tendonff.ocp.joint.start import joint_problem
from tendonff.ocp.mechanism.problem import MechanismMemory, MechanismProblem
from tendonff.ocp.mechanism.response import MechanismRun, invert_mechanism, simulate_mechanism
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.inverse import Inversion
from tendonff.ocp.tendon.inverse import invert as invert_chain
from tendonff.ocp.tendon.simulate import Simulation
from tendonff.ocp.tendon.simulate import simulate as simulate_chain

_SYSTEMS: Mapping[type, Callable[..., Any]] = {Transmission: Chain.of, Mechanism: joint_problem}
_SIMULATE: Mapping[type, Callable[..., Any]] = {
    Chain: simulate_chain,
    JointProblem: simulate_joint,
    MechanismProblem: simulate_mechanism,
}
_INVERT: Mapping[type, Callable[..., Any]] = {
    Chain: invert_chain,
    JointProblem: invert_joint,
    MechanismProblem: invert_mechanism,
}


def _of(table: Mapping[type, Callable[..., Any]], given: object) -> Callable[..., Any]:
    if type(given) not in table:
        known = " or ".join(kind.__name__ for kind in table)
        raise ParameterError(f"must be a {known}, got {type(given).__name__}; system_of makes one of a rig")
    return table[type(given)]


def _numbers(name: str, given: Any) -> Array:
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError(f"{name} must be an array of numbers, got {given!r:.60}") from None


def _step(step_s: Any) -> float:
    if isinstance(step_s, Real):
        return float(step_s)
    raise ParameterError(f"step_s must be a number of seconds, got {step_s!r:.60}; 0.001 suits most rigs")


@overload
def system_of(rig: Transmission, level: Level) -> Chain: ...
@overload
def system_of(rig: Mechanism, level: Level, motion: JointMotion, *, segments: int | None = None) -> JointProblem: ...
@in_turn
def system_of(rig: Any, level: Level, *motion: Any, **options: Any) -> Any:
    """Equations of a rig on a fidelity level, to be simulated and inverted.

    Parameters
    ----------
    rig : Transmission or Mechanism
    level : Level
    motion : JointMotion
        Of a mechanism: how its joint and all others move, where it starts.
    segments : int, optional
        Of a mechanism: masses of each tendon; default: the paths' own.

    Returns
    -------
    Chain or JointProblem

    Raises
    ------
    ParameterError
        If the rig or the level is none.

    Examples
    --------
    >>> import numpy as np
    >>> import tendonff as tf
    >>> from tendonff.models.path import JointMotion
    >>> mechanism = tf.load_scenario("examples/hand_joint.toml").mechanism
    >>> range_rad = JointMotion(names=("knuckle",), time_s=np.arange(2.0), angle_rad=np.array([[0.0], [1.0]]))
    >>> tf.system_of(mechanism, tf.Level.PRESLIDING, range_rad).loop
    True
    """
    made = _of(_SYSTEMS, rig)
    if not isinstance(level, Level):
        raise ParameterError(f"level must be a tf.Level, got {level!r}; write tf.Level({level!r})")
    return made(rig, level, *motion, **options)


@overload
def simulate(
    system: Chain,
    command: Array,
    step_s: float,
    *,
    initial_tension_N: float | None = None,
    state: ChainState | None = None,
    record: bool = False,
    engine: Engine = Engine.AUTO,
    method: Method = Method.BDF2,
    rtol: float = 1e-6,
    atol: float = 1e-9,
) -> Simulation: ...
@overload
def simulate(
    system: JointProblem,
    command: Array,
    step_s: float,
    *,
    contact_N_m: Array | float = 0.0,
    led_rad: Array | None = None,
    memory: JointMemory | None = None,
    engine: Engine = Engine.AUTO,
    method: Method = Method.BDF2,
    rtol: float = 1e-6,
    atol: float = 1e-9,
) -> JointSimulation: ...
@overload
def simulate(
    system: MechanismProblem,
    command: Array,
    step_s: float,
    *,
    known: Array | None = None,
    effort: Array | float = 0.0,
    led: Array | None = None,
    memory: MechanismMemory | None = None,
) -> MechanismRun: ...
@in_turn
def simulate(system: Any, command: Array, step_s: float, **options: Any) -> Any:
    """Respond to a command from rest, or from a state: every tension and motion.

    Parameters
    ----------
    system : Chain, JointProblem or MechanismProblem
    command : ndarray, shape (n,) or (n, drives)
        At 0, h, 2 h ...: force of the actuator [N], or angle of each motor since the start [rad].
    step_s : float
        h [s], > 0.
    initial_tension_N, state, record
        Of a chain: tension at rest [N], state to start from, and whether all states are kept.
    contact_N_m, led_rad, memory
        Of a joint: torque that it gives to what it touches, its motion where something else decides it, and state to
        start from.
    known, effort, led, memory
        Of a mechanism: see `tendonff.ocp.mechanism.response.simulate_mechanism`.
    engine : Engine, optional
    method : {"bdf2", "cvodes", "idas", "collocation"}, optional
        How it advances: by the step of this package, or by an integrator of CasADi.
    rtol, atol : float, optional
        Relative and absolute tolerance of an integrator, for every state in its SI unit.

    Returns
    -------
    Simulation, JointSimulation or MechanismRun

    Raises
    ------
    ParameterError
        If an argument is not usable.

    Examples
    --------
    >>> import numpy as np
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> chain = tf.system_of(scenario.transmission, scenario.run.level)
    >>> run = tf.simulate(chain, np.full(100, 40.0), 1e-3, initial_tension_N=40.0)
    >>> run.outcome.value
    'done'
    """
    return _of(_SIMULATE, system)(system, _numbers("command", command), _step(step_s), **options)


@overload
def invert(
    system: Chain,
    wanted: Array,
    step_s: float,
    *,
    initial_tension_N: float | None = None,
    state: ChainState | None = None,
    record: bool = False,
    engine: Engine = Engine.AUTO,
) -> Inversion: ...
@overload
def invert(
    system: JointProblem,
    wanted: Array,
    step_s: float,
    *,
    contact_N_m: Array | float = 0.0,
    memory: JointMemory | None = None,
    engine: Engine = Engine.AUTO,
) -> JointInversion: ...
@overload
def invert(
    system: MechanismProblem,
    wanted: Array,
    step_s: float,
    *,
    effort: Array | float = 0.0,
    memory: MechanismMemory | None = None,
) -> MechanismRun: ...
@in_turn
def invert(system: Any, wanted: Array, step_s: float, **options: Any) -> Any:
    """Find the command whose response is what is wanted.

    Parameters
    ----------
    system : Chain, JointProblem or MechanismProblem
    wanted : ndarray, shape (n,) or (n, joints)
        At 0, h, 2 h ...: tension at the far end [N], or angle of each joint [rad].
    step_s : float
        h [s], > 0.
    initial_tension_N, state, record
        Of a chain; as in `simulate`.
    contact_N_m, memory
        Of a joint; as in `simulate`.
    effort, memory
        Of a mechanism: see `tendonff.ocp.mechanism.response.invert_mechanism`.
    engine : Engine, optional

    Returns
    -------
    Inversion, JointInversion or MechanismRun

    Raises
    ------
    ParameterError
        If an argument is not usable.

    Examples
    --------
    >>> import numpy as np
    >>> import tendonff as tf
    >>> from tendonff.models.path import JointMotion
    >>> mechanism = tf.load_scenario("examples/hand_joint.toml").mechanism
    >>> time = 1e-3 * np.arange(501)
    >>> wanted = 0.2 * (1 - np.cos(2 * np.pi * time / 0.5))
    >>> motion = JointMotion(names=("knuckle",), time_s=time, angle_rad=wanted[:, None])
    >>> joint = tf.system_of(mechanism, tf.Level.PRESLIDING, motion)
    >>> motor = tf.invert(joint, wanted, 1e-3).motor_rad
    >>> bool(abs(tf.simulate(joint, motor, 1e-3).angle_rad - wanted).max() < 1e-6)
    True
    """
    return _of(_INVERT, system)(system, _numbers("wanted", wanted), _step(step_s), **options)
