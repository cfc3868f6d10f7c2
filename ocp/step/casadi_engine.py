"""Engine CASADI: the step of `templates/stepper.c.j2` without a C compiler.

The ordinary step converges in a few full Newton moves. These are laid out as one CasADi function and accumulated over
many steps inside CasADi; all of them are taken, so that the answer is as close as that of the C code, which keeps one
matrix for an easy step. A step for which the line search would act, or that must be split, is taken by itself, with the
decisions of the C code one by one: where a step is hard, another line search finds another time to split, and two
engines would part ways.
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from tendonff.models.chain import Chain
from tendonff.ocp.step.laws import (
    end_mass,
    link_force,
    link_gain,
    link_start,
    link_states,
    path_mass,
)
from tendonff.ocp.step.protocol import Array, Rows, StepperMemory
from tendonff.ocp.step.scheme import (
    BDF2_CARRY,
    BDF2_WEIGHT,
    EASY_CONTRACTION,
    EASY_GOAL,
    EASY_MOVES,
    MAX_HALVINGS,
    MAX_ITERATIONS,
    MAX_PIECES,
    MAX_SPLITS,
    RESIDUAL_ROUNDING,
    RESIDUAL_TOLERANCE_N,
)

_CHUNKS = (256, 16)
"""Numbers of steps that CasADi takes at once: the small one where hard steps are frequent, for it is taken again."""

_FULL_MOVES = 3
"""Newton moves of an ordinary step; most steps need one or two."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    """One implicit step that was tried.

    Parameters
    ----------
    solved : bool
    x : ndarray, shape (4 N + 6,)
        State at its end.
    tension_N : ndarray, shape (N + 1,)
    residual_N : float
    worst_mass : int
    iterations : int
    """

    solved: bool
    x: Array
    tension_N: Array
    residual_N: float
    worst_mass: int
    iterations: int


@dataclass(frozen=True, slots=True, kw_only=True)
class StepExpressions:
    """One implicit step in symbols: unknown velocities, what is known before, and what follows.

    Parameters
    ----------
    v, base, u, H : ca.SX
        Velocities at the end of the step, base of the scheme, inputs, weight of the rates.
    balance, move : ca.SX, shape (N + 2, 1)
        Force balance of every mass [N], and Newton's move of the velocities.
    rest, move_of_rest : ca.SX, shape (N + 2, 1)
        Any balances [N], and the move that the matrix of v makes of them.
    end : ca.SX, shape (4 N + 6, 1)
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
    move: ca.SX
    rest: ca.SX
    move_of_rest: ca.SX
    end: ca.SX
    force: ca.SX
    tolerance: ca.SX


