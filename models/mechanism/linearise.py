"""The chain, or any mechanism, linearised at a state, in numpy: small changes of inputs to small changes of outputs."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.models.errors import ParameterError
from tendonff.models.layout import INPUT_NAMES, Array, ChainState, StateLayout
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.mechanism.equations import MechanismEquations
from tendonff.models.tendon.chain import Chain


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearChain:
    """Small deviations: dx/dt = A x + B u, y = C x + D u."""

    # a, b, c, d: one input, the actuator's force; outputs f_1 .. f_{N+1}, q_a, q_l
    a: Array
    b: Array
    c: Array
    d: Array
    states: tuple[str, ...]  # names of those that were kept, as in `StateLayout.names`

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [1/s]."""
        return np.linalg.eigvals(self.a).astype(np.complex128)

    def response(self, s_per_s: NDArray[np.complexfloating[Any]]) -> NDArray[np.complex128]:
        """C (s I - A)^-1 B + D at complex frequencies s, shape (n,) [1/s]: outputs over the force, shape (n, N + 3)."""
        inner = np.asarray(s_per_s)[:, None, None] * np.eye(len(self.a)) - self.a
        inside = np.linalg.solve(inner, np.broadcast_to(self.b, (len(inner), *self.b.shape)))
        return np.asarray(self.c @ inside + self.d, dtype=np.complex128)[..., 0]


class Lineariser:
    """Linearises one chain at many states."""

    def __init__(self, chain: Chain) -> None:
        equations = chain_equations(chain)
        x, u = equations.state, ca.SX.sym("force")
        full = ca.vertcat(u, ca.SX.zeros(len(INPUT_NAMES) - 1))
        rate, tension = ca.substitute([equations.rate, equations.tension_N], [equations.inputs], [full])
        y, place, place_rate = ca.vertcat(tension, x[-2], x[-1]), equations.place, equations.place_rate
        jacobians = [ca.densify(ca.jacobian(expression, symbol)) for expression in (rate, y) for symbol in (x, u)]
        self._matrices = ca.Function("linear", [x, u, place, place_rate], jacobians)
        self._chain, self._layout = chain, chain.layout

    def at(self, state: ChainState) -> LinearChain:
        """Linearise at a state.

        At rest the derivative of abs(v) is taken as zero: the tendon sticks, and its bristles act as springs. Sliding,
        the sign of each velocity counts. States that only repeat others are left out, so that no integrator remains
        that the force cannot reach: q_a = q_l + sum of e, and the bristle of a sticking mass, which is sigma0 times
        its position. The chain is linear in the force, which therefore does not matter.
        """
        place = self._chain.path_at(np.array([state.time_s])).table()[0]  # as if it stood still there
        matrices = self._matrices(state.vector(), 0.0, place, np.zeros_like(place))
        a, b, c, d = (np.asarray(matrix) for matrix in matrices)
        lift, kept = _independent(self._layout, a)
        names = self._layout.names
        return LinearChain(a=(a @ lift)[kept], b=b[kept], c=c @ lift, d=d, states=tuple(names[k] for k in kept))


def _independent(layout: StateLayout, a: Array) -> tuple[Array, list[int]]:
    """Matrix from the independent states to all states, shape (size, kept), and the indices of those kept."""
    n, size = layout.count, layout.size
    all_states = np.eye(size)
    elongations, q_a, q_l = layout.part("e").start, size - 2, size - 1
    dropped = [q_a]
    all_states[q_a] = 0
    all_states[q_a, [*range(elongations, elongations + n + 1), q_l]] = 1
    for name in layout.end_states:
        (row,) = range(layout.part(name).start, layout.part(name).stop)
        if np.flatnonzero(a[row]).tolist() == [0]:  # the drive sticks: sigma0 times its position
            dropped.append(row)
            all_states[row] = a[row, 0] * all_states[q_a]
    for name in layout.friction_states:
        for i, row in enumerate(range(layout.part(name).start, layout.part(name).stop), start=1):
            driven_by = np.flatnonzero(a[row])
            if driven_by.tolist() == [i]:  # its rate is a stiffness times v_i alone: this mass sticks
                dropped.append(row)
                all_states[row] = 0
                all_states[row, [*range(elongations + i, elongations + n + 1), q_l]] = a[row, i]
    kept = [k for k in range(size) if k not in dropped]
    return all_states[:, kept], kept


@dataclass(frozen=True, slots=True, kw_only=True)
class Signals:
    """States, inputs, rates and outputs as CasADi columns, and the names of their rows."""

    x: ca.SX
    u: ca.SX
    rate: ca.SX
    y: ca.SX
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def signals_of(page: MechanismEquations) -> Signals:
    """A mechanism whose led bodies have their speeds as inputs and their places as states."""
    return Signals(
        x=ca.vertcat(page.state, page.place),
        u=ca.vertcat(page.inputs, page.place_rate),
        rate=ca.vertcat(page.rate, page.place_rate),
        y=ca.vertcat(page.tension_N, page.effort, page.position),
        states=(*page.state_names, *page.place_names),
        inputs=(*page.input_names, *(f"{name}_per_s" for name in page.place_names)),
        outputs=(*page.tension_names, *page.effort_names, *page.position_names),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearMechanism:
    """Small deviations of a mechanism: dx/dt = A x + B u, y = C x + D u; signals are those of `signals_of`."""

    a: Array
    b: Array
    c: Array
    d: Array


class MechanismLineariser:
    """Linearises one mechanism at many states."""

    def __init__(self, page: MechanismEquations) -> None:
        self.signals = signals = signals_of(page)
        jacobians = [
            ca.densify(ca.jacobian(of, by)) for of in (signals.rate, signals.y) for by in (signals.x, signals.u)
        ]
        self._matrices = ca.Function("linear", [signals.x, signals.u], jacobians)
        speeds = [name.endswith(("m_per_s", "rad_per_s")) for name in signals.states]
        self._speeds = np.array(speeds, dtype=np.bool_)

    def at(self, state: Array, *, sticking: bool = False) -> LinearMechanism:
        """Linearise at a state, shape (states,), of the mechanism and the places of its led bodies.

        Sticking, all speeds are taken as zero: bristles act as springs. Inputs act linearly and do not matter.
        """
        x = np.array(state, dtype=np.float64)
        if x.shape != (len(self._speeds),):
            raise ParameterError(
                f"state must have {len(self._speeds)} numbers, the mechanism's states and the places of its led "
                f"bodies, got shape {x.shape}"
            )
        if sticking:
            x[self._speeds] = 0.0
        a, b, c, d = (np.asarray(each) for each in self._matrices.call([x, np.zeros(len(self.signals.inputs))]))
        return LinearMechanism(a=a, b=b, c=c, d=d)
