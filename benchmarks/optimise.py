"""Optimal control side by side: ours against what a user would otherwise write, on the same problem and grid.

    python benchmarks/optimise.py            everything, the others on 10 ms
    python benchmarks/optimise.py --fine     the others on 4 and 1 ms too: about an hour more
    python benchmarks/optimise.py --quick    ours alone: the fast finger, four scenarios, distances, windows

The problem: the finger example (N = 6) with a force rate limit that binds, 4 s, from rest. Minimise the mean square of
the tension error subject to range and rate of the force. The others are in `optimise_others`:

* Opti + IPOPT: direct collocation (Radau, degree 2), CasADi's plain Opti stack, expanded.
* rockit and do-mpc: the same through these packages (pip install "tendonff[benchmark]"), left out where they are not
  installed. acados itself is on no package index; it is built from source.

Errors are those of the profile replayed on N = 40 at a tenth of a millisecond, in per cent of the reference's range.
Times are seconds of CPU; ours includes nothing cached but the compiled stepper.

Distances are root ratios of the goal (error, travel of the force, static law) to the best that a long search from
moved profiles with finer knots finds, on the fast finger and on random rigs of the tests.
"""

import os
import sys
import time
from dataclasses import replace

import numpy as np
from optimise_others import EXAMPLES, Array, Problem, do_mpc, finger, opti, ours, rockit
from random_rigs import random_problem
from threadpoolctl import threadpool_limits

from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import load_scenario
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.ocp.inverse import invert
from tendonff.ocp.tracking.cost import Evaluation, evaluate
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackingProblem, TrackOptions
from tendonff.ocp.tracking.result import TrackStatus
from tendonff.ocp.tracking.search.grids import nearest_profile
from tendonff.ocp.tracking.search.knots import coarse_spacing, even_knots, limited_rows, local_knots
from tendonff.ocp.tracking.search.sqp import Blocks, SqpSettings, solve_sqp
from tendonff.ocp.tracking.track import track

HOPS = int(os.environ.get("TENDONFF_HOPS", "60"))
RIGS = int(os.environ.get("TENDONFF_RIGS", "12"))

Found = tuple[Evaluation, Array]


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


def best_found(task: TrackingProblem, inverse_N: Array, start_N: Array) -> Found:
    """The best of a long search: finer knots, from several starts, and from profiles moved in time."""
    reference, n = task.goal.reference_N, len(start_N)
    spacing, rng = coarse_spacing(reference), np.random.default_rng(1)
    law = law_of(task.plants[0].chain).input_history_N(reference)
    near = even_knots(n, max(spacing // 4, 1))
    best = _polished(task, start_N, (4, 8), 25)
    for wanted in (inverse_N, law):
        best = _better(task, best, _polished(task, nearest_profile(task, wanted, near), (2, 4, 8), 25))
    rows = np.arange(n)
    blocks = Blocks.between_reversals(task, rows)
    for _ in range(HOPS):
        shift = np.round(rng.normal(0, rng.choice([0.3, 1.0, 2.0]) * spacing, blocks.count)).astype(int)
        shift *= rng.random(blocks.count) < 0.6
        moved = task.clipped(best[1][np.clip(rows + shift[blocks.of_knot], 0, n - 1)])
        best = _better(task, best, _polished(task, moved, (8,), 10))
    return best


def _polished(task: TrackingProblem, force: Array, divisions: tuple[int, ...], iterations: int) -> Found:
    spacing = coarse_spacing(task.goal.reference_N)
    settings = SqpSettings(iterations=iterations, tolerance=1e-3, trust_N=0.1 * float(np.ptp(task.goal.reference_N)))
    best = evaluate(task, force), force
    for division in divisions:
        limited = limited_rows(force, task.step_s, task.limits)
        knots = local_knots(limited, even_knots(len(force), max(spacing // 2, 1)), spacing, max(spacing // division, 1))
        found = solve_sqp(task, force, evaluate(task, force), knots, settings)
        force = found.force_N
        best = min(best, (found.evaluation, force), key=_merit)
    return best


def _better(task: TrackingProblem, one: Found, other: Found) -> Found:
    """The best of two and of what takes the better of them between each two reversals."""
    blocks = Blocks.between_reversals(task, np.arange(len(one[1])))
    better = blocks.sums(other[0].density) < blocks.sums(one[0].density)
    mixed = task.clipped(np.where(better[blocks.of_knot], other[1], one[1]))
    return min(one, other, (evaluate(task, mixed), mixed), key=_merit)


def _merit(found: Found) -> float:
    return found[0].merit if found[0].beyond_N == 0 else np.inf


def distances() -> None:
    """How far the profiles are from the best that a long search finds, by the same goal."""
    print(f"\ndistance to the best found in {HOPS} searches from moved profiles; each profile in seconds of CPU")
    fast = finger(Level.PRESLIDING, 1e-3, 250.0)
    cases = [("finger_fast", (fast.chain, fast.reference, fast.step, fast.limits))]
    for seed in range(RIGS):
        rig, level, reference, step = random_problem(seed)
        cases.append((f"random rig {seed}", (Chain.of(rig, level), reference, step, ForceLimits.of(rig.actuator))))
    for name, (chain, reference, step, limits) in cases:
        began = time.process_time()
        found = track(chain, reference, step, limits)
        seconds = time.process_time() - began
        if found.status is TrackStatus.EXACT or found.cautions:  # nothing binds; another goal is in force
            print(f"{name:15s} {found.status}: left out")
            continue
        inverse = invert(chain, reference, step).force_N
        start = float(reference[0])
        task = TrackingProblem.of(
            (chain,), reference, step, limits, TrackOptions(), initial_tension_N=start, inverse_N=inverse
        )
        with threadpool_limits(1, user_api="blas"):  # more threads cost a hundred times what they give
            ours, best = evaluate(task, found.force_N), best_found(task, inverse, found.force_N)[0]
        print(
            f"{name:15s} {np.sqrt(ours.merit / best.merit):.3f}   error {found.rms_error_N:.4f} N, of the best "
            f"{np.sqrt(best.squares[0]):.4f} N, of the clipped inverse {found.clipped_rms_error_N:.4f} N   "
            f"{seconds:.2f} s   {found.status}",
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
        began = time.process_time()
        found = track(short.chain, reference, 1e-3, short.limits)
        print(f"{seconds:3d} s: {found.windows} windows, {time.process_time() - began:.1f} s of CPU, {found.message}")


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
    for step in (10e-3, 4e-3, 1e-3) if "--fine" in sys.argv else (10e-3,):
        problem = finger(Level.PRESLIDING, step)
        ours(problem)
        for other in (opti, rockit, do_mpc):
            other(problem)


if __name__ == "__main__":
    main()
