"""Optimal control side by side: ours against what a user would otherwise write, on the same problem and grid.

    python benchmarks/optimise.py            everything: about half an hour, nearly all of it the others'
    python benchmarks/optimise.py --quick    ours alone: the fast finger, four scenarios, distances, windows

The problem: the finger example (N = 6) with a force rate limit that binds, 4 s, from rest. Minimise the mean square of
the tension error subject to range and rate of the force. The others are given the same equations, the same scaling and
the simulated clipped inverse as initial guess; the force is piecewise linear on the grid for everybody.

* Opti + IPOPT: direct collocation (Radau, degree 2), CasADi's plain Opti stack, expanded.
* rockit: the same through `rockit-meco` (pip install "tendonff[benchmark]"), left out where it is not installed.

Errors are those of the profile replayed on N = 40 at a tenth of a millisecond, in per cent of the reference's range.
Times are of the clock; ours includes nothing cached but the compiled stepper.
"""

import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import load_scenario
from tendonff.models.chain import Chain, chain_equations
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.inverse import invert
from tendonff.ocp.simulate import simulate
from tendonff.ocp.tracking.cost import evaluate
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.grids import coarse_spacing, even_knots, limited_rows, local_knots, nearest_profile
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackingProblem, TrackOptions
from tendonff.ocp.tracking.sqp import SqpSettings, solve_sqp
from tendonff.ocp.tracking.track import track

Array = NDArray[np.float64]
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
RATE = 400.0
WALL_S = 900.0


@dataclass(frozen=True)
class Problem:
    """One problem on one grid."""

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


def line(
    name: str, problem: Problem, build: float, solve: float, iterations: int, force: Array, note: str = ""
) -> None:
    ok = "within limits" if problem.limits.admits(force, problem.step, 1e-6) else "BREAKS LIMITS"
    print(
        f"{name:34s} {len(problem.reference) - 1:5d} steps  build {build:7.2f} s  solve {solve:7.2f} s  "
        f"{iterations:4d} iterations  {problem.percent(force):7.3f} %  {ok} {note}",
        flush=True,
    )


def ours(problem: Problem, name: str = "tendonff") -> None:
    found = track(problem.chain, problem.reference, problem.step, problem.limits)
    line(name, problem, found.build_s, found.solve_s, found.iterations, found.force_N, str(found.status))


def scales(problem: Problem) -> tuple[Array, Array]:
    """Size of each state, and the states of the clipped inverse."""
    start = float(problem.reference[0])
    run = simulate(problem.chain, problem.clipped, problem.step, initial_tension_N=start, record=True).require()
    assert run.states is not None
    return np.abs(run.states).max(axis=0) + 1e-6, run.states


def opti(problem: Problem) -> None:
    """Direct collocation on Opti with IPOPT."""
    began = time.perf_counter()
    degree, h, n = 2, problem.step, len(problem.reference) - 1
    equations = chain_equations(problem.chain)
    force = ca.SX.sym("force")
    rate = ca.substitute(equations.rate, equations.inputs, ca.vertcat(force, 0, 0, 0))
    f = ca.Function("f", [equations.state, force], [rate, equations.tension_N[-1]])
    size, states = scales(problem)
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
    options = {"print_level": 0, "max_iter": 1000, "max_wall_time": WALL_S, "mu_strategy": "adaptive", "sb": "yes"}
    problem_.solver("ipopt", {"expand": True, "print_time": False}, options)
    built = time.perf_counter()
    try:
        values, note = problem_.solve().value(u), ""
    except RuntimeError:
        values, note = problem_.debug.value(u), problem_.return_status()
    done = time.perf_counter()
    iterations = int(problem_.stats()["iter_count"])
    line("Opti, IPOPT, collocation", problem, built - began, done - built, iterations, np.asarray(values).ravel(), note)


def rockit(problem: Problem) -> None:
    """The same through rockit."""
    try:
        import rockit as rk
    except ImportError:
        print("rockit is not installed: left out")
        return
    began = time.perf_counter()
    n, h = len(problem.reference) - 1, problem.step
    equations = chain_equations(problem.chain)
    force = ca.SX.sym("force")
    rate = ca.substitute(equations.rate, equations.inputs, ca.vertcat(force, 0, 0, 0))
    f = ca.Function("f", [equations.state, force], [rate, equations.tension_N[-1]])
    size, states = scales(problem)
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
    options = {"print_level": 0, "max_iter": 1000, "max_wall_time": WALL_S, "mu_strategy": "adaptive", "sb": "yes"}
    ocp.solver("ipopt", {"expand": True, "print_time": False, "ipopt": options})
    ocp.method(rk.DirectCollocation(N=n, M=1, degree=2))
    ocp._transcribe()
    built = time.perf_counter()
    try:
        solution, note = ocp.solve(), ""
    except RuntimeError:
        solution, note = ocp.non_converged_solution, "not converged"
    done = time.perf_counter()
    values = np.asarray(solution.sample(u, grid="control")[1]).ravel()
    iterations = int(solution.stats["iter_count"])
    line("rockit, IPOPT, collocation", problem, built - began, done - built, iterations, values, note)


