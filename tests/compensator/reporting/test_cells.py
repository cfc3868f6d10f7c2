"""How tables show their cells."""

import pytest

from tendonff.compensator.reporting.page import is_aligned


@pytest.mark.parametrize(
    ("column", "aligned"),
    [
        ((1.0, None, 3), True),
        (("4.6 ± 0.1", "< 0.01", "−3 N, 2 ms"), True),
        ((0.5, "", "12 %"), True),
        (("yes", "no"), False),
        (("40 masses at a tenth of the step are not a number", 1.0), False),
        ((None, None), False),
    ],
)
def test_numbers_and_short_texts_that_begin_with_one_stand_to_the_right(column, aligned):
    assert is_aligned(column) == aligned
