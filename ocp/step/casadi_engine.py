"""Engine CASADI: the same scheme without a C compiler, and a reference for the C code that shares no step with it.

The balances are written here in vectors from the models' own laws, and CasADi's own Newton iteration solves them. Only
the scheme is the same: second-order backward differences, implicit Euler at the start and in the pieces of a step that
must be split. CasADi's `idas` on the page of equations cannot stand in for it: its numbers are others, and it takes
twice as long.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from tendonff.models.layout import INPUT_NAMES, ChainInputs
from tendonff.models.tendon.assembly import end_force, normal_force, path_force
from tendonff.models.tendon.chain import Chain, laws_at
from tendonff.models.tendon.link import tendon_force
from tendonff.ocp.step.protocol import Array, Rows, StepperMemory
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
    """Implicit step in symbols: unknown velocities, known values, and results."""

    # v, base, u, H: velocities at the end of the step, base of the scheme, inputs, weight of the rates
    v: ca.SX
    base: ca.SX
    u: ca.SX
    H: ca.SX
    move: ca.SX  # how the path moves: a column of `path_moves`, its first 4 N + 5 entries
    balance: ca.SX  # shape (N + 2, 1); force balance of every mass [N]
    end: ca.SX  # shape (size, 1); state at the end of the step
    force: ca.SX  # shape (N + 1, 1); tensions [N]
    tolerance: ca.SX  # largest balance that counts as solved [N]


def step_expressions(chain: Chain) -> StepExpressions:
    """Implicit step of a chain; its numbers may be CasADi scalars."""
    n, layout, piece, near, far = chain.count, chain.layout, chain.elements.piece, chain.near, chain.far
    v, base, u, H = (
        ca.SX.sym("v", n + 2),
        ca.SX.sym("base", layout.size),
        ca.SX.sym("u", len(INPUT_NAMES)),
        ca.SX.sym("H"),
    )
    v_base, *own, q_a, q_l = ca.vertsplit(base, layout.cuts)
    rubbing, (e_base, *own) = tuple(own[: len(near.states)]), own[len(near.states) :]
    links, masses = own[: len(layout.link_states)], own[len(layout.link_states) :]
    f_c1, x_c1, f_c2, x_c2 = ca.vertsplit(u)
    move = ca.SX.sym("move", 4 * n + 5)
    place, drift = move[: 3 * n + 3], move[3 * n + 3 :]
    friction, link = laws_at(chain, place)

    rate, on_path = v[:-1] - v[1:] + drift[: n + 1], v[1:-1]
    e = e_base + H * rate
    links = link.implicit(e, tuple(links), H)
    unclipped = link.unclipped_force(e, rate, links) + link.explicit_force(e_base)
    force = tendon_force(unclipped)
    rubbing = near.implicit(v[0], rubbing, H, force[0])
    f_n = normal_force(force[:-1], force[1:], piece.adhesion_N)
    masses = friction.implicit(on_path, tuple(masses), H, f_n)
    f_f = friction.state_force(masses) + friction.viscous_force(on_path)
    q_a, q_l = q_a + H * v[0], q_l + H * v[n + 1]
    sums = ca.vertcat(
        end_force(v[0], q_a, force[0], -1, f_c1, x_c1, near, rubbing),
        path_force(force[:-1], force[1:], f_f),
        end_force(v[n + 1], q_l, force[n], 1, f_c2, x_c2, far),
    )
    mass = ca.vertcat(near.mass_kg, column(piece.mass_kg, n), far.mass_kg)
    balance = mass / H * (v - v_base) - sums
    if chain.far_joint is not None:  # the joint gives the speed of the far end
        balance[n + 1] = far.mass_kg / H * (v[n + 1] - drift[n + 1])
    start = ca.substitute(unclipped, ca.vertcat(v, drift), ca.SX.zeros(2 * n + 4))
    largest = ca.norm_inf(ca.vertcat(start, mass * v_base / H))
    return StepExpressions(
        v=v,
        base=base,
        u=u,
        H=H,
        move=move,
        balance=balance,
        end=ca.vertcat(v, *rubbing, e, *links, *masses, q_a, q_l),
        force=force,
        tolerance=RESIDUAL_TOLERANCE_N + RESIDUAL_ROUNDING * largest,
    )


def column(value: object, n: int) -> ca.DM:
    """A number or one for each mass, as a column; symbols stay."""
    return value * ca.DM.ones(n) if not isinstance(value, np.ndarray) else ca.DM(value)


def path_moves(chain: Chain, places: Array, step_s: float, *, fresh: bool) -> Array:
    """Motion of the path in each step, from rows of `PathRows.table`, the first one step before the start.

    Returns
    -------
    ndarray, shape (6 N + 5, rows)
        Place (3 N + 3); rates of gained lengths and far end (N + 2); shares of the present and of the last bristle
        forces that are kept, (N) each.
    """
    n, rows = chain.count, len(places) - 2
    before, old, now = places[:-2], places[1:-1], places[2:]
    carry, weight = np.full((rows, 1), BDF2_CARRY), np.full((rows, 1), BDF2_WEIGHT * step_s)
    if fresh:
        carry[:1], weight[:1] = 0.0, step_s
    lengths = slice(2 * n + 1, None)
    drift = (now[:, lengths] - old[:, lengths] - carry * (old[:, lengths] - before[:, lengths])) / weight
    kept, earlier = (_kept(a[:, :n], b[:, :n]) for a, b in ((old, now), (before, old)))
    return np.hstack([now, drift, kept, kept * earlier]).T


def _kept(old: Array, now: Array) -> Array:
    """Share of its bristle force that contact keeps."""
    return np.where(now < old, now / np.maximum(old, 1e-300), 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    """Attempted implicit step: whether it is solved, its end, its tensions, its balances."""

    solved: bool
    x: Array
    tension_N: Array
    balance_N: Array


class CasadiStepper:
    """Advance one chain by CasADi functions alone."""

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._chain, self._step_s = chain, step_s
        s, n, size = step_expressions(chain), chain.count, chain.layout.size
        known = ca.vertcat(s.base, s.u, s.H, s.move)
        options = {
            "line_search": True,
            "linear_solver": "tridiag" if chain.far_joint is None else "qr",  # one wants all three diagonals
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
        x, x_old, move = pair[:size], pair[size:], ca.MX.sym("move", 6 * n + 5)
        now, old = (
            self._keep(part, ca.vertsplit(move, [0, 4 * n + 5, 5 * n + 5, 6 * n + 5])[k])
            for part, k in ((x, 1), (x_old, 2))
        )
        base = ca.vertcat(now + BDF2_CARRY * (now - old), u, BDF2_WEIGHT * step_s, move[: 4 * n + 5])
        end, force, balance, solved = self._try((2 * x - x_old)[: n + 2], base)
        step = ca.Function("step", [pair, u, move], [ca.vertcat(end, x), force, solved])
        self._chunk = step.mapaccum("chunk", _CHUNK)

    def _keep(self, x: Any, kept: Any) -> Any:
        """The state with what masses keep of the states of their friction."""
        layout = self._chain.layout
        first, last = layout.part(layout.friction_states[0]).start, layout.size - 2
        whole = [kept] * len(layout.friction_states)
        if isinstance(x, np.ndarray):
            return np.concatenate([x[:first], np.concatenate(whole) * x[first:last], x[last:]])
        return ca.vertcat(x[:first], ca.vertcat(*whole) * x[first:last], x[last:])

    def advance(self, memory: StepperMemory, inputs: ChainInputs, record: bool) -> Rows:
        """See `protocol.Stepper`."""
        table, size, n = inputs.table(), self._chain.layout.size, self._chain.count
        times = memory.time_s + self._step_s * np.arange(-1.0, len(table) + 1)
        places = self._chain.path_at(times).table()
        moves = path_moves(self._chain, places, self._step_s, fresh=memory.fresh)
        states, tensions = np.empty((len(table), size)), np.empty((len(table), n + 1))
        splits, row, last = 0, 0, np.zeros(n + 2)
        while row < len(table):
            part = slice(row, row + _CHUNK)
            if not memory.fresh and len(table) - row >= _CHUNK:
                row += self._advance_chunk(memory, table[part], moves[:, part], states[row:], tensions[row:])
                if row == len(table):
                    break
            old = memory.inputs.table()[0] if row == 0 else table[row - 1]
            end, split = self._advance_one(memory, old, table[row], moves[:, row], places[row + 1 : row + 3])
            splits, last = splits + split, end.balance_N
            if not end.solved:
                break
            states[row], tensions[row] = end.x, end.tension_N
            row += 1
        if row:
            memory.inputs = inputs[row - 1 : row]
            memory.time_s += row * self._step_s
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

    def _advance_chunk(self, memory: StepperMemory, table: Array, moves: Array, states: Array, tensions: Array) -> int:
        """Advance a whole chunk; return the number of leading steps that are solved."""
        size = len(memory.x)
        pair = np.concatenate([memory.x, memory.x_old])
        pairs, f, solved = (np.asarray(m) for m in self._chunk(pair, table.T, moves))
        unsolved = np.flatnonzero(solved.ravel() != 1)
        good = int(unsolved[0]) if unsolved.size else len(table)
        if good:
            states[:good], tensions[:good] = pairs[:size, :good].T, f[:, :good].T
            memory.x, memory.x_old = pairs[:size, good - 1].copy(), pairs[size:, good - 1].copy()
        return good

    def _advance_one(
        self, memory: StepperMemory, old: Array, now: Array, move: Array, places: Array
    ) -> tuple[_Outcome, int]:
        """Step, split into implicit Euler pieces where it does not converge, and whether it was split."""
        x, n = memory.x, self._chain.count
        change = np.zeros_like(x) if memory.fresh else x - memory.x_old
        base = self._keep(x, move[4 * n + 5 : 5 * n + 5])
        if not memory.fresh:
            base = base + BDF2_CARRY * (base - self._keep(memory.x_old, move[5 * n + 5 :]))
        weight = self._step_s * (1.0 if memory.fresh else BDF2_WEIGHT)
        split = 0
        for guess in (x + change, np.zeros_like(x), x):  # extrapolated, then at rest, then as before
            end = self._solve(guess, base, now, weight, move[: 4 * n + 5])
            if end.solved:
                break
        else:
            end, split = self._pieces(x, old, now, places), 1
        if end.solved:
            memory.x, memory.x_old, memory.fresh = end.x.copy(), x.copy(), False
        return end, split

    def _pieces(self, x: Array, old: Array, now: Array, places: Array) -> _Outcome:
        """A step in pieces: halved until one converges, doubled again as soon as the time reached allows."""
        level, left = 1, 2  # pieces of h/2^level until the end of the step
        for _ in range(MAX_PIECES):
            length = 0.5**level
            share = 1 - (left - 1) * length
            way = places[0] + np.array([[share - length], [share]]) * (places[1] - places[0])
            move = path_moves(self._chain, way[[0, 0, 1]], self._step_s * length, fresh=True)[:, 0]
            base = self._keep(x, move[-2 * self._chain.count : -self._chain.count])
            u = old + (now - old) * share
            end = self._solve(x, base, u, self._step_s * length, move[: -2 * self._chain.count])
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

    def _solve(self, guess: Array, base: Array, inputs: Array, weight: float, move: Array) -> _Outcome:
        v, known = guess[: self._chain.count + 2], np.concatenate([base, inputs, [weight], move])
        x, force, balance, solved = (np.asarray(m).ravel() for m in self._try(v, known))
        return _Outcome(solved=bool(solved[0] == 1), x=x, tension_N=force, balance_N=balance)
