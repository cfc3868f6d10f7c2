import numpy as np
import pytest

from tendonff.compensator.identification.measured.preparation import switched_on_s

TIME = np.arange(4000) / 200
SLIDING = 40 + 4 * np.sin(2 * np.pi * 0.3 * TIME)


def ringing(jump_N: float, decay_s: float) -> np.ndarray:
    """What is missing to the end value while a load that was switched on after one row rings."""
    since = np.maximum(TIME - 1 / 200, 0)
    return jump_N * np.exp(-since / decay_s) * np.cos(2 * np.pi * 40 * since)


@pytest.mark.parametrize("decay_s", [0.02, 0.05])
def test_a_load_that_is_switched_on_is_left_out_until_it_has_rung_down(decay_s: float) -> None:
    output = SLIDING - ringing(30.0, decay_s)
    length = switched_on_s(TIME, np.full_like(TIME, 20.0), output)
    assert np.abs(ringing(30.0, decay_s)[length <= TIME]).max() < 0.05 * 30
    assert length < 10 * decay_s


def test_a_jump_that_the_input_makes_is_kept() -> None:
    output = SLIDING - ringing(30.0, 0.05)
    assert switched_on_s(TIME, 1.3 * output, output) == 0


def test_a_jump_that_follows_the_input_a_row_later_is_kept() -> None:
    output = SLIDING - ringing(30.0, 0.05)
    given = np.where(np.arange(len(TIME)) < 1, 20.0, 50.0)
    assert switched_on_s(TIME, given, output) == 0


def test_a_load_that_is_switched_on_without_ringing_leaves_out_the_jump_alone() -> None:
    output = SLIDING.copy()
    output[0] -= 30
    assert 0 < switched_on_s(TIME, np.full_like(TIME, 20.0), output) <= 2 / 200 + 1e-12


def test_a_spike_in_the_first_rows_is_no_load() -> None:
    output = SLIDING.copy()
    output[2] += 30
    assert switched_on_s(TIME, np.full_like(TIME, 20.0), output) == 0


def test_a_jump_that_is_small_against_what_follows_is_kept() -> None:
    output = SLIDING - ringing(3.0, 0.05)
    assert switched_on_s(TIME, np.full_like(TIME, 20.0), output) == 0


def test_a_record_too_short_to_tell_is_kept_whole() -> None:
    rows = slice(0, 500)
    output = SLIDING - ringing(30.0, 0.05)
    assert switched_on_s(TIME[rows], np.full(500, 20.0), output[rows]) == 0
