"""Slopes of the chain's answer over its measured input."""

from itertools import pairwise

import numpy as np
import pytest

from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.fits.chain import ChainModel, Drive, input_windows

STEP = 4e-3


@pytest.fixture(scope="module")
def model(examples):
    transmission = load_scenario(examples / "finger.toml").transmission
    return ChainModel(transmission=transmission, level=Level.PRESLIDING, count=3, longest_step_s=STEP)


@pytest.fixture(scope="module")
def drive():
    time = np.arange(0, 2.4, STEP)
    return Drive(input_N=45 + 25 * np.sin(2 * np.pi * time), step_s=STEP, first_output_N=35.0)


def test_the_answer_follows_a_small_change_of_the_input_as_its_slopes_say(model, drive):
    """One knot in each window is moved; differences are exact where sliding keeps its direction, nearly so at turns."""
    values = model.numbers()
    windows = list(input_windows(model, values, drive, knot_s=0.08, window_s=1.2, before_s=0.4))
    assert len(windows) == 2
    for window in windows:
        knot = len(window.knots_s) // 3
        time = np.arange(len(drive.input_N)) * STEP
        bump = 1e-3 * np.interp(time, window.knots_s, np.arange(len(window.knots_s)) == knot)
        moved = [
            model.respond(values, Drive(input_N=drive.input_N + s * bump, step_s=STEP, first_output_N=35.0))
            for s in (-1, 1)
        ]
        rows = np.searchsorted(time, window.time_s[window.time_s >= 0] - STEP / 2)
        exact = {
            "output_N": window.output_slopes,
            "near_m": window.near_slopes,
            "elongation_m": window.elongation_slopes,
        }
        for name, slopes in exact.items():
            seen = (getattr(moved[1], name) - getattr(moved[0], name))[rows] / 2e-3
            own = slopes[window.time_s >= 0, knot]
            assert np.abs(seen).max() > 0
            np.testing.assert_allclose(own, seen, atol=0.01 * np.abs(seen).max())


def test_windows_cover_the_run_once(model, drive):
    windows = list(input_windows(model, model.numbers(), drive, knot_s=0.05, window_s=0.7, before_s=0.2))
    for before, after in pairwise(windows):
        assert before.time_s[-1] == pytest.approx(after.first_s, abs=1e-12)
        assert after.time_s[0] == pytest.approx(after.first_s - 0.2, abs=1e-9)
    assert windows[-1].time_s[-1] == pytest.approx((len(drive.input_N) - 1) * STEP)
    for window in windows:
        assert window.knots_s[0] == window.time_s[0]
        assert window.knots_s[-1] == window.time_s[-1]
        assert window.output_slopes.shape == (len(window.time_s), len(window.knots_s))
