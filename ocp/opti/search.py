"""The search for the optimal force by direct collocation and IPOPT, in the place of `tracking.search`."""

from collections.abc import Sequence

import numpy as np

from tendonff.ocp.errors import SolveError
from tendonff.ocp.opti.choices import Collocation
from tendonff.ocp.opti.tendon import formulate, ipopt_options
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.batch import Progress
from tendonff.ocp.tracking.cost import evaluate
from tendonff.ocp.tracking.problem import TrackingProblem
from tendonff.ocp.tracking.search import best_start
from tendonff.ocp.tracking.sqp import SqpResult


def search_by_ipopt(
    problem: TrackingProblem, wanted_N: Sequence[Array], iterations: int, progress: Progress | None = None
) -> tuple[Array, tuple[SqpResult, ...]]:
    """Search for the best profile on the whole horizon; arguments and results as of `tracking.search.search`.

    What counts is the simulated response to the force between the intervals' ends; the start is kept where that is no
    better.
    """
    best = best_start(problem, wanted_N)
    rows = problem.step_s * np.arange(len(problem.reference_N))
    longest = max(problem.step_s, Collocation().interval_s)
    formulation = formulate(problem, best[1], Collocation(interval_s=longest))
    formulation.opti.solver("ipopt", *ipopt_options(iterations))
    try:
        found = formulation.solve()
        force, converged, count = found.value(formulation.force_N), True, found.iterations
    except SolveError:  # the last iterate may be better than the start all the same
        force = np.asarray(formulation.opti.debug.value(formulation.force_N)).ravel()
        converged, count = False, int(formulation.opti.debug.stats().get("iter_count", 0))
    if progress is not None:
        progress(iterations, iterations)
    force = problem.clipped(np.interp(rows, formulation.time_s, force))
    evaluation = evaluate(problem, force)
    gain = max(1 - evaluation.merit / best[0].merit, 0.0)
    if not evaluation.merit < best[0].merit:
        evaluation, force = best
    result = SqpResult(force_N=force, evaluation=evaluation, converged=converged, iterations=count, gain=gain)
    return force, (result,)
