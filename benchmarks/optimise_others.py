"""The optimal-control problem of the benchmark, and what a user would otherwise write for it.

    OMP_NUM_THREADS=1 python benchmarks/optimise_others.py                 ours and all others on the 10 ms grid
    OMP_NUM_THREADS=1 python benchmarks/optimise_others.py ours do_mpc     some of them

Each gets the same equations, the same scaling and the simulated clipped inverse as initial guess; the force is
piecewise linear on the grid for everybody. What is not installed is left out, with a word. Times are seconds of CPU;
IPOPT ends after TENDONFF_CPU_S = 900 of them, and what it has then counts.
"""

import os
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.optimal.track import track
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate
from tendonff.ocp.tracking.limits import ForceLimits

Array = NDArray[np.float64]
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
RATE = 400.0
CPU_S = float(os.environ.get("TENDONFF_CPU_S", "900"))
OPTIONS = {"print_level": 0, "max_iter": 1000, "max_cpu_time": CPU_S, "mu_strategy": "adaptive", "sb": "yes"}


@dataclass(frozen=True)
class Problem:
    """Problem on a grid."""

    rig: Transmission
    level: Level
    reference: Array
    step: float
    limits: ForceLimits

    @property
    def chain(self) -> Chain:
        """The design model."""
        return Chain.of(self.rig, self.level)

    @property
    def clipped(self) -> Array:
        """The exact inverse within the limits."""
        return self.limits.apply(invert(self.chain, self.reference, self.step).force_N, self.step, self.reference[0])

    def percent(self, force: Array) -> float:
        """Error on N = 40 at 0.1 ms."""
        fine_step = 1e-4
        coarse = np.arange(len(force)) * self.step
        fine = np.arange(round(coarse[-1] / fine_step) + 1) * fine_step
        run = simulate(
            Chain.of(self.rig, self.level, 40),
            np.interp(fine, coarse, force),
            fine_step,
            initial_tension_N=float(self.reference[0]),
        )
        wanted = np.interp(fine, coarse, self.reference)
        return 100 * float(np.sqrt(np.mean((run.output_tension_N - wanted) ** 2))) / float(np.ptp(self.reference))


def finger(level: Level, step: float, rate: float = RATE) -> Problem:
    scenario = load_scenario(EXAMPLES / "finger_fast.toml")
    scenario = replace(scenario, run=replace(scenario.run, step_s=step))
    limits = replace(ForceLimits.of(scenario.transmission.actuator), rate_N_per_s=rate)
    return Problem(scenario.transmission, level, sample_reference(scenario).tension_N, step, limits)


def ours(problem: Problem, name: str = "tendonff") -> None:
    """Ours; the compiled stepper is made before."""
    track(problem.chain, problem.reference[:20], problem.step, problem.limits)
    began = time.process_time()
    found = track(problem.chain, problem.reference, problem.step, problem.limits)
    taken = time.process_time() - began
    line(name, problem, 0.0, taken, found.iterations, found.force_N, str(found.status))


def line(
    name: str, problem: Problem, build: float, solve: float, iterations: int, force: Array, note: str = ""
) -> None:
    ok = "within limits" if problem.limits.admits(force, problem.step, 1e-6) else "BREAKS LIMITS"
    print(
        f"{name:34s} {len(problem.reference) - 1:5d} steps  build {build:7.2f} s  solve {solve:7.2f} s  "
        f"{iterations:4d} iterations  {problem.percent(force):7.3f} %  {ok} {note}",
        flush=True,
    )


def scales(problem: Problem) -> tuple[Array, Array]:
    """Size of each state, and the states of the clipped inverse."""
    start = float(problem.reference[0])
    run = simulate(problem.chain, problem.clipped, problem.step, initial_tension_N=start, record=True).require()
    assert run.states is not None
    return np.abs(run.states).max(axis=0) + 1e-6, run.states


