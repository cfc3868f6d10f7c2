"""The chain as python-control sees it: a nonlinear system, its linearisation, and the link as a transfer function.

::

    force_N --> [ chain ] --> tension_1_N .. tension_{N+1}_N, actuator_position_m, load_position_m

Positive is as in `models.chain`: forces pull, positions grow towards the actuator, tensions are positive. The systems
are built from `chain_equations` and `link.transfer_function`: no law is written here again. They are stiff, so
`control.input_output_response` needs an implicit method (`solve_ivp_method="Radau"`); `ocp.simulate` is a thousand
times faster for the same answer. Use these to close a loop around the chain or to look at its poles.
"""

from collections.abc import Mapping
from functools import cache

import casadi as ca
import control
import numpy as np
from numpy.typing import NDArray

from tendonff.models.chain import Chain, ChainState, chain_equations
from tendonff.models.link import LinkParameters, transfer_function

Array = NDArray[np.float64]

FORCE_INPUT = "force_N"
END_INPUTS = (FORCE_INPUT, "actuator_rest_position_m", "load_force_N", "load_rest_position_m")
"""Signals of `chain_equations`: f_c1, x_c1, f_c2, x_c2."""


def output_names(chain: Chain) -> tuple[str, ...]:
    """Names of the outputs, as in the files of `tendonff simulate`.

    Parameters
    ----------
    chain : Chain
    """
    tensions = (f"tension_{k}_N" for k in range(1, chain.count + 2))
    return (*tensions, "actuator_position_m", "load_position_m")


def state_names(chain: Chain) -> tuple[str, ...]:
    """Names of the states, in the order of `ChainState.vector`.

    Parameters
    ----------
    chain : Chain
    """
    n = chain.count
    return (
        "v_a",
        *(f"v_{k}" for k in range(1, n + 1)),
        "v_l",
        *(f"e_{k}" for k in range(1, n + 2)),
        *(f"z_{k}" for k in range(1, n + 2)),
        *(f"f_s_{k}" for k in range(1, n + 1)),
        "q_a",
        "q_l",
    )


@cache
def _functions(chain: Chain, both_ends: bool) -> tuple[ca.Function, ca.Function, ca.Function]:
    """Functions (x, u) -> dx/dt, (x, u) -> y and (x, u) -> A, B, C, D."""
    equations = chain_equations(chain)
    x = equations.state
    u = ca.SX.sym("inputs", 4 if both_ends else 1)
    full = u if both_ends else ca.vertcat(u, 0, 0, 0)
    rate = ca.substitute(equations.rate, equations.inputs, full)
    y = ca.vertcat(ca.substitute(equations.tension_N, equations.inputs, full), x[-2], x[-1])
    jacobians = [ca.jacobian(expression, symbol) for expression in (rate, y) for symbol in (x, u)]
    return (
        ca.Function("rate", [x, u], [rate]),
        ca.Function("output", [x, u], [y]),
        ca.Function("linear", [x, u], [ca.densify(matrix) for matrix in jacobians]),
    )


def as_iosystem(chain: Chain, *, both_ends: bool = False, name: str = "tendon") -> control.NonlinearIOSystem:
    """The chain as a continuous-time nonlinear system.

    Parameters
    ----------
    chain : Chain
    both_ends : bool, optional
        Inputs f_c1, x_c1, f_c2, x_c2 of both ends instead of the actuator's force f_c1 alone (x_c1 = f_c2 = x_c2 = 0).
    name : str, optional
        Name of the system, for `control.interconnect`.

    Returns
    -------
    control.NonlinearIOSystem
        4 N + 6 states in the order of `ChainState.vector`; start it at `chain.rest_state(tension_N).vector()`.
    """
    rate, output, _ = _functions(chain, both_ends)

    # python-control hands over its parameters as a third argument; the chain's are fixed.
    def update(_t: float, x: Array, u: Array, _params: Mapping[str, object]) -> Array:
        return np.asarray(rate(x, u)).ravel()

    def outputs(_t: float, x: Array, u: Array, _params: Mapping[str, object]) -> Array:
        return np.asarray(output(x, u)).ravel()

    return control.NonlinearIOSystem(
        update,
        outputs,
        inputs=list(END_INPUTS if both_ends else END_INPUTS[:1]),
        outputs=list(output_names(chain)),
        states=list(state_names(chain)),
        name=name,
    )


def linear_system(chain: Chain, state: ChainState, *, name: str = "linear tendon") -> control.StateSpace:
    """The chain linearised at a state: small changes of the force to small changes of tensions and end positions.

    At rest the derivative of abs(v) is taken as zero: the tendon sticks, and its bristles act as springs. Sliding, the
    sign of each velocity counts. States that only repeat others are left out, so that no integrator remains that the
    force cannot reach: q_a = q_l + sum of e, and the bristle of a sticking mass, which is sigma0 times its position.

    Parameters
    ----------
    chain : Chain
    state : ChainState
        Where: `chain.rest_state(T0)` or a recorded state of a simulation. The chain is linear in the force, which
        therefore does not matter.
    name : str, optional

    Returns
    -------
    control.StateSpace
        One input, N + 3 outputs, 4 N + 5 states, N of them fewer where the whole tendon sticks.
    """
    _, _, linear = _functions(chain, False)
    a, b, c, d = (np.asarray(matrix) for matrix in linear(state.vector(), 0.0))
    lift, kept = _independent(chain.count, a)
    names = state_names(chain)
    return control.StateSpace(
        (a @ lift)[kept],
        b[kept],
        c @ lift,
        d,
        remove_useless_states=False,
        inputs=[FORCE_INPUT],
        outputs=list(output_names(chain)),
        states=[names[k] for k in kept],
        name=name,
    )


def _independent(n: int, a: Array) -> tuple[Array, list[int]]:
    """Matrix from the independent states to all states, shape (4 N + 6, kept), and the indices of those kept."""
    size = 4 * n + 6
    all_states = np.eye(size)
    elongations, bristles, q_a, q_l = n + 2, 3 * n + 4, size - 2, size - 1
    dropped = [q_a]
    all_states[q_a] = 0
    all_states[q_a, [*range(elongations, elongations + n + 1), q_l]] = 1
    for i in range(1, n + 1):
        row = bristles + i - 1
        driven_by = np.flatnonzero(a[row])
        if driven_by.tolist() == [i]:  # d f_s/dt is sigma0 v_i alone: this mass sticks
            dropped.append(row)
            all_states[row] = 0
            all_states[row, [*range(elongations + i, elongations + n + 1), q_l]] = a[row, i]
    kept = [k for k in range(size) if k not in dropped]
    return all_states[:, kept], kept


def link_impedance(link: LinkParameters) -> control.TransferFunction:
    """F/V of one link: force [N] over the rate of its elongation [m/s], as the paper prints it.

    [c tau s^2 + (tau (k1 + k2) + c) s + k1]/(tau s^2 + s); with c = 0 and tau = b_k/k2 it is eq. (7),
    [b_k (k1 + k2) s + k1 k2]/(b_k s^2 + k2 s). F/E itself has more zeros than poles when c > 0.

    Parameters
    ----------
    link : LinkParameters
        Numbers.
    """
    numerator, denominator = transfer_function(link)
    # Leading zeros (c = 0) would make the degree wrong.
    return control.TransferFunction(np.trim_zeros(numerator, "f"), [*denominator, 0.0], name="link")
