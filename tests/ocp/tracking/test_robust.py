import math

import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.parameters.uncertainty import Objective
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.optimal.track import track_robust
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.limits import ForceLimits

STEP = 2e-3
TIME = np.arange(0, 1 + STEP / 2, STEP)
REFERENCE = 30 + 10 * np.sin(2 * np.pi * TIME) * np.minimum(TIME / 0.1, 1)
LIMITS = ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=400.0)


@pytest.fixture(scope="module")
def chains(generic: Transmission) -> tuple[Chain, ...]:
    off = ({}, {"mu": 0.8, "stiffness": 0.9}, {"mu": 1.2, "stiffness": 1.1})
    return tuple(Chain.of(with_numbers(generic, values), Level.PRESLIDING) for values in off)


@pytest.mark.compiler
def test_the_robust_profile_is_better_in_the_case_it_is_made_for(chains: tuple[Chain, ...]) -> None:
    def worst_N(force: np.ndarray) -> float:
        outputs = (simulate(chain, force, STEP).output_tension_N for chain in chains)
        return max(float(np.sqrt(np.mean((output - REFERENCE) ** 2))) for output in outputs)

    worst = {}
    for objective in Objective:
        found = track_robust(chains, REFERENCE, STEP, LIMITS, objective)
        assert LIMITS.admits(found.force_N, STEP, 1e-6)
        assert f"worst of 3 plants, the search's own with {chains[0].count} masses" in found.message
        worst[objective] = worst_N(found.force_N)
    clipped = LIMITS.apply(invert(chains[0], REFERENCE, STEP).force_N, STEP)
    assert worst[Objective.WORST] < 0.97 * worst_N(clipped)
    assert worst[Objective.WORST] <= worst[Objective.MEAN]


def test_the_floor_that_no_force_can_pass_is_said_beside_the_error(chains: tuple[Chain, ...]) -> None:
    """mu theta differs by 0.2 a either way, a the nominal exponent: tanh(0.2 a) of the tension."""
    exponent = math.log(law_of(chains[0]).largest_output_N(1e6) / 1e6) / -1.0
    found = track_robust(chains, REFERENCE[:60], STEP, LIMITS)
    assert f"no force does better than {100 * math.tanh(0.2 * exponent):.3g} % of the tension" in found.message
