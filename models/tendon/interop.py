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

from tendonff.models.layout import Array, ChainState
from tendonff.models.tendon.chain import Chain, chain_equations
from tendonff.models.tendon.linearise import Lineariser
from tendonff.models.turns import in_turn

FORCE_INPUT = "force_N"
END_INPUTS = (FORCE_INPUT, "actuator_rest_position_m", "load_force_N", "load_rest_position_m")
"""Signals of `chain_equations`: f_c1, x_c1, f_c2, x_c2."""


def output_names(chain: Chain) -> tuple[str, ...]:
    """Names of the outputs, as in the files of `tendonff simulate`."""
    tensions = (f"tension_{k}_N" for k in range(1, chain.count + 2))
    return (*tensions, "actuator_position_m", "load_position_m")


@in_turn
def as_iosystem(chain: Chain, *, both_ends: bool = False, name: str = "tendon") -> control.NonlinearIOSystem:
    """The chain as a continuous-time nonlinear system.

    Parameters
    ----------
    both_ends : bool, optional
        Inputs f_c1, x_c1, f_c2, x_c2 of both ends instead of the actuator's force f_c1 alone (x_c1 = f_c2 = x_c2 = 0).
    name : str, optional
        Name of the system, for `control.interconnect`.

    Returns
    -------
    control.NonlinearIOSystem
        states in the order of `StateLayout`; start it at `chain.rest_state(tension_N).vector()`.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> chain = tf.Chain.of(scenario.transmission, tf.Level.VISCOELASTIC)
    >>> system = tf.as_iosystem(chain)
    >>> system.ninputs, system.nstates
    (1, 30)
    """
    equations = chain_equations(chain)
    x, u = equations.state, ca.SX.sym("inputs", len(END_INPUTS) if both_ends else 1)
    full = u if both_ends else ca.vertcat(u, ca.SX.zeros(len(END_INPUTS) - 1))
    place = ca.DM(chain.path_at(np.zeros(1)).table()[0])  # joints stand still
    derivative, tension = ca.substitute(
        [equations.rate, equations.tension_N],
        [equations.inputs, equations.place, equations.place_rate],
        [full, place, ca.DM.zeros(place.numel())],
    )
    rate = ca.Function("rate", [x, u], [derivative])
    output = ca.Function("output", [x, u], [ca.vertcat(tension, x[-2], x[-1])])

    # python-control hands over its parameters as a third argument; the chain's are fixed.
    @in_turn
    def update(_t: float, x: Array, u: Array, _params: Mapping[str, object]) -> Array:
        return np.asarray(rate(x, u)).ravel()

    @in_turn
    def outputs(_t: float, x: Array, u: Array, _params: Mapping[str, object]) -> Array:
        return np.asarray(output(x, u)).ravel()

    return control.NonlinearIOSystem(
        update,
        outputs,
        inputs=list(END_INPUTS if both_ends else END_INPUTS[:1]),
        outputs=list(output_names(chain)),
        states=list(chain.layout.names),
        name=name,
    )


@in_turn
def linear_system(chain: Chain, state: ChainState, *, name: str = "linear tendon") -> control.StateSpace:
    """The chain linearised at a state: small changes of the force to small changes of tensions and end positions.

    See `models.linearise`. The state is `chain.rest_state(T0)` or a recorded one of a simulation; the chain is linear
    in the force, which therefore does not matter.

    Returns
    -------
    control.StateSpace
        One input, N + 3 outputs, 4 N + 5 states, N of them fewer where the whole tendon sticks.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> chain = tf.Chain.of(scenario.transmission, tf.Level.VISCOELASTIC)
    >>> small = tf.linear_system(chain, chain.rest_state(30.0))
    >>> small.ninputs, small.noutputs
    (1, 9)
    """
    linear = Lineariser(chain).at(state)
    return control.StateSpace(
        linear.a,
        linear.b,
        linear.c,
        linear.d,
        remove_useless_states=False,
        inputs=[FORCE_INPUT],
        outputs=list(output_names(chain)),
        states=list(linear.states),
        name=name,
    )
