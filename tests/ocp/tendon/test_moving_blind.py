"""Moving paths on a plant of another make: 60 masses in four sections, two of which joints move."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.optimal.track import track
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.result import TrackStatus
from tests.moving_plant import moving_finger, moving_output

Array = NDArray[np.float64]
STEP = 1e-3
TIME = np.arange(0.0, 2.0, STEP)
REFERENCE = 30 + np.minimum(TIME / 0.5, 1) * (12 * np.sin(2 * np.pi * 0.9 * TIME) + 4 * np.sin(2 * np.pi * 2.1 * TIME))


@pytest.fixture(scope="module")
def finger(generic: Transmission) -> Transmission:
    return moving_finger(generic, TIME, segments=24)


def error(finger: Transmission, force_N: Array, finer: int) -> float:
    """RMS error on the other plant at a finer step, % of range."""
    rows = np.arange(len(TIME))
    force = np.interp(np.arange((len(rows) - 1) * finer + 1) / finer, rows, force_N)
    output = moving_output(finger, force, STEP / finer, 15)[::finer]
    return float(100 * np.sqrt(np.mean((output - REFERENCE) ** 2)) / np.ptp(REFERENCE))


@pytest.mark.compiler
@pytest.mark.slow
def test_inverse_and_optimal_profile_follow_where_a_design_for_the_path_at_rest_does_not(
    finger: Transmission, record_property: pytest.FixtureRequest
) -> None:
    chain = Chain.of(finger, Level.PRESLIDING)
    limits = ForceLimits(minimum_N=0.0, maximum_N=200.0, rate_N_per_s=1e5)
    inverse, optimal = invert(chain, REFERENCE, STEP), track(chain, REFERENCE, STEP, limits)
    found = error(finger, inverse.force_N, 2)
    still = error(finger, invert(chain.at_rest(), REFERENCE, STEP).force_N, 2)
    record_property("figure", f"moving path, blind on 60 masses: {found:.2f} % of range, at rest {still:.0f} %")  # type: ignore[operator]
    assert optimal.status is TrackStatus.EXACT
    assert optimal.force_N == pytest.approx(inverse.force_N, abs=1e-9)
    assert found < 0.4
    assert still > 20


@pytest.mark.compiler
@pytest.mark.slow
def test_where_the_rate_binds_the_optimal_profile_leaves_less_than_half_of_the_clipped_inverse(
    finger: Transmission, record_property: pytest.FixtureRequest
) -> None:
    """At half the step: the other plant is of first order, and adds 0.2 % of range to the optimal profile."""
    chain, limits = (
        Chain.of(finger, Level.PRESLIDING),
        ForceLimits(minimum_N=0.0, maximum_N=200.0, rate_N_per_s=250.0),
    )
    inverse, optimal = invert(chain, REFERENCE, STEP), track(chain, REFERENCE, STEP, limits)
    clipped, best = (error(finger, force, 2) for force in (limits.apply(inverse.force_N, STEP, 30.0), optimal.force_N))
    record_property("figure", f"moving path, 250 N/s: optimal {best:.2f} %, clipped inverse {clipped:.2f} % of range")  # type: ignore[operator]
    assert clipped > 3
    assert best < 0.5 * clipped
