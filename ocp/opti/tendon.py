"""The optimal force of a tendon as `casadi.Opti`: the problem of `tracking.problem`, for users to extend.

Variables are the force at the ends of the intervals, linear between them, and the states of every plant. What
`tracking` penalises is a constraint here, and its dynamics, simulated there, are constraints as well.
"""

import time
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from tendonff.models.layout import INPUT_NAMES, Array
from tendonff.models.mechanism.chain import ChainEquations, chain_equations
from tendonff.ocp.errors import SolveError
from tendonff.ocp.opti.choices import Collocation
from tendonff.ocp.opti.collocation import History, Trajectory, collocate
from tendonff.ocp.tracking.problem import MotionBound, PlantModel, TrackingProblem


@dataclass(frozen=True, slots=True, kw_only=True)
class OptiSolution:
    """Numbers of a solved problem.

    Attributes
    ----------
    message : str
        The solver's word.
    iterations : int
        Of the solver.
    solve_s : float
        Time it took [s].
    values : ca.OptiSol
        CasADi's own record.
    """

    message: str
    iterations: int
    solve_s: float
    values: ca.OptiSol

    def value(self, expression: ca.MX) -> Array:
        """An expression of the problem's variables, a row an instant."""
        found = np.asarray(ca.DM(self.values.value(expression)))
        return found.ravel() if 1 in found.shape else found.T


@dataclass(frozen=True, slots=True, kw_only=True)
class Formulation:
    """A problem of optimal control over a horizon; extend it through `opti`, then `solve`.

    Attributes
    ----------
    opti : ca.Opti
        With objective, constraints, first guess and solver; `subject_to`, `minimize` and `solver` add and replace.
    time_s : ndarray, shape (n,)
        Ends of the intervals.
    tension_N : ca.MX, shape (links, n)
        Of every link from the drive on, tendon by tendon.
    states : ca.MX, shape (states, n)
        Of a tendon in the order of `StateLayout`, of the nominal plant; of joints in that of `equations.state_names`.
    cost : ca.MX
        What is minimised [N^2 or rad^2].
    plants : tuple of Trajectory
        States with what drives them, of every plant that counts; the nominal one first.
    """

    opti: ca.Opti
    time_s: Array
    tension_N: ca.MX
    states: ca.MX
    cost: ca.MX
    plants: tuple[Trajectory, ...]

    def along(self, expression: ca.SX) -> ca.MX:
        """An expression of the nominal plant's equations at all instants, shape (rows, n)."""
        return self.plants[0].along(expression)

    def solve(self) -> OptiSolution:
        """Solve it; SolveError with the solver's word where that fails."""
        return solve_opti(self.opti)


@dataclass(frozen=True, slots=True, kw_only=True)
class TensionFormulation(Formulation):
    """Force of the actuator whose tension is wanted: errors of all plants, effort and travel of the force.

    Attributes
    ----------
    wanted_N : ndarray, shape (n,)
        Reference of the output.
    force_N, output_N : ca.MX, shape (n, 1)
        Of the actuator, and tension at the far end.
    contact_N : ca.MX, shape (n, 1)
        Force that the load gives to what it touches: none or, with `payload`, a variable.
    load_m, load_m_per_s : ca.MX, shape (n, 1)
        Place and speed of the load, positive towards the actuator.
    """

    wanted_N: Array
    force_N: ca.MX
    output_N: ca.MX
    contact_N: ca.MX
    load_m: ca.MX
    load_m_per_s: ca.MX


def solve_opti(opti: ca.Opti) -> OptiSolution:
    """Solve a problem; SolveError with the solver's word and the way out where that fails."""
    began = time.perf_counter()
    try:
        found = opti.solve()
    except RuntimeError:
        statistics = opti.debug.stats()
        raise SolveError(
            f"the optimal-control problem was not solved: {statistics['return_status']} after "
            f"{statistics['iter_count']} iterations; widen its constraints, give a better guess by "
            "opti.set_initial, or take a larger smoothing"
        ) from None
    statistics = found.stats()
    return OptiSolution(
        message=str(statistics["return_status"]),
        iterations=int(statistics["iter_count"]),
        solve_s=time.perf_counter() - began,
        values=found,
    )


