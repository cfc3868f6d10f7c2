"""A mechanism's equations handed to `casadi.integrator`.

Inputs and places are straight lines between samples, as the compiled step has them: within a sample they are a + b t,
with a and b given anew for each. At every sample, where their slopes jump, an integrator starts afresh.
"""

import functools
import io
from contextlib import redirect_stderr, redirect_stdout
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.ocp.integrate.method import Accuracy, Method

Array = NDArray[np.float64]

_CHUNK = 50
"""Samples that an integrator takes in one call."""

_MOST_HALVINGS = 8
"""Where a step of collocation is not solved, it is halved, at most so often."""


class Equations(Protocol):
    """A system of differential equations, such as `MechanismEquations` and `ChainEquations`; CasADi columns."""

    @property
    def state(self) -> ca.SX:
        """States."""

    @property
    def inputs(self) -> ca.SX:
        """Inputs, linear between samples."""

    @property
    def place(self) -> ca.SX:
        """Other histories that are given, linear between samples."""

    @property
    def place_rate(self) -> ca.SX:
        """Its time derivative."""

    @property
    def rate(self) -> ca.SX:
        """Time derivatives of the states."""


class Integrator:
    """Advance equations over samples that are `step_s` apart.

    Parameters
    ----------
    equations : Equations
        Symbols of theirs that are neither state nor input nor place must be in `over`.
    step_s : float
    method : Method
        Any but BDF2.
    accuracy : Accuracy, optional
    over : ca.SX, shape (parameters, 1), optional
        Symbols that sensitivities may be taken over.
    """

    def __init__(
        self,
        equations: Equations,
        step_s: float,
        method: Method,
        accuracy: Accuracy | None = None,
        over: ca.SX | None = None,
    ) -> None:
        self._step_s, self._method, self._accuracy = step_s, method, accuracy or Accuracy()
        self._parameters = 0 if over is None else over.numel()
        t, since = ca.SX.sym("t"), ca.SX.sym("since")
        u, place = equations.inputs, equations.place
        u_rate, from_u, from_place = (ca.SX.sym("line", each.numel()) for each in (u, u, place))
        now = [from_u + (t - since) * u_rate, from_place + (t - since) * equations.place_rate]
        self._dae = {
            "x": equations.state,
            "t": t,
            "u": ca.vertcat(since, from_u, u_rate, from_place, equations.place_rate),
            "p": ca.SX(0, 1) if over is None else over,
            "ode": ca.substitute([equations.rate], [u, place], now)[0],
        }

    def advance(self, state: Array, inputs: Array, places: Array, at: Array | None = None) -> Array:
        """States at the samples that follow, shape (rows, states); fewer where the integrator gives up.

        Parameters
        ----------
        state : ndarray, shape (states,)
        inputs, places : ndarray, shape (rows + 1, ...)
            At the present instant, and at the samples that follow.
        at : ndarray, shape (parameters,), optional
            Values of what sensitivities may be taken over.
        """
        return self._run(state, np.empty((len(state), 0)), inputs, places, at)[0]

    def sensitivities(
        self, state: Array, slopes: Array, inputs: Array, places: Array, at: Array
    ) -> tuple[Array, Array]:
        """The same with d states/d parameters, shape (rows, states, parameters), by CasADi's forward mode.

        `slopes`, shape (states, parameters), are those of the state at the start.
        """
        return self._run(state, slopes, inputs, places, at)

    def _run(self, state: Array, slopes: Array, inputs: Array, places: Array, at: Array | None) -> tuple[Array, Array]:
        rows = len(inputs) - 1
        rates = [np.diff(each, axis=0) / self._step_s for each in (inputs, places)]
        lines = np.column_stack([inputs[:-1], rates[0], places[:-1], rates[1]])
        states, sensitivity = np.empty((rows, len(state))), np.empty((rows, *slopes.shape))
        values = np.empty(0) if at is None else np.asarray(at, dtype=np.float64)
        row = single = 0  # samples up to `single` are taken one by one: some of them are hard
        while row < rows:
            size = min(_CHUNK, rows - row) if row >= single else 1
            here = slice(row, row + size)
            found = self._piece(state, slopes, lines[here], values)
            if found is None and size == 1:
                break
            if found is None:
                single = row + size
                continue
            states[here], sensitivity[here] = found
            state, slopes, row = states[row + size - 1], sensitivity[row + size - 1], row + size
        return states[:row], sensitivity[:row]

    def _piece(self, state: Array, slopes: Array, lines: Array, at: Array) -> tuple[Array, Array] | None:
        """States and slopes at the ends of some samples; None where the integrator gives up."""
        size, width = len(lines), slopes.shape[1]
        since = np.column_stack([self._step_s * np.arange(size), lines]).T
        for refinement in self._refinements if size == 1 else (1,):
            try:
                # CasADi prints every argument of what fails, and has one exception for all causes.
                with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                    found = self._function(size, width, refinement).call([state, since, at, slopes])
            except RuntimeError:
                continue
            states, *by = (np.asarray(each).T for each in found)
            if np.isfinite(states).all():
                return states, np.stack(by, axis=2) if by else np.empty((size, len(state), 0))
        return None

    @property
    def _refinements(self) -> tuple[int, ...]:
        """Factors by which the steps of a sample are shortened in turn, where its method has no step control."""
        return tuple(2**k for k in range(_MOST_HALVINGS + 1)) if self._method is Method.COLLOCATION else (1,)

    @functools.cache  # noqa: B019
    def _function(self, rows: int, width: int, refinement: int) -> ca.Function:
        """States at the ends of so many samples, and their slopes along so many directions."""
        grid = self._step_s * np.arange(1.0, rows + 1)
        options = _options(self._method, self._accuracy, refinement)
        advance = ca.integrator("advance", self._method.value, self._dae, 0.0, grid, options)
        x, u = ca.MX.sym("x", self._dae["x"].numel()), ca.MX.sym("u", self._dae["u"].numel(), rows)
        p, slopes = ca.MX.sym("p", self._parameters), ca.MX.sym("slopes", x.numel(), width)
        ends = advance(x0=x, u=u, p=p)["xf"]
        seeds = [[slopes[:, k], ca.MX(ca.DM.eye(self._parameters)[:, k])] for k in range(width)]
        by = ca.forward([ends], [x, p], seeds) if width else []
        return ca.Function("samples", [x, u, p, slopes], [ends, *(each[0] for each in by)])


