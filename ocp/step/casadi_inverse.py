"""Engine CASADI: the exact inverse, element by element from the load to the actuator.

Without a compiler it inverts single tendons, and those of a joint through `ocp.joint.recursion`. Newton's method on the
page of equations cannot stand in for it: it fails where a tendon hangs loose, and takes three times as long elsewhere.
"""

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from tendonff.models.layout import fields_of
from tendonff.models.tendon.assembly import end_force, near_tension, tension_sum
from tendonff.models.tendon.chain import Chain, laws_at
from tendonff.models.tendon.friction import from_far_side
from tendonff.models.tendon.link import tendon_force
from tendonff.ocp.step.casadi_engine import column, path_moves
from tendonff.ocp.step.protocol import Array, InverseRows
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT


def _each(law: Any, count: int) -> list[Any]:
    """A law whose fields are numbers or columns, as one law for each element."""
    columns = {name: value for name, value in fields_of(law).items() if getattr(value, "numel", lambda: 1)() > 1}
    return [replace(law, **{name: value[k] for name, value in columns.items()}) for k in range(count)]


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseStep:
    """Symbols and expressions of one step of the inverse."""

    pair: ca.SX  # shape (2 size, 1); state before the step, and one step earlier
    reference: ca.SX  # tension at the far end [N]
    move: ca.SX  # a column of `path_moves`
    end: ca.SX  # shape (size, 1); state after the step
    force: ca.SX  # f_c1 [N]
    tension: ca.SX  # shape (N + 1, 1); of every link, the actuator's first [N]

    def function(self, *outputs: ca.SX) -> ca.Function:
        """Expressions of it as a function (pair, reference, move)."""
        return ca.Function("invert", [self.pair, self.reference, self.move], outputs, {"cse": True})


def inverse_step(chain: Chain, H: float, carry: float, *, cut_off: bool = True) -> InverseStep:
    """The exact inverse of one step of weight `H` [s].

    Tensions are cut off at zero or, not `cut_off`, go on below it where the tendon would have to push.
    """
    n, layout = chain.count, chain.layout
    piece, mass = chain.elements.piece, column(chain.elements.piece.mass_kg, n)
    pair, reference = ca.SX.sym("pair", 2 * layout.size), ca.SX.sym("reference")
    x, x_old, move = pair[: layout.size], pair[layout.size :], ca.SX.sym("move", 6 * n + 5)
    place, drift, kept, kept_old = ca.vertsplit(move, [0, 3 * n + 3, 4 * n + 5, 5 * n + 5, 6 * n + 5])
    frictions, links = (_each(law, count) for law, count in zip(laws_at(chain, place), (n, n + 1), strict=True))
    ones = ca.SX.ones(layout.part(layout.friction_states[0]).start)
    of_states = len(layout.friction_states)
    x_now, x_last = (
        ca.vertcat(ones, ca.repmat(share, of_states, 1), 1, 1) * part for share, part in ((kept, x), (kept_old, x_old))
    )
    v_base, *own, q_a, q_l = ca.vertsplit(x_now + carry * (x_now - x_last), layout.cuts)
    dry, (e_base, *own) = tuple(own[: len(chain.near.states)]), own[len(chain.near.states) :]
    border = len(layout.link_states)
    f, forces, unknown = reference, [reference], ca.SX.sym("unknown")

    def root(expression: ca.SX) -> ca.SX:
        """Where an expression that is affine in the unknown is zero."""
        return -ca.substitute(expression, unknown, 0) / ca.jacobian(expression, unknown)

    far, near = chain.far, chain.near
    if chain.far_joint is None:
        balance = far.mass_kg / H * (unknown - v_base[n + 1])
        v = root(balance - end_force(unknown, q_l + H * unknown, f, 1, 0, 0, far))
    else:
        v = drift[n + 1]
    q_l = q_l + H * v
    speeds, stretches = [v], []
    link_ends: list[tuple[ca.SX, ...]] = []
    mass_ends: list[tuple[ca.SX, ...]] = []
    for i in range(n, -1, -1):
        base, link = tuple(part[i] for part in own[:border]), links[i]
        e = e_base[i] + H * unknown
        explicit = link.explicit_force(e_base[i])
        rate = root(link.unclipped_force(e, unknown, link.implicit(e, base, H)) + explicit - f)
        stretches.append(e_base[i] + H * rate)
        link_ends.append(link.implicit(stretches[-1], base, H))
        v = v + rate - drift[i]
        speeds.append(v)
        if i > 0:
            friction = frictions[i - 1]
            inertia = mass[i - 1] / H * (v - v_base[i])
            without = near_tension(f, friction.viscous_force(v), inertia)
            base = tuple(part[i - 1] for part in own[border:])
            states = from_far_side(friction, v, base, H, tension_sum(f, without, piece.adhesion_N))
            mass_ends.append(states)
            f = without + friction.state_force(states)
            f = tendon_force(f) if cut_off else f
            forces.append(f)
    q_a, dry = q_a + H * v, near.implicit(v, dry, H, f)
    force = root(near.mass_kg / H * (v - v_base[0]) - end_force(v, q_a, f, -1, unknown, 0, near, dry))
    elements = (*zip(*link_ends, strict=True), *zip(*mass_ends, strict=True))
    blocks = [speeds, *((state,) for state in dry), stretches, *elements]
    end = ca.vertcat(*(s for block in blocks for s in block[::-1]), q_a, q_l)
    tension = ca.vertcat(*forces[::-1])
    return InverseStep(pair=pair, reference=reference, move=move, end=end, force=force, tension=tension)


class CasadiInverse:
    """The exact inverse of one chain as a mapped CasADi function."""

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._chain, self._step_s = chain, step_s
        self._first, self._next = (
            step.function(ca.vertcat(step.end, step.pair[: chain.layout.size]), step.force, ca.mmin(step.tension))
            for step in (inverse_step(chain, step_s, 0.0), inverse_step(chain, BDF2_WEIGHT * step_s, BDF2_CARRY))
        )

    def invert(self, x: Array, time_s: float, reference: Array, record: bool) -> InverseRows:
        """See `protocol.Inverse`."""
        if not len(reference):
            states = np.empty((0, len(x))) if record else None
            return InverseRows(force_N=np.empty(0), least_tension_N=np.empty(0), states=states, x=x)
        times = time_s + self._step_s * np.arange(-1.0, len(reference) + 1)
        moves = path_moves(self._chain, self._chain.path_at(times).table(), self._step_s, fresh=True)
        pair, force, least = self._first(np.concatenate([x, x]), reference[0], moves[:, 0])
        pairs, forces, leasts = [pair], [force], [least]
        if len(reference) > 1:
            rest = self._next.mapaccum("invert_run", len(reference) - 1)(pair, reference[1:], moves[:, 1:])
            for whole, part in zip((pairs, forces, leasts), rest, strict=True):
                whole.append(part)
        kept = np.hstack([np.asarray(p) for p in pairs])[: len(x)].T
        return InverseRows(
            force_N=np.hstack([np.asarray(f).ravel() for f in forces]),
            least_tension_N=np.hstack([np.asarray(f).ravel() for f in leasts]),
            states=kept if record else None,
            x=kept[-1],
        )
