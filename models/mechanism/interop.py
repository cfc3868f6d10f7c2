"""The chain as python-control sees it: a nonlinear system, and its linearisation.

::

    force_N --> [ chain ] --> tension_1_N .. tension_{N+1}_N, actuator_position_m, load_position_m

Positive is as in `models.chain`: forces pull, positions grow towards the actuator, tensions are positive. The systems
are built from `chain_equations`: no law is written here again. They are stiff, so `control.input_output_response`
needs an implicit method (`solve_ivp_method="Radau"`); `ocp.simulate` is a thousand times faster for the same answer.
Use these to close a loop around the chain or to look at its poles.
"""

from collections.abc import Mapping

import casadi as ca
import control
import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.layout import Array, ChainState
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.mechanism.equations import MechanismEquations
from tendonff.models.mechanism.linearise import Lineariser, MechanismLineariser, Signals, signals_of
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import in_turn

FORCE_INPUT = "force_N"
END_INPUTS = (FORCE_INPUT, "actuator_rest_position_m", "load_force_N", "load_rest_position_m")
"""Signals of `chain_equations`: f_c1, x_c1, f_c2, x_c2."""


def output_names(chain: Chain) -> tuple[str, ...]:
    """Names of the outputs, as in the files of `tendonff simulate`."""
    tensions = (f"tension_{k}_N" for k in range(1, chain.count + 2))
    return (*tensions, "actuator_position_m", "load_position_m")


@in_turn
def as_iosystem(
    system: Chain | MechanismEquations, *, both_ends: bool = False, name: str = "tendon"
) -> control.NonlinearIOSystem:
    """The chain, or any mechanism, as a continuous-time nonlinear system.

    Parameters
    ----------
    system : Chain or MechanismEquations
        Of a mechanism, inputs are its own and the speeds of led bodies, whose places are states behind its own; outputs
        are tensions, efforts on bodies and their positions.
    both_ends : bool, optional
        Of a chain: inputs f_c1, x_c1, f_c2, x_c2 of both ends instead of the actuator's force f_c1 alone (x_c1 = f_c2 =
        x_c2 = 0).
    name : str, optional
        Name of the system, for `control.interconnect`.

    Returns
    -------
    control.NonlinearIOSystem
        states in the order of `StateLayout`; start it at `chain.rest_state(tension_N).vector()`, a mechanism at
        `rest_state` and the places of led bodies.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> chain = tf.Chain.of(scenario.transmission, tf.Level.VISCOELASTIC)
    >>> system = tf.as_iosystem(chain)
    >>> system.ninputs, system.nstates
    (1, 30)
    """
    if isinstance(system, MechanismEquations):
        return _nonlinear(signals_of(system), name)
    equations = chain_equations(system)
    x, u = equations.state, ca.SX.sym("inputs", len(END_INPUTS) if both_ends else 1)
    full = u if both_ends else ca.vertcat(u, ca.SX.zeros(len(END_INPUTS) - 1))
    place = ca.DM(system.path_at(np.zeros(1)).table()[0])  # joints stand still
    derivative, tension = ca.substitute(
        [equations.rate, equations.tension_N],
        [equations.inputs, equations.place, equations.place_rate],
        [full, place, ca.DM.zeros(place.numel())],
    )
    signals = Signals(
        x=x,
        u=u,
        rate=derivative,
        y=ca.vertcat(tension, x[-2], x[-1]),
        states=system.layout.names,
        inputs=END_INPUTS if both_ends else END_INPUTS[:1],
        outputs=output_names(system),
    )
    return _nonlinear(signals, name)


def _nonlinear(signals: Signals, name: str) -> control.NonlinearIOSystem:
    rate = ca.Function("rate", [signals.x, signals.u], [signals.rate])
    output = ca.Function("output", [signals.x, signals.u], [signals.y])

    # python-control hands over its parameters as a third argument; the system's are fixed.
    @in_turn
    def update(_t: float, x: Array, u: Array, _params: Mapping[str, object]) -> Array:
        return np.asarray(rate(x, u)).ravel()

    @in_turn
    def outputs(_t: float, x: Array, u: Array, _params: Mapping[str, object]) -> Array:
        return np.asarray(output(x, u)).ravel()

    return control.NonlinearIOSystem(
        update,
        outputs,
        inputs=list(signals.inputs),
        outputs=list(signals.outputs),
        states=list(signals.states),
        name=name,
    )


@in_turn
def linear_system(
    system: Chain | MechanismEquations, state: ChainState | Array, *, name: str = "linear tendon"
) -> control.StateSpace:
    """The chain, or any mechanism, linearised at a state: small changes of inputs to small changes of outputs.

    A chain has the force as input, and tensions and end positions as outputs; see `models.linearise`. A mechanism has
    the inputs and outputs of `as_iosystem`. Both are linear in forces, which therefore do not matter; at rest the
    derivative of abs(v) is zero: the tendon sticks.

    Parameters
    ----------
    system : Chain or MechanismEquations
    state : ChainState or ndarray
        Of a chain `chain.rest_state(T0)`, or a recorded one of a simulation; of a mechanism an array of its states and
        the places of its led bodies, whose elongations repeat the positions of the bodies: eigenvalues of zero.
    name : str, optional

    Returns
    -------
    control.StateSpace
        Of a chain: one input, N + 3 outputs, 4 N + 5 states, N of them fewer where the whole tendon sticks.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> chain = tf.Chain.of(scenario.transmission, tf.Level.VISCOELASTIC)
    >>> small = tf.linear_system(chain, chain.rest_state(30.0))
    >>> small.ninputs, small.noutputs
    (1, 9)
    """
    if isinstance(system, MechanismEquations):
        return _linear(system, np.asarray(state, dtype=np.float64), name)
    if not isinstance(state, ChainState):
        raise ParameterError("a chain is linearised at a ChainState, got an array; take chain.rest_state(T0)")
    linear = Lineariser(system).at(state)
    return control.StateSpace(
        linear.a,
        linear.b,
        linear.c,
        linear.d,
        remove_useless_states=False,
        inputs=[FORCE_INPUT],
        outputs=list(output_names(system)),
        states=list(linear.states),
        name=name,
    )


def _linear(page: MechanismEquations, state: Array, name: str) -> control.StateSpace:
    lineariser = MechanismLineariser(page)
    linear, signals = lineariser.at(state), lineariser.signals
    return control.StateSpace(
        *(linear.a, linear.b, linear.c, linear.d),
        remove_useless_states=False,
        inputs=list(signals.inputs),
        outputs=list(signals.outputs),
        states=list(signals.states),
        name=name,
    )
