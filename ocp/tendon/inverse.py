"""The exact inverse: the output tension is a flat output.

Given f_{N+1}(t), the load's balance gives q_l, the link gives e, hence q_N and v_N, the friction gives f_N, and so on
up to f_c1. Under the scheme of the forward simulation each mass needs one scalar quadratic in f_s: closed form, O(N),
causal, no iteration. Simulated with the same chain and step, the force gives the reference back to rounding.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tendonff.models.errors import ParameterError
from tendonff.models.layout import ChainState
from tendonff.models.tendon.assembly import end_force
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.step.c_engine import CompiledInverse
from tendonff.ocp.step.casadi_inverse import CasadiInverse
from tendonff.ocp.step.protocol import Array, Inverse, require_recorded
from tendonff.ocp.tendon.simulate import at_rest, tensions_of


class InverseStatus(StrEnum):
    """Whether the inverse's force really exists."""

    EXACT = "exact"  # every link stays taut: the chain follows the reference
    WOULD_PUSH = "would_push"  # somewhere the reference falls faster than the tendon can follow without being pushed


@dataclass(frozen=True, slots=True, kw_only=True)
class Inversion:
    """Force that makes the output tension follow a reference, before actuator limits.

    Attributes
    ----------
    status : InverseStatus
        How it ended.
    message : str
        Why, for the user.
    time_s, force_N : numpy.ndarray
        Shape (n,); rows at 0, h, 2 h ...; the force of row 0 holds the state of the start: at rest, its tension.
    least_tension_N : numpy.ndarray
        Shape (n,); smallest tension along the path at each row.
    states : numpy.ndarray or None
        Shape (n, size); in the order of `StateLayout`, recorded on request.
    final : ChainState
        State after the last row.
    """

    status: InverseStatus
    message: str
    time_s: Array
    force_N: Array
    least_tension_N: Array
    states: Array | None
    final: ChainState

    @property
    def recorded(self) -> Array:
        """The states, shape (n, size); ParameterError where they were not requested."""
        return require_recorded(self.states)


@in_turn
def invert(
    chain: Chain,
    reference_N: Array,
    step_s: float,
    *,
    initial_tension_N: float | None = None,
    state: ChainState | None = None,
    record: bool = False,
    engine: Engine = Engine.AUTO,
) -> Inversion:
    """Find the actuator's force whose response is the reference (x_c2 = f_c2 = 0).

    Parameters
    ----------
    chain : Chain
        Its near end must act (k_c1 = 0).
    reference_N : ndarray, shape (n,)
        Reference of the output tension at 0, h, 2 h ... [N], > 0.
    step_s : float
        h [s], > 0.
    initial_tension_N : float, optional
        Uniform tension T0 of the start at rest [N]; default: the first reference.
    state : ChainState, optional
        Start from here instead; the first reference is then not used.
    record : bool, optional
        Keep every state.

    Raises
    ------
    ParameterError
        If reference or step are not usable numbers.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> chain = tf.Chain.of(scenario.transmission, tf.Level.PRESLIDING)
    >>> reference = tf.sample_reference(scenario)
    >>> found = tf.invert(chain, reference.tension_N, reference.step_s)
    >>> run = tf.simulate(chain, found.force_N, reference.step_s)
    >>> bool(abs(run.output_tension_N - reference.tension_N).max() < 1e-6)
    True
    """
    reference = np.ascontiguousarray(reference_N, dtype=np.float64)
    if reference.ndim != 1 or reference.size < 1:
        raise ParameterError(f"reference_N must be a vector with at least one row, got shape {reference.shape}")
    if not 0 < step_s < math.inf:
        raise ParameterError(f"step_s must be a finite number > 0, got {step_s}; 0.001 suits most rigs")
    bad = np.flatnonzero(~((reference > 0) & np.isfinite(reference)))
    if bad.size:
        row = int(bad[0])
        raise ParameterError(
            f"reference_N must be finite and > 0, got {reference[row]} at t = {row * step_s:g} s; a tendon cannot push"
        )
    if state is None:
        tension = float(reference[0]) if initial_tension_N is None else initial_tension_N
        state, force, least = at_rest(chain, tension), tension, tension
    else:
        force, least = _at(chain, state)
    first = state.vector()
    compiled = resolve_engine(engine) is Engine.COMPILED
    inverse: Inverse = CompiledInverse(chain, step_s) if compiled else CasadiInverse(chain, step_s)
    rows = inverse.invert(first, state.time_s, reference[1:], record)
    least_tension = np.concatenate([[least], rows.least_tension_N])
    pushed = np.flatnonzero(least_tension <= 0)
    if pushed.size:
        row = int(pushed[0])
        status = InverseStatus.WOULD_PUSH
        message = (
            f"the reference asks the tendon to push at t = {row * step_s:.6g} s ({pushed.size} of {least_tension.size} "
            "rows); "
            "let it fall more slowly or keep more tension"
        )
    else:
        status, message = InverseStatus.EXACT, f"{least_tension.size} rows, least tension {least_tension.min():.4g} N"
    return Inversion(
        status=status,
        message=message,
        time_s=np.arange(len(reference), dtype=np.float64) * step_s,
        force_N=np.concatenate([[force], rows.force_N]),
        least_tension_N=least_tension,
        states=None if rows.states is None else np.vstack([first, rows.states]),
        final=ChainState.from_vector(rows.x, chain.layout, state.time_s + (len(reference) - 1) * step_s),
    )


def _at(chain: Chain, state: ChainState) -> tuple[float, float]:
    """Force that balances the actuator at a state without accelerating it, and the least tension there [N]."""
    tension = tensions_of(chain, state.vector(), state.time_s)[0]
    v, q = float(state.velocity_m_per_s[0]), state.near_position_m
    own = tuple(state.near.tolist())
    without = end_force(v, q, float(tension[0]), -1, 0.0, 0.0, chain.near, own)
    return -float(without), float(tension.min())