def step_expressions(chain: Chain) -> StepExpressions:
    """One implicit step of a chain; its numbers may be CasADi scalars.

    Parameters
    ----------
    chain : Chain
    """
    n, elements, ends = chain.count, chain.elements, (chain.near, chain.far)
    link = (
        elements.stiffness_N_per_m,
        elements.relaxing_stiffness_N_per_m,
        elements.relaxation_time_s,
        elements.damping_N_s_per_m,
    )
    path = (
        elements.mass_kg,
        elements.viscous_N_s_per_m,
        elements.adhesion_N,
        elements.bristle_stiffness_N_per_m,
        elements.mu_dynamic_pull,
        elements.mu_static_pull,
        elements.mu_dynamic_release,
        elements.mu_static_release,
        elements.stribeck_velocity_m_per_s,
    )
    near, far = ((end.mass_kg, end.damping_N_s_per_m, end.stiffness_N_per_m) for end in ends)
    gain_of, start_of, force_of = link_gain().function(), link_start().function(), link_force().function()
    states_of, mass_of, end_of = link_states().function(), path_mass().function(), end_mass().function()

    v, base, u, H = ca.SX.sym("v", n + 2), ca.SX.sym("base", 4 * n + 6), ca.SX.sym("u", 4), ca.SX.sym("H")
    base_v, base_e, base_z, base_s, base_q = ca.vertsplit(base, [0, n + 2, 2 * n + 3, 3 * n + 4, 4 * n + 4, 4 * n + 6])
    f_c1, x_c1, f_c2, x_c2 = ca.vertsplit(u)
    gain = gain_of(H, *link)
    start = [start_of(base_e[i], base_z[i], H, *link) for i in range(n + 1)]
    force, slope = zip(*(force_of(v[i] - v[i + 1], start[i], gain) for i in range(n + 1)), strict=True)

    first, by_v, by_f = end_of(v[0], force[0], base_v[0], base_q[0], H, -1, f_c1, x_c1, *near)
    residual, lower, diag, upper = [first], [ca.SX(0)], [by_v + by_f * slope[0]], [-by_f * slope[0]]
    bristle = []
    for i in range(1, n + 1):
        balance, by_v, by_near, by_far, f_s = mass_of(v[i], force[i - 1], force[i], base_v[i], base_s[i - 1], H, *path)
        residual.append(balance)
        lower.append(by_near * slope[i - 1])
        diag.append(by_v - by_near * slope[i - 1] + by_far * slope[i])
        upper.append(-by_far * slope[i])
        bristle.append(f_s)
    last, by_v, by_f = end_of(v[n + 1], force[n], base_v[n + 1], base_q[1], H, 1, f_c2, x_c2, *far)
    residual.append(last)
    lower.append(by_f * slope[n])
    diag.append(by_v - by_f * slope[n])

    mass = ca.vertcat(near[0], *[elements.mass_kg] * n, far[0])
    largest = ca.norm_inf(ca.vertcat(*start, mass * base_v / H))
    links = [states_of(v[i] - v[i + 1], base_e[i], base_z[i], H, *link) for i in range(n + 1)]
    end = ca.vertcat(
        v,
        *[e for e, _ in links],
        *[z for _, z in links],
        *bristle,
        base_q[0] + H * v[0],
        base_q[1] + H * v[n + 1],
    )
    rest = ca.SX.sym("rest", n + 2)
    return StepExpressions(
        v=v,
        base=base,
        u=u,
        H=H,
        balance=ca.vertcat(*residual),
        move=_tridiagonal_move(residual, lower, diag, upper),
        rest=rest,
        move_of_rest=_tridiagonal_move(ca.vertsplit(rest), lower, diag, upper),
        end=end,
        force=ca.vertcat(*force),
        tolerance=RESIDUAL_TOLERANCE_N + RESIDUAL_ROUNDING * largest,
    )


class _StepFunctions:
    """The parts of one implicit step as CasADi functions, all of its weight H.

    Parameters
    ----------
    chain : Chain
    """

    def __init__(self, chain: Chain) -> None:
        step, options = step_expressions(chain), {"cse": True}
        unknowns = [step.v, step.base, step.u, step.H]
        self.tolerance = ca.Function("tolerance", [step.base, step.H], [step.tolerance], options)
        self.balance = ca.Function("balance", unknowns, [step.balance], options)
        self.newton = ca.Function("newton", unknowns, [step.balance, step.move], options)
        self.move_of_rest = ca.Function("move_of_rest", [*unknowns, step.rest], [step.move_of_rest], options)
        self.finish = ca.Function("finish", unknowns, [step.end, step.force], options)


def _tridiagonal_move(residual: list[ca.SX], lower: list[ca.SX], diag: list[ca.SX], upper: list[ca.SX]) -> ca.SX:
    """Newton's move: minus the tridiagonal matrix's inverse times the residual, by elimination."""
    ratio: list[ca.SX] = []
    rest: list[ca.SX] = []
    pivot = diag[0]
    for i in range(len(diag)):
        rest.append((residual[i] - (lower[i] * rest[i - 1] if i else 0)) / pivot)
        if i + 1 < len(diag):
            ratio.append(upper[i] / pivot)
            pivot = diag[i + 1] - lower[i + 1] * ratio[i]
    move = [-rest[-1]]
    for i in range(len(diag) - 2, -1, -1):
        move.append(-rest[i] - ratio[i] * move[-1])
    return ca.vertcat(*move[::-1])


