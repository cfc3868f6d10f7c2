"""The law of the feedback against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.errors import ParameterError
from tendonff.ocp.feedback.law import FeedbackController, FeedbackLaw

LAW = FeedbackLaw(sample_s=0.005, delay_s=0.012, proportional=0.8, integral_per_s=5.0, width=0.01)
TIME = 0.005 * np.arange(600)


def wave(time):
    return 0.4 * np.sin(4.0 * time)


def test_a_measurement_that_is_the_reference_of_its_age_asks_for_nothing():
    """0.012 s are 2.4 samples: the delay line interpolates, to second order in the sample time."""
    found = FeedbackController(LAW)
    late = wave(np.maximum(TIME - LAW.delay_s, 0.0))
    corrections = [found.step(r, y) for r, y in zip(wave(TIME), late, strict=True)]
    present = FeedbackController(replace(LAW, delay_s=0.0))
    wrong = [present.step(r, y) for r, y in zip(wave(TIME), late, strict=True)]
    assert np.abs(corrections).max() < 1e-4
    assert np.abs(wrong).max() > 0.01


def test_a_constant_error_is_answered_by_kp_and_ki():
    found = FeedbackController(LAW)
    for _ in range(100):
        correction = found.step(0.0, -0.01)
    assert correction == pytest.approx(0.8 * 0.01 + 5.0 * 0.01 * 100 * 0.005, rel=1e-12)


def test_the_integral_does_not_wind_up_at_the_clamp():
    found = FeedbackController(replace(LAW, clamp=0.02))
    for _ in range(1000):
        assert found.step(0.0, -1.0) == pytest.approx(0.02)
    for _ in range(2):
        correction = found.step(0.0, 0.01)
    assert correction < 0.02


def test_errors_within_the_deadband_are_ignored():
    found = FeedbackController(replace(LAW, deadband=0.001))
    assert found.step(0.0, 0.0009) == 0.0
    assert found.step(0.0, -0.003) == pytest.approx((0.8 + 5.0 * 0.005) * 0.002)


def test_a_missing_measurement_holds_the_correction_and_a_missing_reference_the_last_one():
    found = FeedbackController(LAW)
    held = [found.step(0.1, 0.0) for _ in range(50)][-1]
    assert [found.step(0.1, math.nan) for _ in range(20)] == [held] * 20
    assert math.isfinite(found.step(math.nan, 0.0))


def test_what_was_learned_one_way_is_turned_round_where_the_reference_turns():
    """An error of the sign of the motion: once learned, the correction follows it through a reversal at once."""
    shaped = FeedbackController(replace(LAW, friction_share=1.0, delay_s=0.0, width=0.002))
    plain = FeedbackController(replace(LAW, delay_s=0.0))
    reference = wave(TIME)
    friction = 0.02 * np.sign(np.gradient(reference))
    left = {}
    for name, found in (("shaped", shaped), ("plain", plain)):
        last, errors = 0.0, []
        for r, d in zip(reference, friction, strict=True):
            errors.append(r - d + last)  # a plant that follows, less friction
            last = found.step(float(r), errors[-1])
        left[name] = np.sqrt(np.mean((np.array(errors) - reference)[300:] ** 2))
    assert left["shaped"] < 0.55 * left["plain"]


@pytest.mark.parametrize("true_s", [0.006, 0.012, 0.020])
def test_the_age_of_the_measurement_is_learned_beside_friction(true_s):
    found = FeedbackController(replace(LAW, friction_share=0.5, stroke=0.2, error_scale=0.005))
    reference = wave(TIME)
    reached = reference - 0.005 * np.sign(np.gradient(reference))
    corrected = np.zeros(len(TIME) + 1)
    for k, r in enumerate(reference):
        seen = np.interp(TIME[k] - true_s, TIME[: k + 1], reached[: k + 1] + corrected[: k + 1])
        corrected[k + 1] = found.step(float(r), float(seen))
    assert found.age_s == pytest.approx(true_s, abs=0.002)


def test_a_delay_beyond_the_delay_line_is_refused_with_the_bound():
    with pytest.raises(ParameterError, match=r"delay_s must be at most 255 samples, 1.275 s, got 2"):
        replace(LAW, delay_s=2.0)
