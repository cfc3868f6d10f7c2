import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tendonff.models.capstan import Branch, CapstanLaw, behind_drive_N
from tendonff.models.capstan.spread_bounds import play_exponents
from tendonff.models.errors import ParameterError
from tendonff.models.gear import DriveLaw
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.bounds import play

LAW = CapstanLaw(pull_exponent=0.62, release_exponent=0.45, adhesion_N=0.5)
histories = st.lists(st.floats(0.0, 150.0), min_size=2, max_size=40).map(np.array)


def test_the_law_of_a_transmission_has_its_dynamic_coefficients(generic: Transmission) -> None:
    law = CapstanLaw.of(generic)
    assert law.pull_exponent == pytest.approx(0.2 * 3.1)
    assert law.release_exponent == pytest.approx(0.15 * 3.1)
    assert law.adhesion_N == 0.5


@given(history=histories, share=st.floats(0.0, 1.0))
def test_plays_compose(history: np.ndarray, share: float) -> None:
    """The output of the first part, led through the second, is the output of the whole."""
    middle = LAW.part(share).output_history_N(history)
    end = LAW.part(1 - share).output_history_N(middle, initial_output_N=history[0])
    assert end == pytest.approx(LAW.output_history_N(history), abs=1e-9)


@given(history=histories)
def test_the_profile_holds_the_outputs_of_the_parts(history: np.ndarray) -> None:
    profile = LAW.profile_history_N(history, [0.0, 0.3, 1.0])
    assert profile[:, 0] == pytest.approx(history, abs=1e-9)
    assert profile[:, 1] == pytest.approx(LAW.part(0.3).output_history_N(history))
    assert profile[:, 2] == pytest.approx(LAW.output_history_N(history))


def test_one_way_slip_has_the_ratio_of_its_direction() -> None:
    """(T_in + p)/(T_out + p) = e^{mu_pull theta} pulling, e^{-mu_release theta} releasing."""
    out = LAW.output_history_N(np.array([20.0, 90.0, 20.0]))
    assert (90.5) / (out[1] + 0.5) == pytest.approx(math.exp(0.62))
    assert (20.5) / (out[2] + 0.5) == pytest.approx(math.exp(-0.45))


@given(wanted=st.lists(st.floats(1.0, 100.0), min_size=2, max_size=30, unique=True).map(np.array))
def test_the_static_inverse_is_a_right_inverse_of_the_play(wanted: np.ndarray) -> None:
    needed = LAW.input_history_N(wanted)
    start = float(needed[0])
    # An input below zero would push; the law is a formula and takes it.
    assert LAW.output_history_N(needed, initial_output_N=start) == pytest.approx(np.maximum(wanted, 0.0), abs=1e-9)


def test_the_inverse_jumps_by_both_exponents_at_a_reversal() -> None:
    needed = LAW.input_history_N(np.array([30.0, 31.0, 30.999999]))
    assert (needed[1] + 0.5) / (needed[2] + 0.5) == pytest.approx(math.exp(0.62 + 0.45), rel=1e-6)


def test_a_force_reaches_so_far_and_no_farther() -> None:
    reach = LAW.largest_output_N(200.0)
    assert LAW.input_for_N(reach, Branch.PULL) == pytest.approx(200.0)
    assert LAW.output_history_N([30.0, 200.0])[-1] == pytest.approx(reach)
    floor = LAW.smallest_output_N(5.0)
    assert LAW.input_for_N(floor, Branch.RELEASE) == pytest.approx(5.0)
    assert LAW.output_history_N([90.0, 5.0])[-1] == pytest.approx(floor)


