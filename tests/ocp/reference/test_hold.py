"""Kept forces: what is kept, what the chain makes of it, and what it costs."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.parameters import Path, Transmission
from tendonff.models.path import JointMotion, Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.reference.hold import find_holds, keep_force, keep_force_to_end, last_approach
from tendonff.ocp.tendon.inverse import invert

STEP = 1e-3


def smooth(*points: tuple[float, float]) -> np.ndarray:
    """Quintic steps through (time, tension)."""
    pieces = []
    for (t0, y0), (t1, y1) in pairwise(points):
        u = np.arange(round((t1 - t0) / STEP)) * STEP / (t1 - t0)
        pieces.append(y0 + (y1 - y0) * u**3 * (10 - 15 * u + 6 * u * u))
    return np.concatenate([*pieces, [points[-1][1]]])


LIFT_AND_HOLD = smooth((0, 20), (0.4, 60), (0.8, 60), (1.1, 80), (1.4, 30))


@pytest.fixture(scope="module")
def chain(generic: Transmission) -> Chain:
    """A load with some mass: where the reference comes to rest, it would swing on."""
    friction = replace(generic.friction, mu_static=0.2, mu_static_release=0.15)
    load = replace(generic.load, mass_kg=0.05)
    return Chain.of(replace(generic, friction=friction, load=load), Level.VISCOELASTIC)


def test_holds_are_where_the_reference_rests_and_the_start_is_none() -> None:
    [(first, last)] = find_holds(smooth((0, 20), (0.1, 20), (0.4, 60), (0.8, 60), (1.1, 80)), STEP)
    assert 370 <= first <= 400
    assert 800 <= last <= 830
    assert find_holds(20 + np.sin(np.arange(3000) * STEP), STEP) == ()


@pytest.mark.parametrize(
    ("reference", "crept"),
    [
        (LIFT_AND_HOLD, True),
        (smooth((0, 20), (0.4, 60), (0.8, 60)), False),  # a hold
        (30 + 5 * np.sin(2 * np.pi * np.arange(1000) * STEP), False),  # full motion
    ],
)
def test_the_last_approach_is_a_slow_end_and_neither_a_hold_nor_motion(reference: np.ndarray, crept: bool) -> None:
    found = last_approach(reference, STEP)
    assert (found is not None) is crept
    if found is not None:
        assert found[1] == len(reference) - 1
        assert np.ptp(reference[found[0] :]) <= 1e-4 * np.ptp(reference)


def test_the_force_does_not_chatter_at_the_end_of_the_reference(chain: Chain) -> None:
    end = last_approach(LIFT_AND_HOLD, STEP)
    assert end is not None
    exact = invert(chain, LIFT_AND_HOLD, STEP).force_N
    kept = keep_force(chain, LIFT_AND_HOLD, STEP, (end,))
    assert np.ptp(exact[end[0] :]) > 3.0  # the reversal that the end cuts off
    assert np.ptp(kept.force_N[end[0] :]) == 0.0
    assert np.array_equal(kept.force_N[: end[0]], exact[: end[0]])
    assert kept.drift_N < 1e-3 * np.ptp(LIFT_AND_HOLD)


def test_an_end_under_which_the_output_drifts_is_followed(chain: Chain, generic: Transmission) -> None:
    """A load that swings on under a kept force, and one that does not."""
    quick = smooth((0, 20), (0.4, 60), (0.8, 60), (1.1, 80), (1.25, 50))
    end, holds = last_approach(quick, STEP), find_holds(quick, STEP)
    assert end is not None
    heavy = Chain.of(replace(generic, load=replace(generic.load, mass_kg=0.5)), Level.VISCOELASTIC)
    assert keep_force(heavy, quick, STEP, (end,)).drift_N > 1e-2 * np.ptp(quick)
    assert keep_force_to_end(heavy, quick, STEP, ()) is None
    kept = keep_force_to_end(heavy, quick, STEP, holds)
    assert kept is not None
    assert kept.holds == holds
    calm = keep_force_to_end(chain, LIFT_AND_HOLD, STEP, ())
    assert calm is not None
    assert calm.holds == (last_approach(LIFT_AND_HOLD, STEP),)


def test_a_kept_force_stays_spares_the_way_there_and_back_and_says_what_it_costs(chain: Chain) -> None:
    holds = find_holds(LIFT_AND_HOLD, STEP)
    exact = invert(chain, LIFT_AND_HOLD, STEP).force_N
    kept = keep_force(chain, LIFT_AND_HOLD, STEP, holds)
    [(first, last)] = holds
    assert np.ptp(kept.force_N[first : last + 1]) == 0.0
    assert np.abs(np.diff(kept.force_N)).sum() < 0.95 * np.abs(np.diff(exact)).sum()
    assert kept.drift_N == pytest.approx(np.abs(kept.followed_N - LIFT_AND_HOLD).max())
    assert 0 < kept.drift_N < 0.01 * np.ptp(LIFT_AND_HOLD)
    assert np.abs(kept.followed_N - LIFT_AND_HOLD)[last + 150 :].max() < 1e-4  # the move after it makes it good


def test_the_followed_reference_has_the_kept_force_as_its_exact_inverse(chain: Chain) -> None:
    kept = keep_force(chain, LIFT_AND_HOLD, STEP, find_holds(LIFT_AND_HOLD, STEP))
    assert invert(chain, kept.followed_N, STEP).force_N == pytest.approx(kept.force_N, abs=1e-6)


def test_on_a_path_that_moves_what_follows_a_hold_begins_where_the_joint_is_then(generic: Transmission) -> None:
    time = np.arange(len(LIFT_AND_HOLD)) * STEP
    bends = Section(name="knuckle", angle_rad=1.2, joint="q", angle_per_rad=1.0, length_per_rad_m=0.002)
    motion = JointMotion(names=("q",), time_s=time, angle_rad=0.3 * (1 - np.cos(time))[:, None])
    path = Path(total_angle_rad=1.2, segments=4, sections=(bends,))
    chain = Chain.of(replace(generic, path=path, motion=motion), Level.PRESLIDING)
    holds = find_holds(LIFT_AND_HOLD, STEP)
    kept = keep_force(chain, LIFT_AND_HOLD, STEP, holds)
    assert np.abs(kept.followed_N - LIFT_AND_HOLD)[holds[0][1] + 150 :].max() < 1e-4
