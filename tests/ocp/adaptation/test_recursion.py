"""The update against least squares solved at once."""

import casadi as ca
import numpy as np
import pytest

from tendonff.ocp.adaptation.recursion import (
    CLIP,
    CURVED,
    FARTHEST,
    KNOWN,
    LEAST,
    MOST,
    RECALL,
    TRUST,
    Prior,
    covariance_names,
    return_law,
    trust_law,
    update_law,
)

R, DEVIATION, START, LOW, HIGH, QUICK, LONG, SLEW = 0.7, 0.2, 0.3, 0.5, 2.0, 0.05, 0.02, 10.0


def update(count, f, P, e, s, weight, *, spreads=(), priors=(), b=(), exponent=None, **given):
    """One update by name of the output; P as a full matrix."""
    law = update_law(count, spreads, priors, exponent)
    entries = [P[int(name[1]), int(name[2])] for name in covariance_names(count + len(spreads))]
    known = {"mean": 0.0, "lasting": 0.0, "level": 1.0, "drift": 0.0, "slew": SLEW} | given
    known |= {"quick": QUICK, "long_share": LONG, "R": R, "deviation": DEVIATION, "start": START}
    known |= {"low": LOW, "high": HIGH}
    numbers = [known[symbol.name()] for symbol in law.inputs if symbol.name() in known]
    out = law.function()(e, weight, *s, *f, *b, *entries, *numbers)
    return dict(zip(law.outputs, (float(ca.DM(v)) for v in out), strict=True))


def step(count, f, P, e, s, weight, **numbers):
    """Factors, covariance and surprise of one update."""
    found = update(count, f, P, e, s, weight, **numbers)
    new = np.zeros((len(s), len(s)))
    for name in covariance_names(len(s)):
        i, j = int(name[1]), int(name[2])
        new[i, j] = new[j, i] = found[f"{name}_new"]
    return np.array([found[f"f{k}_new"] for k in range(count)]), new, found["surprise"]


@pytest.mark.parametrize("count", [1, 2])
def test_without_forgetting_the_recursion_is_weighted_least_squares(count):
    """Small errors, so that nothing is clipped and hardly anything moves: normal equations, the start as prior."""
    rng = np.random.default_rng(1)
    truth = 1 + 1e-6 * np.array([3.0, -2.0])[:count]
    S, w = rng.normal(size=(50, count)), rng.uniform(0.1, 1.0, 50)
    y = S @ (truth - 1) + 1e-6 * rng.normal(size=50)
    f, P = np.ones(count), START**2 * np.eye(count)
    for row, weight, measured in zip(S, w, y, strict=True):
        f, P, _ = step(count, f, P, measured - row @ (f - 1), row, weight)
    information = (S * w[:, None]).T @ S / R + np.eye(count) / START**2
    expected = np.linalg.solve(information, (S * w[:, None]).T @ y / R)
    assert f - 1 == pytest.approx(expected, rel=1e-3, abs=1e-11)
    assert np.linalg.inv(P) == pytest.approx(information, rel=1e-3, abs=1e-3)


def test_an_exponent_beside_the_factor_is_weighted_least_squares_of_both():
    """What the second stage takes from the estimate without an exponent leaves that of the normal equations with it."""
    rng = np.random.default_rng(2)
    S, S_n, w = rng.normal(size=50), rng.normal(size=50) + 0.5, rng.uniform(0.1, 1.0, 50)
    y = 1e-6 * (3.0 * S + 2.0 * S_n + rng.normal(size=50))
    f, P, exponent = 1.0, np.array([[START**2]]), Prior(width=0.5)
    beside = {"n": 0.0, "Pn": (0.5 * START) ** 2, "shift0": 0.0}
    for s, s_n, weight, measured in zip(S, S_n, w, y, strict=True):
        e = measured - s * (f - 1)
        new = update(1, (f,), P, e, (s,), weight, exponent=exponent, s_n=s_n, **beside)
        f, P, beside = new["f0_new"], np.array([[new["P00_new"]]]), {name: new[f"{name}_new"] for name in beside}
    both = np.stack([S, S_n], axis=1)
    information = (both * w[:, None]).T @ both / R + np.diag([1 / START**2, 1 / (0.5 * START) ** 2])
    expected = np.linalg.solve(information, (both * w[:, None]).T @ y / R)
    found = f - 1 - beside["n"] * beside["shift0"], beside["n"]
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-11)
    covariance = np.linalg.inv(information)
    assert P[0, 0] + beside["Pn"] * beside["shift0"] ** 2 == pytest.approx(covariance[0, 0], rel=1e-3)
    assert beside["Pn"] == pytest.approx(covariance[1, 1], rel=1e-3)