def formulate(
    problem: TrackingProblem, guess_N: Array, collocation: Collocation, *, payload: bool = False
) -> TensionFormulation:
    """Pose a tracking problem.

    Parameters
    ----------
    problem : TrackingProblem
    guess_N : ndarray, shape (n,)
        A force within the limits to start from [N]; see `tracking.search.first_guess`.
    collocation : Collocation
    payload : bool, optional
        The force of the load on what it touches is a variable, but for its first row, and the user's equations decide
        it; of all plants alike.
    """
    rows = problem.step_s * np.arange(len(problem.reference_N))
    intervals = max(round(float(rows[-1]) / collocation.interval_s), 1)
    time_s, step = np.linspace(0.0, rows[-1], intervals + 1), float(rows[-1]) / intervals
    coarser, limits = step / problem.step_s, problem.limits
    guess = np.interp(time_s, rows, guess_N)

    # variables: the force; states follow
    opti = ca.Opti()
    force = opti.variable(intervals + 1)
    opti.set_initial(force, guess)
    contact = opti.variable(intervals + 1) if payload else ca.MX.zeros(intervals + 1, 1)

    # dynamics: the equations of every plant under that force
    pages = [chain_equations(plant.chain) for plant in problem.plants]
    every = [
        _driven(opti, page, plant, force, contact, guess, step, collocation)
        for page, plant in zip(pages, problem.plants, strict=True)
    ]
    tensions = [plant.along(page.tension_N) for page, plant in zip(pages, every, strict=True)]

    # objective: squared errors over the plants, effort, travel of the force
    wanted = [np.interp(time_s, rows, plant.wanted_N) for plant in problem.plants]
    squares = [
        of.weight * ca.sumsqr(tension[-1, :].T - ca.DM(each)) / (intervals + 1)
        for of, tension, each in zip(problem.plants, tensions, wanted, strict=True)
    ]
    least = problem.least_travel_N * coarser
    travel = ca.sum1(ca.sqrt(ca.diff(force) ** 2 + least**2) - least)
    effort = ca.sumsqr(force) / (intervals + 1)
    cost = _mean(squares, problem.power) + problem.effort_weight * effort + problem.travel_weight * travel

    # path: limits of the actuator, tension along the tendon
    most = limits.rate_N_per_s * step
    opti.subject_to(opti.bounded(-most, ca.diff(force), most))
    opti.subject_to(opti.bounded(limits.minimum_N, force[1:], limits.maximum_N))
    for tension in tensions[: problem.chains]:
        opti.subject_to(ca.vec(tension[:, 1:]) >= problem.low_N)
        if np.isfinite(problem.high_N):
            opti.subject_to(ca.vec(tension[:, 1:]) <= problem.high_N)
    for plant, of in zip(every, problem.plants, strict=True):
        for bound in of.bounds:
            _bind(opti, bound, of, plant.states, force)

    # boundary: the force of row 0 is given, and every plant is where it is
    opti.subject_to(force[0] == problem.start_N)
    if payload:
        opti.subject_to(contact[0] == 0.0)

    found = TensionFormulation(
        opti=opti,
        time_s=time_s,
        wanted_N=wanted[0],
        force_N=force,
        output_N=tensions[0][-1, :].T,
        contact_N=contact,
        load_m=every[0].states[-1, :].T,
        load_m_per_s=every[0].states[problem.plants[0].chain.count + 1, :].T,
        tension_N=tensions[0],
        states=every[0].states,
        cost=cost,
        plants=tuple(every),
    )
    opti.minimize(cost / float(opti.value(cost, opti.initial())))
    opti.solver("ipopt", *ipopt_options())
    return found


def ipopt_options(iterations: int = 200, verbose: bool = False) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of CasADi and of IPOPT: the guess is good, so it is kept."""
    plugin = {"expand": True, "print_time": False}
    solver: dict[str, Any] = {
        "max_iter": iterations,
        "print_level": 5 if verbose else 0,
        "sb": "yes",
        "mumps_pivot_order": 5,  # METIS: half the time of the default on long horizons
        "mu_init": 1e-5,
        "bound_push": 1e-6,
        "bound_frac": 1e-6,
        "tol": 1e-6,
        "acceptable_tol": 1e-3,
        "acceptable_obj_change_tol": 1e-4,
        "acceptable_iter": 5,
    }
    return plugin, solver


def _driven(
    opti: ca.Opti,
    page: ChainEquations,
    plant: PlantModel,
    force: ca.MX,
    contact: ca.MX,
    guess: Array,
    step_s: float,
    collocation: Collocation,
) -> Trajectory:
    """A chain under the force, its path where the joints move it."""
    n, names = len(guess), list(INPUT_NAMES)
    given = {name: ca.MX.zeros(1, n) for name in names} | {"near_force_N": force.T, "far_force_N": contact.T}
    places = plant.chain.path_at(plant.state.time_s + step_s * np.arange(float(n))).table()
    return collocate(
        opti,
        page,
        step_s,
        plant.state.vector(),
        History(inputs=ca.vertcat(*(given[name] for name in names)), places=ca.DM(places.T)),
        (np.column_stack([guess, np.zeros((n, len(names) - 1))]), places),
        degree=collocation.degree,
        smoothing=collocation.smoothing,
    )


def _mean(squares: list[ca.MX], power: float) -> ca.MX:
    """Mean of order `power` over the plants."""
    return (sum((each**power for each in squares), ca.MX(0)) / len(squares)) ** (1 / power)


def _bind(opti: ca.Opti, bound: MotionBound, plant: PlantModel, states: ca.MX, force: ca.MX) -> None:
    """Limits of the actuator's motion."""
    speed, travel = states[0, 1:].T, states[-2, 1:].T - plant.origin_m
    total = (
        bound.per_force * force[1:] + bound.per_travel_per_m * travel + bound.per_speed_s_per_m * speed
    ) * bound.newtons
    if np.isfinite(bound.low):
        opti.subject_to(total >= bound.low * bound.newtons)
    if np.isfinite(bound.high):
        opti.subject_to(total <= bound.high * bound.newtons)