@pytest.mark.parametrize("branch", Branch)
def test_elongation_and_stiffness_are_integrals_of_the_profile(branch: Branch) -> None:
    """Mean of T over the path divided by k; its slope over T_in is 1/stiffness."""
    shares = np.linspace(0.0, 1.0, 2001)
    start, end = (1.0, 80.0) if branch is Branch.PULL else (400.0, 80.0)
    profile = LAW.profile_history_N([start, end], shares)[-1]
    elongation = LAW.elongation_m(80.0, 2e4, branch)
    assert elongation == pytest.approx(np.trapezoid(profile, shares) / 2e4, rel=1e-6)
    slope = (LAW.elongation_m(81.0, 2e4, branch) - LAW.elongation_m(79.0, 2e4, branch)) / 2
    assert slope == pytest.approx(1 / LAW.stiffness_N_per_m(2e4, branch), rel=1e-9)


@pytest.mark.parametrize("branch", Branch)
def test_the_deadband_is_the_travel_until_the_output_moves(branch: Branch) -> None:
    """Difference of elongation between the end of one branch and the start of the other, output at rest."""
    before = LAW.elongation_m(80.0, 2e4, branch)
    other = Branch.RELEASE if branch is Branch.PULL else Branch.PULL
    out = LAW.output_history_N([80.0], initial_output_N=1.0 if branch is Branch.PULL else 300.0)[0]
    after = LAW.elongation_m(LAW.input_for_N(out, other), 2e4, other)
    assert LAW.deadband_m(80.0, 2e4, branch) == pytest.approx(abs(float(before - after)), rel=1e-9)


def test_with_one_coefficient_the_deadband_is_the_printed_formula() -> None:
    """(R T_in/(EA mu)) (1 - e^{-a})^2 with k = EA/L, L = R theta, a = mu theta."""
    law, a, k = CapstanLaw(pull_exponent=0.62, release_exponent=0.62), 0.62, 2e4
    assert law.deadband_m(80.0, k, Branch.PULL) == pytest.approx(80.0 / (k * a) * (1 - math.exp(-a)) ** 2)


def test_a_straight_path_passes_everything_on() -> None:
    law = CapstanLaw(pull_exponent=0.0, release_exponent=0.0, adhesion_N=0.7)
    history = np.array([30.0, 5.0, 90.0])
    assert law.output_history_N(history) == pytest.approx(history)
    assert law.stiffness_N_per_m(2e4, Branch.PULL) == law.stiffness_N_per_m(2e4, Branch.RELEASE) == 2e4
    assert law.deadband_m(50.0, 2e4, Branch.PULL) == 0.0


@pytest.mark.parametrize("name", ["pull_exponent", "release_exponent", "adhesion_N"])
@pytest.mark.parametrize("bad", [-0.1, math.nan, math.inf])
def test_a_bad_exponent_is_refused_by_name_and_value(name: str, bad: float) -> None:
    with pytest.raises(ParameterError, match=f"{name} must be a finite number >= 0, got {bad}"):
        replace(LAW, **{name: bad})


@given(
    inputs=st.lists(st.floats(0.0, 1e3), min_size=1, max_size=70),
    start=st.floats(0.0, 1e3),
    exponents=st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 2.0)),
)
def test_a_history_is_the_play_operator_taken_one_instant_after_the_other(
    inputs: list[float], start: float, exponents: tuple[float, float]
) -> None:
    """To the bit: the symbolic operator that identification fits, and the composed clips of the capstan law."""
    law = CapstanLaw(pull_exponent=exponents[0], release_exponent=exponents[1], adhesion_N=0.7)
    memory, expected = start, list[float]()
    for low, high in zip(*law.output_bounds_N(inputs), strict=True):
        memory = float(ca.evalf(play(ca.SX(memory), ca.SX(low), ca.SX(high))))
        expected.append(max(memory, 0.0))
    assert law.output_history_N(inputs, start).tolist() == expected


def test_the_law_answers_without_building_a_function(monkeypatch: pytest.MonkeyPatch) -> None:
    """A table asks it some thousand times; a CasADi function costs a millisecond to build."""
    law = CapstanLaw(pull_exponent=0.6, release_exponent=0.5, adhesion_N=0.2)
    inputs = np.array([10.0, 20.0, 15.0])
    before = law.output_history_N(inputs)

    def refuse(*_: object) -> None:
        raise AssertionError("a CasADi function was built")

    monkeypatch.setattr(ca, "Function", refuse)
    assert law.output_history_N(inputs) == pytest.approx(before, abs=0)
    assert law.input_for_N(before, Branch.PULL)[1] == pytest.approx(20.0)


