"""The dynamic programme over the static law, judged by that law alone."""

import numpy as np
import pytest

from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.inverse import invert
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackingProblem, TrackOptions
from tendonff.ocp.tracking.search.programme import programme

STEP = 4e-3
TIME = np.arange(0, 2 + STEP / 2, STEP)
REFERENCE = 30 + 10 * np.sin(2 * np.pi * TIME) * np.minimum(TIME / 0.3, 1)
LIMITS = ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=2000.0)


@pytest.mark.parametrize("width", [0.1, 0.2])
def test_by_the_static_law_it_beats_the_inverse_over_both_extremes(generic: Transmission, width: float) -> None:
    """At most 0.9 of the clipped static inverse's error, within the limits."""
    rigs = (with_numbers(generic, {"mu": factor}) for factor in (1.0, 1 - width, 1 + width))
    chains = tuple(Chain.of(rig, Level.PRESLIDING) for rig in rigs)
    inverse = invert(chains[0], REFERENCE, STEP).force_N
    problem = TrackingProblem.of(
        chains, REFERENCE, STEP, LIMITS, TrackOptions(), initial_tension_N=30.0, inverse_N=inverse
    )
    found = programme(problem)
    assert LIMITS.admits(found, STEP, 1e-6)

    def error(force: np.ndarray) -> float:
        outputs = (law_of(chain).output_history_N(force, 30.0) for chain in chains[1:])
        return float(np.sqrt(np.mean([(output - REFERENCE) ** 2 for output in outputs])))

    static = LIMITS.apply(law_of(chains[0]).input_history_N(REFERENCE, 30.0), STEP)
    assert error(found) < 0.9 * error(static)


def test_of_one_plant_it_leaves_early_where_the_rate_is_slow(generic: Transmission) -> None:
    """Within the limits and by the static law at most half the error of the static law's own inverse."""
    limits = ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=250.0)
    chain = Chain.of(generic, Level.PRESLIDING)
    inverse = invert(chain, REFERENCE, STEP).force_N
    problem = TrackingProblem.of(
        (chain,), REFERENCE, STEP, limits, TrackOptions(), initial_tension_N=30.0, inverse_N=inverse
    )
    found, law = programme(problem), law_of(chain)
    assert limits.admits(found, STEP, 1e-6)

    def error(force: np.ndarray) -> float:
        return float(np.sqrt(np.mean((law.output_history_N(force, 30.0) - REFERENCE) ** 2)))

    assert error(found) < 0.5 * error(limits.apply(law.input_history_N(REFERENCE, 30.0), STEP))
