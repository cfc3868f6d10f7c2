"""The steady state of a cycle: what a state leads back to, found in few cycles."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainState
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.periodic import steady_inverse, steady_response

STEP = 2e-3
TIME = np.arange(251) * STEP
CYCLE = 40 + 20 * np.sin(4 * np.pi * TIME) + 6 * np.sin(8 * np.pi * TIME + 1)
CYCLE[-1] = CYCLE[0]


@pytest.fixture(scope="module")
def creeping(generic: Transmission) -> Chain:
    """A relaxation time of ten periods, so that cycles settle slowly."""
    tendon = replace(generic.tendon, relaxation_time_s=5.0)
    friction = replace(generic.friction, mu_static=0.2, mu_static_release=0.15)
    return Chain.of(replace(generic, tendon=tendon, friction=friction), Level.PRESLIDING)


def test_the_state_after_the_cycle_is_the_state_before_it(creeping: Chain) -> None:
    found, steadiness = steady_inverse(creeping, CYCLE, STEP)
    assert steadiness.converged
    assert found.states is not None
    scale = np.max(np.abs(found.states), axis=0) + 1e-12
    assert np.max(np.abs(found.states[-1] - found.states[0]) / scale) < 1e-4
    assert found.force_N[-1] == pytest.approx(found.force_N[0], abs=1e-4)


def test_few_cycles_find_what_many_lead_to(creeping: Chain) -> None:
    found, steadiness = steady_inverse(creeping, CYCLE, STEP)
    many = invert(creeping, np.concatenate([np.tile(CYCLE[:-1], 120), CYCLE]), STEP).force_N[-len(CYCLE) :]
    few = invert(creeping, np.concatenate([np.tile(CYCLE[:-1], 6), CYCLE]), STEP).force_N[-len(CYCLE) :]
    assert steadiness.cycles <= 8
    assert found.force_N == pytest.approx(many, abs=1e-4)
    assert np.abs(few - many).max() > 1e-3  # cycles alone are not there yet


def test_the_response_to_the_steady_force_is_the_cycle(creeping: Chain) -> None:
    force = steady_inverse(creeping, CYCLE, STEP)[0].force_N
    found, steadiness = steady_response(creeping, force, STEP, initial_tension_N=float(CYCLE[0]))
    assert steadiness.converged
    assert found.output_tension_N == pytest.approx(CYCLE, abs=1e-3)


def test_the_steady_state_does_not_depend_on_where_the_search_starts(creeping: Chain) -> None:
    force = steady_inverse(creeping, CYCLE, STEP)[0].force_N
    outputs = [
        steady_response(creeping, force, STEP, initial_tension_N=tension)[0].output_tension_N
        for tension in (20.0, 60.0)
    ]
    assert outputs[0] == pytest.approx(outputs[1], abs=2e-3)


def test_a_state_of_the_cycle_continues_it(creeping: Chain) -> None:
    found, _ = steady_inverse(creeping, CYCLE, STEP)
    assert found.states is not None
    state = ChainState.from_vector(found.states[0], creeping.layout)
    again = invert(creeping, CYCLE, STEP, state=state).force_N
    assert again[5:] == pytest.approx(found.force_N[5:], abs=0.05)  # but for the first step, of first order
