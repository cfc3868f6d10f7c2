"""Rounded switches: the laws themselves, but for a few widths about zero."""

import casadi as ca
import numpy as np
import pytest

from tendonff.ocp.codegen.smoothing import smoothed, switches

X = ca.SX.sym("x")
WIDTH = 1e-2


def rounded(expression):
    function = ca.Function("law", [X], [expression])
    count = switches(function).size1_out(0)
    return smoothed(function, np.full(count, WIDTH))


@pytest.mark.parametrize("x", [-3.0, -0.2, 0.3, 5.0])
@pytest.mark.parametrize(
    "law", [ca.fabs(X), ca.if_else(X >= 0, 2 * X, 3 * X), ca.if_else(X > 0, X, 0), ca.if_else(X < 0, X, X**2)]
)
def test_away_from_zero_a_rounded_switch_is_the_law_to_half_the_squared_width(law, x):
    exact, found = (float(each(x)) for each in (ca.Function("law", [X], [law]), rounded(law)))
    assert abs(found - exact) <= (WIDTH / x) ** 2 / 2 * max(abs(x), x**2) * 1.01


def test_at_zero_the_size_is_the_width_and_both_branches_count_half():
    assert float(rounded(ca.fabs(X))(0.0)) == pytest.approx(WIDTH)
    assert float(rounded(ca.if_else(X >= 0, 2.0, 4.0))(0.0)) == pytest.approx(3.0)


def test_comparisons_with_other_numbers_stay_sharp():
    law = rounded(ca.if_else(X > 1e-9, X, 1e-9))
    assert [float(law(x)) for x in (-1.0, 0.0, 1e-3)] == [1e-9, 1e-9, 1e-3]


def test_what_switches_is_found_in_order():
    function = ca.Function("law", [X], [ca.if_else(X - 1 >= 0, 1, 2) * ca.fabs(2 * X)])
    assert sorted(np.abs(np.asarray(switches(function)(3.0))).ravel().tolist()) == [2.0, 6.0]
