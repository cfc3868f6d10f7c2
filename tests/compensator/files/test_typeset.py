"""Numbers in text as they are printed."""

import pytest

from tendonff.compensator.files.typeset import typeset


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("1.5e+02 % of range", "150 % of range"),
        ("a mode grows at 8.68e+03 1/s", "a mode grows at 8680 1/s"),
        ("2.5e-05 rad", "2.5·10⁻⁵ rad"),
        ("stiffness of 2e+07 N/m, 3.1e-09 m", "stiffness of 2·10⁷ N/m, 3.1·10⁻⁹ m"),
        ("moves by -0.5 mm (-3 %)", "moves by −0.5 mm (−3 %)"),
        ("known to +-3 %, 0.2 (+- 0.01)", "known to ±3 %, 0.2 (± 0.01)"),
    ],
)
def test_numbers_have_a_true_minus_sign_and_no_exponent_where_a_few_digits_do(text, printed):
    assert typeset(text) == printed


@pytest.mark.parametrize(
    "text", ["tendonff table --pose mcp=-0.5 --out c1e+02", "DAHL 1-2", "export-c, 2026-11-24", "e^{+-mu}"]
)
def test_commands_names_and_ranges_stay_as_they_are_typed(text):
    assert typeset(text) == text
