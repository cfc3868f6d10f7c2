"""The chain under a measured input tension."""

import numpy as np
import pytest

from tendonff.compensator.identification.fitting.parametric_chain import ParametricChain
from tendonff.compensator.identification.parameters import BY_TENSIONS, Parameter
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.fits.chain import Drive

D = Parameter
SLOPE_BY_SHIFT = (D.INPUT_BIAS, D.OUTPUT_BIAS, D.OUTPUT_GAIN)


@pytest.fixture(scope="module")
def model(examples):
    transmission = load_scenario(examples / "finger.toml").transmission
    return ParametricChain(transmission=transmission, level=Level.PRESLIDING, count=5, longest_step_s=2e-3)


def drive(step=1e-3):
    time = np.arange(0, 2, step)
    return Drive(input_N=40 + 15 * np.sin(4 * time) - 5 * time, step_s=step, first_output_N=36.0)


@pytest.mark.parametrize("name", [n for n in BY_TENSIONS if n not in SLOPE_BY_SHIFT])
def test_slopes_are_the_derivatives_of_output_and_elongation(model, name):
    values = {**model.values(), D.STATIC_EXCESS: 0.1, D.ADHESION: 1.0, D.MU_RELEASE: 0.17}
    if name is D.LOAD_EXPONENT:
        values[name] = 0.2
    step = 1e-5 * max(abs(values[name]), 1e-2)
    found = model.predict(values, drive(), tuple(dict.fromkeys((D.BRISTLE, name))))
    ahead, behind = (model.predict({**values, name: values[name] + s * step}, drive()) for s in (1, -1))
    for ours, a, b in (
        (found.output_slopes[:, -1], ahead.output_N, behind.output_N),
        (found.elongation_slopes[:, -1], ahead.elongation_m, behind.elongation_m),
    ):
        expected = (a - b) / (2 * step)
        scale = np.abs(expected).max()
        assert scale > 0
        assert np.abs(ours - expected).max() < 2e-3 * scale


def test_a_coarser_log_gives_the_same_answer(model):
    """100 Hz samples are interpolated to the chain's own step."""
    values = model.values()
    fine = model.predict(values, drive(1e-3)).output_N[::10]
    coarse = model.predict(values, drive(1e-2)).output_N
    assert np.abs(fine - coarse).max() < 0.02


def test_a_symmetric_model_has_one_coefficient(model):
    from dataclasses import replace

    one = replace(model, symmetric=True)
    values = {**one.values(), D.MU_RELEASE: 0.9}
    assert one.numbers_of(values)["mu_dynamic_release"] == values[D.MU]
