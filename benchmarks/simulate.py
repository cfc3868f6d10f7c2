"""Forward simulation side by side: ours against the integrators a user would otherwise take, on the same equations.

    python benchmarks/simulate.py            everything, less than ten minutes
    python benchmarks/simulate.py --quick    the main table only, less than one

1. The finger example under a smooth force, one row per millisecond. Every way gives the tensions at the same rows; the
   error is that of the output tension against `cvodes` at a tolerance of 1e-11 with the same force. The adaptive ways
   run at several tolerances, scaled to the size of each state, and at CasADi's own defaults; in two settings: with the
   force as rows (what a force file is: the integrator starts anew at each row), and with the force as a formula of
   time, so that they may step across rows. SciPy has the analytic Jacobian. *Times ours* compares with our run at 1 ms;
   *at equal accuracy* with the cheapest of our steps that is at least as accurate as that line.
   Once more without structural and viscous damping, where a light mass on a stuck bristle rings.
2. Growth with the number of masses.
3. Implicit Euler against BDF2, the same stepper with other coefficients.
4. The error at the examples' own step against a run with 10 us.
5. The marginal cost of a row of `tendonff simulate`: a file of 200 s against one of 20 s.

Times are processor times, the least of a few repetitions, without building and compiling; those of the command line are
of the clock.

What came out (ratios; two shared cores with AVX2, CasADi 3.8.2):

* A step of ours costs 0.02 us per mass, linearly from N = 40 to 1000 (0.045 at N = 6); the engine without a compiler 50
  to 100 times as much.
* Without damping, `cvodes` with the force as rows costs 1000 to 1900 times our run at N = 6; at equal accuracy 190 to
  1700 times where it is accurate at all: at loose tolerances it is off by 0.2 to 9 % of range. At N = 40 nothing rings
  in this course, and it costs 30 to 40 times as much unless it stumbles.
* With the finger's damping, `cvodes` at its defaults costs 150 to 240 times our run with the force as rows, 50 to 140
  times with the force in time, and is then the more accurate of the two. The cheapest way with rows whose error is no
  larger than ours at 1 ms costs 35 to 50 times (N = 6) and 50 to 65 times (N = 40) our run; where we refine the step to
  match its error, 10 to 40 times; with the force as a formula of time, 4 to 40 times. What limits it is the order: one
  force per row that the exact inverse can reproduce calls for a multistep scheme, and L-stable ones end at the second
  order (Dahlquist).
* All of this without Stribeck effect, as the finger has none; with it a step costs two to three times as much.
* SciPy's ways cost 250 to 3000 times our run, collocation 160 to 900 times, and that does not always converge.
* Implicit Euler has 9 to 24 times the error of BDF2 at 1 ms for the same time.
* Errors at the examples' own step are below 0.05 % of range without Stribeck effect, and on the soft bristle with it.
  On the stiff one they are 0.3 % under the reference and 1 % under its inverse, which slips and sticks.
* The command line adds some 4 us per row of 43 numbers for writing them.
"""

import math
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks.adaptive import ADAPTIVE, by_method
from tendonff.compensator.scenario.sampled.sampling import initial_tension, sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.errors import SolveError
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.step import c_engine, render
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import Simulator, simulate

Array = NDArray[np.float64]
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
STEP = 1e-3
START_N, SWING_N = 40.0, 30.0
"""The force swings by more than friction holds back, so that the far end moves in every half period."""


