"""Engine CASADI: the same scheme without a C compiler, and a reference for the C code that shares no step with it.

The balances are written here in vectors from the models' own laws, and CasADi's own Newton iteration solves them. Only
the scheme is the same: second-order backward differences, implicit Euler at the start and in the pieces of a step that
must be split.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from tendonff.models.assembly import end_force, near_tension, normal_force, path_force
from tendonff.models.chain import Chain
from tendonff.models.friction import from_far_side
from tendonff.models.layout import INPUT_NAMES, ChainInputs
from tendonff.models.link import tendon_force
from tendonff.ocp.step.protocol import Array, InverseRows, Rows, StepperMemory
from tendonff.ocp.step.scheme import (
    BDF2_CARRY,
    BDF2_WEIGHT,
    MAX_ITERATIONS,
    MAX_PIECES,
    MAX_SPLITS,
    RESIDUAL_ROUNDING,
    RESIDUAL_TOLERANCE_N,
)

_CHUNK = 64
"""Steps that CasADi takes at once; where one of them is hard it is taken by itself and the rest again."""

_SLACK = 20.0
"""CasADi's iteration stops at its own tolerance; what counts as solved is this much wider than the C code's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepExpressions:
    """One implicit step in symbols: unknown velocities, what is known before, and what follows.

    Parameters
    ----------
    v, base, u, H : ca.SX
        Velocities at the end of the step, base of the scheme, inputs, weight of the rates.
    balance : ca.SX, shape (N + 2, 1)
        Force balance of every mass [N].
    end : ca.SX, shape (size, 1)
        State at the end of the step.
    force : ca.SX, shape (N + 1, 1)
        Tensions [N].
    tolerance : ca.SX
        Largest balance that counts as solved [N].
    """

    v: ca.SX
    base: ca.SX
    u: ca.SX
    H: ca.SX
    balance: ca.SX
    end: ca.SX
    force: ca.SX
    tolerance: ca.SX


