"""Random rigs over wide ranges: every one ends in a profile that an independent check accepts, or in an explanation.

Set TENDONFF_RANDOM_RIGS to run more of them (the benchmark's 50 all pass).
"""

import os

import numpy as np
import pytest

from benchmarks.random_rigs import random_problem
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.optimal.track import TrackStatus, track
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate
from tendonff.ocp.tendon.stability import predict_stick_slip
from tendonff.ocp.tracking.cost import evaluate
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.options import TrackOptions
from tendonff.ocp.tracking.problem import TrackingProblem

COUNT = int(os.environ.get("TENDONFF_RANDOM_RIGS", "6"))


@pytest.mark.compiler
@pytest.mark.parametrize("seed", range(COUNT))
def test_a_random_rig_gets_a_profile_that_holds_or_an_explanation(seed: int) -> None:
    rig, level, reference, step = random_problem(seed)
    chain = Chain.of(rig, level)
    actuator, found = rig.actuator, track(chain, reference, step, ForceLimits.of(rig.actuator))
    if found.status in {TrackStatus.INFEASIBLE, TrackStatus.FAILED}:
        assert found.reasons or "try a smaller step" in found.message
        return
    force, slack = found.force_N, 1e-6
    assert force.min() >= actuator.force_min_N - slack * actuator.force_max_N
    assert force.max() <= actuator.force_max_N * (1 + slack)
    assert np.abs(np.diff(force)).max() <= actuator.force_rate_max_N_per_s * step * (1 + slack)
    # The other engine shares the laws, but neither the code nor the linear algebra.
    run = simulate(chain, force, step, initial_tension_N=float(reference[0]), engine=Engine.CASADI).require()
    apart = float(np.abs(run.output_tension_N - found.predicted_output_N).max())
    if apart > 1e-6 * float(reference.max()):  # a rig that amplifies rounding itself must be one we warn of
        assert predict_stick_slip(chain, reference, step, force_N=force).warnings
    assert run.tension_N[1:].min() > 0
    # Beside the error of the model, stiffer bristles and travel count.
    start, limits = float(reference[0]), ForceLimits.of(rig.actuator)
    inverse = invert(chain, reference, step).force_N
    problem = TrackingProblem.of(
        (chain,),
        (chain.rest_state(start),),
        (reference,),
        step,
        limits,
        TrackOptions(),
        initial_tension_N=start,
        start_N=limits.start(start),
        inverse_N=inverse,
    )
    clipped = evaluate(problem, problem.clipped(inverse))
    if clipped.beyond_N == 0:
        assert evaluate(problem, force).merit <= clipped.merit * (1 + 1e-9)
    if found.status is not TrackStatus.EXACT:
        assert found.reasons
