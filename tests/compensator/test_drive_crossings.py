"""Stated errors of drives with several imperfections at once, beside plants that share no code with the package."""

import pytest

from benchmarks.crossings import crossing


@pytest.mark.parametrize("seed", [*(pytest.param(k, marks=pytest.mark.nightly) for k in (4, 13)), 21])
@pytest.mark.compiler
def test_what_a_rough_drive_shakes_is_stated_within_a_fifth(seed: int) -> None:
    """A pair whose commands are held, a cycle of a servo in steps with a play, a loop in steps without a lag.

    Where the waves that they start are not followed, the pair and the loop are stated at 0.4 of what the plants do.
    """
    found = crossing(seed)
    assert found.nominal_said == pytest.approx(found.nominal_true, rel=0.2)
    assert found.worst_said == pytest.approx(found.worst_true, rel=0.2)