def four_scenarios() -> None:
    """Optimal against the better of clipped inverse and clipped static law, on N = 40 at 0.1 ms."""
    print("\nscenario, rate limit: optimal / better of clipped inverse and static law, on N = 40 at 0.1 ms")
    for name, level, rate in (
        ("finger_fast.toml", Level.PRESLIDING, 150.0),
        ("finger_fast.toml", Level.VISCOELASTIC, 400.0),
        ("bowden.toml", Level.VISCOELASTIC, 500.0),
        ("surgical.toml", Level.PRESLIDING, 120.0),
    ):
        scenario = load_scenario(EXAMPLES / name)
        limits = replace(ForceLimits.of(scenario.transmission.actuator), rate_N_per_s=rate)
        sampled = sample_reference(scenario)
        problem = Problem(scenario.transmission, level, sampled.tension_N, sampled.step_s, limits)
        found = track(problem.chain, problem.reference, problem.step, limits)
        static = limits.apply(law_of(problem.chain).input_history_N(problem.reference), problem.step)
        best = min(problem.percent(problem.clipped), problem.percent(static))
        left = problem.percent(found.force_N)
        print(
            f"{name:20s} {level:13s} {rate:6g} N/s  {left:7.3f} % / {best:7.3f} % = {left / best:.2f}   {found.status}"
        )


def best_found(problem: Problem, start: Array) -> float:
    """Error on the design model of a long search: finer knots, many iterations, from several starts [N rms]."""
    chain, reference = problem.chain, problem.reference
    inverse = invert(chain, reference, problem.step).force_N
    options = TrackOptions()
    task = TrackingProblem.of(
        (chain,),
        reference,
        problem.step,
        problem.limits,
        options,
        initial_tension_N=float(reference[0]),
        inverse_N=inverse,
    )
    spacing, n = coarse_spacing(reference), len(reference)
    law = law_of(chain).input_history_N(reference)
    starts = (start, *(nearest_profile(task, wanted, even_knots(n, max(spacing // 4, 1))) for wanted in (inverse, law)))
    best = np.inf
    for first in starts:
        force = first
        for division in (2, 4, 6):
            limited = limited_rows(force, problem.step, problem.limits)
            knots = local_knots(limited, even_knots(n, max(spacing // 2, 1)), spacing, max(spacing // division, 1))
            settings = SqpSettings(iterations=40, tolerance=1e-3, trust_N=0.1 * float(np.ptp(reference)))
            found = solve_sqp(task, force, evaluate(task, force), knots, settings)
            force = found.force_N
            if found.evaluation.beyond_N == 0:
                best = min(best, float(np.sqrt(found.evaluation.squares[0])))
    return best


def distances() -> None:
    """How far the profiles are from the best that a long search finds, on the design model."""
    print("\ndistance to the best found, on the design model")
    for rate in (150.0, 250.0, 400.0):
        for level in (Level.VISCOELASTIC, Level.PRESLIDING):
            problem = finger(level, 2e-3, rate)
            began = time.process_time()
            found = track(problem.chain, problem.reference, problem.step, problem.limits)
            seconds, best = time.process_time() - began, best_found(problem, found.force_N)
            print(
                f"finger {level:13s} {rate:6g} N/s  {found.rms_error_N:.4f} N / {best:.4f} N = "
                f"{found.rms_error_N / best:.2f}   {seconds:.2f} s of CPU",
                flush=True,
            )


def long_horizon() -> None:
    """One piece against windows, and 60 s."""
    print("\nwindows")
    short = finger(Level.PRESLIDING, 1e-3)
    whole = track(short.chain, short.reference, short.step, short.limits)
    pieces = track(short.chain, short.reference, short.step, short.limits, TrackOptions(window_s=1.5))
    apart = float(np.sqrt(np.mean((whole.predicted_output_N - pieces.predicted_output_N) ** 2)))
    print(
        f"4 s in 1 and in {pieces.windows} pieces: errors {whole.rms_error_N:.4f} and {pieces.rms_error_N:.4f} N, "
        f"outputs {apart:.4f} N apart (rms)"
    )
    for seconds in (15, 30, 60):
        t = np.arange(seconds * 1000 + 1) * 1e-3
        reference = 30 + np.minimum(t / 0.5, 1) * (12 * np.sin(np.pi * t) + 5 * np.sin(2.6 * np.pi * t))
        began = time.perf_counter()
        found = track(short.chain, reference, 1e-3, short.limits)
        print(f"{seconds:3d} s: {found.windows} windows, {time.perf_counter() - began:.1f} s, {found.message}")


def main() -> None:
    print("error on N = 40 at 0.1 ms; the clipped inverse leaves:")
    for level in Level:
        problem = finger(level, 1e-3)
        print(f"  {level:13s} {problem.percent(problem.clipped):.3f} %")
    for level in Level:
        ours(finger(level, 1e-3), f"tendonff, {level}")
    four_scenarios()
    distances()
    long_horizon()
    if "--quick" in sys.argv:
        return
    print()
    for step in (10e-3, 4e-3, 1e-3):
        problem = finger(Level.PRESLIDING, step)
        ours(problem)
        opti(problem)
        rockit(problem)


if __name__ == "__main__":
    main()
