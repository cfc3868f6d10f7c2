"""What holds the masses of the path together."""

import casadi as ca
import pytest

from tendonff.models.tendon.assembly import normal_force


def number(*tensions: float) -> float:
    return float(ca.evalf(normal_force(*map(ca.SX, tensions))))


def test_the_normal_force_is_the_sum_of_both_tensions_and_twice_the_adhesion():
    assert number(3.0, 5.0, 0.25) == pytest.approx(8.5)


@pytest.mark.parametrize("tensions", [(0.0, 0.0, 0.0), (-2.0, 0.5, 0.0)])
def test_a_slack_tendon_presses_with_next_to_nothing_but_never_with_less_than_nothing(tensions):
    """Friction is divided by it: zero would be no number, and a large floor would be friction where there is none."""
    assert 0 < number(*tensions) <= 1e-6
