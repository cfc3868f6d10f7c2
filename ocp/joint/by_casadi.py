"""Engine CASADI of a joint between tendons: no compiler needed, the same numbers, several times slower.

Forward it solves the equations of the page under the scheme of `ocp.step.scheme`, step by step, with Newton's method;
the inverse is that of `recursion`.
"""

import io
from contextlib import redirect_stderr, redirect_stdout

import casadi as ca
import numpy as np

from tendonff.models.cached import cached_property
from tendonff.models.mechanism.equations import equations_of
from tendonff.ocp.codegen.smoothing import smoothed, switches
from tendonff.ocp.joint.integrated import chain_states, cut_joint, led_places, page_state
from tendonff.ocp.joint.protocol import Array, JointInverseRows, JointMemory, JointProblem, JointRows
from tendonff.ocp.joint.recursion import JointRecursion
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT

_TOLERANCE = 1e-9
"""Largest scaled residual that Newton's method aims at: of states over their sizes, of balances [N]."""

_SOLVED = 1e-6
"""Largest that counts as solved."""

_WIDTHS = np.geomspace(1e-2, 1e-8, 25)
"""Of rounded switches [m/s], [N], where Newton's method fails on the sharp ones."""

_SPEED, _TURN = 1e-2, 1.0
"""Sizes by which unknowns are scaled [m/s], [rad/s]."""


class _Root:
    """Zero of a function of scaled unknowns, shape (unknowns,), and of given numbers."""

    def __init__(self, unknown: ca.SX, given: ca.SX, residual: ca.SX, sizes: Array) -> None:
        scaled = ca.SX.sym("scaled", unknown.numel())
        (found,) = ca.substitute([residual], [unknown], [scaled * sizes])
        self._exact, self._sizes = ca.Function("residual", [scaled, given], [found]), sizes
        self._newton = _newton(self._exact)
        self._worst = ca.Function("worst", [scaled, given], [ca.norm_inf(found)])

    def solve(self, guess: Array, given: Array) -> Array | None:
        """The unknowns; None where Newton's method finds none."""
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            found = np.asarray(self._newton(guess / self._sizes, given)).ravel()
            if not self._is_solved(found, given):
                found = guess / self._sizes
                for newton in (*self._rounded, self._newton):
                    found = np.asarray(newton(found, given)).ravel()
        return found * self._sizes if self._is_solved(found, given) else None

    @cached_property
    def _rounded(self) -> list[ca.Function]:
        """With friction's switch rounded off, less and less: from each solution the next is found."""
        count = switches(self._exact).size1_out(0)
        return [_newton(smoothed(self._exact, np.full(count, width))) for width in _WIDTHS]

    def _is_solved(self, found: Array, given: Array) -> bool:
        return bool(np.isfinite(found).all()) and float(self._worst(found, given)) <= _SOLVED


