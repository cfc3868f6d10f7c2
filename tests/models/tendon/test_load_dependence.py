"""Friction that falls with the load, against its closed forms."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.capstan.two_ended import TwoEndedLaw
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.tendon.elements import whole_of
from tendonff.models.tendon.friction import LoadedBristle, LuGreBristle, at_load
from tendonff.models.tendon.load_dependence import lifted_N, lowered_N, mean_tension_in_slip_N

LAW = CapstanLaw(pull_exponent=0.6, release_exponent=0.4, adhesion_N=0.5, load_exponent=0.25, reference_tension_N=30.0)
LOADED = LoadedBristle(
    bristle_stiffness_N_per_m=5e4,
    mu_dynamic_pull=0.1,
    mu_static_pull=0.13,
    mu_dynamic_release=0.08,
    mu_static_release=0.09,
    stribeck_velocity_m_per_s=5e-3,
    viscous_N_s_per_m=2.0,
    load_exponent=0.3,
    reference_tension_N=20.0,
)


@given(out=st.floats(0.5, 300.0))
def test_one_way_slip_obeys_the_power_law_of_the_tensions(out):
    """(T_in + p)^n = (T_out + p)^n + n mu theta T_0^n."""
    n, p, reference = LAW.load_exponent, LAW.adhesion_N, LAW.reference_tension_N
    for branch, a in ((Branch.PULL, LAW.pull_exponent), (Branch.RELEASE, -LAW.release_exponent)):
        power = (out + p) ** n + n * a * reference**n
        near = float(LAW.input_for_N(out, branch))
        assert near == pytest.approx(max(power, 0.0) ** (1 / n) - p, rel=1e-12)


def test_a_vanishing_exponent_is_the_capstan_law():
    plain, nearly = (replace(LAW, load_exponent=n) for n in (0.0, 1e-7))
    for branch in Branch:
        assert nearly.input_for_N(25.0, branch) == pytest.approx(plain.input_for_N(25.0, branch), rel=1e-6)
        assert nearly.elongation_m(25.0, 2e4, branch) == pytest.approx(plain.elongation_m(25.0, 2e4, branch), rel=1e-5)
        assert nearly.deadband_m(25.0, 2e4, branch) == pytest.approx(plain.deadband_m(25.0, 2e4, branch), rel=1e-5)


def test_the_law_does_not_depend_on_the_tension_at_which_it_is_stated():
    n = LAW.load_exponent
    scale = (60.0 / LAW.reference_tension_N) ** -n
    other = replace(
        LAW,
        reference_tension_N=60.0,
        pull_exponent=scale * LAW.pull_exponent,
        release_exponent=scale * LAW.release_exponent,
    )
    history = 40 + 30 * np.sin(np.linspace(0, 20, 200))
    assert other.output_history_N(history) == pytest.approx(LAW.output_history_N(history), rel=1e-12)
    mu, slope = (ca.evalf(x) for x in at_load(ca.SX(0.2), ca.SX(50.0), ca.SX(n), ca.SX(30.0)))
    stated = math.tanh(math.atanh(0.2) * scale)
    again, same = (ca.evalf(x) for x in at_load(ca.SX(stated), ca.SX(50.0), ca.SX(n), ca.SX(60.0)))
    assert float(again) == pytest.approx(float(mu), rel=1e-12)
    assert float(same) == pytest.approx(float(slope), rel=1e-12)


def test_the_mean_tension_in_slip_is_the_integral_over_the_path():
    s = (np.arange(20_000) + 0.5) / 20_000
    along = lowered_N(lifted_N(70.0, 0.25, 30.0) * np.exp(-0.9 * s), 0.25, 30.0)
    assert mean_tension_in_slip_N(70.0, 0.9, 0.25, 30.0) == pytest.approx(along.mean(), rel=1e-8)
    assert mean_tension_in_slip_N(70.0, 0.0, 0.25, 30.0) == 70.0


def test_plays_with_load_dependence_compose_along_the_path():
    history = 40 + 30 * np.sin(np.linspace(0, 20, 200))
    first, second = LAW.part(0.3), LAW.part(0.7)
    start = 40.0
    twice = second.output_history_N(first.output_history_N(history, start), start)
    assert twice == pytest.approx(LAW.output_history_N(history, start), rel=1e-10)


def test_the_inverse_law_reproduces_its_reference():
    reference = 40 + 30 * np.sin(np.linspace(0, 12, 400))
    answered = LAW.output_history_N(LAW.input_history_N(reference), reference[0])
    assert np.abs(answered[30:] - reference[30:]).max() < 1e-9


def test_the_two_ended_law_contains_the_play_law():
    near = 30 + 20 * np.sin(np.linspace(0, 10, 150))
    whole = TwoEndedLaw(
        pull_exponent=np.array([0.0, 0.2, 0.6]),
        release_exponent=np.array([0.0, 0.1, 0.4]),
        length_share=np.full(3, 1 / 3),
        adhesion_N=LAW.adhesion_N,
        load_exponent=LAW.load_exponent,
        reference_tension_N=LAW.reference_tension_N,
    )
    far = LAW.output_history_N(near, 30.0)
    profile = whole.history_N(near, far, np.full(3, 30.0))
    assert profile[:, 1] == pytest.approx(LAW.part(1 / 3).output_history_N(near, 30.0), rel=0.2)
    assert profile[:, 2] == pytest.approx(far, rel=1e-9)


@pytest.mark.parametrize("speed", [-0.05, -1e-5, 0.0, 1e-4, 0.3])
@pytest.mark.parametrize("far_sum", [0.2, 40.0, 900.0])
def test_the_inverse_of_an_element_meets_its_forward_law(speed, far_sum):
    """f_n = A + f_s and the implicit rule give the same bristle force, to round-off."""
    piece = LOADED.on_piece(ca.SX(0.5), ca.SX(1 / 6), ca.SX(1 / 6))
    v, base, H = ca.SX(speed), (ca.SX(1.7),), ca.SX(1e-3)
    found = piece.implicit_from_far_side(v, base, H, ca.SX(far_sum))
    forward = piece.implicit(v, base, H, far_sum + found[0])
    assert float(ca.evalf(found[0])) == pytest.approx(float(ca.evalf(forward[0])), rel=1e-12, abs=1e-13)


def test_without_an_exponent_nothing_but_the_plain_bristle_is_built(generic):
    assert type(whole_of(generic, Level.PRESLIDING).friction) is LuGreBristle
    told = replace(generic, friction=replace(generic.friction, load_exponent=0.0))
    assert type(whole_of(told, Level.PRESLIDING).friction) is LuGreBristle


def test_a_load_exponent_without_its_tension_is_refused(generic):
    with pytest.raises(ParameterError, match="load_exponent needs reference_tension_N"):
        replace(generic.friction, load_exponent=0.2)
    with pytest.raises(ParameterError, match=r"load_exponent must be <= 0.5, got 0.7"):
        replace(generic.friction, load_exponent=0.7, reference_tension_N=20.0)
