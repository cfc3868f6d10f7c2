"""Forward simulation of the chain by one fixed-step scheme, whatever the engine."""

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.layout import ChainInputs, ChainState
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.link import tendon_force
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Accuracy, Method
from tendonff.ocp.short import rows_in_short
from tendonff.ocp.step.c_engine import CompiledStepper
from tendonff.ocp.step.casadi_engine import CasadiStepper
from tendonff.ocp.step.protocol import Array, Rows, Stepper, StepperMemory
from tendonff.ocp.tendon.integrated import IntegratedStepper


class Outcome(StrEnum):
    """Outcome of a simulation."""

    DONE = "done"  # all rows computed, every link in tension
    SLACK = "slack"  # all rows computed; some link went slack on the way
    FAILED = "failed"  # a step could not be solved; the rows before it are good


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """Response of the chain, rows at 0, h, 2 h ...

    Attributes
    ----------
    outcome : Outcome
        How the run ended.
    message : str
        What happened, for the user.
    time_s : numpy.ndarray
        Shape (n,).
    force_N : numpy.ndarray
        Shape (n,); f_c1, the actuator's force.
    tension_N : numpy.ndarray
        Shape (n, N + 1); f_1 .. f_{N+1}; the last column is the output tension.
    near_position_m, far_position_m : numpy.ndarray
        Shape (n,); q_a, q_l.
    states : numpy.ndarray or None
        Shape (n, size); every state in the order of `StateLayout`, recorded on request.
    final : ChainState
        State after the last good row.
    iterations, splits : int
        Linear solves, and steps that had to be split.
    """

    outcome: Outcome
    message: str
    time_s: Array
    force_N: Array
    tension_N: Array
    near_position_m: Array
    far_position_m: Array
    states: Array | None
    final: ChainState
    iterations: int
    splits: int

    def __repr__(self) -> str:
        return rows_in_short(self, self.outcome, self.time_s)

    @property
    def output_tension_N(self) -> Array:
        """f_{N+1}, shape (n,) [N]."""
        return self.tension_N[:, -1]

    def require(self) -> "Simulation":
        """Return itself, or raise `SolveError` with the message if it failed."""
        if self.outcome is Outcome.FAILED:
            raise SolveError(self.message)
        return self


class Simulator:
    """A chain in motion: feed it inputs, chunk by chunk, in bounded memory.

    It starts at a state, with the inputs there in one row, and goes on in steps of h [s] > 0, else ParameterError.
    CodeError if the compiled engine was requested and no compiler works. Any method but BDF2 is one of CasADi's
    integrators, to an accuracy, whatever the engine.
    """

    def __init__(
        self,
        chain: Chain,
        step_s: float,
        state: ChainState,
        inputs: ChainInputs,
        engine: Engine = Engine.AUTO,
        method: Method = Method.BDF2,
        accuracy: Accuracy | None = None,
    ) -> None:
        if not 0 < step_s < math.inf:
            raise ParameterError(f"step_s must be a finite number > 0, got {step_s}; 0.001 suits most rigs")
        self._chain = chain
        x = state.vector()
        self._memory = StepperMemory(x=x, x_old=x.copy(), inputs=inputs, time_s=state.time_s, fresh=True)
        self._stepper: Stepper = _stepper(chain, step_s, engine, Method(method), accuracy or Accuracy())

    @property
    def state(self) -> ChainState:
        """Where the chain is now."""
        return ChainState.from_vector(self._memory.x, self._chain.layout, self._memory.time_s)

    def checkpoint(self) -> StepperMemory:
        """State to which `restore` returns."""
        return replace(self._memory, x=self._memory.x.copy(), x_old=self._memory.x_old.copy())

    def restore(self, memory: StepperMemory) -> None:
        """Go back to a checkpoint, which stays good for more."""
        self._memory = replace(memory, x=memory.x.copy(), x_old=memory.x_old.copy())

    def advance(self, inputs: ChainInputs, record: bool = False) -> Rows:
        """Advance over inputs at the ends of the coming steps; fewer rows where a step fails for good."""
        return self._stepper.advance(self._memory, inputs, record)


def _stepper(chain: Chain, step_s: float, engine: Engine, method: Method, accuracy: Accuracy) -> Stepper:
    if method is not Method.BDF2:
        return IntegratedStepper(chain, step_s, method, accuracy)
    compiled = resolve_engine(engine) is Engine.COMPILED
    return CompiledStepper(chain, step_s) if compiled else CasadiStepper(chain, step_s)


def tensions_of(chain: Chain, states: Array, time_s: Array | float = 0.0) -> Array:
    """Tensions of recorded states, shape (rows, size), as shape (rows, N + 1) [N].

    The time [s] matters where the path moves. The rate of that motion, which acts by the damping alone, is left out.
    """
    layout, x = chain.layout, np.atleast_2d(states)
    v, own = x[:, layout.part("v")], tuple(x[:, layout.part(name)] for name in layout.link_states)
    link = chain.link.shortened(chain.path_at(np.atleast_1d(time_s)).ratio)
    e = x[:, layout.part("e")]
    force: Array = tendon_force(link.unclipped_force(e, v[:, :-1] - v[:, 1:], own) + np.asarray(link.explicit_force(e)))
    return force


