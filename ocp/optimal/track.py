"""Optimal control: the force profile within the actuator's limits whose output comes closest to a reference."""

import math
import time
from collections.abc import Sequence

import numpy as np

from tendonff.models.parameters.uncertainty import Objective
from tendonff.models.tendon.chain import Chain
from tendonff.models.turns import in_turn
from tendonff.ocp.errors import CodeError, SolveError
from tendonff.ocp.opti.search import search_by_ipopt
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.batch import Progress
from tendonff.ocp.tendon.inverse import InverseStatus, Inversion, invert
from tendonff.ocp.tracking.answer import Found, answer
from tendonff.ocp.tracking.cost import Evaluation, evaluate
from tendonff.ocp.tracking.diagnosis import held_N, law_of
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.motion import limit_motion
from tendonff.ocp.tracking.options import Solver, TrackOptions
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.result import Tracking, TrackStatus
from tendonff.ocp.tracking.search import best_start, led_start, search, starts
from tendonff.ocp.tracking.sqp import SqpResult

_BEYOND = 5e-4  # of the reference's range, as `MotionBound` counts: half a percent of the speed
_EXACT = 1e-3  # of the reference's range: an error below this is called rounding


@in_turn
def track(
    chain: Chain,
    reference_N: Array,
    step_s: float,
    limits: ForceLimits,
    options: TrackOptions = TrackOptions(),  # noqa: B008 - frozen
    *,
    initial_tension_N: float | None = None,
    inversion: Inversion | None = None,
    progress: Progress | None = None,
) -> Tracking:
    """Find the force within the limits whose response comes closest to the reference (x_c2 = f_c2 = 0).

    Where no limit binds that is the exact inverse. Elsewhere the profile prepares each reversal: it leaves the inverse
    early, ramps at the largest rate through the deadband, and meets the inverse again later.

    Parameters
    ----------
    chain : Chain
        Design model.
    reference_N : ndarray, shape (n,)
        Desired output tension at 0, h, 2 h ... [N], > 0.
    step_s : float
        h [s], > 0.
    limits : ForceLimits
    options : TrackOptions, optional
    initial_tension_N : float, optional
        Uniform tension T0 of the start at rest [N]; default: the first reference.
    inversion : Inversion, optional
        `invert` of the same arguments, where the caller has it already.
    progress : callable, optional
        Callback(completed, total), in iterations; total is their limit.

    Returns
    -------
    Tracking
        Whatever happens; the status says what it is.

    Raises
    ------
    ParameterError
        If reference or step are not usable numbers.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger_fast.toml")
    >>> reference = tf.sample_reference(scenario)
    >>> chain = tf.Chain.of(scenario.transmission, tf.Level.PRESLIDING)
    >>> limits = tf.ForceLimits.of(scenario.transmission.actuator)
    >>> found = tf.track(chain, reference.tension_N, reference.step_s, limits)
    >>> print(found.status.value, bool(found.rms_error_N < 0.5 * found.clipped_rms_error_N))
    optimal True
    """
    return track_robust(
        (chain,),
        reference_N,
        step_s,
        limits,
        options=options,
        initial_tension_N=initial_tension_N,
        inversion=inversion,
        progress=progress,
    )


@in_turn
def track_robust(
    chains: tuple[Chain, ...],
    reference_N: Array,
    step_s: float,
    limits: ForceLimits,
    objective: Objective = Objective.WORST,
    options: TrackOptions = TrackOptions(),  # noqa: B008 - frozen
    *,
    initial_tension_N: float | None = None,
    inversion: Inversion | None = None,
    progress: Progress | None = None,
    others_N: Sequence[Array] = (),
) -> Tracking:
    """Find one profile that is best in the worst case or on average over some chains; see `track`.

    Parameters
    ----------
    chains : tuple of Chain
        Models of all that the uncertainty admits. The first is the nominal one: its inverse is the starting point, and
        its output is predicted.
    reference_N : ndarray, shape (n,)
    step_s : float
    limits : ForceLimits
    objective : Objective, optional
        Which error over the chains is minimised.
    options : TrackOptions, optional
    initial_tension_N : float, optional
    inversion : Inversion, optional
        Of the nominal chain, where the caller has it already.
    progress : callable, optional
    others_N : sequence of ndarray, optional
        Reference of each further chain, shape (n,) [N]; default: that of the nominal one.

    Returns
    -------
    Tracking
        Its RMS error is that of the nominal chain.
    """
    reference = np.asarray(reference_N, dtype=np.float64)
    start = float(reference[0]) if initial_tension_N is None else initial_tension_N
    began = time.perf_counter()
    inverse = invert(chains[0], reference, step_s, initial_tension_N=start) if inversion is None else inversion
    problem = TrackingProblem.from_rest(
        chains, (reference, *others_N), step_s, limits, options, start_N=start, inverse=inverse, objective=objective
    )
    return solve_tracking(problem, inverse, options, progress, build_s=time.perf_counter() - began)


