"""Elongation of a visco-elastic tendon."""

import numpy as np
import pytest

from tendonff.ocp.fits.elongation import elongation

K1, K2, TAU, STEP = 1.5e4, 6e3, 0.4, 1e-3
TIME = np.arange(0, 4, STEP)


def test_a_held_step_creeps_as_the_closed_form():
    """x = F/k1 - F (1/k1 - 1/(k1 + k2)) e^{-t/tau_c}, tau_c = tau (k1 + k2)/k1."""
    force = np.where(TIME > 0, 50.0, 0.0)
    found = elongation((K1, K2, TAU), force, STEP).elongation_m
    creep = np.exp(-(TIME - STEP / 2) / (TAU * (K1 + K2) / K1))
    expected = 50 / K1 - 50 * (1 / K1 - 1 / (K1 + K2)) * creep
    np.testing.assert_allclose(found[1:], expected[1:], rtol=1e-3)


@pytest.mark.parametrize("which", [0, 1, 2])
def test_slopes_are_the_derivatives(which):
    force = 30 + 20 * np.sin(3 * TIME)
    numbers = [K1, K2, TAU]
    step = 1e-5 * numbers[which]

    def at(value):
        changed = list(numbers)
        changed[which] = value
        return elongation(tuple(changed), force, STEP).elongation_m

    expected = (at(numbers[which] + step) - at(numbers[which] - step)) / (2 * step)
    found = elongation((K1, K2, TAU), force, STEP).slopes[:, which]
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())
