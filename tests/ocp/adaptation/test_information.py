"""The information matrix against closed forms."""

import numpy as np
import pytest

from tendonff.ocp.adaptation.information import information
from tendonff.ocp.adaptation.recursion import Prior
from tendonff.ocp.adaptation.tuning import Sensor, Tunable, Tuning


def tuning(*parameters):
    return Tuning.of(
        sensor=Sensor.OUTPUT_TENSION, parameters=parameters, delay_samples=0, noise=0.1, span=30.0, step_s=1e-3
    )


def test_a_constant_slope_teaches_with_the_root_of_the_samples():
    known = tuning(Tunable.MU)
    rows = 400
    found = information(known, np.arange(rows) * 1e-3, np.full((rows, 1), 12.0), np.full(rows, 0.5))
    samples = np.arange(1, rows + 1)
    expected = 1 / np.sqrt(1 / known.start_deviation**2 + samples * 0.5 * 144 / known.variance)
    assert found.deviation[:, 0] == pytest.approx(expected)
    after = found.known_after_s(0)
    assert after == pytest.approx(1e-3 * np.flatnonzero(expected <= 0.03)[0])
    assert f"identifies mu within 3 % after {after:.2g} s from the output tension" in found.sentences()[0]


def test_a_closed_gate_teaches_nothing_and_that_is_said():
    found = information(tuning(Tunable.MU), np.arange(50) * 1e-3, np.full((50, 1), 12.0), np.zeros(50))
    assert found.deviation == pytest.approx(0.3)
    assert found.known_after_s(0) is None
    assert "does not identify mu" in found.doubts()[0]


def test_two_parameters_with_one_effect_cannot_be_separated():
    rng = np.random.default_rng(0)
    effect = rng.normal(size=500)
    slopes = np.column_stack([effect, 0.5 * effect + 1e-3 * rng.normal(size=500)]) * 30
    found = information(tuning(Tunable.MU, Tunable.LOAD_STIFFNESS), np.arange(500) * 1e-3, slopes, np.ones(500))
    assert found.correlation < -0.98
    assert "cannot be separated" in found.doubts()[-1]
    assert found.doubts()[-1] == found.sentences()[-1]


def test_what_cannot_be_separated_at_all_stays_as_uncertain_as_it_was():
    """Closed form: of two equal slopes the sum becomes known, the difference stays at the spread of the start."""
    known = tuning(Tunable.MU, Tunable.LOAD_STIFFNESS)
    slopes = np.full((60, 2), 1e9)
    found = information(known, np.arange(60) * 1e-3, slopes, np.ones(60))
    assert found.deviation == pytest.approx(known.start_deviation / np.sqrt(2), rel=1e-6)
    assert found.correlation == pytest.approx(-1, abs=1e-6)


def test_an_exponent_is_known_within_an_amount_and_friction_within_a_share():
    found = information(
        tuning(Tunable.MU, Tunable.LOAD_EXPONENT),
        np.arange(500) * 1e-3,
        30 * np.random.default_rng(0).normal(size=(500, 2)),
        np.ones(500),
        priors=(Prior(), Prior(width=0.2)),
    )
    assert found.deviation[0, 1] <= 0.2 * 0.3 < found.deviation[0, 0]
    assert "identifies mu within 3 % after" in found.sentences()[0]
    assert "identifies load_exponent within 0.03 after" in found.sentences()[1]