def first_guess(problem: TrackingProblem, inversion: Inversion) -> Array:
    """The best of what the exact inverse of the nominal plant suggests, within the limits, shape (n,) [N]."""
    nominal, inverse = problem.plants[0], inversion.force_N
    law = law_of(nominal.chain).force_history_N(problem.reference_N, nominal.chain.drive, float(inverse[0]))
    found = best_start(problem, starts(problem, inverse, law))[1]
    return problem.clipped(
        limit_motion(nominal.chain, found, problem.step_s, problem.limits, problem.rest_N, nominal.state)
    )


def solve_tracking(
    problem: TrackingProblem,
    inversion: Inversion,
    options: TrackOptions,
    progress: Progress | None = None,
    *,
    build_s: float,
) -> Tracking:
    """Solve a tracking problem that took `build_s` to pose; `inversion` is the exact inverse of the nominal plant."""
    began = time.perf_counter()
    found = _solve(problem, inversion, options, progress)
    return answer(found, problem, inversion, options, build_s=build_s, solve_s=time.perf_counter() - began)


def _solve(problem: TrackingProblem, inversion: Inversion, options: TrackOptions, progress: Progress | None) -> Found:
    """The best profile: of the search, or the clipped inverse or capstan law where that finds nothing better."""
    reference, limits, nominal = problem.reference_N, problem.limits, problem.plants[0]
    inverse, span = inversion.force_N, float(np.ptp(reference))

    def limited(force: Array) -> Array:
        slowed = limit_motion(
            nominal.chain, problem.clipped(force), problem.step_s, limits, problem.rest_N, nominal.state
        )
        return problem.clipped(slowed)

    clipped = limited(inverse)
    at_clipped = evaluate(problem, clipped)
    binds = not limits.admits(inverse, problem.step_s, 1e-9) or not np.array_equal(clipped, problem.clipped(inverse))
    certain = inversion.status is InverseStatus.EXACT and options.effort_weight == 0 and problem.chains == 1
    if certain and not binds and at_clipped.beyond_N == 0:
        # The clipped inverse is the inverse itself, and its error is rounding, unless the rig amplifies that.
        small = at_clipped.squares[0] <= (_EXACT * span) ** 2
        status = TrackStatus.EXACT if small else TrackStatus.UNSTABLE
        return Found(status=status, force_N=clipped, evaluation=at_clipped, at_clipped=at_clipped)
    law = law_of(nominal.chain).force_history_N(reference, nominal.chain.drive, float(inverse[0]))
    static = limited(law)
    candidates = [(at_clipped, clipped), (evaluate(problem, static), static)]
    results: tuple[SqpResult, ...] = ()
    note = ""
    try:
        begun = starts(problem, clipped if limits.motion.binds else inverse, law)  # which breaks no bound of the motion
        if not np.array_equal(clipped, problem.clipped(inverse)):  # a limit of the motion binds
            led = limited(led_start(problem, inverse, options.max_iterations))
            candidates.append((evaluate(problem, led), led))
            begun = (led, *begun)
        find = search_by_ipopt if options.solver is Solver.IPOPT else search
        force, results = find(problem, begun, options.max_iterations, progress)
        candidates.append((evaluate(problem, force), force))
        if limits.motion.binds:  # the search may end beyond a limit of the motion
            kept = limited(force)
            candidates.append((evaluate(problem, kept), kept))
    except (CodeError, SolveError) as error:
        note = f"; the search stopped: {error}"
    inside = [k for k, (found, _) in enumerate(candidates) if found.beyond_N <= _BEYOND * span]
    best = min(inside or range(len(candidates)), key=lambda i: candidates[i][0].merit)
    evaluation, force = candidates[best]
    results = results if best > 1 else ()
    return Found(
        status=_status(problem, evaluation, results),
        note=note,
        force_N=force,
        evaluation=evaluation,
        at_clipped=at_clipped,
        results=results,
    )


def _status(problem: TrackingProblem, evaluation: Evaluation, results: tuple[SqpResult, ...]) -> TrackStatus:
    if not math.isfinite(evaluation.merit):
        return TrackStatus.FAILED
    if problem.reference_N.max() > held_N(problem.plants[0].chain, problem.limits):
        return TrackStatus.BEST_ACHIEVABLE
    if not results:
        return TrackStatus.CLIPPED
    return TrackStatus.OPTIMAL if all(result.converged for result in results) else TrackStatus.ACCEPTABLE
