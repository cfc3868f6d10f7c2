"""Integrate any equations over sampled inputs, with sensitivities over any of their symbols."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from tendonff.models.errors import ParameterError, require
from tendonff.models.turns import in_turn
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.integrator import Array, Equations, Integrator, gave_up
from tendonff.ocp.integrate.method import Accuracy, Method


@dataclass(frozen=True, slots=True, kw_only=True)
class Integration:
    """States of a run, rows at 0, h, 2 h ...

    Attributes
    ----------
    time_s : ndarray, shape (n,)
    states : ndarray, shape (n, states)
    slopes : ndarray, shape (n, states, parameters)
        d states/d parameters; no parameters where none are asked for.
    complete : bool
        The integrator reached the last row.
    message : str
        Why it did not, for the user.
    """

    time_s: Array
    states: Array
    slopes: Array
    complete: bool
    message: str

    def require(self) -> "Integration":
        """Return itself, or raise `SolveError` with the message where the integrator gave up."""
        if not self.complete:
            raise SolveError(self.message)
        return self


@in_turn
def integrate(
    equations: Equations,
    start: Array | ca.SX,
    inputs: Array,
    step_s: float,
    *,
    places: Array | None = None,
    method: Method = Method.IDAS,
    rtol: float = 1e-6,
    atol: float = 1e-9,
    over: ca.SX | None = None,
    at: Array | None = None,
) -> Integration:
    """Advance equations by one of CasADi's integrators; inputs and places are linear between samples.

    Parameters
    ----------
    equations : Equations
        Such as `mechanism_equations` returns.
    start : ndarray or ca.SX, shape (states,)
        First state; an expression of `over` where it depends on that.
    inputs : ndarray, shape (n, inputs)
        At 0, h, 2 h ...
    step_s : float
        h [s], > 0.
    places : ndarray, shape (n, led), optional
        Of bodies whose motion is given; default: at zero.
    method : {"idas", "cvodes", "collocation"}, optional
    rtol, atol : float, optional
        Relative and absolute tolerance, for every state in its SI unit.
    over : ca.SX, shape (parameters, 1), optional
        Symbols of the equations; sensitivities over them are CasADi's forward derivatives.
    at : ndarray, shape (parameters,), optional
        Their values.

    Raises
    ------
    ParameterError
        If shapes or numbers do not fit.

    Examples
    --------
    >>> import casadi as ca
    >>> import numpy as np
    >>> import tendonff as tf
    >>> from tendonff.models.mechanism import Mechanism, equations_of, rest_state
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> mu = ca.SX.sym("mu")
    >>> numbers = {"tendon": {"mu_dynamic_pull": mu, "mu_static_pull": mu}}
    >>> finger = Mechanism.of(scenario.transmission).cut(tf.Level.PRESLIDING, numbers=numbers)
    >>> page = equations_of(finger)
    >>> load_m = 20.0 / scenario.transmission.load.stiffness_N_per_m
    >>> rest = rest_state(finger, {"tendon": 20.0}, {"actuator": 0.0, "load": load_m})
    >>> force_N = np.column_stack([np.linspace(20.0, 30.0, 101), np.zeros(101)])
    >>> run = tf.integrate(page, rest, force_N, 1e-3, over=mu, at=np.array([0.2]))
    >>> bool(run.slopes[-1, page.rows("load_m")[0], 0] < 0)  # more friction, less movement
    True
    """
    method = Method(method)
    if method is Method.BDF2:
        raise ParameterError('the method "bdf2" is that of simulate; integrate takes "idas", "cvodes", "collocation"')
    require("step_s", step_s, above=0, hint="0.001 suits most rigs")
    given = np.atleast_2d(np.asarray(inputs, dtype=np.float64))
    led = np.zeros((len(given), equations.place.numel())) if places is None else np.asarray(places, dtype=np.float64)
    for name, values, count in (("inputs", given, equations.inputs.numel()), ("places", led, equations.place.numel())):
        if values.shape != (len(given), count) or not np.isfinite(values).all():
            raise ParameterError(
                f"{name} must be finite numbers of shape ({len(given)}, {count}), got shape {values.shape}; give a row "
                "for each sample and a column for each name"
            )
    symbols = ca.SX(0, 1) if over is None else over
    numbers = np.empty(0) if at is None else np.atleast_1d(np.asarray(at, dtype=np.float64))
    if numbers.shape != (symbols.numel(),):
        raise ParameterError(f"at must have a value for each of {symbols.numel()} symbols, got shape {numbers.shape}")
    first = ca.SX(ca.DM(start)) if isinstance(start, np.ndarray) else start
    if first.numel() != equations.state.numel():
        raise ParameterError(f"start must have {equations.state.numel()} states, got {first.numel()}")
    values, slope = ca.Function("start", [symbols], [first, ca.jacobian(first, symbols)]).call([numbers])
    x, by = np.asarray(values).ravel(), np.asarray(ca.DM(slope)).reshape(first.numel(), len(numbers))
    integrator = Integrator(equations, step_s, method, Accuracy(rtol=rtol, atol=atol), symbols)
    states, slopes = integrator.sensitivities(x, by, given, led, numbers)
    complete = len(states) == len(given) - 1
    reached = step_s * len(states)
    return Integration(
        time_s=step_s * np.arange(len(states) + 1.0),
        states=np.vstack([x, states]),
        slopes=np.concatenate([by[None], slopes]),
        complete=complete,
        message=f"{len(given)} rows" if complete else f"stopped after t = {reached:.6g} s: {gave_up(method)}",
    )