class CasadiStepper:
    """Advance one chain by CasADi functions alone.

    Parameters
    ----------
    chain : Chain
    step_s : float
        h [s].
    """

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._step_s, self._count = step_s, chain.count
        self._functions = _StepFunctions(chain)
        step = self._ordinary_step()
        self._chunks = {size: step.mapaccum(f"chunk_{size}", size) for size in _CHUNKS}

    def _ordinary_step(self) -> ca.Function:
        """(x, x_old), inputs -> (x, x_old), tensions, whether full Newton moves with falling balance solve it."""
        n, parts, weight = self._count, self._functions, BDF2_WEIGHT * self._step_s
        pair, u = ca.MX.sym("pair", 2 * (4 * n + 6)), ca.MX.sym("u", 4)
        x, x_old = pair[: 4 * n + 6], pair[4 * n + 6 :]
        base = x + BDF2_CARRY * (x - x_old)
        tolerance = parts.tolerance(base, weight)
        v = 2 * x[: n + 2] - x_old[: n + 2]
        answer, norm, falling = v, ca.inf, ca.MX(1)
        for k in range(_FULL_MOVES + 1):
            if k < _FULL_MOVES:
                residual, move = parts.newton(v, base, u, weight)
            else:
                residual, move = parts.balance(v, base, u, weight), 0
            size = ca.norm_inf(residual)
            falling = ca.logic_and(falling, size < norm)
            answer, norm = ca.if_else(falling, v, answer), ca.if_else(falling, size, norm)
            v = v + move
        solved = norm <= tolerance
        x_next, force = parts.finish(answer, base, u, weight)
        return ca.Function("step", [pair, u], [ca.vertcat(x_next, x), force, solved])

    def advance(self, memory: StepperMemory, inputs: Array, record: bool) -> Rows:
        """See `stepping.Stepper`."""
        n = self._count
        states, tensions = np.empty((len(inputs), 4 * n + 6)), np.empty((len(inputs), n + 1))
        splits, row, iterations, easy = 0, 0, 0, True
        last = _Outcome(solved=True, x=memory.x, tension_N=np.zeros(n + 1), residual_N=0.0, worst_mass=0, iterations=0)
        while row < len(inputs):
            size = _CHUNKS[0] if easy and len(inputs) - row >= _CHUNKS[0] else _CHUNKS[1]
            if not memory.fresh and len(inputs) - row >= size:
                good = self._advance_chunk(memory, inputs[row : row + size], states[row:], tensions[row:])
                row, easy = row + good, good == size
                iterations += good  # at least; CasADi does not count
                if good == size:
                    continue
            last, split = self._advance_one(memory, inputs[row])
            iterations, splits = iterations + last.iterations, splits + split
            if not last.solved:
                break
            states[row], tensions[row] = last.x, last.tension_N
            row += 1
        return Rows(
            tension_N=tensions[:row],
            ends_m=states[:row, -2:].copy(),
            states=states[:row] if record else None,
            iterations=iterations,
            splits=splits,
            residual_N=last.residual_N,
            worst_mass=last.worst_mass,
        )

    def _advance_chunk(self, memory: StepperMemory, inputs: Array, states: Array, tensions: Array) -> int:
        """Advance a whole chunk; return the number of leading steps that are solved."""
        size = len(memory.x)
        pairs, f, solved = (
            np.asarray(m) for m in self._chunks[len(inputs)](np.concatenate([memory.x, memory.x_old]), inputs.T)
        )
        unsolved = np.flatnonzero(solved.ravel() != 1)
        good = int(unsolved[0]) if unsolved.size else len(inputs)
        if good:
            states[:good] = pairs[:size, :good].T
            tensions[:good] = f[:, :good].T
            memory.x_old = pairs[size:, good - 1].copy()
            memory.x = pairs[:size, good - 1].copy()
            memory.inputs = inputs[good - 1].copy()
        return good

    def _advance_one(self, memory: StepperMemory, inputs: Array) -> tuple[_Outcome, int]:
        """One step, split into implicit Euler pieces where it does not converge, and whether it was split."""
        x, n = memory.x, self._count
        change = np.zeros_like(x) if memory.fresh else x - memory.x_old
        base = x + BDF2_CARRY * change
        weight = self._step_s * (1.0 if memory.fresh else BDF2_WEIGHT)
        for guess in (x + change, np.zeros_like(x), x):  # extrapolated, then at rest, then as before
            end = self._solve(guess[: n + 2], base, inputs, weight)
            if end.solved:
                break
        split = int(not end.solved)
        if split:  # pieces of h/2, h/4 ...: halved until one converges, doubled as soon as the time reached allows
            level, left, now = 1, 2, x
            pieces = 0
            while left > 0 and level <= MAX_SPLITS and pieces < MAX_PIECES:
                pieces += 1
                u = memory.inputs + (inputs - memory.inputs) * (1 - (left - 1) * 0.5**level)
                end = self._solve(now[: n + 2], now, u, self._step_s * 0.5**level)
                if end.solved:
                    now, left = end.x, left - 1
                    if level > 1 and left % 2 == 0:
                        level, left = level - 1, left // 2
                else:
                    level, left = level + 1, 2 * left
            end = replace(end, solved=left == 0)  # not solved where the pieces ran out either
        if end.solved:
            memory.x, memory.x_old, memory.inputs, memory.fresh = end.x.copy(), x.copy(), inputs.copy(), False
        return end, split

    def _easy(
        self, guess: Array, base: Array, inputs: Array, weight: float, residual: Array, goal: float
    ) -> tuple[Array, float, int]:
        """Newton's moves with the matrix of the guess: velocities, largest balance and number of moves."""
        v, now, moves = guess, _largest(residual)[0], 0
        while True:
            before = now
            v = v + np.asarray(self._functions.move_of_rest(guess, base, inputs, weight, residual)).ravel()
            residual = np.asarray(self._functions.balance(v, base, inputs, weight)).ravel()
            now, moves = _largest(residual)[0], moves + 1
            if moves >= EASY_MOVES or now <= goal or not now < EASY_CONTRACTION * before:
                return v, now, moves

    def _solve(self, guess: Array, base: Array, inputs: Array, weight: float) -> _Outcome:
        """One implicit step by Newton's method: with the matrix of the guess, else with backtracking."""
        parts, v, iterations = self._functions, guess, 0
        tolerance = float(parts.tolerance(base, weight))
        residual, move = (np.asarray(m).ravel() for m in parts.newton(v, base, inputs, weight))
        norm, worst = _largest(residual)
        if not norm <= tolerance:
            easy, size, iterations = self._easy(guess, base, inputs, weight, residual, EASY_GOAL * tolerance)
            if size <= tolerance:
                v, norm = easy, size
        spent = iterations
        while iterations - spent < MAX_ITERATIONS and not norm <= tolerance:
            iterations += 1
            t = 1.0
            for _ in range(MAX_HALVINGS):
                trial = v + t * move
                residual, next_move = (np.asarray(m).ravel() for m in parts.newton(trial, base, inputs, weight))
                size, next_worst = _largest(residual)
                if size < norm:
                    break
                t /= 2
            else:
                break  # no descent: the caller splits the step
            v, move, norm, worst = trial, next_move, size, next_worst
        if iterations > spent and EASY_GOAL * tolerance < norm <= tolerance:  # one move more: little is left to add up
            size, _ = _largest(np.asarray(parts.balance(v + move, base, inputs, weight)).ravel())
            if size < norm:
                v, norm = v + move, size
        x, force = (np.asarray(m).ravel() for m in parts.finish(v, base, inputs, weight))
        return _Outcome(
            solved=norm <= tolerance,
            x=x,
            tension_N=force,
            residual_N=norm,
            worst_mass=worst,
            iterations=iterations,
        )


def _largest(residual: Array) -> tuple[float, int]:
    """Largest balance and its mass; the first NaN where there is one."""
    sizes = np.abs(residual)
    worst = int(np.argmax(sizes))  # to numpy too, NaN is largest
    return float(sizes[worst]), worst
