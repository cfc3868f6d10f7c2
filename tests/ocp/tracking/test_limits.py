import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tendonff.models.errors import ParameterError
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.search import limited_rows

LIMITS = ForceLimits(minimum_N=2.0, maximum_N=50.0, rate_N_per_s=100.0)
STEP = 0.01


@given(wanted=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40), start=st.floats(-10, 100))
def test_what_the_actuator_gives_is_within_its_limits(wanted: list[float], start: float) -> None:
    given_N = LIMITS.apply(np.array(wanted), STEP, start)
    assert LIMITS.admits(given_N, STEP, 1e-9)
    assert given_N[0] == min(max(start, 2.0), 50.0)


@given(wanted=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40))
def test_limiting_twice_changes_nothing(wanted: list[float]) -> None:
    once = LIMITS.apply(np.array(wanted), STEP)
    assert LIMITS.apply(once, STEP) == pytest.approx(once, abs=1e-12)


def test_a_profile_within_the_limits_is_left_alone() -> None:
    slow = 20 + 0.9 * np.sin(np.arange(100) * STEP * 10)
    assert LIMITS.apply(slow, STEP).tolist() == slow.tolist()


def test_a_jump_becomes_a_ramp_at_the_rate_limit() -> None:
    ramp = LIMITS.apply(np.array([10.0, 13.0, 13.0, 13.0, 13.0]), STEP)
    assert ramp == pytest.approx([10, 11, 12, 13, 13])


@pytest.mark.parametrize(
    ("force", "name", "time_s"),
    [
        ([10.0, 10.0, 51.0], "force_rate_max_N_per_s", 0.01),
        ([30.0, 30.9, 5.0, 5.9], "force_rate_max_N_per_s", 0.01),  # a fall
        ([50.0, 50.5, 51.0], "force_max_N", 0.02),
        ([2.0, 1.5, 2.0], "force_min_N", 0.01),
    ],
)
def test_the_worst_bound_is_named_with_its_time(force: list[float], name: str, time_s: float) -> None:
    worst = LIMITS.worst(np.array(force), STEP)
    assert (worst.name, worst.time_s) == (name, pytest.approx(time_s))
    assert worst.excess > 0
    assert f"{name} = " in str(worst)


def test_limits_that_admit_nothing_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"force_min_N must be below force_max_N = 1, got 2"):
        ForceLimits(minimum_N=2.0, maximum_N=1.0, rate_N_per_s=1.0)


def test_rows_at_a_limit_are_those_whose_step_or_force_touches_it() -> None:
    """1 N a row is the rate; rows count from the second on."""
    force = np.array([10.0, 11.0, 11.5, 10.5, 30.0, 50.0, 50.0, 49.0, 2.0, 2.0, 2.5])
    assert limited_rows(force, STEP, LIMITS).tolist() == [
        *(True, False, True),  # 1 N up, half, 1 N down
        *(True, True, True),  # faster than the rate; at the largest force twice
        *(True, True, True, False),
    ]


def test_a_rate_is_one_of_newtons_a_second_whatever_the_step() -> None:
    force = 20 + 0.5 * np.arange(5)
    assert not limited_rows(force, STEP, LIMITS).any()
    assert limited_rows(force, 0.5 * STEP, LIMITS).all()