def _options(method: Method, accuracy: Accuracy, refinement: int) -> dict[str, Any]:
    """CasADi's options; the only place where they are named."""
    quiet = {"show_eval_warnings": False}
    if method is Method.COLLOCATION:
        return quiet | {
            "collocation_scheme": "radau",
            "interpolation_order": 3,
            "number_of_finite_elements": accuracy.elements * refinement,
            "rootfinder": "newton",
            "rootfinder_options": quiet | {"line_search": True, "abstol": accuracy.atol, "max_iter": 50},
        }
    return quiet | {"reltol": accuracy.rtol, "abstol": accuracy.atol, "max_num_steps": 200_000}


def evaluated(function: ca.Function, *columns: Array) -> list[Array]:
    """Outputs of a function for rows of its inputs, a row each; none for no rows."""
    if not len(columns[0]):
        return [np.empty((0, function.size1_out(k))) for k in range(function.n_out())]
    return [np.asarray(each).T for each in function.call([column.T for column in columns])]


def gave_up(method: Method) -> str:
    """Why a run by an integrator ends early, in words."""
    accuracy = "less accurate tolerances" if method is not Method.COLLOCATION else "a smaller step_s"
    others = "bdf2" if method is Method.IDAS else "idas, which gets through slack tendons, or bdf2"
    return f"{method} gave up there: check the input for jumps, try {accuracy}, or the method {others}"