def test_a_factor_that_moves_is_less_certain():
    P, s = np.array([[0.01]]), (2.0,)
    still, moved = (step(1, (1.0,), P, e, s, 1.0) for e in (0.0, 0.3))
    assert moved[1][0, 0] / still[1][0, 0] == pytest.approx(1 + CURVED * (moved[0][0] - 1))


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


def test_a_surprise_is_what_the_spread_of_the_factors_does_not_explain():
    P = np.array([[0.02, 0.005], [0.005, 0.03]])
    s = np.array([3.0, -2.0])
    mean = 9.0 + (2.0 / DEVIATION - 9.0) * 0.5 * QUICK
    assert step(2, (1.0, 1.0), P, 2.0, s, 0.5, mean=9.0)[2] == pytest.approx(
        mean**2 - KNOWN * (s @ P @ s) / DEVIATION**2
    )
    assert step(2, (1.0, 1.0), P, 2.0, s, 0.5, mean=0.0)[2] == LEAST
    assert step(2, (1.0, 1.0), P, 2.0, s, 0.5, mean=1e3)[2] == MOST


def test_no_factor_moves_faster_than_the_inverse_may_follow():
    P = np.array([[0.02, 0.005], [0.005, 0.03]])
    whole, slow = (step(2, (1.0, 1.0), P, 2.0, (3.0, -2.0), 1.0, slew=slew) for slew in (10.0, 1e-3))
    change, limited = whole[0] - 1, slow[0] - 1
    assert abs(limited).max() == pytest.approx(1e-3)
    assert limited / abs(limited).max() == pytest.approx(change / abs(change).max())


def test_nuisance_parameters_take_what_they_explain():
    """Weighted least squares over factor and offset; what is unexplained opens the offset and closes the factor."""
    rng, spreads = np.random.default_rng(2), (0.05,)
    S = np.column_stack([rng.normal(size=200), np.full(200, 3.0)])
    f, b, P = (1.0,), (0.0,), np.diag([START**2, 0.05**2])
    information = S.T @ S / R + np.linalg.inv(P)
    for row in S:
        found = update(1, f, P, row @ [2e-5, 1e-5] - row @ [f[0] - 1, b[0]], row, 1.0, spreads=spreads, b=b)
        f, b = (found["f0_new"],), (found["b0_new"],)
        P = np.array([[found["P00_new"], found["P10_new"]], [found["P10_new"], found["P11_new"]]])
    expected = np.linalg.solve(information, S.T @ S @ [2e-5, 1e-5] / R)
    assert [f[0] - 1, b[0]] == pytest.approx(expected, rel=1e-3)
    small = np.diag([1e-6, 1e-6])
    calm, doubted = (
        step(1, (1.0,), small, 0.0, (0.0, 0.0), 1.0, drift=1e-6, level=level, spreads=spreads, b=(0.0,))[1] - small
        for level in (1.0, 10.0)
    )
    assert doubted[0, 0] == pytest.approx(calm[0, 0] / 10)
    assert doubted[1, 1] == pytest.approx(10 * calm[1, 1])


def test_what_lasts_is_averaged_at_any_speed():
    found = update(1, (1.0,), np.array([[1e-4]]), 2.0, (2.0,), 0.0, mean=7.0, lasting=30.0)
    assert found["mean_new"] == 7.0
    assert found["lasting_new"] == pytest.approx(30 + LONG * (2.0 / DEVIATION - 30))
    assert found["remains"] == pytest.approx(found["lasting_new"] ** 2 - KNOWN * 4e-4 / DEVIATION**2)


def test_a_model_that_explains_less_forgets_more_slowly():
    """Drift over level, and wider clipping: the past counts for longer, a large error is no outlier."""
    P = np.array([[1e-4]])
    near, far = (step(1, (1.0,), P, 0.0, (2.0,), 1.0, drift=0.01, level=level)[1][0, 0] for level in (1.0, 10.0))
    assert near - far == pytest.approx(0.009)
    clipped = step(1, (1.0,), P, 30.0, (2.0,), 1.0, level=10.0)[0][0]
    assert clipped == pytest.approx(1 + 2e-4 / (4e-4 + R) * CLIP * np.sqrt(4e-4 + 10 * DEVIATION**2))


def trust(d, P, level=1.0, lost=100.0, back=(0.0, 0.0)):
    """Share that counts, and evidence."""
    entries = [P[int(name[1]), int(name[2])] for name in covariance_names(len(d))]
    return [float(ca.DM(value)) for value in trust_law(len(d)).function()(*d, *entries, *back[: len(d)], level, lost)]


def share(d, P, **given):
    return trust(d, P, **given)[0]


