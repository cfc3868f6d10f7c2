"""With so much preview: nothing later is used, all of it is worth as much as knowing everything."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.simulate import simulate
from tendonff.ocp.tracking.goals.preview import track_preview
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackOptions
from tendonff.ocp.tracking.result import Tracking, TrackStatus
from tendonff.ocp.tracking.track import track

STEP = 4e-3
LIMITS = ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=400.0)
TIME = np.arange(0.0, 0.8 + STEP / 2, STEP)
REFERENCE = 30 + 10 * np.sin(3 * np.pi * TIME) * np.minimum(TIME / 0.1, 1)


@pytest.fixture(scope="module")
def chain(generic: Transmission) -> Chain:
    friction = replace(generic.friction, mu_static=0.2, mu_static_release=0.15)
    return Chain.of(replace(generic, friction=friction), Level.PRESLIDING)


@pytest.fixture(scope="module")
def planned(chain: Chain) -> Tracking:
    return track_preview(chain, REFERENCE, STEP, LIMITS, 0.3)


def test_what_lies_beyond_the_preview_changes_nothing(chain: Chain) -> None:
    """Another reference from row 110 on, of the same range: the same force up to there, less the preview."""
    rows, ahead = 131, 50
    one, other = REFERENCE[:rows].copy(), REFERENCE[:rows].copy()
    other[110:] = REFERENCE[110] + 2 * (TIME[110:rows] - TIME[110])
    other[-1] = one.min()
    plain = TrackOptions(travel_weight=0.0, static_weight=0.0)  # which are measured by the whole reference
    forces = [track_preview(chain, each, STEP, LIMITS, ahead * STEP, plain).force_N for each in (one, other)]
    differs = np.flatnonzero(forces[0] != forces[1])
    assert 110 - ahead < differs[0] < 110


def test_with_preview_for_the_dead_zone_it_is_nearly_as_good_as_knowing_all(chain: Chain, planned: Tracking) -> None:
    best = track(chain, REFERENCE, STEP, LIMITS)
    assert planned.status is TrackStatus.OPTIMAL
    assert LIMITS.admits(planned.force_N, STEP, 1e-6)
    output = simulate(chain, planned.force_N, STEP).output_tension_N
    assert np.sqrt(np.mean((output - REFERENCE) ** 2)) == pytest.approx(planned.rms_error_N, rel=1e-9)
    assert planned.rms_error_N < best.rms_error_N + 0.05 * (best.clipped_rms_error_N - best.rms_error_N)
    assert "with 0.3 s of preview" in planned.message


def test_less_preview_is_worth_less(chain: Chain, planned: Tracking) -> None:
    short = track_preview(chain, REFERENCE, STEP, LIMITS, 0.1)
    assert 1.2 * planned.rms_error_N < short.rms_error_N < 0.98 * short.clipped_rms_error_N


def test_where_no_limit_binds_no_preview_is_needed(chain: Chain) -> None:
    assert track_preview(chain, REFERENCE, STEP, replace(LIMITS, rate_N_per_s=1e6), 0.1).status is TrackStatus.EXACT


def test_a_preview_of_a_few_steps_is_refused(chain: Chain) -> None:
    with pytest.raises(ParameterError, match=r"preview_s must be at least 10 steps = 0\.04 s, got 0\.02"):
        track_preview(chain, REFERENCE, STEP, LIMITS, 0.02)
