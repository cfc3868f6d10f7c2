"""A change of the code moves no fit by more than a tenth of its interval, and no interval by more than a fifth."""

import json

import golden_fits
import pytest

pytestmark = pytest.mark.compiler


@pytest.mark.parametrize(
    "name",
    [n if n == "near end" else pytest.param(n, marks=pytest.mark.nightly) for n in golden_fits.RIGS],
)
def test_a_fit_is_what_it_was(name, tmp_path):
    stored = json.loads(golden_fits.STORED.read_text())[name]
    found = golden_fits.as_stored(golden_fits.found_in(name, tmp_path))
    assert (found["law"], found["described"]) == (stored["law"], stored["described"])
    assert found["fit_percent"] == pytest.approx(stored["fit_percent"], rel=0.02)
    assert list(found["estimates"]) == list(stored["estimates"])
    for key, was in stored["estimates"].items():
        now, half = found["estimates"][key], was["half_width"]
        assert (now["half_width"] is None) == (half is None), key
        if half is None:
            assert now["value"] == pytest.approx(was["value"], rel=1e-3, abs=1e-9), key
        else:
            assert abs(now["value"] - was["value"]) <= 0.1 * half, key
            assert now["half_width"] == pytest.approx(half, rel=0.2), key
