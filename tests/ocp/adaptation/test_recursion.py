"""The update against least squares solved at once."""

import casadi as ca
import numpy as np
import pytest

from tendonff.ocp.adaptation.recursion import CLIP, covariance_names, update_law

R, DEVIATION, START, LOW, HIGH = 0.7, 0.2, 0.3, 0.5, 2.0


def step(count, f, P, e, s, weight, drift=0.0):
    """One update; P as a full matrix."""
    entries = [P[int(name[1]), int(name[2])] for name in covariance_names(count)]
    out = update_law(count).function()(e, weight, *s, *f, *entries, R, DEVIATION, drift, START, LOW, HIGH)
    values = [float(ca.DM(v)) for v in out]
    new = np.zeros((count, count))
    for name, value in zip(covariance_names(count), values[count:-1], strict=True):
        i, j = int(name[1]), int(name[2])
        new[i, j] = new[j, i] = value
    return np.array(values[:count]), new, values[-1]


@pytest.mark.parametrize("count", [1, 2])
def test_without_forgetting_the_recursion_is_weighted_least_squares(count):
    """Small errors, so that nothing is clipped: the same answer as the normal equations with the start as prior."""
    rng = np.random.default_rng(1)
    truth = np.array([1.03, 0.98])[:count]
    S, w = rng.normal(size=(50, count)), rng.uniform(0.1, 1.0, 50)
    y = S @ (truth - 1) + 0.01 * rng.normal(size=50)
    f, P = np.ones(count), START**2 * np.eye(count)
    for row, weight, measured in zip(S, w, y, strict=True):
        f, P, _ = step(count, f, P, measured - row @ (f - 1), row, weight)
    information = (S * w[:, None]).T @ S / R + np.eye(count) / START**2
    assert f == pytest.approx(1 + np.linalg.solve(information, (S * w[:, None]).T @ y / R), rel=1e-9)
    assert np.linalg.inv(P) == pytest.approx(information, rel=1e-9)


def test_with_the_gate_closed_nothing_moves():
    P = np.array([[0.02, 0.005], [0.005, 0.03]])
    f, new, _ = step(2, (1.1, 0.9), P, 5.0, (3.0, -2.0), 0.0, drift=0.1)
    assert f == pytest.approx([1.1, 0.9], abs=0)
    assert new == pytest.approx(P, abs=0)


def test_an_error_counts_up_to_three_deviations_of_what_is_possible():
    far, farther = (step(1, (1.0,), np.array([[1e-4]]), e, (2.0,), 1.0)[0][0] for e in (3.0, 300.0))
    limit = CLIP * np.sqrt(4e-4 + DEVIATION**2)
    assert far == farther == pytest.approx(1 + 2e-4 / (4e-4 + R) * limit)


def test_estimates_stay_within_their_range_and_the_variance_below_that_of_the_start():
    f, P, _ = step(1, (1.9,), np.array([[0.09]]), 50.0, (9.0,), 1.0, drift=1.0)
    assert f[0] == HIGH
    assert P[0, 0] == pytest.approx(START**2)


def test_scaling_a_variance_back_keeps_the_correlation():
    P = np.array([[0.09, 0.03], [0.03, 0.04]])
    _, new, _ = step(2, (1.0, 1.0), P, 0.0, (0.0, 0.0), 1.0, drift=0.02)
    assert new[0, 0] == pytest.approx(0.09)
    assert new[0, 1] / np.sqrt(new[0, 0] * new[1, 1]) == pytest.approx(0.03 / np.sqrt(0.11 * 0.06))


def test_the_spread_is_the_variance_that_the_factors_explain():
    P = np.array([[0.02, 0.005], [0.005, 0.03]])
    s = np.array([3.0, -2.0])
    assert step(2, (1.0, 1.0), P, 0.0, s, 1.0)[2] == pytest.approx(s @ P @ s)
