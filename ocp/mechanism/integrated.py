"""Any mechanism advanced by CasADi's integrators on its page of equations; no compiler needed."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.models.mechanism.equations import MechanismEquations, equations_of
from tendonff.models.mechanism.loads import Spring
from tendonff.models.mechanism.mechanism import CutMechanism
from tendonff.models.mechanism.parts import Force, Lead
from tendonff.ocp.integrate.integrator import Integrator, evaluated
from tendonff.ocp.integrate.method import Accuracy, Method
from tendonff.ocp.mechanism.compiled import RunRows
from tendonff.ocp.mechanism.problem import Array, MechanismMemory, MechanismProblem


def cut_problem(problem: MechanismProblem, led: NDArray[np.bool_]) -> CutMechanism:
    """The mechanism of a problem at its level: a place for each body that is led, an effort on each that is free."""
    drives = (Lead(body=name) if leads else Force(body=name) for name, leads in zip(problem.names, led, strict=True))
    cut = problem.mechanism.cut(problem.level, problem.segments)
    springs = dict(zip(problem.names[problem.known :], problem.stiffness.tolist(), strict=True))
    bodies = tuple(  # a servo is a spring to where its motor is, which comes as an effort
        replace(body, loads=(*body.loads, Spring(stiffness=springs[body.name])))
        if math.isfinite(springs.get(body.name, math.inf))
        else body
        for body in cut.bodies
    )
    return replace(cut, bodies=bodies, drives=tuple(drives))


def page_state(cut: CutMechanism, memory: MechanismMemory, led: NDArray[np.bool_]) -> Array:
    """State of `equations_of(cut_problem(problem, led))`, of a memory."""
    free = [row for row, leads in zip(memory.z, led, strict=True) if not leads]
    bodies = [
        np.array([place, speed, dry])[: 2 + len(body.states)]
        for (speed, place, dry), body in zip(free, cut.free, strict=True)
    ]
    tendons = [np.r_[x[1 : t.count + 1], x[t.count + 2 : -2]] for x, t in zip(memory.x, cut.tendons, strict=True)]
    return np.concatenate([*bodies, *tendons])


class IntegratedMechanism:
    """Advance one mechanism by an integrator; the call of `CompiledMechanism.run`."""

    def __init__(self, problem: MechanismProblem, step_s: float, method: Method, accuracy: Accuracy) -> None:
        self._problem, self._step_s = problem, step_s
        self._method, self._accuracy = method, accuracy

    def run(self, memory: MechanismMemory, position: Array, effort: Array, led: Array | None = None) -> RunRows:
        """Advance over positions of bodies that are led and torques on what bodies touch, shape (rows + 1, bodies)."""
        problem = self._problem
        leads = np.array(problem.leads if led is None else led, dtype=bool)
        cut = cut_problem(problem, leads)
        page = equations_of(cut)
        places = position[:, leads]
        start = page_state(cut, memory, leads)
        integrator = Integrator(page, self._step_s, self._method, self._accuracy)
        states = integrator.advance(start, -effort[:, ~leads], places)
        done = len(states)
        rates = np.diff(places, axis=0)[:done] / self._step_s
        at = [page.state, page.place, page.place_rate]
        outputs = ca.Function("outputs", at, [page.tension_N, page.effort, page.position])
        tensions, torques, where = evaluated(outputs, states, places[1 : done + 1], rates)
        ends = np.cumsum([0, *(tendon.count + 1 for tendon in cut.tendons)])
        if done:
            self._remember(memory, cut, page, states[-1], where[-1], rates[-1], leads)
            memory.tension_N = tensions[-1, ends[1:] - 1].copy()
        return RunRows(
            position=where,
            torque=torques,
            tension_N=tensions[:, ends[1:] - 1],
            drum_N=tensions[:, ends[:-1]],
            lowest_N=tensions.min(axis=1) if done else np.empty(0),
            iterations=done,
            splits=0,
            residual_N=np.nan,
        )

    def _remember(
        self,
        memory: MechanismMemory,
        cut: CutMechanism,
        page: MechanismEquations,
        state: Array,
        where: Array,
        rates: Array,
        leads: NDArray[np.bool_],
    ) -> None:
        """Leave the last state; the compiled step goes on from there as from rest, by implicit Euler."""
        values = dict(zip(page.state_names, state.tolist(), strict=True))
        speeds = np.zeros(len(leads))
        speeds[leads] = rates
        dry = np.zeros(len(leads))
        for k, body in enumerate(cut.bodies):
            if not leads[k]:
                speeds[k] = values[f"{body.name}_{body.unit}_per_s"]
                dry[k] = sum(values[f"{body.name}_{name}_{body.unit.effort}"] for name in body.states)
        memory.z = np.column_stack([speeds, where, dry])
        q, w = (ca.SX.sym(letter, len(leads)) for letter in "qw")
        by_name = dict(zip((body.name for body in cut.bodies), ca.vertsplit(q), strict=True))
        far = [tendon.far.travel_m(by_name) for tendon in cut.tendons]
        moves = ca.Function("far", [q, w], [ca.vertcat(*far), ca.vertcat(*(ca.jtimes(x, q, w) for x in far))])
        places_m, speeds_m = (np.asarray(each).ravel() for each in moves(where, speeds))
        motors = where[self._problem.known :][list(self._problem.motor_of)]
        near_m = memory.start_m + self._problem.winding_m * motors
        first = len(state) - sum(len(x) - 4 for x in memory.x)
        for k, (tendon, x) in enumerate(zip(cut.tendons, memory.x, strict=True)):
            own, first = state[first : first + len(x) - 4], first + len(x) - 4
            n = tendon.count
            memory.x[k] = np.r_[own[0], own[:n], speeds_m[k], own[n:], near_m[k], places_m[k]]
        memory.x_old, memory.z_old, memory.fresh = [x.copy() for x in memory.x], memory.z.copy(), True
