"""Direct collocation of a mechanism's equations in a `casadi.Opti`.

On every interval the states are a polynomial that starts where the last one ended and obeys the equations at the points
of Radau, the last of which is the interval's end; inputs and places are straight lines. Of degree 1 that is implicit
Euler. Variables and residuals are scaled by the largest values of the guess.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.ocp.codegen.smoothing import smoothed, switches
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.integrator import Equations, Integrator, evaluated, gave_up
from tendonff.ocp.integrate.method import Accuracy, Method

Array = NDArray[np.float64]

_LEAST = 1e-9
"""Scale of a state that does not move in the guess, in its SI unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """Inputs and places at the instants of a grid, numbers or variables.

    Attributes
    ----------
    inputs : ca.MX or ca.DM, shape (inputs, n)
    places : ca.MX or ca.DM, shape (led, n)
        Of led bodies.
    """

    inputs: ca.MX | ca.DM
    places: ca.MX | ca.DM


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """States over a grid, as expressions of an Opti's variables.

    Attributes
    ----------
    equations : Equations
        Whose states they are.
    step_s : float
        Time between two columns [s].
    states : ca.MX, shape (states, n)
        In the equations' order.
    history : History
        What drives them.
    """

    equations: Equations
    step_s: float
    states: ca.MX
    history: History

    def along(self, expression: ca.SX) -> ca.MX:
        """An expression of the equations' state, inputs, place and place_rate at all instants, shape (rows, n).

        Rates of places are those of the interval before; at first there are none.
        """
        page, rates = self.equations, ca.diff(self.history.places, 1, 1) / self.step_s
        first = ca.MX.zeros(page.place.numel(), 1)
        known = [page.state, page.inputs, page.place, page.place_rate]
        of = ca.Function("along", known, [expression])
        given = [self.states, self.history.inputs, self.history.places, ca.horzcat(first, rates)]
        return of.map(self.states.size2())(*given)


def collocate(
    opti: ca.Opti,
    equations: Equations,
    step_s: float,
    start: Array,
    history: History,
    guess: tuple[Array, Array],
    *,
    degree: int,
    smoothing: float,
) -> Trajectory:
    """Add states and dynamics to a problem.

    Parameters
    ----------
    opti : ca.Opti
    equations : Equations
    step_s : float
        Length of an interval [s].
    start : ndarray, shape (states,)
    history : History
    guess : tuple of ndarray
        Inputs of shape (n, inputs) and places of shape (n, led) whose response is the first guess of the states.
    degree : int
        Of the polynomials, 1 to 9.
    smoothing : float
        Width of rounded switches over the largest value of what switches in the guess [-], > 0; see `smoothing`.

    Raises
    ------
    SolveError
        If the guess cannot be integrated.
    """
    page, n, size = equations, len(guess[0]) - 1, equations.state.numel()
    states, rates = _response(equations, step_s, start, guess)
    scale = np.maximum(np.abs(states).max(axis=0), _LEAST)

    # the laws, with friction's switch rounded off
    known = [page.state, page.inputs, page.place, page.place_rate]
    exact = ca.Function("rate", known, [page.rate])
    reached = evaluated(switches(exact), states, *guess, rates)[0]
    largest = np.abs(reached).max(axis=0, initial=0.0)
    rate = smoothed(exact, smoothing * np.where(largest > 0, largest, 1.0))

    # one interval: the polynomial's slope at each point of Radau is what the equations say
    points = np.array(ca.collocation_points(degree, "radau"))
    slopes, _, _ = ca.collocation_coeff(points.tolist())
    first, inner = ca.SX.sym("x", size), [ca.SX.sym("x", size) for _ in points]
    u, place = ([ca.SX.sym("from", of.numel()), ca.SX.sym("to", of.numel())] for of in (page.inputs, page.place))
    slope = ca.mtimes(ca.horzcat(first, *inner), ca.DM(slopes))
    residual = []
    for k, (tau, x) in enumerate(zip(points, inner, strict=True)):
        now = [(1 - tau) * a + tau * b for a, b in (u, place)]
        residual.append((slope[:, k] - step_s * rate(x, *now, (place[1] - place[0]) / step_s)) / scale)
    interval = ca.Function("interval", [first, ca.vertcat(*inner), *u, *place], [ca.vertcat(*residual)])

    # all of them
    scaled = opti.variable(size * degree, n)
    values = scaled * ca.DM(np.tile(scale, degree))
    x = ca.horzcat(ca.DM(start), values[-size:, :])
    ends = [(of[:, :-1], of[:, 1:]) for of in (history.inputs, history.places)]
    opti.subject_to(ca.vec(interval.map(n)(x[:, :-1], values, *ends[0], *ends[1])) == 0)
    between = [(1 - tau) * states[:-1] + tau * states[1:] for tau in points]
    opti.set_initial(scaled, np.hstack([each / scale for each in between]).T)
    return Trajectory(equations=equations, step_s=step_s, states=x, history=history)


def _response(equations: Equations, step_s: float, start: Array, guess: tuple[Array, Array]) -> tuple[Array, Array]:
    """States of the guess at all instants, and the rates of its places before each."""
    inputs, places = guess
    found = Integrator(equations, step_s, Method.IDAS, Accuracy()).advance(start, inputs, places)
    if len(found) < len(inputs) - 1:
        raise SolveError(f"the guess was not simulated beyond {step_s * len(found):.6g} s: {gave_up(Method.IDAS)}")
    return np.vstack([start, found]), np.diff(places, axis=0, prepend=places[:1]) / step_s
