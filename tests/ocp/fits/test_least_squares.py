"""Least squares and its statement about its own uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.least_squares import (
    Residuals,
    Unknown,
    after_a_step,
    block_covariance,
    minimise,
    softened,
    solve,
)

TIME = np.linspace(0, 1, 400)
UNKNOWNS = [
    Unknown(name="a", start=1.0, low=-10, high=10, scale=1),
    Unknown(name="b", start=0.5, low=1e-3, high=1e3, scale=1, logarithmic=True),
]


def line(measured, extra=None):
    def evaluate(values):
        slopes = np.stack([np.ones_like(TIME), TIME], axis=1)
        if extra is not None:
            slopes = np.column_stack([slopes, extra])
        model = values["a"] + values["b"] * TIME
        return Residuals(values=model - measured, slopes=slopes, blocks=np.arange(len(TIME)) // 10)

    return evaluate


def test_intervals_hold_the_truth_as_often_as_they_say_although_the_noise_is_correlated():
    rng = np.random.default_rng(1)
    hits = []
    for _ in range(60):
        noise = np.repeat(rng.normal(0, 0.05, 40), 10)  # constant within a block
        found = solve(line(2 + 3 * TIME + noise), UNKNOWNS)
        low, high = found.interval("b")
        hits.append(low <= 3 <= high)
    assert 0.85 <= np.mean(hits) <= 1.0


def test_an_outlier_hardly_moves_a_robust_fit():
    measured = 2 + 3 * TIME
    measured[17] += 1000
    assert solve(line(measured), UNKNOWNS).values["b"] == pytest.approx(3, abs=0.1)
    assert solve(line(measured), UNKNOWNS, robust=False).values["b"] != pytest.approx(3, abs=0.1)


def test_a_direction_that_the_data_does_not_see_has_no_standard_error():
    """Two unknowns that only act together."""
    twin = Unknown(name="c", start=0.0, low=-10, high=10, scale=1)
    found = solve(line(2 + 3 * TIME + 0.01 * np.sin(40 * TIME), extra=TIME), [*UNKNOWNS, twin])
    assert found.standard_error("b") == np.inf
    assert found.standard_error("c") == np.inf
    assert np.isfinite(found.standard_error("a"))


def test_an_unknown_on_its_bound_is_named():
    found = solve(line(-1 + 3 * TIME), [Unknown(name="a", start=1.0, low=0, high=10, scale=1), UNKNOWNS[1]])
    assert found.at_bound == ("a",)


def test_a_model_without_a_finite_answer_is_an_error_that_says_where_to_look():
    with pytest.raises(SolveError, match="check units and signs"):
        solve(line(np.full_like(TIME, np.nan)), UNKNOWNS)


def test_a_value_whose_blocks_show_no_scatter_has_the_variance_of_independent_rows():
    rng = np.random.default_rng(0)
    slopes = np.zeros((40, 2))
    slopes[:20, 0], slopes[20:, 1] = 1e-12, 1.0  # the first value's rows are explained to the last digit
    values = np.concatenate([np.full(20, 0.0), rng.standard_normal(20)])
    rows = Residuals(values=values, slopes=slopes, blocks=np.arange(40) // 4)
    covariance, degrees = block_covariance(rows, robust=False)
    variance = (values**2).sum() / 38
    assert degrees == 8
    assert covariance[0, 0] == pytest.approx(variance / (20 * 1e-24))
    assert covariance[1, 1] >= variance / 20
    assert covariance[0, 1] == 0


def test_a_nearly_blind_value_without_scatter_overflows_nothing():
    slopes = np.ones((40, 2))
    slopes[20:, 0] += 1e-8  # singular values 5e-9 apart
    values = np.tile([3.0, -3.0], 20)  # every block's gradient is zero
    covariance, _ = block_covariance(Residuals(values=values, slopes=slopes, blocks=np.arange(40) // 4), robust=False)
    assert (np.diag(covariance) > 0).all()


def test_points_that_are_worse_than_the_one_before_cost_no_slopes():
    """A valley as of Rosenbrock: some steps go too far."""
    asked = []

    def off(values):
        asked.append("values")
        return np.array([10 * (values["b"] - values["a"] ** 2), 1 - values["a"]])

    def evaluate(values):
        asked.append("slopes")
        slopes = np.array([[-20 * values["a"], 10.0], [-1.0, 0.0]])
        return Residuals(values=off(values), slopes=slopes, blocks=np.arange(2))

    unknowns = [Unknown(name=name, start=at, low=-5, high=5, scale=1) for name, at in (("a", -1.2), ("b", 1.0))]
    plain = solve(evaluate, unknowns, robust=False)
    every = asked.count("slopes")
    asked.clear()
    found = solve(evaluate, unknowns, values=off, robust=False)
    assert found.values == plain.values == pytest.approx({"a": 1.0, "b": 1.0})
    assert asked.count("slopes") < every


def far(values):
    """A curve whose error at the start is thousands of times its noise, and grows without bound at small b."""
    model = values["a"] * np.exp(values["b"] * TIME)
    measured = 2e3 * np.exp(1.5 * TIME) + np.sin(np.arange(len(TIME)))
    slopes = np.stack([np.exp(values["b"] * TIME), model * TIME], axis=1)
    return Residuals(values=model - measured, slopes=slopes, blocks=np.arange(len(TIME)) // 10)


FAR = [
    Unknown(name="a", start=500.0, low=1, high=1e6, scale=0.5, logarithmic=True),
    Unknown(name="b", start=3.0, low=1e-3, high=10, scale=0.5),
]


def test_a_search_from_afar_ends_where_the_usual_one_does_in_half_the_evaluations():
    def searched(*, from_afar):
        count = []

        def counting(values):
            count.append(values)
            return far(values)

        return minimise(counting, FAR, from_afar=from_afar, most=200, tolerance=1e-10), len(count)

    (found, few), (usual, many) = (searched(from_afar=each) for each in (True, False))
    assert found.values == pytest.approx(usual.values, rel=1e-6)
    assert found.cost == pytest.approx(usual.cost, rel=1e-6)
    assert 2 * few <= many, (few, many)


def test_softened_residuals_have_the_loss_for_their_squares():
    residuals = np.array([-1e6, -3.0, 0.0, 1e-9, 0.5, 40.0])
    soft, slope = softened(residuals)
    assert soft**2 / 2 == pytest.approx(np.sqrt(1 + residuals**2) - 1, rel=1e-12, abs=1e-15)
    assert np.sign(soft).tolist() == np.sign(residuals).tolist()
    step = 1e-6 * np.maximum(np.abs(residuals), 1.0)
    differences = (softened(residuals + step)[0] - softened(residuals - step)[0]) / (2 * step)
    assert slope == pytest.approx(differences, rel=1e-6)


def test_a_search_steps_back_from_where_there_is_no_answer():
    def bounded(values):
        found = far(values)
        return found if values["b"] < 3.5 else replace(found, values=np.full_like(found.values, np.nan))

    begun = [FAR[0], replace(FAR[1], start=3.4, scale=30.0)]
    found = minimise(bounded, begun, from_afar=True, most=200, tolerance=1e-10)
    assert found.values["b"] == pytest.approx(1.5, abs=1e-3)


def test_what_a_step_would_leave_is_exact_where_residuals_are_linear():
    rows = line(2 + 3 * TIME)({"a": 1.0, "b": 1.0})
    assert after_a_step(rows) == pytest.approx(0.0, abs=1e-12)
    assert np.sum(np.sqrt(1 + rows.values**2) - 1) > 1


@pytest.mark.parametrize("high", [10.0, 1.5])
def test_known_residuals_of_the_start_save_its_evaluation_unless_a_bound_moves_it(high):
    asked = []

    def evaluate(values):
        asked.append(values["x"])
        return Residuals(
            values=np.array([values["x"] - 1.0, 0.5]), slopes=np.array([[1.0], [0.0]]), blocks=np.arange(2)
        )

    unknown = Unknown(name="x", start=2.0, low=0.0, high=high, scale=1.0)
    begun = evaluate({"x": 2.0})
    asked.clear()
    found = minimise(evaluate, [unknown], begun=begun)
    assert found.values["x"] == pytest.approx(1.0)
    assert (asked[0] == high) == (high < 2.0)
    assert 2.0 not in asked
