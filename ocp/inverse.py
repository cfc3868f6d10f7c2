"""The exact inverse: the output tension is a flat output.

Given f_{N+1}(t), the load's balance gives q_l, the link gives e, hence q_N and v_N, the friction gives f_N, and so on
up to f_c1. Under the scheme of the forward simulation each mass needs one scalar quadratic in f_s: closed form, O(N),
causal, no iteration. Simulated with the same chain and step, the force gives the reference back to rounding.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import casadi as ca
import numpy as np

from tendonff.models.chain import Chain, ChainState
from tendonff.models.errors import ParameterError
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.step.c_engine import CompiledInverse
from tendonff.ocp.step.laws import (
    far_velocity,
    link_gain,
    link_rate,
    link_start,
    link_states,
    near_force,
    path_mass_inverse,
)
from tendonff.ocp.step.protocol import Array, InverseRows
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT


class InverseStatus(StrEnum):
    """Whether the inverse's force really exists.

    Attributes
    ----------
    EXACT
        Every link stays taut: the chain follows the reference.
    WOULD_PUSH
        Somewhere the reference falls faster than the tendon can follow without being pushed.
    """

    EXACT = "exact"
    WOULD_PUSH = "would_push"


@dataclass(frozen=True, slots=True, kw_only=True)
class Inversion:
    """Force that makes the output tension follow a reference, before actuator limits.

    Parameters
    ----------
    status : InverseStatus
    message : str
        Why, for the user.
    time_s, force_N : ndarray, shape (n,)
        Rows at 0, h, 2 h ...; the force of row 0 is the tension at rest.
    least_tension_N : ndarray, shape (n,)
        Smallest tension along the path at each row.
    states : ndarray, shape (n, 4 N + 6), or None
        In the order of `ChainState.vector`, recorded on request.
    """

    status: InverseStatus
    message: str
    time_s: Array
    force_N: Array
    least_tension_N: Array
    states: Array | None


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
        Wanted output tension at 0, h, 2 h ... [N], > 0.
    step_s : float
        h [s], > 0.
    initial_tension_N : float, optional
        Uniform tension T0 of the start at rest [N]; default: the first reference.
    state : ChainState, optional
        Start from here instead; the first reference is then not used.
    record : bool, optional
        Keep every state.
    engine : Engine, optional

    Returns
    -------
    Inversion

    Raises
    ------
    ParameterError
        If reference or step are not usable numbers.
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
    tension = float(reference[0]) if initial_tension_N is None else initial_tension_N
    if state is None:
        state = chain.rest_state(tension)
    first = state.vector()
    compiled = resolve_engine(engine) is Engine.COMPILED
    rows = (CompiledInverse(chain, step_s) if compiled else _CasadiInverse(chain, step_s)).invert(
        first, reference[1:], record
    )
    least = np.concatenate([[tension], rows.least_tension_N])
    pushed = np.flatnonzero(least <= 0)
    if pushed.size:
        row = int(pushed[0])
        status = InverseStatus.WOULD_PUSH
        message = (
            f"the reference asks the tendon to push at t = {row * step_s:.6g} s ({pushed.size} of {least.size} rows); "
            "let it fall more slowly or keep more tension"
        )
    else:
        status, message = InverseStatus.EXACT, f"{least.size} rows, least tension {least.min():.4g} N"
    return Inversion(
        status=status,
        message=message,
        time_s=np.arange(len(reference), dtype=np.float64) * step_s,
        force_N=np.concatenate([[tension], rows.force_N]),
        least_tension_N=least,
        states=None if rows.states is None else np.vstack([first, rows.states]),
    )


class _CasadiInverse:
    """Engine CASADI: the same recursion as a mapped CasADi function."""

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._chain, self._step_s = chain, step_s
        self._size = 4 * chain.count + 6
        self._first = self._make(step_s, carry=0.0)
        self._next = self._make(BDF2_WEIGHT * step_s, carry=BDF2_CARRY)

    def _make(self, weight: float, carry: float) -> ca.Function:
        """Function (pair (x, x_old), reference) -> (pair, force, least tension)."""
        chain, n = self._chain, self._chain.count
        e = chain.elements
        link = (e.stiffness_N_per_m, e.relaxing_stiffness_N_per_m, e.relaxation_time_s, e.damping_N_s_per_m)
        mass = (e.mass_kg, e.viscous_N_s_per_m, e.adhesion_N)
        bristle = (
            e.bristle_stiffness_N_per_m,
            e.mu_dynamic_pull,
            e.mu_static_pull,
            e.mu_dynamic_release,
            e.mu_static_release,
            e.stribeck_velocity_m_per_s,
        )
        near, far = ((m.mass_kg, m.damping_N_s_per_m, m.stiffness_N_per_m) for m in (chain.near, chain.far))
        pair, reference = ca.SX.sym("pair", 2 * self._size), ca.SX.sym("reference")
        x, x_old = pair[: self._size], pair[self._size :]
        base = x + carry * (x - x_old)
        base_v, base_e, base_z, base_s, base_q = ca.vertsplit(
            base, [0, n + 2, 2 * n + 3, 3 * n + 4, 4 * n + 4, 4 * n + 6]
        )
        gain = link_gain().function()(weight, *link)
        start_of, rate_of, states_of = link_start().function(), link_rate().function(), link_states().function()
        path_of = path_mass_inverse().function()
        f, least = reference, reference
        v = far_velocity().function()(f, base_v[n + 1], base_q[1], weight, 1, 0, 0, *far)
        q_far = base_q[1] + weight * v
        velocities, elongations, relaxed, bristles = [v], [], [], []
        for i in range(n, -1, -1):
            rate = rate_of(f, start_of(base_e[i], base_z[i], weight, *link), gain)
            e_i, z_i = states_of(rate, base_e[i], base_z[i], weight, *link)
            elongations.append(e_i)
            relaxed.append(z_i)
            v = v + rate
            velocities.append(v)
            if i > 0:
                f, f_s = path_of(v, f, base_v[i], base_s[i - 1], weight, *mass, *bristle)
                bristles.append(f_s)
                least = ca.fmin(least, f)
        force = near_force().function()(v, f, base_v[0], base_q[0], weight, -1, 0, *near)
        parts = [part[::-1] for part in (velocities, elongations, relaxed, bristles)]
        end = ca.vertcat(*[s for part in parts for s in part], base_q[0] + weight * v, q_far)
        return ca.Function("invert", [pair, reference], [ca.vertcat(end, x), force, least], {"cse": True})

    def invert(self, x: Array, reference: Array, record: bool) -> InverseRows:
        """Force, least tension and states for references at the ends of the coming steps."""
        if not len(reference):
            return InverseRows(force_N=np.empty(0), least_tension_N=np.empty(0), states=None)
        pair, force, least = self._first(np.concatenate([x, x]), reference[0])
        pairs, forces, leasts = [pair], [force], [least]
        if len(reference) > 1:
            run = self._next.mapaccum("invert_run", len(reference) - 1)
            rest = run(pair, reference[1:])
            for whole, part in zip((pairs, forces, leasts), rest, strict=True):
                whole.append(part)
        states = np.hstack([np.asarray(p) for p in pairs])[: self._size].T
        return InverseRows(
            force_N=np.hstack([np.asarray(f).ravel() for f in forces]),
            least_tension_N=np.hstack([np.asarray(f).ravel() for f in leasts]),
            states=states if record else None,
        )