def opti(problem: Problem) -> None:
    """Direct collocation on Opti with IPOPT."""
    began = time.process_time()
    degree, h, n = 2, problem.step, len(problem.reference) - 1
    f, (size, states) = dynamics(problem), scales(problem)
    taus = ca.collocation_points(degree, "radau")
    c, _, _ = ca.collocation_coeff(taus)
    c = np.asarray(c)
    nx = len(size)
    x0, points = ca.MX.sym("x0", nx), [ca.MX.sym(f"x{j}", nx) for j in range(degree)]
    u0, u1 = ca.MX.sym("u0"), ca.MX.sym("u1")
    defects = []
    for j, tau in enumerate(taus):
        slope = (x0 * c[0, j] + sum(points[i] * c[i + 1, j] for i in range(degree))) * size
        defects.append((h * f(points[j] * size, u0 + tau * (u1 - u0))[0] - slope) / size)
    stage = ca.Function("stage", [x0, *points, u0, u1], [ca.vertcat(*defects), f(points[-1] * size, u1)[1]]).expand()
    problem_ = ca.Opti()
    nodes = problem_.variable(nx, n + 1)
    inner = problem_.variable(nx, n * (degree - 1))
    u = problem_.variable(1, n + 1)
    defect, output = stage.map(n)(nodes[:, :-1], inner, nodes[:, 1:], u[:-1], u[1:])
    problem_.minimize(ca.sumsqr(output - ca.DM(problem.reference[1:]).T) / n)
    problem_.subject_to(ca.vec(defect) == 0)
    problem_.subject_to(nodes[:, 0] == states[0] / size)
    problem_.subject_to(u[0] == problem.reference[0])
    problem_.subject_to(problem_.bounded(problem.limits.minimum_N, u, problem.limits.maximum_N))
    step = problem.limits.rate_N_per_s * h
    problem_.subject_to(problem_.bounded(-step, u[1:] - u[:-1], step))
    problem_.set_initial(nodes, (states / size).T)
    problem_.set_initial(inner, ((states[1:] * taus[0] + states[:-1] * (1 - taus[0])) / size).T)
    problem_.set_initial(u, problem.clipped)
    problem_.solver("ipopt", {"expand": True, "print_time": False}, OPTIONS)
    built = time.process_time()
    try:
        values, note = problem_.solve().value(u), ""
    except RuntimeError:
        values, note = problem_.debug.value(u), problem_.return_status()
    done = time.process_time()
    iterations = int(problem_.stats()["iter_count"])
    line("Opti, IPOPT, collocation", problem, built - began, done - built, iterations, np.asarray(values).ravel(), note)


def dynamics(problem: Problem) -> ca.Function:
    """Rate of the chain's state and its output tension [N], of state and force [N]."""
    equations = chain_equations(problem.chain)
    force = ca.SX.sym("force")
    rate = ca.substitute(equations.rate, equations.inputs, ca.vertcat(force, 0, 0, 0))
    return ca.Function("f", [equations.state, force], [rate, equations.tension_N[-1]])


def rockit(problem: Problem) -> None:
    """The same through rockit."""
    try:
        import rockit as rk
    except ImportError:
        print("rockit is not installed: left out")
        return
    began = time.process_time()
    n, h = len(problem.reference) - 1, problem.step
    f, (size, states) = dynamics(problem), scales(problem)
    ocp = rk.Ocp(t0=0, T=n * h)
    x, u, du = ca.vertcat(*(ocp.state() for _ in size)), ocp.state(), ocp.control()
    wanted = ocp.parameter(grid="control", include_last=True)
    slope = f(x * size, u)[0] / size
    for k, state in enumerate(ca.vertsplit(x)):
        ocp.set_der(state, slope[k])
    ocp.set_der(u, du * problem.limits.rate_N_per_s)
    ocp.add_objective(ocp.sum((f(x * size, u)[1] - wanted) ** 2, grid="control", include_last=True) / n)
    ocp.subject_to(ocp.at_t0(x) == states[0] / size)
    ocp.subject_to(ocp.at_t0(u) == problem.reference[0])
    ocp.subject_to((du <= 1) >= -1)
    ocp.subject_to(problem.limits.minimum_N <= (u <= problem.limits.maximum_N))
    ocp.set_value(wanted, problem.reference)
    # Its collocation takes no table as initial guess (0.6.7), but functions of time.
    grid = [np.arange(n + 1) * h]
    for k in range(len(size)):
        ocp.set_initial(x[k], ca.interpolant(f"x{k}", "linear", grid, states[:, k] / size[k])(ocp.t))
    ocp.set_initial(u, ca.interpolant("u", "linear", grid, problem.clipped)(ocp.t))
    ocp.solver("ipopt", {"expand": True, "print_time": False, "ipopt": OPTIONS})
    ocp.method(rk.DirectCollocation(N=n, M=1, degree=2))
    ocp._transcribe()
    built = time.process_time()
    try:
        solution, note = ocp.solve(), ""
    except RuntimeError:
        solution, note = ocp.non_converged_solution, "not converged"
    done = time.process_time()
    values = np.asarray(solution.sample(u, grid="control")[1]).ravel()
    iterations = int(solution.stats["iter_count"])
    line("rockit, IPOPT, collocation", problem, built - began, done - built, iterations, values, note)


