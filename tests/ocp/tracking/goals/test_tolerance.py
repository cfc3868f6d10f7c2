"""Least effort within a band: the path against a linear program, the force against a dynamic programme on the play."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from tendonff.models.capstan import CapstanLaw
from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.simulate import simulate
from tendonff.ocp.tracking.goals.tolerance import least_travel_path, track_band, turns_of
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import travel_N
from tendonff.ocp.tracking.result import TrackStatus

STEP = 2e-3
LAW = CapstanLaw(pull_exponent=0.5, release_exponent=0.4, adhesion_N=1.0)


def walk(seed: int, rows: int) -> np.ndarray:
    return 30 + np.cumsum(np.random.default_rng(seed).normal(0, 1, rows))


def least_total_variation(reference: np.ndarray, tolerance: float) -> float:
    """Linear program: rises and falls in the band, from the first reference on."""
    n = len(reference) - 1
    sums = np.tril(np.ones((n, n)))
    rows = np.block([[sums, -sums], [-sums, sums]])
    room = np.concatenate([reference[1:] + tolerance - reference[0], -(reference[1:] - tolerance - reference[0])])
    return float(linprog(np.ones(2 * n), rows, room).fun)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("tolerance", [0.3, 1.5, 50.0])
def test_the_path_stays_in_the_band_and_no_other_in_it_travels_less(seed: int, tolerance: float) -> None:
    reference = walk(seed, 60)
    path = least_travel_path(reference, tolerance)
    assert np.abs(path - reference).max() <= tolerance * (1 + 1e-12)
    assert path[0] == reference[0]
    assert travel_N(path) == pytest.approx(least_total_variation(reference, tolerance), abs=1e-9)


def least_force_travel(reference: np.ndarray, tolerance: float, forces: np.ndarray) -> float:
    """Dynamic programme: forces of a grid, and all outputs that the play makes of them."""
    states = {(30.0, 30.0): 0.0}
    for wanted in reference[1:]:
        after: dict[tuple[float, float], float] = {}
        for (force, output), cost in states.items():
            for new in (force, *forces.tolist()):
                low, high = LAW.output_bounds_N(new)
                arrived = float(np.clip(output, low, high))
                if abs(arrived - wanted) <= tolerance + 1e-9:
                    key = (new, round(arrived, 9))
                    after[key] = min(after.get(key, np.inf), cost + abs(new - force))
        states = after
    return min(states.values())


def test_by_the_static_law_no_force_travels_less_than_that_of_the_path() -> None:
    """On a grid of forces that holds those of the path; a small turn within the band is passed by."""
    reference, tolerance = np.array([30.0, 33.0, 36.0, 35.2, 38.0, 33.0, 27.0, 30.0, 34.0]), 1.0
    path = least_travel_path(reference, tolerance)
    force = LAW.input_history_N(path, 30.0)
    assert np.allclose(LAW.output_history_N(force, 30.0), path)
    peak, valley, last = 38.0 - tolerance, 27.0 + tolerance, 34.0 - tolerance
    up, down = np.exp(LAW.pull_exponent), np.exp(-LAW.release_exponent)
    high, low, end = (peak + 1) * up - 1, (valley + 1) * down - 1, (last + 1) * up - 1
    assert travel_N(force) == pytest.approx((high - 30) + (high - low) + (end - low))  # closed form
    grid = np.unique(np.concatenate([force, np.linspace(15, 65, 26)]))
    assert least_force_travel(reference, tolerance, grid) == pytest.approx(travel_N(force))


def bell(seconds: float = 1.2) -> np.ndarray:
    time = np.arange(0.0, seconds + STEP / 2, STEP)
    return 30 + 10 * np.sin(2 * np.pi * time) * np.minimum(time / 0.2, 1) + 0.6 * np.sin(16 * np.pi * time)


@pytest.fixture(scope="module")
def chain(generic: Transmission) -> Chain:
    friction = replace(generic.friction, mu_static=0.2, mu_static_release=0.15)
    return Chain.of(replace(generic, friction=friction), Level.PRESLIDING)


def test_where_no_limit_binds_the_output_is_the_path_and_the_force_turns_as_often(chain: Chain) -> None:
    reference, limits = bell(), ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=1e6)
    found = track_band(chain, reference, STEP, limits, 1.0)
    assert found.status is TrackStatus.EXACT
    assert found.departures == ()
    assert 0.9 < found.peak_error_N <= 1.0
    assert turns_of(found.force_N, 1.0) == 2  # the reference turns at each ripple
    assert "the output stays within 1 N of the reference; the force travels" in found.message


def test_where_the_rate_binds_the_band_is_kept_with_less_travel_than_following(chain: Chain) -> None:
    """Clipped, the force that no limit bounds leaves the band."""
    reference, limits = bell(), ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=250.0)
    found = track_band(chain, reference, STEP, limits, 2.0)
    assert found.status is TrackStatus.OPTIMAL
    assert limits.admits(found.force_N, STEP, 1e-6)
    output = simulate(chain, found.force_N, STEP).output_tension_N
    assert np.abs(output - reference).max() <= 2.0
    free = track_band(chain, reference, STEP, replace(limits, rate_N_per_s=1e6), 2.0)
    clipped = simulate(chain, limits.apply(free.force_N, STEP), STEP).output_tension_N
    assert np.abs(clipped - reference).max() > 2.1
    assert travel_N(found.force_N) < 1.02 * travel_N(free.force_N)


def test_a_band_that_cannot_be_kept_is_said_with_what_is_missing(chain: Chain) -> None:
    reference, limits = bell(), ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=100.0)
    found = track_band(chain, reference, STEP, limits, 0.2)
    assert found.status is TrackStatus.BEST_ACHIEVABLE
    assert "leaves the band of 0.2 N by up to" in found.message
    assert found.reasons


def test_a_tolerance_of_nothing_is_refused(chain: Chain) -> None:
    with pytest.raises(ParameterError, match=r"tolerance_N must be > 0, got 0.*leave it out"):
        track_band(chain, bell(), STEP, ForceLimits(minimum_N=0, maximum_N=300, rate_N_per_s=1e6), 0.0)
