from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.uncertainty import Objective, Uncertainty
from tendonff.ocp.inverse import invert
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.robust import error_band, sample_transmissions, track_robust

STEP = 2e-3
TIME = np.arange(0, 1 + STEP / 2, STEP)
REFERENCE = 30 + 10 * np.sin(2 * np.pi * TIME) * np.minimum(TIME / 0.1, 1)
LIMITS = ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=400.0)
UNSURE = Uncertainty(mu=0.2, stiffness=0.1, bristle_stiffness=0.3, samples=4)


def test_samples_stay_within_their_ranges_and_start_with_what_is_known(generic: Transmission) -> None:
    samples = sample_transmissions(generic, replace(UNSURE, samples=50))
    assert samples[0].transmission == generic
    assert {samples[1].mu, samples[2].mu} == {0.8, 1.2}
    for name, width in (("mu", 0.2), ("stiffness", 0.1), ("bristle_stiffness", 0.3)):
        factors = np.array([getattr(s, name) for s in samples])
        assert np.all(np.abs(factors - 1) <= width + 1e-12)
        assert float(np.ptp(factors)) > 1.8 * width  # the hypercube reaches into its corners
    last = samples[-1]
    assert last.transmission.friction.mu_static == pytest.approx(generic.friction.mu_static * last.mu)
    assert last.transmission.tendon.stiffness_N_per_m == pytest.approx(
        generic.tendon.stiffness_N_per_m * last.stiffness
    )


def test_samples_depend_on_the_seed_alone(generic: Transmission) -> None:
    many = replace(UNSURE, samples=8)
    assert sample_transmissions(generic, many) == sample_transmissions(generic, many)
    assert sample_transmissions(generic, many) != sample_transmissions(generic, replace(many, seed=1))


def test_certainty_needs_one_sample(generic: Transmission) -> None:
    assert len(sample_transmissions(generic, Uncertainty(samples=9))) == 1


def test_friction_overestimated_makes_the_output_swing_more_than_asked(generic: Transmission) -> None:
    """Over-compensation: the exact inverse of the nominal rig on rigs with less friction."""
    samples = sample_transmissions(generic, replace(UNSURE, stiffness=0.0, bristle_stiffness=0.0, samples=3))
    force = invert(Chain.of(generic, Level.PRESLIDING), REFERENCE, STEP).force_N
    band = error_band(samples, Level.PRESLIDING, force, REFERENCE, STEP)
    assert band.nominal_rms_N < 1e-6
    assert band.amplified_sample.mu == pytest.approx(0.8)
    assert band.amplification > 0.05
    assert band.least_rms_N <= band.median_rms_N <= band.worst_rms_N <= band.worst_peak_N


def test_the_robust_profile_is_better_in_the_case_it_is_made_for(generic: Transmission) -> None:
    samples = sample_transmissions(generic, UNSURE)
    bands = {}
    for objective in Objective:
        found = track_robust(samples, Level.PRESLIDING, REFERENCE, STEP, LIMITS, objective)
        assert LIMITS.admits(found.force_N, STEP, 1e-6)
        assert "worst of 4 plants" in found.message
        bands[objective] = error_band(samples, Level.PRESLIDING, found.force_N, REFERENCE, STEP)
    chain = Chain.of(generic, Level.PRESLIDING)
    plain = LIMITS.apply(invert(chain, REFERENCE, STEP).force_N, STEP)
    clipped = error_band(samples, Level.PRESLIDING, plain, REFERENCE, STEP)
    assert bands[Objective.WORST].worst_rms_N < 0.97 * clipped.worst_rms_N
    assert bands[Objective.WORST].worst_rms_N <= bands[Objective.MEAN].worst_rms_N


def test_a_half_width_of_one_is_refused() -> None:
    with pytest.raises(ParameterError, match="mu must be a finite number >= 0 and < 1, got 1"):
        Uncertainty(mu=1.0)