def do_mpc(problem: Problem) -> None:
    """The same through do-mpc: one prediction over the whole horizon."""
    try:
        from do_mpc.controller import MPC
        from do_mpc.model import Model
    except ImportError:
        print("do-mpc is not installed: left out")
        return
    began = time.process_time()
    n, h = len(problem.reference) - 1, problem.step
    f, (size, states) = dynamics(problem), scales(problem)
    model = Model("continuous", "SX")
    x, u = model.set_variable("_x", "x", (len(size), 1)), model.set_variable("_x", "u")
    du = model.set_variable("_u", "du")
    model.set_variable("_tvp", "wanted")
    slope = f(x * size, u)[0]
    model.set_rhs("x", slope / size)
    model.set_rhs("u", du * problem.limits.rate_N_per_s)
    model.setup()
    mpc = MPC(model)
    mpc.set_param(
        n_horizon=n,
        t_step=h,
        state_discretization="collocation",
        collocation_type="radau",
        collocation_deg=2,
        collocation_ni=1,
        store_full_solution=False,
        nlpsol_opts={"ipopt": OPTIONS, "print_time": False, "expand": True},
    )
    output = f(model.x["x"] * size, model.x["u"])[1]  # of the symbols that setting up has made
    error = (output - model.tvp["wanted"]) ** 2 / n
    mpc.set_objective(mterm=error, lterm=error)
    mpc.set_rterm(du=0.0)
    mpc.bounds["lower", "_u", "du"], mpc.bounds["upper", "_u", "du"] = -1, 1
    mpc.bounds["lower", "_x", "u"], mpc.bounds["upper", "_x", "u"] = problem.limits.minimum_N, problem.limits.maximum_N
    times = mpc.get_tvp_template()
    for k in range(n + 1):
        times["_tvp", k, "wanted"] = problem.reference[k]
    mpc.set_tvp_fun(lambda _: times)
    mpc.setup()
    guess = np.column_stack([states / size, problem.clipped])
    start = guess[0].copy()
    start[-1] = problem.reference[0]
    mpc.x0 = start
    mpc.set_initial_guess()
    for k in range(n + 1):
        mpc.opt_x_num["_x", k, 0] = [guess[k] / mpc._x_scaling.cat.full().ravel()] * len(mpc.opt_x_num["_x", k, 0])
    built = time.process_time()
    mpc.make_step(start)
    done = time.process_time()
    values = np.array([float(mpc.opt_x_num["_x", k, 0, -1][-1]) for k in range(n + 1)])
    stats = mpc.solver_stats
    note = "" if stats["success"] else str(stats["return_status"])
    line("do-mpc, IPOPT, collocation", problem, built - began, done - built, int(stats["iter_count"]), values, note)


ALL = {"ours": ours, "opti": opti, "rockit": rockit, "do_mpc": do_mpc}


def main() -> None:
    for name in sys.argv[1:] or ALL:
        ALL[name](finger(Level.PRESLIDING, 10e-3))


if __name__ == "__main__":
    main()