class CasadiJoint:
    """Invert and advance one mechanism; see `protocol.JointEngine`.

    Every state but the speeds follows from those in closed form: elongations from rates, states of links and friction
    from equations that are affine in them. Newton's method looks for the masses' speeds alone, beside the joint's: on
    friction's own equation it would go to and fro.
    """

    def __init__(self, problem: JointProblem, step_s: float) -> None:
        self._problem, self._step_s = problem, step_s
        self._cut = cut_joint(problem)
        self._motors = 1 if problem.loop else len(problem.chains)
        self._page = page = equations_of(self._cut)
        weight, base = ca.SX.sym("weight"), ca.SX.sym("base", page.state.numel())
        base_place = ca.SX.sym("base_place", page.place.numel())
        x, place, rates = page.state, page.place, (page.place - base_place) / weight
        rate, tension, effort = ca.substitute([page.rate, page.tension_N, page.effort[0]], [page.place_rate], [rates])
        self._given = ca.vertcat(x[:2], place, weight, base, base_place, page.inputs)
        self._speeds, *followed = self._groups()
        self._count = len(self._speeds)
        inertia = problem.mechanism.joint.inertia_kg_m2
        balance = inertia * ((x[1] - base[1]) / weight - rate[1]) / problem.scale_m
        links = np.cumsum([chain.count + 1 for chain in problem.chains])
        far, near = tension[(links - 1).tolist()], tension[[0, *links[:-1].tolist()]]
        self._outputs = ca.Function("outputs", [x, place, weight, base_place], [far, near, ca.mmin(tension), effort])
        defect = x - base - weight * rate
        off = defect[self._speeds] / _SPEED
        states, _, off, balance = _without(x, followed, [x, defect, off, balance])
        self._defect, self._balance, self._whole = off, balance, states

    def _groups(self) -> list[list[int]]:
        """Rows of the states: speeds of the masses, then those that follow from what stands before."""
        first = self._page.state.numel() - sum(chain.layout.size - 4 for chain in self._problem.chains)
        groups: list[list[int]] = [[], list(range(2, first))]
        for chain in self._problem.chains:
            sizes = [chain.count, chain.count + 1]
            sizes += [chain.count + 1] * len(chain.link.states) + [chain.count] * len(chain.friction.states)
            groups += [[] for _ in range(len(sizes) + 1 - len(groups))]
            for k, size in enumerate(sizes):
                groups[k if k == 0 else k + 1] += range(first, first + size)
                first += size
        return [groups[0], *(group for group in groups[1:] if group)]

    @cached_property
    def _inverse(self) -> JointRecursion:
        return JointRecursion(self._problem, self._step_s)

    @cached_property
    def _free(self) -> _Root:
        """Speeds of the joint and the masses of a step, of the motors."""
        x, places = self._page.state, self._page.place.numel()
        weight, base = self._given[2 + places], self._given[3 + places]
        turned = ca.substitute(ca.vertcat(self._balance, self._defect, self._whole), x[0], base + weight * x[1])
        unknown = ca.vertcat(x[1], x[self._speeds])
        return self._root(unknown, turned[: self._count + 1], np.append(_TURN, np.full(self._count, _SPEED)))

    @cached_property
    def _led(self) -> _Root:
        """Speeds of the masses of a step, of the motors and of the joint's motion."""
        return self._root(self._page.state[self._speeds], self._defect, np.full(self._count, _SPEED))

    @cached_property
    def _state_of(self) -> ca.Function:
        """All states of a step, of the speeds of the masses and of what is given with its unknowns put in."""
        given = ca.SX.sym("given", self._given.numel())
        (states,) = ca.substitute([self._whole], [self._given], [given])
        return ca.Function("states", [self._page.state[self._speeds], given], [states])

    def _root(self, unknown: ca.SX, residual: ca.SX, sizes: Array) -> _Root:
        """The zero of a residual; what is unknown has no effect where it is among the given numbers."""
        given = ca.SX.sym("given", self._given.numel())
        known = [k for k in range(given.numel()) if not ca.depends_on(unknown, self._given[k])]
        (of_given,) = ca.substitute([residual], [self._given[known]], [given[known]])
        return _Root(unknown, given, of_given, sizes)

    def invert(
        self, memory: JointMemory, angle_rad: Array, contact_N_m: Array, least_tension_N: float
    ) -> JointInverseRows:
        """See `protocol.JointEngine`."""
        return self._inverse.invert(memory, angle_rad, contact_N_m, least_tension_N)

    def run(self, memory: JointMemory, travel_m: Array, contact_N_m: Array, angle_rad: Array | None) -> JointRows:
        """See `protocol.JointRunner`."""
        per_rad = np.array(self._problem.windings_m) / self._problem.mechanism.drive.gear_ratio
        motor = (np.asarray(travel_m, dtype=np.float64) / per_rad)[:, : self._motors]
        x, out, torque, done = self._advance(memory, motor, contact_N_m, angle_rad)
        count = len(per_rad)
        return JointRows(
            angle_rad=np.array([each[0] for each in x]),
            torque_N_m=torque,
            lowest_N=out[:, -1],
            tension_N=out[:, :count],
            drum_N=out[:, count:-1],
            iterations=done,
            splits=0,
            residual_N=_SOLVED,
            reason=None if done == len(motor) - 1 else "Newton's method did not converge; try the method idas",
        )

    def _advance(
        self, memory: JointMemory, motor: Array, contact_N_m: Array, angle_rad: Array | None
    ) -> tuple[list[Array], Array, Array, int]:
        """States, tensions (far, near, lowest), torques, and the number of steps."""
        problem, h, rows, first = self._problem, self._step_s, len(motor) - 1, slice(0, self._motors)
        root = self._free if angle_rad is None else self._led
        per_rad = np.array(problem.windings_m) / problem.mechanism.drive.gear_ratio
        x, x_old = (page_state(problem, each) for each in (memory, _before(memory)))
        now, old = (np.array([c[-2] for c in each] - memory.start_m) / per_rad for each in (memory.x, memory.x_old))
        places = led_places(problem, self._cut, memory.time_s - h, h, np.zeros((rows + 2, len(per_rad))))
        places[0, first], places[1, first], places[2:, first] = old[first], now[first], motor[1:]
        found: list[Array] = []
        out, torque = np.empty((rows, 2 * len(per_rad) + 1)), np.empty(rows)
        for k in range(rows):
            carry, weight = (0.0, h) if memory.fresh and k == 0 else (BDF2_CARRY, BDF2_WEIGHT * h)
            base, place = x + carry * (x - x_old), places[k + 2]
            base_place = places[k + 1] + carry * (places[k + 1] - places[k])
            x_old, x = x, x.copy()
            if angle_rad is not None:
                x[0] = angle_rad[k + 1]
                x[1] = (x[0] - base[0]) / weight
            contact = -contact_N_m[k + 1] if angle_rad is None else 0.0
            given = np.concatenate([x[:2], place, [weight], base, base_place, [contact]])
            speeds = x[self._speeds]
            unknown = root.solve(np.append(x[1], speeds) if root is self._free else speeds, given)
            if unknown is None:
                break
            if root is self._free:
                x[1], speeds = unknown[0], unknown[1:]
                x[0] = base[0] + weight * x[1]
            else:
                speeds = unknown
            given[:2] = x[:2]
            x = np.asarray(self._state_of(speeds, given)).ravel()
            *tensions, turning = self._outputs(x, place, weight, base_place)
            out[k], torque[k] = np.concatenate([np.asarray(each).ravel() for each in tensions]), float(turning)
            found.append(x)
        done = len(found)
        if done:
            own = x.size - sum(chain.layout.size - 4 for chain in problem.chains)
            last = (found[-1], places[done + 1]), (found[-2] if done > 1 else x_old, places[done])
            memory.x, memory.x_old = (
                chain_states(problem, each[own:], each[0], each[1], memory.start_m + place[first] * per_rad)
                for each, place in last
            )
            memory.z, memory.z_old = (np.array([each[1], each[0], *each[2:own], 0.0])[:3] for each, _ in last)
            memory.time_s, memory.fresh = memory.time_s + done * h, False
            memory.tension_N = out[done - 1, : len(per_rad)].copy()
        return found, out[:done], torque[:done], done


def _without(x: ca.SX, groups: list[list[int]], expressions: list[ca.SX]) -> list[ca.SX]:
    """Expressions with states put in, a group after the other; the second is the defect, affine in each group's own."""
    for group in groups:
        own, defect = x[group], expressions[1][group]
        slope = ca.vertcat(*(ca.jacobian(defect[k], own[k]) for k in range(len(group))))
        found = -ca.substitute(defect, own, ca.SX.zeros(len(group))) / slope
        expressions = ca.substitute(expressions, [own], [found])
    return expressions


def _newton(residual: ca.Function) -> ca.Function:
    options = {"abstol": _TOLERANCE, "max_iter": 100, "line_search": True, "error_on_fail": False}
    return ca.rootfinder("step", "newton", residual, options)


def _before(memory: JointMemory) -> JointMemory:
    """The memory with its earlier state as the present one."""
    earlier = memory.copy()
    earlier.x, earlier.z = earlier.x_old, earlier.z_old
    return earlier