SPREAD = CapstanLaw(pull_exponent=0.62, release_exponent=0.45, adhesion_N=0.5, pull_spread=0.8, release_spread=0.4)


def _turning(rows=900):
    """A tension with large and small reversals and a hold."""
    rng = np.random.default_rng(3)
    levels = np.concatenate([[20.0], np.ravel(np.column_stack([rng.uniform(30, 60, 12), rng.uniform(8, 28, 12)]))])
    turning = np.interp(np.linspace(0, len(levels) - 1, rows), np.arange(len(levels)), levels)
    return np.concatenate([turning, np.full(50, turning[-1]), np.linspace(turning[-1], 40, 100)])


def test_the_inverse_of_spread_plays_is_exact_through_small_reversals():
    wanted = _turning()
    force = SPREAD.input_history_N(wanted)
    np.testing.assert_allclose(SPREAD.output_history_N(force), wanted, rtol=0, atol=1e-12)
    assert np.ptp(force[900:950]) == 0  # what stands still is held


def test_in_gross_sliding_spread_plays_have_the_ratio_of_one():
    up, down = np.linspace(5, 300, 400), np.linspace(300, 2, 400)
    output = SPREAD.output_history_N(np.concatenate([up, down]))
    assert (up[-1] + 0.5) / (output[399] + 0.5) == pytest.approx(math.exp(0.62), rel=1e-12)
    assert (down[-1] + 0.5) / (output[-1] + 0.5) == pytest.approx(math.exp(-0.45), rel=1e-12)
    assert SPREAD.output_bounds_N(300.0)[0] == pytest.approx(output[399])


def test_a_spread_of_nothing_is_the_capstan_law():
    wanted, bare = _turning(), replace(SPREAD, pull_spread=0.0, release_spread=0.0)
    hardly = replace(SPREAD, pull_spread=1e-12, release_spread=0.0)
    np.testing.assert_allclose(hardly.input_history_N(wanted), bare.input_history_N(wanted), rtol=1e-9)
    np.testing.assert_allclose(hardly.output_history_N(wanted), bare.output_history_N(wanted), rtol=1e-9)


def test_at_a_reversal_the_force_of_spread_plays_jumps_by_the_narrowest_band_alone():
    wanted = np.concatenate([np.linspace(20, 60, 20_000), np.linspace(60, 30, 20_000)])
    lifted = SPREAD.input_history_N(wanted) + 0.5
    narrowest = -play_exponents(-0.62, 0.8)[0] + play_exponents(0.45, 0.4)[0]
    assert narrowest < 0.5 * (0.62 + 0.45)
    assert lifted[20_001] / lifted[19_999] == pytest.approx(math.exp(-narrowest), rel=0.02)


@pytest.mark.parametrize("spread", [-0.1, 1.1, math.nan])
def test_a_spread_out_of_bounds_is_refused(spread):
    with pytest.raises(ParameterError, match="pull_spread"):
        replace(SPREAD, pull_spread=spread)


@given(reference=histories)
def test_the_force_of_a_drive_that_rubs_gives_back_what_was_asked_for(reference: np.ndarray) -> None:
    """Friction of the drive is a play in front of the tendon's: its right inverse acts on the reference's branch."""
    drive, wanted = DriveLaw(coulomb_N=3.0, lost_share=0.2), reference + 20
    force = LAW.force_history_N(wanted, drive)
    tension = behind_drive_N(drive, force, float(wanted[0]))
    assert LAW.output_history_N(tension) == pytest.approx(wanted, rel=1e-9)
    assert behind_drive_N(DriveLaw(), force, 0.0) == pytest.approx(force)