def step_expressions(chain: Chain) -> StepExpressions:
    """One implicit step of a chain; its numbers may be CasADi scalars.

    Parameters
    ----------
    chain : Chain
    """
    n, layout, piece, near, far = chain.count, chain.layout, chain.elements.piece, chain.near, chain.far
    v, base, u, H = (
        ca.SX.sym("v", n + 2),
        ca.SX.sym("base", layout.size),
        ca.SX.sym("u", len(INPUT_NAMES)),
        ca.SX.sym("H"),
    )
    v_base, e_base, *own, q_a, q_l = ca.vertsplit(base, layout.cuts)
    links, masses = own[: len(layout.link_states)], own[len(layout.link_states) :]
    f_c1, x_c1, f_c2, x_c2 = ca.vertsplit(u)

    rate, on_path = v[:-1] - v[1:], v[1:-1]
    e = e_base + H * rate
    links = chain.link.implicit(e, tuple(links), H)
    force = tendon_force(chain.link.unclipped_force(e, rate, links))
    f_n = normal_force(force[:-1], force[1:], piece.adhesion_N)
    masses = chain.friction.implicit(on_path, tuple(masses), H, f_n)
    f_f = chain.friction.state_force(masses) + chain.friction.viscous_force(on_path)
    q_a, q_l = q_a + H * v[0], q_l + H * v[n + 1]
    sums = ca.vertcat(
        end_force(v[0], q_a, force[0], -1, f_c1, x_c1, near),
        path_force(force[:-1], force[1:], f_f),
        end_force(v[n + 1], q_l, force[n], 1, f_c2, x_c2, far),
    )
    mass = ca.vertcat(near.mass_kg, piece.mass_kg * ca.DM.ones(n), far.mass_kg)
    start = ca.substitute(chain.link.unclipped_force(e, rate, links), v, ca.SX.zeros(n + 2))
    largest = ca.norm_inf(ca.vertcat(start, mass * v_base / H))
    return StepExpressions(
        v=v,
        base=base,
        u=u,
        H=H,
        balance=mass / H * (v - v_base) - sums,
        end=ca.vertcat(v, e, *links, *masses, q_a, q_l),
        force=force,
        tolerance=RESIDUAL_TOLERANCE_N + RESIDUAL_ROUNDING * largest,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    """One implicit step that was tried: whether it is solved, its end, its tensions, its balances."""

    solved: bool
    x: Array
    tension_N: Array
    balance_N: Array


class CasadiStepper:
    """Advance one chain by CasADi functions alone.

    Parameters
    ----------
    chain : Chain
    step_s : float
        h [s].
    """

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._chain, self._step_s = chain, step_s
        s, n, size = step_expressions(chain), chain.count, chain.layout.size
        known = ca.vertcat(s.base, s.u, s.H)
        options = {
            "line_search": True,
            "linear_solver": "tridiag",
            "abstol": RESIDUAL_TOLERANCE_N / 100,
            "abstolStep": 1e-15,
            "max_iter": MAX_ITERATIONS,
            "error_on_fail": False,
        }
        solve = ca.rootfinder("solve", "newton", {"x": s.v, "p": known, "g": s.balance}, options)
        finish = ca.Function("finish", [s.v, known], [s.end, s.force, s.balance, s.tolerance], {"cse": True})
        guess, known = ca.MX.sym("guess", n + 2), ca.MX.sym("known", known.numel())
        end, force, balance, tolerance = finish(solve(guess, known), known)
        good = ca.norm_inf(balance) <= _SLACK * tolerance
        solved = ca.logic_and(good, ca.sumsqr(balance) >= 0)  # the norm overlooks what is not a number
        self._try = ca.Function("try", [guess, known], [end, force, balance, solved])
        pair, u = ca.MX.sym("pair", 2 * size), ca.MX.sym("u", s.u.numel())
        x, change = pair[:size], pair[:size] - pair[size:]
        base = ca.vertcat(x + BDF2_CARRY * change, u, BDF2_WEIGHT * step_s)
        end, force, balance, solved = self._try((x + change)[: n + 2], base)
        step = ca.Function("step", [pair, u], [ca.vertcat(end, x), force, solved])
        self._chunk = step.mapaccum("chunk", _CHUNK)

    def advance(self, memory: StepperMemory, inputs: ChainInputs, record: bool) -> Rows:
        """See `protocol.Stepper`."""
        table, size, n = inputs.table(), self._chain.layout.size, self._chain.count
        states, tensions = np.empty((len(table), size)), np.empty((len(table), n + 1))
        splits, row, last = 0, 0, np.zeros(n + 2)
        while row < len(table):
            if not memory.fresh and len(table) - row >= _CHUNK:
                row += self._advance_chunk(memory, table[row : row + _CHUNK], states[row:], tensions[row:])
                if row == len(table):
                    break
            old = memory.inputs.table()[0] if row == 0 else table[row - 1]
            end, split = self._advance_one(memory, old, table[row])
            splits, last = splits + split, end.balance_N
            if not end.solved:
                break
            states[row], tensions[row] = end.x, end.tension_N
            row += 1
        if row:
            memory.inputs = inputs[row - 1 : row]
        sizes = np.abs(last)
        worst = int(np.argmax(sizes))  # to numpy too, NaN is largest
        return Rows(
            tension_N=tensions[:row],
            ends_m=states[:row, -2:].copy(),
            states=states[:row] if record else None,
            iterations=row,  # at least; CasADi does not count
            splits=splits,
            residual_N=float(sizes[worst]),
            worst_mass=worst,
        )

    def _advance_chunk(self, memory: StepperMemory, table: Array, states: Array, tensions: Array) -> int:
        """Advance a whole chunk; return the number of leading steps that are solved."""
        size = len(memory.x)
        pairs, f, solved = (np.asarray(m) for m in self._chunk(np.concatenate([memory.x, memory.x_old]), table.T))
        unsolved = np.flatnonzero(solved.ravel() != 1)
        good = int(unsolved[0]) if unsolved.size else len(table)
        if good:
            states[:good], tensions[:good] = pairs[:size, :good].T, f[:, :good].T
            memory.x, memory.x_old = pairs[:size, good - 1].copy(), pairs[size:, good - 1].copy()
        return good

    def _advance_one(self, memory: StepperMemory, old: Array, now: Array) -> tuple[_Outcome, int]:
        """One step, split into implicit Euler pieces where it does not converge, and whether it was split."""
        x = memory.x
        change = np.zeros_like(x) if memory.fresh else x - memory.x_old
        weight = self._step_s * (1.0 if memory.fresh else BDF2_WEIGHT)
        split = 0
        for guess in (x + change, np.zeros_like(x), x):  # extrapolated, then at rest, then as before
            end = self._solve(guess, x + BDF2_CARRY * change, now, weight)
            if end.solved:
                break
        else:
            end, split = self._pieces(x, old, now), 1
        if end.solved:
            memory.x, memory.x_old, memory.fresh = end.x.copy(), x.copy(), False
        return end, split

    def _pieces(self, x: Array, old: Array, now: Array) -> _Outcome:
        """A step in pieces: halved until one converges, doubled again as soon as the time reached allows."""
        level, left = 1, 2  # pieces of h/2^level until the end of the step
        for _ in range(MAX_PIECES):
            u = old + (now - old) * (1 - (left - 1) * 0.5**level)
            end = self._solve(x, x, u, self._step_s * 0.5**level)
            if end.solved:
                x, left = end.x, left - 1
                if left == 0:
                    return end
                if level > 1 and left % 2 == 0:
                    level, left = level - 1, left // 2
            else:
                level, left = level + 1, 2 * left
                if level > MAX_SPLITS:
                    break
        return _Outcome(solved=False, x=end.x, tension_N=end.tension_N, balance_N=end.balance_N)

    def _solve(self, guess: Array, base: Array, inputs: Array, weight: float) -> _Outcome:
        v, known = guess[: self._chain.count + 2], np.concatenate([base, inputs, [weight]])
        x, force, balance, solved = (np.asarray(m).ravel() for m in self._try(v, known))
        return _Outcome(solved=bool(solved[0] == 1), x=x, tension_N=force, balance_N=balance)


class CasadiInverse:
    """The exact inverse as a mapped CasADi function.

    Parameters
    ----------
    chain : Chain
    step_s : float
        h [s].
    """

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._chain = chain
        self._first = self._make(step_s, carry=0.0)
        self._next = self._make(BDF2_WEIGHT * step_s, carry=BDF2_CARRY)

    def _make(self, H: float, carry: float) -> ca.Function:
        """Function (pair (x, x_old), reference) -> (pair, force, least tension)."""
        chain, n, layout = self._chain, self._chain.count, self._chain.layout
        link, friction, piece = chain.link, chain.friction, chain.elements.piece
        pair, reference = ca.SX.sym("pair", 2 * layout.size), ca.SX.sym("reference")
        x, x_old = pair[: layout.size], pair[layout.size :]
        v_base, e_base, *own, q_a, q_l = ca.vertsplit(x + carry * (x - x_old), layout.cuts)
        border = len(layout.link_states)
        f, least, unknown = reference, reference, ca.SX.sym("unknown")

        def root(expression: ca.SX) -> ca.SX:
            """Where an expression that is affine in the unknown is zero."""
            return -ca.substitute(expression, unknown, 0) / ca.jacobian(expression, unknown)

        far, near = chain.far, chain.near
        balance = far.mass_kg / H * (unknown - v_base[n + 1])
        v = root(balance - end_force(unknown, q_l + H * unknown, f, 1, 0, 0, far))
        q_l = q_l + H * v
        speeds, stretches = [v], []
        link_ends: list[tuple[ca.SX, ...]] = []
        mass_ends: list[tuple[ca.SX, ...]] = []
        for i in range(n, -1, -1):
            base = tuple(part[i] for part in own[:border])
            e = e_base[i] + H * unknown
            rate = root(link.unclipped_force(e, unknown, link.implicit(e, base, H)) - f)
            stretches.append(e_base[i] + H * rate)
            link_ends.append(link.implicit(stretches[-1], base, H))
            v = v + rate
            speeds.append(v)
            if i > 0:
                inertia = piece.mass_kg / H * (v - v_base[i])
                without = near_tension(f, friction.viscous_force(v), inertia)
                base = tuple(part[i - 1] for part in own[border:])
                states = from_far_side(friction, v, base, H, f + without + 2 * piece.adhesion_N)
                mass_ends.append(states)
                f = tendon_force(without + friction.state_force(states))
                least = ca.fmin(least, f)
        q_a = q_a + H * v
        balance = near.mass_kg / H * (v - v_base[0])
        force = root(balance - end_force(v, q_a, f, -1, unknown, 0, near))
        blocks = [speeds, stretches, *zip(*link_ends, strict=True), *zip(*mass_ends, strict=True)]
        end = ca.vertcat(*(s for block in blocks for s in block[::-1]), q_a, q_l)
        return ca.Function("invert", [pair, reference], [ca.vertcat(end, x), force, least], {"cse": True})

    def invert(self, x: Array, reference: Array, record: bool) -> InverseRows:
        """See `protocol.Inverse`."""
        if not len(reference):
            return InverseRows(force_N=np.empty(0), least_tension_N=np.empty(0), states=None)
        pair, force, least = self._first(np.concatenate([x, x]), reference[0])
        pairs, forces, leasts = [pair], [force], [least]
        if len(reference) > 1:
            rest = self._next.mapaccum("invert_run", len(reference) - 1)(pair, reference[1:])
            for whole, part in zip((pairs, forces, leasts), rest, strict=True):
                whole.append(part)
        states = np.hstack([np.asarray(p) for p in pairs])[: len(x)].T
        return InverseRows(
            force_N=np.hstack([np.asarray(f).ravel() for f in forces]),
            least_tension_N=np.hstack([np.asarray(f).ravel() for f in leasts]),
            states=states if record else None,
        )