def force_at(t: ca.SX | Array | float) -> ca.SX | Array | float:
    """Smooth force with reversals [N], for numbers, arrays and expressions."""
    return (
        START_N + SWING_N * ca.sin(4 * math.pi * t) * (1 - ca.exp(-20 * t * t))
        if isinstance(t, ca.SX)
        else (START_N + SWING_N * np.sin(4 * math.pi * t) * (1 - np.exp(-20 * np.square(t))))
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """Method at a tolerance."""

    way: str
    setting: str
    us_per_row: float
    percent: float


def least_time(run: Callable[[], Array], repetitions: int) -> tuple[float, Array]:
    """Least processor time of a few runs [s], and the result."""
    best, result = math.inf, np.empty(0)
    for _ in range(repetitions):
        begin = time.process_time()
        result = run()
        best = min(best, time.process_time() - begin)
    return best, result


def percent_of_range(output: Array, reference: Array) -> float:
    """Rms difference in % of the reference's range."""
    return 100 * math.sqrt(float(np.mean((output - reference) ** 2))) / float(np.ptp(reference))


def ours(chain: Chain, rows: int, engine: Engine, step_s: float = STEP, every: int = 1) -> Callable[[], Array]:
    """Our stepper from rest over rows of the smooth force; the output at `every` one of them."""
    row_time = np.arange(rows // every + 1) * step_s * every
    force = np.interp(np.arange(rows + 1) * step_s, row_time, np.asarray(force_at(row_time)))
    inputs, start = ChainInputs.of_force(force), chain.rest_state(START_N)

    def run() -> Array:
        simulator = Simulator(chain, step_s, start, inputs[:1], engine)
        return np.concatenate([[START_N], simulator.advance(inputs[1:]).tension_N[every - 1 :: every, -1]])

    if engine is Engine.COMPILED:
        return run
    prepared = [Simulator(chain, step_s, start, inputs[:1], engine) for _ in range(3)]  # building them is not the run
    return lambda: np.concatenate([[START_N], prepared.pop().advance(inputs[1:]).tension_N[:, -1]])


def by_rows(chain: Chain, rows: int, solver: Method, tolerance: float) -> Callable[[], Array]:
    """SUNDIALS through CasADi with the force as rows."""
    force = np.asarray(force_at(np.arange(rows + 1) * STEP))
    return lambda: by_method(chain, force, STEP, START_N, solver, tolerance)


def by_rows_at_defaults(chain: Chain, rows: int, solver: Method) -> Callable[[], Array]:
    """The same without a thought: CasADi's default tolerances, states in SI units."""
    equations, t, force = chain_equations(chain), ca.SX.sym("t"), ca.SX.sym("force", 3)
    now = ca.vertcat(force[0] + force[1] * (t - force[2]), 0, 0, 0)
    rate, tension = ca.substitute([equations.rate, equations.tension_N[-1]], [equations.inputs], [now])
    time_s = np.arange(rows + 1) * STEP
    dae = {"t": t, "x": equations.state, "u": force, "ode": rate}
    integrator = ca.integrator("defaults", solver.value, dae, 0.0, time_s[1:], {"max_num_steps": 200_000})
    output = ca.Function("output", [equations.state, t, force], [tension], {"cse": True})
    newton = np.asarray(force_at(time_s))
    pieces = np.stack([newton[:-1], np.diff(newton) / STEP, time_s[:-1]])
    start = chain.rest_state(START_N).vector()
    return lambda: np.concatenate(
        [[START_N], np.asarray(output(integrator(x0=start, u=pieces)["xf"], time_s[None, 1:], pieces)).ravel()]
    )


def in_time(chain: Chain, rows: int, solver: str, options: dict[str, object]) -> Callable[[], Array]:
    """A CasADi integrator with the force as a formula of time."""
    equations, t = chain_equations(chain), ca.SX.sym("t")
    rate, tension = ca.substitute(
        [equations.rate, equations.tension_N[-1]], [equations.inputs], [ca.vertcat(force_at(t), 0, 0, 0)]
    )
    grid = np.arange(1, rows + 1) * STEP
    dae = {"t": t, "x": equations.state, "ode": rate}
    integrator = ca.integrator("integrator", solver, dae, 0.0, grid, options)
    output = ca.Function("output", [equations.state, t], [tension], {"cse": True})
    start = chain.rest_state(START_N).vector()
    return lambda: np.concatenate([[START_N], np.asarray(output(integrator(x0=start)["xf"], grid[None, :])).ravel()])


def scipy_in_time(chain: Chain, rows: int, method: str, tolerance: float) -> Callable[[], Array]:
    """SciPy's `solve_ivp` with compiled-in CasADi functions for rate and Jacobian."""
    equations = chain_equations(chain)
    x, u = equations.state, equations.inputs
    rate = ca.Function("rate", [x, u[0]], [ca.substitute(equations.rate, u[1:], ca.SX.zeros(3))], {"cse": True})
    slope = ca.Function("slope", [x, u[0]], [ca.jacobian(rate(x, u[0]), x)], {"cse": True})
    output = ca.Function("output", [x, u[0]], [ca.substitute(equations.tension_N[-1], u[1:], ca.SX.zeros(3))])
    grid = np.arange(rows + 1) * STEP
    sparse = method in ("Radau", "BDF")

    def jacobian(t: float, y: Array) -> object:
        value = slope(y, float(force_at(t)))
        return value.sparse() if sparse else value.full()

    def run() -> Array:
        found = solve_ivp(
            lambda t, y: rate(y, float(force_at(t))).full().ravel(),
            (0.0, float(grid[-1])),
            chain.rest_state(START_N).vector(),
            method=method,
            t_eval=grid,
            rtol=tolerance,
            atol=tolerance * scales(chain),
            jac=jacobian,
        )
        if not found.success:
            raise SolveError(found.message)
        return np.asarray(output(found.y, np.asarray(force_at(grid))[None, :])).ravel()

    return run


def scales(chain: Chain) -> Array:
    """Typical size of every state."""
    n = chain.count
    stretch, _ = chain.link.shortened(chain.elements.ratio[1]).rest(START_N)
    return np.concatenate(
        [np.full(n + 2, 1e-2), np.full(2 * n + 2, stretch), np.full(n, START_N), np.full(2, stretch * (n + 1))]
    )


def main_table(chain: Chain, rows: int, quick: bool) -> list[Line]:
    """Every way on one chain."""
    _, reference = least_time(by_rows(chain, rows, Method.CVODES, 1e-11), 1)
    tight = {"reltol": 1e-11, "abstol": 1e-14, "max_num_steps": 200_000}
    _, reference_in_time = least_time(in_time(chain, rows, "cvodes", tight), 1)
    lines: list[Line] = []

    def add(way: str, setting: str, make: Callable[[], Callable[[], Array]], repetitions: int = 2) -> None:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                seconds, output = least_time(make(), repetitions)
        except (RuntimeError, SolveError, ValueError) as error:
            print(f"    {way}, {setting}: failed, {str(error).strip().splitlines()[-1][:90]}")
            return
        same = reference if "rows" in way or way.startswith("ours") else reference_in_time
        percent = percent_of_range(output, same) if np.isfinite(output).all() else math.inf
        lines.append(Line(way=way, setting=setting, us_per_row=1e6 * seconds / rows, percent=percent))

    add("ours, compiled", "1 ms", lambda: ours(chain, rows, Engine.COMPILED), 5)
    for finer in (2, 4, 8, 16):
        step = STEP / finer
        add(
            "ours, compiled",
            f"{1e6 * step:g} us",
            lambda k=finer, h=step: ours(chain, k * rows, Engine.COMPILED, h, every=k),
            3,
        )
    add("ours, CasADi", "1 ms", lambda: ours(chain, rows, Engine.CASADI), 3)
    for solver in ADAPTIVE:
        add(f"{solver}, force in rows", "default", lambda s=solver: by_rows_at_defaults(chain, rows, s))
        add(f"{solver}, force in time", "default", lambda s=solver: in_time(chain, rows, s.value, {}))
        for tolerance in (1e-3, 1e-4, 1e-5, 1e-6):
            add(
                f"{solver}, force in rows", f"{tolerance:.0e}", lambda s=solver, e=tolerance: by_rows(chain, rows, s, e)
            )
            options = {"reltol": tolerance, "abstol": 1e-3 * tolerance, "max_num_steps": 200_000}
            add(
                f"{solver}, force in time",
                f"{tolerance:.0e}",
                lambda s=solver, o=options: in_time(chain, rows, s.value, o),
            )
    if quick:
        return lines
    for order in (1, 2, 3):
        options = {
            "number_of_finite_elements": 1,
            "interpolation_order": order,
            "collocation_scheme": "radau",
            "rootfinder": "newton",
            "rootfinder_options": {"line_search": True, "error_on_fail": True, "abstol": 1e-9},
        }
        add("collocation (Radau)", f"order {order}", lambda o=options: in_time(chain, rows, "collocation", o), 1)
    for method in ("Radau", "BDF", "LSODA"):
        for tolerance in (1e-3, 1e-4, 1e-5):
            add(
                f"SciPy {method}", f"{tolerance:.0e}", lambda m=method, e=tolerance: scipy_in_time(chain, rows, m, e), 1
            )
    return lines


def print_table(title: str, lines: list[Line]) -> None:
    """Time, error and ratios of every way."""
    base, steps = lines[0], [line for line in lines if line.way == lines[0].way]
    head = f"{'way':28s} {'setting':>8s} {'us/row':>10s} {'error %':>9s} {'times ours':>11s} {'at equal accuracy':>18s}"
    print(f"\n{title}\n    {head}")
    for line in lines:
        matching = [own.us_per_row for own in steps if own.percent <= line.percent]
        equal = f"{line.us_per_row / min(matching):18.1f}" if matching else f"{'-':>18s}"
        print(
            f"    {line.way:28s} {line.setting:>8s} {line.us_per_row:10.2f} {line.percent:9.4f} "
            f"{line.us_per_row / base.us_per_row:11.1f} {equal if line not in steps else ''}"
        )


def growth(rig: Transmission) -> None:
    """Cost against the number of masses."""
    print("\nGrowth with N, presliding: us/row (and per mass)")
    for n in (6, 40, 200, 1000):
        chain, rows = Chain.of(rig, Level.PRESLIDING, n), 2000
        ours(chain, 2, Engine.COMPILED)()
        seconds, _ = least_time(ours(chain, rows, Engine.COMPILED), 3)
        text = f"    N = {n:4d}: ours, compiled {1e6 * seconds / rows:8.2f} ({1e6 * seconds / rows / n:.3f})"
        if n <= 200:
            seconds, _ = least_time(ours(chain, 600, Engine.CASADI), 2)
            text += f", CasADi {1e6 * seconds / 600:8.1f}"
            few = max(20, 4000 // n)
            seconds, _ = least_time(by_rows(chain, few, Method.CVODES, 1e-4), 1)
            text += f", cvodes at 1e-4 {1e6 * seconds / few:10.0f}"
        print(text)


def euler_against_bdf2(rig: Transmission) -> None:
    """The decision for the scheme: error and cost of both, by printing the stepper with Euler's coefficients."""
    print("\nImplicit Euler against BDF2: error in % of range at N = 6 against cvodes at 1e-11, us/row")
    steps = (4e-3, 2e-3, 1e-3, 5e-4)
    original = render.BDF2_CARRY, render.BDF2_WEIGHT
    for level in (Level.VISCOELASTIC, Level.PRESLIDING):
        chain = Chain.of(rig, level, 6)
        _, reference = least_time(by_rows(chain, 2000, Method.CVODES, 1e-11), 1)
        for name, (carry, weight) in (("BDF2", original), ("implicit Euler", (0.0, 1.0))):
            render.BDF2_CARRY, render.BDF2_WEIGHT = carry, weight
            c_engine._source.cache_clear()
            c_engine._library.cache_clear()
            cells = []
            for step in steps:
                rows = round(2.0 / step)
                seconds, output = least_time(ours(chain, rows, Engine.COMPILED, step), 3)
                every = max(1, round(STEP / step))
                at = reference[:: max(1, round(step / STEP))]
                cells.append(
                    f"{1e3 * step:g} ms {percent_of_range(output[::every], at):.4f} % {1e6 * seconds / rows:.2f} us"
                )
            print(f"    {level:13s} {name:15s} " + "   ".join(cells))
        render.BDF2_CARRY, render.BDF2_WEIGHT = original
        c_engine._source.cache_clear()
        c_engine._library.cache_clear()


def examples_error() -> None:
    """Error of the examples at their own step, under their reference as force and under its exact inverse."""
    print("\nError at the example's step against 10 us, rms in % of range (reference as force / inverse as force)")
    for path in sorted(path for path in EXAMPLES.glob("*.toml") if isinstance(load_scenario(path), Scenario)):
        scenario = load_scenario(path)
        wanted, step, start = (
            sample_reference(scenario).tension_N[:4001],
            scenario.run.step_s,
            initial_tension(scenario),
        )
        parts = round(step / 1e-5)
        at, fine_at = np.arange(len(wanted)), np.arange((len(wanted) - 1) * parts + 1) / parts
        cells = []
        for level in Level:
            chain = Chain.of(scenario.transmission, level)
            errors = []
            for force in (wanted, invert(chain, wanted, step, initial_tension_N=start).force_N):
                coarse = simulate(chain, force, step, initial_tension_N=start).output_tension_N
                fine = simulate(chain, np.interp(fine_at, at, force), step / parts, initial_tension_N=start)
                errors.append(percent_of_range(coarse, fine.output_tension_N[::parts]))
            cells.append(f"{level} {errors[0]:.4f} / {errors[1]:.4f}")
        print(f"    {path.stem:16s} " + "   ".join(cells))


def command_line() -> None:
    """Marginal cost of a row of `tendonff simulate`."""
    print("\nCommand line, N = 40, presliding: marginal cost of a row between files of 20 s and 200 s")
    text = (
        (EXAMPLES / "finger.toml")
        .read_text(encoding="utf-8")
        .replace("segments = 6 ", "segments = 40 ")
        .replace("initial_tension_N = 30", f"initial_tension_N = {START_N:g}")
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scenario.toml").write_text(text, encoding="utf-8")
        best = {}
        for seconds in (20, 200):
            t = np.arange(round(seconds / STEP) + 1) * STEP
            rows = np.column_stack([t, np.asarray(force_at(t))])
            np.savetxt(folder / "F.csv", rows, fmt="%.9g", delimiter=",", header="time_s,force_N", comments="")
            command = [sys.executable, "-m", "tendonff.compensator.cli", "simulate", "scenario.toml"]
            command += ["--level", "presliding", "--force", "F.csv", "--out", "O.csv"]
            times = []
            for _ in range(3):
                begin = time.perf_counter()
                subprocess.run(command, cwd=folder, check=True)
                times.append(time.perf_counter() - begin)
            best[seconds] = min(times)
    chain = Chain.of(load_scenario(EXAMPLES / "finger.toml").transmission, Level.PRESLIDING, 40)
    stepper, _ = least_time(ours(chain, 20_000, Engine.COMPILED), 3)
    row = 1e6 * (best[200] - best[20]) / 180_000
    print(f"    {row:.2f} us per row, of which the stepper takes {1e6 * stepper / 20_000:.2f} us")


def main() -> None:
    quick = "--quick" in sys.argv[1:]
    begin = time.perf_counter()
    rig = load_scenario(EXAMPLES / "finger.toml").transmission
    cases = [(6, Level.PRESLIDING, 1000), (6, Level.VISCOELASTIC, 1000), (40, Level.PRESLIDING, 400)]
    if not quick:
        cases.append((40, Level.VISCOELASTIC, 400))
    for n, level, rows in cases:
        tables = main_table(Chain.of(rig, level, n), rows, quick)
        print_table(f"Finger, {level}, N = {n}, {rows} rows", tables)
    bare = replace(
        rig,
        tendon=replace(rig.tendon, damping_N_s_per_m=0.0),
        friction=replace(rig.friction, viscous_N_s_per_m=0.0),
    )
    for n, rows in ((6, 1000), (40, 100)):
        tables = main_table(Chain.of(bare, Level.VISCOELASTIC, n), rows, quick=True)
        print_table(f"Finger without structural and viscous damping, viscoelastic, N = {n}, {rows} rows", tables)
    if not quick:
        growth(rig)
        euler_against_bdf2(rig)
        examples_error()
        command_line()
    print(f"\n{time.perf_counter() - begin:.0f} s in all")


if __name__ == "__main__":
    main()
