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
    """An error of the sign of the motion: once learned, the correction follows it through a reversal at once, by
    the play of the reference or by the shape that comes with each sample.
    """
    learning = replace(LAW, delay_s=0.0, width=0.0002, error_scale=0.02)
    reference, way = wave(TIME), np.sign(np.gradient(wave(TIME)))
    late, left = (way == np.roll(way, 4)) & (TIME > 1.5), {}
    for name, law in (("play", learning), ("streamed", replace(learning, streamed=True)), ("plain", learning.plain())):
        found, last, errors = FeedbackController(law), 0.0, []
        for r, s in zip(reference, way, strict=True):
            errors.append(r - 0.02 * s + last)  # a plant that follows, less friction
            last = found.step(float(r), errors[-1], float(s) if law.streamed else 0.0)
        left[name] = np.sqrt(np.mean((np.array(errors) - reference)[late] ** 2))
    assert left["play"] < 0.3 * left["plain"]
    assert left["streamed"] < 0.3 * left["plain"]


def beside(law, error, *, true_s, lag_s=0.02):
    """Errors of a joint behind a servo whose feedforward leaves this error, and the controller at the end."""
    found, reference = FeedbackController(law), wave(TIME)
    reached, follow = np.zeros(len(TIME)), 1 - math.exp(-LAW.sample_s / lag_s)
    moved = 0.0
    for k, r in enumerate(reference):
        reached[k] = r + error[k] + moved
        moved += follow * (found.step(float(r), float(np.interp(TIME[k] - true_s, TIME, reached))) - moved)
    return reached - reference, found


LEARNING = replace(LAW, lag_s=0.02, stroke=0.05, width=0.002, error_scale=0.005, half_range=0.4)
FRICTION = -0.005 * np.sign(np.gradient(wave(TIME)))


@pytest.mark.parametrize("true_s", [0.0, 0.006, 0.012, 0.020, 0.024])
def test_the_age_of_the_measurement_is_learned_beside_friction(true_s):
    _, found = beside(LEARNING, FRICTION, true_s=true_s)
    assert found.age_s == pytest.approx(true_s, abs=0.001)


def test_an_error_that_grows_with_the_reference_is_learned_beside_friction():
    """Once learned it is corrected before it is measured; integrals follow it late."""
    error = FRICTION - 0.003 - 0.01 * wave(TIME) / 0.4
    late = TIME > 1.5
    learned, plain = (
        np.sqrt(np.mean(beside(law, error, true_s=0.012)[0][late] ** 2)) for law in (LEARNING, LEARNING.plain())
    )
    assert learned < 0.25 * np.sqrt(np.mean(error[late] ** 2))
    assert learned < 0.45 * plain


@pytest.mark.parametrize("of_the_joint", [True, False])
def test_a_small_error_of_the_rate_is_the_joint_s_and_a_large_one_an_age(of_the_joint):
    """0.5 ms: with a bound of 1 ms it is corrected, with none it is taken for a measurement that is younger."""
    law = replace(LEARNING, rate_error_s=0.001 if of_the_joint else 0.0)
    error = -0.0005 * np.gradient(wave(TIME), LAW.sample_s)
    left = beside(law, error, true_s=LAW.delay_s)[0][TIME > 1.5]
    share = np.sqrt(np.mean(left**2) / np.mean(error[TIME > 1.5] ** 2))
    assert (share < 0.25) if of_the_joint else (share > 0.7)


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_friction_of_a_wrap_that_is_a_fifth_off_is_learned_from_logarithms(factor):
    """Capstan: the logarithm of the tension follows that of the force with a play of mu theta, 0.6 by the model."""
    logarithm, way = np.log(20.0 + 8.0 * np.sin(4.0 * TIME)), np.sign(np.cos(4.0 * TIME))
    law = replace(LAW, streamed=True, delay_s=0.005, error_scale=0.1, deviations=(4.0, 0.3, 0.3), stroke=0.1)
    law = replace(law, width=0.003, middle=3.0, half_range=0.4, proportional=0.2)
    left = {}
    for name, told in (("feedforward", law.scaled(0.0).plain()), ("both", law)):
        found, tension, errors, before = FeedbackController(told, logarithm[0]), logarithm[0], [], logarithm[0]
        for wanted, shape in zip(logarithm, 0.6 * way, strict=True):
            force = wanted + shape + found.step(float(wanted), float(before), float(shape))
            before, tension = tension, np.clip(tension, force - 0.6 * factor, force + 0.6 * factor)
            errors.append(np.exp(tension) - np.exp(wanted))
        left[name] = np.sqrt(np.mean(np.square(errors)))
    assert left["both"] < 0.4 * left["feedforward"]


def test_at_rest_nothing_is_learned():
    """There the correction of a constant error grows by the integral alone."""
    found = FeedbackController(LEARNING)
    moved = [found.step(float(r), float(r)) for r in wave(TIME[:40])]
    still = float(wave(TIME[39]))
    held = [found.step(still, still - 0.01) for _ in range(100)]
    assert moved[0] == 0.0
    assert held[-1] - held[-51] == pytest.approx(50 * LAW.integral_per_s * LAW.sample_s * 0.01, rel=1e-9)


def test_a_delay_beyond_the_delay_line_is_refused_with_the_bound():
    with pytest.raises(ParameterError, match=r"delay_s must be at most 255 samples, 1.275 s, got 2"):
        replace(LAW, delay_s=2.0)