def describe_failure(chain: Chain, rows: Rows, time_s: float, step_s: float) -> str:
    """Text of a step that failed and ended at `time_s`: when, which mass, how far off, what to try."""
    if rows.reason is not None:
        return f"simulation stopped before t = {time_s:.6g} s: {rows.reason}"
    masses = {0: "the actuator", chain.count + 1: "the load"}
    where = masses.get(rows.worst_mass, f"mass {rows.worst_mass} of {chain.count}")
    return (
        f"simulation stopped at t = {time_s:.6g} s: the step did not converge although it was split; "
        f"worst balance {rows.residual_N:.3g} N at {where}; "
        f"check the force there for jumps or NaN, or use a step below {step_s:g} s"
    )


@in_turn
def simulate(
    chain: Chain,
    force_N: Array,
    step_s: float,
    *,
    initial_tension_N: float | None = None,
    state: ChainState | None = None,
    record: bool = False,
    engine: Engine = Engine.AUTO,
    method: Method = Method.BDF2,
    rtol: float = 1e-6,
    atol: float = 1e-9,
) -> Simulation:
    """Play a force on the actuator; the load moves only with the tendon (x_c2 = f_c2 = 0).

    Parameters
    ----------
    force_N : ndarray, shape (n,)
        f_c1 at 0, h, 2 h ... [N].
    step_s : float
        h [s], > 0.
    initial_tension_N : float, optional
        Uniform tension T0 of the start at rest [N]; default: the first force.
    state : ChainState, optional
        Start from here instead.
    record : bool, optional
        Keep every state.
    method : {"bdf2", "cvodes", "idas", "collocation"}, optional
        How it advances: by the step of this package, or by an integrator of CasADi on `mechanism_equations`, a hundred
        times slower or more.
    rtol, atol : float, optional
        Relative and absolute tolerance of an integrator, for every state in its SI unit.

    Returns
    -------
    Simulation
        Failed runs return too, with their outcome.

    Raises
    ------
    ParameterError
        If force or step are not usable numbers.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> chain = tf.Chain.of(scenario.transmission, tf.Level.PRESLIDING)
    >>> reference = tf.sample_reference(scenario)
    >>> run = tf.simulate(chain, reference.tension_N, reference.step_s)
    >>> lost = reference.tension_N - run.output_tension_N
    >>> print(f"{lost.max():.0f} N of friction at most")
    18 N of friction at most
    """
    force = np.asarray(force_N, dtype=np.float64)
    if force.ndim != 1 or force.size < 1:
        raise ParameterError(f"force_N must be a vector with at least one row, got shape {force.shape}")
    if not np.all(np.isfinite(force)):
        row = int(np.flatnonzero(~np.isfinite(force))[0])
        raise ParameterError(f"force_N must be finite, got {force[row]} at t = {row * step_s:g} s; repair the profile")
    if state is None:
        state = at_rest(chain, float(force[0]) if initial_tension_N is None else initial_tension_N)
    inputs = ChainInputs.of_force(force)
    simulator = Simulator(chain, step_s, state, inputs[:1], engine, method, Accuracy(rtol=rtol, atol=atol))
    first = state.vector()
    rows = simulator.advance(inputs[1:], record)
    tension = np.vstack([tensions_of(chain, first, state.time_s), rows.tension_N])
    ends = np.vstack([first[-2:], rows.ends_m])
    good = len(tension)
    outcome, message = outcome_of(chain, rows, tension, good == len(force), step_s)
    return Simulation(
        outcome=outcome,
        message=message,
        time_s=np.arange(good, dtype=np.float64) * step_s,
        force_N=force[:good],
        tension_N=tension,
        near_position_m=ends[:, 0],
        far_position_m=ends[:, 1],
        states=None if rows.states is None else np.vstack([first, rows.states]),
        final=simulator.state,
        iterations=rows.iterations,
        splits=rows.splits,
    )


def at_rest(chain: Chain, tension_N: float) -> ChainState:
    """The chain at rest under a uniform tension [N]; ParameterError where it is below 0 or not finite."""
    if not 0 <= tension_N < math.inf:
        raise ParameterError(f"initial_tension_N must be a finite number >= 0, got {tension_N}; a tendon cannot push")
    return chain.rest_state(tension_N)


def outcome_of(chain: Chain, rows: Rows, tension_N: Array, complete: bool, step_s: float) -> tuple[Outcome, str]:
    """Outcome and message of a run, from its last chunk and all tensions, shape (n, N + 1), complete or not."""
    if not complete:
        return Outcome.FAILED, describe_failure(chain, rows, len(tension_N) * step_s, step_s)
    slack = tension_N <= 0
    if slack.any():
        row = int(np.argmax(slack.any(axis=1)))
        link = int(np.argmax(slack[row])) + 1
        share = 100 * float(slack.any(axis=1).mean())
        return (
            Outcome.SLACK,
            f"link {link} went slack at t = {row * step_s:.6g} s; some link is slack in {share:.2g} % of the rows",
        )
    return Outcome.DONE, f"{len(tension_N)} rows"
