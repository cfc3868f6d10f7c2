"""What is left of noise on the input, which friction would remember, and how it is taken out."""

import numpy as np
import pytest

from tendonff.compensator.identification.measured.smoothing import without_ripple


def test_ripple_goes_and_turning_points_stay():
    clean = np.concatenate([np.linspace(10, 50, 400), np.full(300, 50.0), np.linspace(50, 20, 300)])
    ripple = 0.2 * np.sin(np.arange(1000) / 7)
    smooth = without_ripple(clean + ripple, 0.5)
    top = int(np.argmax(smooth))
    assert np.all(np.diff(smooth[:top]) >= 0)
    assert np.all(np.diff(smooth[top + 1 :]) <= 0)
    assert np.abs(smooth - clean).max() < 0.25
    assert smooth.max() == pytest.approx(50.2, abs=0.01)  # an extreme is where it was measured


def test_a_reversal_of_more_than_the_ripple_is_kept():
    x = np.concatenate([np.linspace(0, 10, 100), np.linspace(10, 9, 20), np.linspace(9, 12, 40)])
    np.testing.assert_array_equal(without_ripple(x, 0.9), x)
    assert np.all(np.diff(without_ripple(x, 1.1)) >= 0)


@pytest.mark.parametrize("sign", [1, -1])
def test_what_never_turns_is_left_alone(sign):
    x = sign * np.linspace(0, 1, 50)
    np.testing.assert_array_equal(without_ripple(x, 0.1), x)
    falls_first = sign * np.concatenate([np.linspace(1, 0, 50), np.linspace(0, 2, 50)])
    np.testing.assert_array_equal(without_ripple(falls_first, 0.1), falls_first)
