"""The certified interval encloses every play whose exponents and input are within what was said."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tendonff.models.capstan import CapstanLaw
from tendonff.models.errors import ParameterError
from tendonff.ocp.adaptation.bounds import CertifiedInterval

LAW = CapstanLaw(pull_exponent=0.6, release_exponent=0.5, adhesion_N=0.7)


@given(seed=st.integers(0, 10_000), pull=st.floats(-0.2, 0.2), release=st.floats(-0.2, 0.2))
def test_the_output_of_every_play_within_the_band_stays_inside_for_all_time(seed, pull, release):
    rng = np.random.default_rng(seed)
    known = np.clip(10 + np.cumsum(rng.normal(size=400)), 0, None)
    true = np.clip(known + rng.uniform(-0.5, 0.5, 400), 0, None)
    other = CapstanLaw(pull_exponent=0.6 * (1 + pull), release_exponent=0.5 * (1 + release), adhesion_N=LAW.adhesion_N)
    low, high = CertifiedInterval(law=LAW, spread=0.2, noise_N=0.5).history_N(known, 10.0)
    output = other.output_history_N(true, 10.0)
    assert np.all(low <= output + 1e-9)
    assert np.all(output <= high + 1e-9)


def test_the_width_in_one_way_slip_is_that_of_the_exponents():
    """ln(high + p) - ln(low + p) = 2 d mu theta + 2 m, and no more however long it slips."""
    force = np.linspace(30, 300, 500)
    low, high = CertifiedInterval(law=LAW, spread=0.1, noise_N=0.0, margin=0.01).history_N(force)
    width = np.log((high + 0.7) / (low + 0.7))
    assert width[-200:] == pytest.approx(2 * 0.1 * 0.6 + 0.02, rel=1e-12)


def test_nothing_uncertain_is_the_play_itself():
    force = 30 + 20 * np.sin(np.arange(300) / 20)
    low, high = CertifiedInterval(law=LAW, spread=0.0, noise_N=0.0).history_N(force)
    assert low == pytest.approx(high)
    assert low == pytest.approx(LAW.output_history_N(force))


def test_the_margin_is_the_least_that_encloses_what_a_richer_model_gives():
    force = 30 + 20 * np.sin(np.arange(300) / 20)
    outputs = np.stack([LAW.output_history_N(force), (LAW.output_history_N(force) + 0.7) * 1.05 - 0.7])
    interval = CertifiedInterval(law=LAW, spread=0.0, noise_N=0.0).with_margin_for(force, outputs)
    assert interval.margin == pytest.approx(np.log(1.05))
    low, high = interval.history_N(force)
    assert np.all((low - 1e-9 <= outputs) & (outputs <= high + 1e-9))


@given(seed=st.integers(0, 10_000), pull=st.floats(-0.2, 0.2), release=st.floats(-0.2, 0.2))
def test_the_output_of_several_plays_within_the_band_stays_inside(seed, pull, release):
    """With spread bounds slip sets in before the play of mu theta would slip."""
    known = np.clip(10 + np.cumsum(np.random.default_rng(seed).normal(size=300)), 0, None)
    law = replace(LAW, pull_spread=0.7, release_spread=0.5)
    low, high = CertifiedInterval(law=law, spread=0.2, noise_N=0.0).history_N(known, 10.0)
    exponents = {"pull_exponent": 0.6 * (1 + pull), "release_exponent": 0.5 * (1 + release)}
    output = replace(law, **exponents).output_history_N(known, 10.0)
    assert np.all(low <= output + 1e-9)
    assert np.all(output <= high + 1e-9)


def test_an_output_where_the_law_leaves_nothing_has_no_margin_in_logarithms():
    bare = CertifiedInterval(law=replace(LAW, adhesion_N=0.0), spread=0.1, noise_N=0.0)
    force = np.array([10.0, 5.0, 0.0])
    with pytest.raises(ParameterError, match="margin must be a finite number >= 0, got inf"):
        bare.with_margin_for(force, np.array([[10.0, 5.0, 0.1]]))
    noisy = replace(bare, noise_N=0.1).with_margin_for(force, np.array([[10.0, 5.0, 0.1]]))
    assert noisy.history_N(force)[1][-1] >= 0.1
    assert bare.with_margin_for(force, np.array([[10.0, 5.0, 0.0]])).margin >= 0


@pytest.mark.parametrize("bad", [-0.1, 1.0, np.nan])
def test_a_spread_that_means_nothing_is_refused(bad):
    with pytest.raises(ParameterError, match="spread must be >= 0 and < 1, got"):
        CertifiedInterval(law=LAW, spread=bad, noise_N=0.0)