def test_an_estimate_counts_as_far_as_it_stands_out():
    """1 - (TRUST/D^2)^3, with D from the inverse of the covariance."""
    P, d = np.array([[0.02, 0.005], [0.005, 0.03]]), np.array([0.7, 0.8])
    distance = d @ np.linalg.solve(2 * P, d)
    assert distance > TRUST
    assert share(d, P, level=2.0, lost=1e9) == pytest.approx(1 - (TRUST / distance) ** 3)
    assert share([0.3], np.array([[0.01]]), lost=1e9) == pytest.approx(1 - (TRUST / 9) ** 3)
    assert share([0.2], np.array([[0.01]])) == 0.0
    assert share([0.0], np.array([[0.01]])) == 0.0


def test_an_estimate_that_came_back_counts_as_far_as_it_stands_farther_out_than_that():
    known, back = np.array([[0.0]]), np.array([0.02, 0.03])
    assert share([0.199], known, back=(0.04,)) == 0.0
    assert share([0.4], known, lost=1e9, back=(0.04,)) == pytest.approx(1 - (0.04 / 0.16) ** 3)
    P, d = np.array([[0.02, 0.005], [0.005, 0.03]]), np.array([0.9, 1.0])
    distance = d @ np.linalg.solve(2 * P + np.diag(back) / TRUST, d)
    assert share(d, P, level=2.0, lost=1e9, back=back) == pytest.approx(1 - (TRUST / distance) ** 3)


def test_evidence_for_what_does_not_stand_out_is_its_squared_distance():
    P = np.array([[0.01]])
    assert trust([0.3], P)[1] == 1.0
    assert trust([0.05], P)[1] == pytest.approx(0.25 / TRUST)
    assert trust([0.0], P)[1] == 0.0


def test_an_estimate_that_goes_out_has_not_come_back_and_one_that_returns_has():
    """Out to 1.2, back to 1.15, out beyond, back too far: the way back is forgotten slowly, and has a largest value."""
    law, far, back, safe, rate = return_law().function(), 1.0, 0.0, 1.0, 0.1
    for f in (1.05, 1.1, 1.2):
        far, back = (float(ca.DM(value)) for value in law(f, safe, far, back, rate))
        assert (far, back) == (f, 0.0)
    far, back = (float(ca.DM(value)) for value in law(1.15, safe, far, back, rate))
    assert far == pytest.approx(1.2 - RECALL * rate * 0.05)
    assert back == pytest.approx((far - 1.15) ** 2)
    far, later = (float(ca.DM(value)) for value in law(0.7, safe, far, back, rate))
    assert far == 0.7
    assert later == pytest.approx(back * (1 - RECALL * rate))
    assert float(ca.DM(law(1.0, safe, far, later, rate)[1])) == pytest.approx(FARTHEST**2)


def test_a_model_that_explains_nothing_does_not_count():
    P = np.array([[1e-6]])
    assert share([0.5], P, level=50.0) == pytest.approx(0.75, rel=1e-3)
    assert share([0.5], P, level=100.0) == share([0.5], P, level=900.0) == 0.0


def test_a_factor_whose_prior_is_narrower_wanders_less_and_stays_within_its_own_bounds():
    """At rest in value: the random walk alone, up to the variance of the start; then an error that pushes it out."""
    priors = Prior(), Prior(width=0.2, least=0.9, most=1.1)
    _, P, _ = step(2, [1.0, 1.0], np.zeros((2, 2)), 0.0, [0.0, 0.0], 1.0, priors=priors, drift=1e-4)
    assert np.diag(P) == pytest.approx([1e-4, 0.2**2 * 1e-4])
    _, P, _ = step(2, [1.0, 1.0], START**2 * np.eye(2), 0.0, [0.0, 0.0], 1.0, priors=priors, drift=1e-4)
    assert np.diag(P) == pytest.approx([START**2, 0.2**2 * START**2])
    for sign, ends in ((1, [HIGH, 1.1]), (-1, [LOW, 0.9])):
        f, _, _ = step(2, [1.0, 1.0], 1e4 * np.eye(2), sign * 1e3, [1.0, 1.0], 1.0, priors=priors)
        assert f == pytest.approx(ends)


def test_a_factor_that_stops_at_its_bound_takes_the_others_to_what_is_most_likely_there():
    """The least squares with the second factor at its bound; clipping it alone would leave the first one off."""
    P, s, e = np.array([[0.09, -0.05], [-0.05, 0.04]]), np.array([1.0, 1.3]), -0.02
    free, _, _ = step(2, [1.0, 1.0], P, e, s, 1.0)
    bound = Prior(), Prior(least=1.0, most=1.5)
    f, _, _ = step(2, [1.0, 1.0], P, e, s, 1.0, priors=bound)
    assert free[1] < 1
    assert f == pytest.approx([free[0] - P[0, 1] / P[1, 1] * (free[1] - 1), 1.0])
