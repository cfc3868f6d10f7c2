"""Engine CASADI: the same step by CasADi's line-searched Newton, for machines without a C compiler."""

import casadi as ca
import numpy as np

from tendonff.models.chain import Chain
from tendonff.ocp.elements import end_mass, link_force, link_gain, link_start, link_states, path_mass
from tendonff.ocp.scheme import (
    BDF2_CARRY,
    BDF2_WEIGHT,
    MAX_ITERATIONS,
    MAX_SPLITS,
    RESIDUAL_ROUNDING,
    RESIDUAL_TOLERANCE_N,
)
from tendonff.ocp.stepping import Array, Rows, StepperMemory

_CHUNK = 256


class CasadiStepper:
    """Advance one chain by CasADi's `newton` root finder with line search and tridiagonal linear solver.

    Parameters
    ----------
    chain : Chain
    step_s : float
        h [s].
    """

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._step_s = step_s
        self._count = n = chain.count
        link, bristle, elements = chain.link, chain.bristle, chain.elements
        gain_of, start_of = link_gain().function(), link_start().function()
        force_of, states_of = link_force().function(), link_states().function()
        mass_of, end_of = path_mass().function(), end_mass().function()
        link_numbers = (
            link.stiffness_N_per_m,
            link.relaxing_stiffness_N_per_m,
            link.relaxation_time_s,
            link.damping_N_s_per_m,
        )
        path_numbers = (
            elements.mass_kg,
            elements.viscous_N_s_per_m,
            elements.adhesion_N,
            bristle.bristle_stiffness_N_per_m,
            bristle.mu_dynamic_pull,
            bristle.mu_static_pull,
            bristle.mu_dynamic_release,
            bristle.mu_static_release,
            bristle.stribeck_velocity_m_per_s,
        )
        v, base, u, weight = ca.SX.sym("v", n + 2), ca.SX.sym("base", 4 * n + 6), ca.SX.sym("u", 4), ca.SX.sym("H")
        base_v, base_e, base_z, base_s, base_q = ca.vertsplit(
            base, [0, n + 2, 2 * n + 3, 3 * n + 4, 4 * n + 4, 4 * n + 6]
        )
        f_c1, x_c1, f_c2, x_c2 = ca.vertsplit(u)

        gain = gain_of(weight, *link_numbers)
        start = [start_of(base_e[i], base_z[i], weight, *link_numbers) for i in range(n + 1)]
        force = [force_of(v[i] - v[i + 1], start[i], gain)[0] for i in range(n + 1)]
        masses = [
            mass_of(v[i], force[i - 1], force[i], base_v[i], base_s[i - 1], weight, *path_numbers)
            for i in range(1, n + 1)
        ]
        near, far = (
            (end.mass_kg, end.damping_N_s_per_m, end.stiffness_N_per_m) for end in (chain.near, chain.far)
        )
        residual = ca.vertcat(
            end_of(v[0], force[0], base_v[0], base_q[0], weight, -1, f_c1, x_c1, *near)[0],
            *[m[0] for m in masses],
            end_of(v[n + 1], force[n], base_v[n + 1], base_q[1], weight, 1, f_c2, x_c2, *far)[0],
        )
        links = [states_of(v[i] - v[i + 1], base_e[i], base_z[i], weight, *link_numbers) for i in range(n + 1)]
        end_state = ca.vertcat(
            v,
            *[e for e, _ in links],
            *[z for _, z in links],
            *[m[4] for m in masses],
            base_q[0] + weight * v[0],
            base_q[1] + weight * v[n + 1],
        )
        tolerance = RESIDUAL_TOLERANCE_N + RESIDUAL_ROUNDING * ca.norm_inf(ca.vertcat(*start))
        balance = ca.Function("balance", [v, base, u, weight], [residual])
        finish = ca.Function(
            "finish", [v, base, u, weight], [end_state, ca.vertcat(*force), residual, tolerance], {"cse": True}
        )
        newton = ca.rootfinder(
            "newton",
            "newton",
            balance,
            {
                "line_search": True,
                "linear_solver": "tridiag",
                "abstol": RESIDUAL_TOLERANCE_N,
                "abstolStep": 0.0,
                "max_iter": MAX_ITERATIONS,
                "error_on_fail": False,
            },
        )
        guess = ca.MX.sym("guess", n + 2)
        base_mx, u_mx, weight_mx = ca.MX.sym("base", 4 * n + 6), ca.MX.sym("u", 4), ca.MX.sym("H")
        solved = newton(guess, base_mx, u_mx, weight_mx)
        self._solve = ca.Function(
            "solve", [guess, base_mx, u_mx, weight_mx], list(finish(solved, base_mx, u_mx, weight_mx))
        )
        # One BDF2 step as a map of (x, x_old), accumulated over a chunk inside CasADi.
        pair = ca.MX.sym("pair", 2 * (4 * n + 6))
        x, x_old = pair[: 4 * n + 6], pair[4 * n + 6 :]
        x_next, f, r, tol = self._solve(
            2 * x[: n + 2] - x_old[: n + 2], x + BDF2_CARRY * (x - x_old), u_mx, BDF2_WEIGHT * step_s
        )
        step = ca.Function("step", [pair, u_mx], [ca.vertcat(x_next, x), f, ca.norm_inf(r) - tol])
        self._chunk = step.mapaccum("chunk", _CHUNK)

    def advance(self, memory: StepperMemory, inputs: Array, record: bool) -> Rows:
        """See `stepping.Stepper`."""
        n = self._count
        states, tensions = np.empty((len(inputs), 4 * n + 6)), np.empty((len(inputs), n + 1))
        splits, row, worst, residual = 0, 0, 0, 0.0
        while row < len(inputs):
            if not memory.fresh and len(inputs) - row >= _CHUNK:
                good = self._advance_chunk(memory, inputs[row : row + _CHUNK], states[row:], tensions[row:])
                row += good
                if good == _CHUNK:
                    continue
            solved, split, residual, worst = self._advance_one(memory, inputs[row], states[row], tensions[row])
            splits += split
            if not solved:
                break
            row += 1
        ends = states[:row, -2:].copy()
        return Rows(
            tension_N=tensions[:row],
            ends_m=ends,
            states=states[:row] if record else None,
            iterations=row,  # CasADi does not count inside a mapped root finder; at least one solve a row
            splits=splits,
            residual_N=residual,
            worst_mass=worst,
        )

    def _advance_chunk(self, memory: StepperMemory, inputs: Array, states: Array, tensions: Array) -> int:
        """Advance a whole chunk; return the number of leading steps that are solved."""
        size = len(memory.x)
        pairs, f, excess = (
            np.asarray(m) for m in self._chunk(np.concatenate([memory.x, memory.x_old]), inputs.T)
        )
        unsolved = np.flatnonzero(~(excess.ravel() <= 0))
        good = int(unsolved[0]) if unsolved.size else len(inputs)
        if good:
            states[:good] = pairs[:size, :good].T
            tensions[:good] = f[:, :good].T
            memory.x_old = pairs[size:, good - 1].copy()
            memory.x = pairs[:size, good - 1].copy()
            memory.inputs = inputs[good - 1].copy()
        return good

    def _advance_one(
        self, memory: StepperMemory, inputs: Array, state: Array, tension: Array
    ) -> tuple[bool, int, float, int]:
        """One step, split into implicit Euler pieces where it does not converge: (solved, split, residual, worst)."""
        n, x, x_old = self._count, memory.x, memory.x_old
        carry, weight = (0.0, 1.0) if memory.fresh else (BDF2_CARRY, BDF2_WEIGHT)
        guess = x[: n + 2] + (0.0 if memory.fresh else 1.0) * (x[: n + 2] - x_old[: n + 2])
        solved, x_next, f, residual, worst = self._solve_one(
            guess, x + carry * (x - x_old), inputs, weight * self._step_s
        )
        split = int(not solved)
        halvings = 0
        while not solved and halvings < MAX_SPLITS:
            halvings += 1
            pieces, x_next = 2**halvings, x
            for k in range(1, pieces + 1):
                u = memory.inputs + (inputs - memory.inputs) * (k / pieces)
                solved, x_next, f, residual, worst = self._solve_one(
                    x_next[: n + 2], x_next, u, self._step_s / pieces
                )
                if not solved:
                    break
        if solved:
            state[:], tension[:] = x_next, f
            memory.x, memory.x_old, memory.inputs, memory.fresh = x_next.copy(), x.copy(), inputs.copy(), False
        return solved, split, residual, worst

    def _solve_one(
        self, guess: Array, base: Array, inputs: Array, weight: float
    ) -> tuple[bool, Array, Array, float, int]:
        x, f, residual, tolerance = (np.asarray(m).ravel() for m in self._solve(guess, base, inputs, weight))
        worst = int(np.argmax(np.where(np.isnan(residual), np.inf, np.abs(residual))))
        size = float(np.abs(residual[worst]))
        return bool(size <= tolerance[0]), x, f, size, worst
