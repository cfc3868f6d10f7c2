"""Forward sensitivities of the time step by CasADi alone: what `templates/tangent.c.j2` does without a C compiler.

With one it serves paths that move, where the C has the parameters of pieces only. Over the force at 41 knots it takes
a fifth of the time of differences (1 000 rows of the finger: 0.23 s for 1.2 s; in C 0.02 s).
"""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.models.layout import ChainInputs
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.step.casadi_engine import CasadiStepper, path_moves, step_expressions
from tendonff.ocp.step.protocol import Array, Rows, StepperMemory
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT

_CHUNK = 128
"""Rows whose Jacobians are held at once."""


class CasadiTangent:
    """A simulation with its derivatives in several directions.

    `symbolic` is the chain with the entries of `numbers`, whose values are given, as CasADi scalars; the chain itself
    where no number changes.
    """

    def __init__(self, chain: Chain, symbolic: Chain, numbers: ca.SX, values: Array, step_s: float) -> None:
        self._stepper, self._chain = CasadiStepper(chain, step_s), chain
        self._step_s, self._count = step_s, chain.count
        step = step_expressions(symbolic)
        outputs = [
            ca.densify(ca.jacobian(expression, argument))
            for expression in (step.balance, step.end, step.force)
            for argument in (step.v, step.base, step.u[0], numbers)
        ]
        inputs = [step.v, step.base, step.u, step.H, step.move, numbers]
        self._slopes = ca.Function("slopes", inputs, outputs, {"cse": True})
        self._values = values

    def run(
        self,
        x: Array,
        time_s: float,
        inputs: ChainInputs,
        start: Array,
        drive: Array,
        numbers: Array,
        forgotten: NDArray[np.intc],
    ) -> tuple[Rows, Array, Array]:
        """Simulate and differentiate in d directions.

        Inputs are those at the first state, then at the ends of the steps. Changes in each direction are those of the
        first state, shape (size, d), of f_c1 at the end of each step (rows, d), and of the numbers, shape (numbers, d).
        In each row so many first directions are followed no longer as `forgotten` says.

        Returns
        -------
        rows : Rows
            With states; fewer than requested where a step fails.
        tension_slopes : ndarray, shape (rows, N + 1, d)
        ends_slopes : ndarray, shape (rows, 2, d)
        """
        memory = StepperMemory(x=x.copy(), x_old=x.copy(), inputs=inputs[:1], time_s=time_s, fresh=True)
        rows = self._stepper.advance(memory, inputs[1:], record=True)
        after = rows.recorded
        states, done, n = np.vstack([x, x, after]), len(after), self._count
        times = time_s + self._step_s * np.arange(-1.0, done + 1)
        moves = path_moves(self._chain, self._chain.path_at(times).table(), self._step_s, fresh=True).T
        layout = self._chain.layout
        kept, kept_old = np.ones((2, done, layout.size))
        for name in layout.friction_states:
            kept[:, layout.part(name)] = moves[:, 4 * n + 5 : 5 * n + 5]
            kept_old[:, layout.part(name)] = moves[:, 5 * n + 5 :]
        bases = kept * states[1:-1] + BDF2_CARRY * (kept * states[1:-1] - kept_old * states[:-2])
        bases[:1] = kept[:1] * states[1:2]
        weights = np.full(done, BDF2_WEIGHT * self._step_s)
        weights[:1] = self._step_s  # the first step is implicit Euler: its base is the state itself
        tension, ends = np.empty((done, n + 1, start.shape[1])), np.empty((done, 2, start.shape[1]))
        now, old = start, start
        for first in range(0, done, _CHUNK):
            part = slice(first, min(first + _CHUNK, done))
            blocks = self._evaluate(
                after[part, : n + 2], bases[part], inputs.table()[1:][part], weights[part], moves[part]
            )
            for k, row in enumerate(range(part.start, part.stop)):
                (r_v, r_base, r_u, r_p), (x_v, x_base, _, x_p), (f_v, f_base, _, f_p) = (
                    [block[k] for block in group] for group in blocks
                )
                transported, earlier = kept[row][:, None] * now, kept_old[row][:, None] * old
                base = transported + (BDF2_CARRY * (transported - earlier) if row else 0.0)
                known = r_base @ base + r_u @ drive[row][None, :] + r_p @ numbers
                move = -np.linalg.solve(r_v, known)
                now, old = x_v @ move + x_base @ base + x_p @ numbers, now
                now[:, : forgotten[row]] = move[:, : forgotten[row]] = base[:, : forgotten[row]] = 0
                tension[row] = f_v @ move + f_base @ base + f_p @ numbers
                ends[row] = now[-2:]
        return rows, tension, ends

    def _evaluate(self, v: Array, base: Array, inputs: Array, weights: Array, moves: Array) -> list[list[Array]]:
        """Jacobians of balance, end and force over v, base, f_c1 and numbers, each of shape (rows, ., .)."""
        rows, place = len(v), moves[:, : 4 * self._count + 5].T
        mapped = self._slopes.map(rows)(
            v.T, base.T, inputs.T, weights[None, :], place, np.repeat(self._values[:, None], rows, axis=1)
        )
        blocks = []
        for k, block in enumerate(mapped):
            height, width = self._slopes.size_out(k)
            dense = np.asarray(block.full()).reshape(height, rows, width)
            blocks.append(np.ascontiguousarray(dense.transpose(1, 0, 2)))
        return [blocks[4 * k : 4 * k + 4] for k in range(3)]
