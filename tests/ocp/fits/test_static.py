"""Static laws of measured histories."""

import math

import numpy as np
import pytest

from tendonff.models.capstan import CapstanLaw
from tendonff.ocp.fits import static
from tendonff.ocp.fits.static import ORDER, StaticParameter, input_from_output, output_from_input

P = StaticParameter
VALUES = {
    P.PULL: 0.6,
    P.RELEASE: 0.4,
    P.ADHESION: 2.0,
    P.INPUT_BIAS: 0.3,
    P.OUTPUT_BIAS: -0.2,
    P.GUIDE: 4.0,
    P.BRISTLE: 600.0,
    P.BRISTLE_SPREAD: 0.8,
    P.PULL_SPREAD: 0.7,
    P.RELEASE_SPREAD: 0.4,
}
TIME = np.arange(0, 6, 0.01)
INPUT = 30 + 12 * np.sin(2.1 * TIME) + 5 * np.sin(7.3 * TIME)
MOTION = 0.1 * np.sin(2 * TIME)


def play(values):
    return output_from_input(values, INPUT, 28.0)


def motion(values):
    return input_from_output(values, INPUT, MOTION, 33.0)


@pytest.mark.parametrize("law", [play, motion])
@pytest.mark.parametrize("name", ORDER)
def test_slopes_are_the_derivatives_of_the_prediction(law, name):
    step = 1e-6 * max(1.0, VALUES[name])
    ahead, behind = (law({**VALUES, name: VALUES[name] + sign * step}).prediction_N for sign in (1, -1))
    slopes = law(VALUES).slopes[:, ORDER.index(name)]
    np.testing.assert_allclose(slopes, (ahead - behind) / (2 * step), atol=2e-6 * max(1.0, np.abs(slopes).max()))


@pytest.mark.compiler
@pytest.mark.parametrize("law", [play, motion])
def test_compiled_laws_answer_as_casadi_does(law, monkeypatch):
    """Over more rows than one call of CasADi's takes."""
    compiled = law(VALUES)
    monkeypatch.setattr(static, "CHUNK", 256)
    static._accumulated.cache_clear()
    monkeypatch.setenv("TENDONFF_ENGINE", "casadi")
    by_casadi = law(VALUES)
    static._accumulated.cache_clear()
    np.testing.assert_allclose(compiled.prediction_N, by_casadi.prediction_N, rtol=1e-12)
    np.testing.assert_allclose(compiled.slopes, by_casadi.slopes, rtol=1e-9, atol=1e-12)


def test_the_output_is_the_play_of_the_capstan_law():
    law = CapstanLaw(pull_exponent=0.6, release_exponent=0.4, adhesion_N=2.0)
    values = {P.PULL: 0.6, P.RELEASE: 0.4, P.ADHESION: 2.0}
    expected = law.output_history_N(INPUT, 28.0)
    np.testing.assert_allclose(output_from_input(values, INPUT, 28.0).prediction_N, expected, rtol=1e-12)


@pytest.mark.parametrize(("sign", "exponent"), [(1, 0.6), (-1, -0.4)])
def test_motion_in_gross_sliding_gives_the_capstan_ratio(sign, exponent):
    """T_in + p = (T_out + p) e^{+-mu theta}, also where T_out is negative and p > -T_out."""
    output, travel = np.full(400, -0.5), sign * np.linspace(0, 1, 400)
    values = {P.PULL: 0.6, P.RELEASE: 0.4, P.ADHESION: 2.0, P.BRISTLE: 600.0}
    found = input_from_output(values, output, travel, -0.5).prediction_N[-1]
    assert found + 2.0 == pytest.approx(1.5 * math.exp(exponent), rel=1e-9)


def test_spread_bounds_are_the_mean_of_plays_whose_bounds_lie_evenly_over_the_spread():
    values = {P.PULL: 0.6, P.RELEASE: 0.4, P.ADHESION: 2.0, P.PULL_SPREAD: 0.7, P.RELEASE_SPREAD: 0.3}
    shares = (np.arange(8) + 0.5) / 4 - 1
    plays = [
        CapstanLaw(pull_exponent=0.6 * (1 + 0.7 * s), release_exponent=0.4 * (1 + 0.3 * s), adhesion_N=2.0)
        for s in shares
    ]
    expected = np.mean([one.output_history_N(INPUT, 28.0) for one in plays], axis=0)
    np.testing.assert_allclose(output_from_input(values, INPUT, 28.0).prediction_N, expected, rtol=1e-12)


def test_two_equal_bristles_are_one_bristle():
    """Half the stiffness under half the load, side by side; eq. (5a) for one."""
    values = {P.PULL: 0.6, P.RELEASE: 0.4, P.ADHESION: 2.0, P.BRISTLE: 600.0}
    far, f_s, found = 30.0, 0.0, []
    travel = np.linspace(0, 0.2, 20001)
    c, h = math.tanh(0.3), travel[1]
    for _ in travel[1:]:
        f_n = 2 * (far + 2.0) + f_s
        f_s += 600.0 * h * (1 - f_s / (c * f_n))
        found.append(far + f_s)
    output = np.full(len(travel), far)
    np.testing.assert_allclose(input_from_output(values, output, travel, far).prediction_N[1:], found, rtol=1e-4)


def test_a_bristle_spread_stiffens_the_first_travel_after_a_reversal():
    """Initial stiffness sigma0 cosh(spread): the mean of the two strands."""
    values = {P.PULL: 0.6, P.RELEASE: 0.4, P.ADHESION: 2.0, P.BRISTLE: 600.0, P.BRISTLE_SPREAD: 1.2}
    travel = np.array([0.0, 1e-7])
    found = input_from_output(values, np.full(2, 30.0), travel, 30.0).prediction_N
    assert (found[1] - found[0]) / 1e-7 == pytest.approx(600.0 * math.cosh(1.2), rel=1e-4)
