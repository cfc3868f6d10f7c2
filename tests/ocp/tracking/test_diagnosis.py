import math

import numpy as np
import pytest

from tendonff.models.capstan import CapstanLaw
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tracking.diagnosis import departures, law_of, reasons, reversals
from tendonff.ocp.tracking.limits import ForceLimits

STEP = 1e-3
LAW = CapstanLaw(pull_exponent=0.62, release_exponent=0.62)
OPEN = ForceLimits(minimum_N=0.0, maximum_N=1e3, rate_N_per_s=1e6)


def why(reference: np.ndarray, limits: ForceLimits, low: float = 0.0, high: float = math.inf) -> str:
    return " ".join(reasons(LAW, reference, reference, STEP, limits, low, high))


def test_the_law_of_a_chain_is_the_law_of_its_transmission(generic: Transmission) -> None:
    law, whole = law_of(Chain.of(generic, Level.ELASTIC, 7)), CapstanLaw.of(generic)
    assert law.pull_exponent == pytest.approx(whole.pull_exponent, rel=1e-12)
    assert law.release_exponent == pytest.approx(whole.release_exponent, rel=1e-12)
    assert law.adhesion_N == whole.adhesion_N


def test_reversals_ignore_ripple_below_one_per_cent_of_the_range() -> None:
    time = np.arange(0, 2, STEP)
    course = np.sin(2 * np.pi * time) + 0.002 * np.sin(400 * time)
    assert (reversals(course) * STEP).tolist() == pytest.approx([0.25, 0.75, 1.25, 1.75], abs=0.02)


def test_a_rise_that_is_too_fast_is_named_with_its_time_and_both_rates() -> None:
    """80 N/s e^{0.62} = 149 N/s."""
    reference = 20 + np.concatenate([np.zeros(1300), np.arange(200) * 80 * STEP])
    text = why(reference, ForceLimits(minimum_N=0.0, maximum_N=1e3, rate_N_per_s=100.0))
    assert "rises at 80 N/s at t = 1.3" in text
    assert "through e^(mu theta) = 1.86 that needs 149 N/s at the actuator, limit 100" in text


def test_a_reversal_is_explained_by_how_long_the_output_stands_still() -> None:
    """At 40 N the force travels 40 (e^0.62 - e^-0.62) = 52.8 N: 0.53 s at 100 N/s."""
    time = np.arange(0, 1, STEP)
    text = why(40 - 10 * np.abs(2 * time - 1), ForceLimits(minimum_N=0.0, maximum_N=1e3, rate_N_per_s=100.0))
    assert "1 of 1 reversals" in text
    assert "most at t = 0.5 s: 52.8 N, at 100 N/s that takes 0.528 s" in text


def test_a_plateau_that_gives_the_force_its_time_is_no_reason() -> None:
    """At 40 N the force travels 52.8 N: half a second of plateau is enough at 110 N/s and too short at 100 N/s.

    The reversal is found at an end of the plateau, so what counts is the time on both sides of it together.
    """
    rise = np.linspace(30.0, 40.0, 500)
    reference = np.concatenate([rise, np.full(490, 40.0), rise[::-1]])
    limits = [ForceLimits(minimum_N=0.0, maximum_N=1e3, rate_N_per_s=rate) for rate in (100.0, 110.0)]
    short, enough = (why(reference, limit) for limit in limits)
    assert "a rate limit of 10" in short
    assert "a rate limit of" not in enough


def test_a_lower_bound_of_the_force_is_explained_as_what_no_release_goes_below() -> None:
    """Not as a tension that remains: an output that never rose above 20 e^0.62 = 37.2 N is not held there."""
    text = why(np.linspace(30.0, 14.0, 500), ForceLimits(minimum_N=20.0, maximum_N=1e3, rate_N_per_s=1e6))
    assert "no release there brings the output below 37.18 N" in text


def test_nothing_is_explained_where_nothing_stands_in_the_way() -> None:
    assert why(np.linspace(20.0, 30.0, 500), OPEN) == ""


def test_bounds_on_the_tension_are_explained_in_their_own_names() -> None:
    reference = np.linspace(40.0, 30.0, 500)
    assert "minimum_tension_N is 20" in why(reference, OPEN, low=20.0)
    assert "maximum_tension_N is 60" in why(reference, OPEN, high=60.0)


def test_departures_are_stretches_with_their_signed_peak() -> None:
    reference = np.linspace(0.0, 10.0, 1001)
    output = reference.copy()
    output[200:300] -= 0.5
    output[250] -= 0.1
    output[700:710] += 0.3
    below, above = departures(output, reference, STEP)
    assert (below.start_s, below.end_s, below.peak_time_s) == pytest.approx((0.2, 0.299, 0.25))
    assert (below.peak_error_N, above.peak_error_N) == pytest.approx((-0.6, 0.3))
    assert "up to 0.6 N below the reference" in str(below)
    assert departures(reference, reference, STEP) == ()
