"""Least time between two tensions: against the static law's ramp, and against every shorter ramp."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.simulate import simulate
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.goals.transition import settled_row, static_time_s, track_transition
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.result import TrackStatus

STEP, ROWS = 2e-3, 401
LIMITS = ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=150.0)


@pytest.fixture(scope="module")
def stiff(generic: Transmission) -> Chain:
    friction = replace(generic.friction, mu_static=0.2, mu_static_release=0.15)
    return Chain.of(replace(generic, friction=friction), Level.ELASTIC)


@pytest.mark.parametrize("end", [40.0, 18.0])
def test_a_stiff_tendon_takes_the_time_of_the_static_laws_ramp(stiff: Chain, end: float) -> None:
    """(T_end + p) e^{+-mu theta} - p is reached at the largest rate; inertia and damping add two hundredths."""
    law, tolerance = law_of(stiff), 0.1
    near = end - np.sign(end - 30) * tolerance
    factor = np.exp(law.pull_exponent) if end > 30 else np.exp(-law.release_exponent)
    ramp = abs((near + law.adhesion_N) * factor - law.adhesion_N - 30) / 150.0
    assert static_time_s(law, 30.0, near, LIMITS) == pytest.approx(ramp)
    found = track_transition(stiff, 30.0, end, ROWS, STEP, LIMITS, tolerance_N=tolerance)
    assert found.status is TrackStatus.OPTIMAL
    assert LIMITS.admits(found.force_N, STEP, 1e-6)
    output = simulate(stiff, found.force_N, STEP, initial_tension_N=30.0).output_tension_N
    row = settled_row(output, end, tolerance)
    assert row < ROWS
    assert np.abs(output[row:] - end).max() <= tolerance
    assert ramp - STEP <= row * STEP <= ramp + 0.02
    assert f"in {row * STEP:.4g} s (static law: {ramp:.3g} s)" in found.message


def test_no_plain_ramp_settles_sooner(stiff: Chain) -> None:
    """A family of others: up at the largest rate to any force, held."""
    found = track_transition(stiff, 30.0, 40.0, ROWS, STEP, LIMITS, tolerance_N=0.1)
    ours = settled_row(found.predicted_output_N, 40.0, 0.1)
    time = np.arange(ROWS) * STEP
    for force in np.linspace(60, 80, 21):
        ramp = np.minimum(30 + 150.0 * time, force)
        assert settled_row(simulate(stiff, ramp, STEP).output_tension_N, 40.0, 0.1) >= ours


def test_what_the_largest_force_cannot_reach_is_said(stiff: Chain) -> None:
    limits = replace(LIMITS, maximum_N=60.0)
    found = track_transition(stiff, 30.0, 45.0, ROWS, STEP, limits)
    assert found.status is TrackStatus.BEST_ACHIEVABLE
    assert "does not come to stay within 0.15 N" in found.message
    assert "out of reach by the static law" in found.message


def test_a_tolerance_wider_than_the_change_is_refused(stiff: Chain) -> None:
    with pytest.raises(ParameterError, match="tolerance_N must lie between 0 and the change from 30 to 40 N, got 12"):
        track_transition(stiff, 30.0, 40.0, ROWS, STEP, LIMITS, tolerance_N=12.0)
