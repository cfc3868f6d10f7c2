"""Every numbered formula of the theory pages, checked against the packages, or independently where none holds it."""

import itertools
import math
import re
import runpy
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainState
from tendonff.models.path import Section, cut_path
from tendonff.models.tendon.assembly import normal_force
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import LuGreBristle, equivalent_coefficient
from tendonff.models.tendon.link import ZenerLink
from tendonff.ocp.adaptation.bounds import CertifiedInterval
from tendonff.ocp.adaptation.recursion import update_law
from tendonff.ocp.optimal.track import track
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate
from tendonff.ocp.tracking.limits import ForceLimits

ROOT = Path(__file__).resolve().parents[1]
LAW = CapstanLaw(pull_exponent=0.63, release_exponent=0.47, adhesion_N=1.5)
BRISTLE = LuGreBristle(
    bristle_stiffness_N_per_m=4e4,
    mu_dynamic_pull=0.15,
    mu_static_pull=0.25,
    mu_dynamic_release=0.1,
    mu_static_release=0.2,
    stribeck_velocity_m_per_s=5e-3,
    viscous_N_s_per_m=4.0,
)
LINK = ZenerLink(stiffness_N_per_m=2e4, relaxing_stiffness_N_per_m=6e3, relaxation_time_s=0.4, damping_N_s_per_m=3.0)
CHECKED: set[str] = set()


def equation(*tags):
    """Mark a test as the check of these equations."""
    CHECKED.update(tags)
    return lambda test: test


def number(expression):
    return float(ca.evalf(ca.SX(expression)))


@pytest.fixture(scope="module")
def finger(examples):
    return load_scenario(examples / "finger.toml")


@equation("1.1", "1.2")
@pytest.mark.parametrize(("branch", "exponent"), [(Branch.PULL, 0.63), (Branch.RELEASE, -0.47)])
def test_the_differential_equation_of_sliding_integrates_to_the_capstan_law(branch, exponent):
    tension, steps = 20.0, 20000
    for _ in range(steps):  # midpoint rule from the load to the actuator
        half = tension + 0.5 * exponent / steps * (tension + LAW.adhesion_N)
        tension += exponent / steps * (half + LAW.adhesion_N)
    assert float(LAW.input_for_N(20.0, branch)) == pytest.approx(tension, rel=1e-7)
    assert tension + 1.5 == pytest.approx(21.5 * math.exp(exponent), rel=1e-7)


@equation("1.3", "1.4")
def test_the_play_law_holds_for_any_history_and_keeps_the_profile_within_its_slope():
    force = 40 * np.exp(np.cumsum(np.random.default_rng(3).normal(0, 0.1, 400)))
    u, w = np.log(force + 1.5), math.log(force[0] + 1.5)
    expected = []
    for x in u:
        w = min(max(w, x - 0.63), x + 0.47)
        expected.append(math.exp(w) - 1.5)
    assert LAW.output_history_N(force) == pytest.approx(np.maximum(expected, 0), rel=1e-12)
    places = np.linspace(0, 1, 64)
    slope = np.diff(np.log(LAW.profile_history_N(force, places) + 1.5), axis=1) * 63
    assert slope.min() >= -0.63 - 1e-9
    assert slope.max() <= 0.47 + 1e-9
    assert slope.min() < -0.6  # both bounds are met on the way
    assert slope.max() > 0.45


@equation("1.5", "2.2")
def test_at_a_reversal_the_input_crosses_both_exponents_before_the_output_moves():
    before = 80.0
    held = LAW.output_history_N([before], 10.0)[0]
    edge = (before + 1.5) / math.exp(0.63 + 0.47) - 1.5
    assert LAW.output_history_N([before, edge * 1.001], 10.0)[-1] == pytest.approx(held, rel=1e-12)
    assert LAW.output_history_N([before, edge * 0.99], 10.0)[-1] < held * 0.999
    equal = CapstanLaw(pull_exponent=0.63, release_exponent=0.63)
    ratio = equal.input_for_N(20.0, Branch.PULL) / equal.input_for_N(20.0, Branch.RELEASE)
    assert float(ratio) == pytest.approx(math.exp(2 * 0.63), rel=1e-12)
    assert float(ratio) == pytest.approx(3.5, abs=0.05)


@equation("1.6", "P3")
def test_the_stiffness_in_slip_is_the_slope_of_force_over_the_mean_tension():
    law, k = CapstanLaw(pull_exponent=0.63, release_exponent=0.47), 2e4
    s = (np.arange(20000) + 0.5) / 20000
    for branch, decay, slope in (
        (Branch.PULL, np.exp(-0.63 * s), 0.63 / (1 - math.exp(-0.63))),
        (Branch.RELEASE, np.exp(0.47 * s), 0.47 / (math.exp(0.47) - 1)),
    ):
        assert slope == pytest.approx(1 / decay.mean(), rel=1e-8)
        assert law.stiffness_N_per_m(k, branch) == pytest.approx(k * slope, rel=1e-12)


@equation("1.7")
def test_the_deadband_is_the_elongation_given_back_while_the_front_runs_through():
    a, k = 0.63, 2e4
    law = CapstanLaw(pull_exponent=a, release_exponent=a)
    s = (np.arange(20000) + 0.5) / 20000
    given_back = 50 * np.mean(np.exp(-a * s) - math.exp(-2 * a) * np.exp(a * s)) / k
    assert 50 / (k * a) * (1 - math.exp(-a)) ** 2 == pytest.approx(given_back, rel=1e-7)
    assert law.deadband_m(50.0, k, Branch.PULL) == pytest.approx(given_back, rel=1e-7)


@equation("2.1")
def test_the_inverted_law_is_a_right_inverse_of_the_play():
    reference = 30 + 12 * np.sin(np.linspace(0, 20, 2000))
    assert LAW.output_history_N(LAW.input_history_N(reference, 30.0), 30.0) == pytest.approx(reference, rel=1e-12)


@equation("2.3")
def test_the_plateau_after_a_reversal_lasts_as_long_as_the_ramp_through_the_jump():
    law = CapstanLaw(pull_exponent=0.63, release_exponent=0.63)
    rate, step, level = 200.0, 1e-4, 30.0
    ramp = float(law.input_for_N(level, Branch.PULL)) - rate * step * np.arange(10000)
    held = law.output_history_N(np.maximum(ramp, 0.1), level)
    plateau = step * np.argmax(held < level * (1 - 1e-9))
    assert level * (math.exp(0.63) - math.exp(-0.63)) / rate == pytest.approx(plateau, abs=2 * step)


@equation("2.4", "2.5")
def test_plays_with_spread_bounds_by_the_formulas_themselves():
    """The operator written out, one play at a time, and its inverse with the number of slipping plays searched for."""
    law = CapstanLaw(pull_exponent=0.63, release_exponent=0.47, adhesion_N=1.5, pull_spread=0.7, release_spread=0.5)
    low, high = law.plays.low, law.plays.high
    assert float(np.mean(low)) == pytest.approx(math.exp(-0.63), rel=1e-12)
    assert float(np.mean(high)) == pytest.approx(math.exp(0.47), rel=1e-12)
    wanted = np.array([20, 25, 32, 30, 24, 26, 25, 40, 12, 18], dtype=float)
    w, forces = np.full(8, wanted[0] + 1.5), [wanted[0]]
    for before, r in itertools.pairwise(wanted):
        bounds = low if r > before else high
        tried = [(8 * (r + 1.5) - w[j:].sum()) / bounds[:j].sum() for j in range(1, 9)]
        means = [np.clip(w, u * low, u * high).mean() for u in tried]
        [u, *_] = [u for u, mean in zip(tried, means, strict=True) if abs(mean - r - 1.5) < 1e-9]
        w = np.minimum(np.maximum(w, u * low), u * high)
        forces.append(u - 1.5)
    np.testing.assert_allclose(law.input_history_N(wanted), forces, rtol=1e-12)
    np.testing.assert_allclose(law.output_history_N(forces), wanted, rtol=1e-12)


@pytest.fixture(scope="module")
def two_ends():
    return runpy.run_path(str(ROOT / "docs" / "figures" / "two_ends.py"))["profiles"]()


@equation("3.1", "3.2")
def test_the_cones_of_both_ends_cut_the_profile_as_the_simulated_chain_does(finger, two_ends):
    mu, theta = finger.transmission.friction.mu_dynamic, finger.transmission.path.total_angle_rad
    before, after = (np.log(profile) for profile in two_ends)
    s = np.linspace(0, theta, before.size)
    y = np.maximum.reduce([before, after[0] - mu * s, after[-1] - mu * (theta - s)])
    y = np.minimum.reduce([y, after[0] + mu * s, after[-1] + mu * (theta - s)])
    assert np.ptp(after - before) > 0.3  # the load's end did act
    assert after == pytest.approx(y, abs=0.01)
    assert abs(after[0] - after[-1]) <= mu * theta


@equation("3.3")
def test_the_elongation_is_the_mean_tension_over_the_stiffness():
    s = (np.arange(20000) + 0.5) / 20000
    y = math.log(50 + 1.5) - 0.63 * s
    assert float(LAW.elongation_m(50.0, 2e4, Branch.PULL)) == pytest.approx(np.mean(np.exp(y) - 1.5) / 2e4, rel=1e-7)


@equation("6", "7", "4.1")
def test_a_held_link_relaxes_from_both_stiffnesses_to_one():
    e, z = ca.SX.sym("e"), ca.SX.sym("z")
    law = ca.Function("f", [e, z], [LINK.unclipped_force(e, ca.SX(0), (z,))])
    solve = ca.integrator("held", "cvodes", {"x": z, "p": e, "ode": LINK.rate(e, (z,))[0]}, 0.0, 0.7)
    after = float(law(2e-3, solve(x0=0, p=2e-3)["xf"]))
    assert after == pytest.approx(2e4 * 2e-3 + 6e3 * 2e-3 * math.exp(-0.7 / 0.4), rel=1e-5)
    elastic = replace(LINK, relaxing_stiffness_N_per_m=0.0)
    assert number(elastic.unclipped_force(ca.SX(2e-3), ca.SX(0.1), (ca.SX(1e-3),))) == pytest.approx(2e4 * 2e-3 + 0.3)


@equation("5a", "4.2")
def test_the_bristle_climbs_exponentially_over_the_presliding_length():
    v, normal, f = 1e-4, 50.0, ca.SX.sym("f")
    mu = number(BRISTLE.coefficient(ca.SX(v)))
    length, x = mu * normal / 4e4, 3e-4
    rate = BRISTLE.rate(ca.SX(v), (f,), ca.SX(normal))[0]
    end = ca.integrator("slide", "cvodes", {"x": f, "ode": rate}, 0.0, x / v, {"reltol": 1e-9, "abstol": 1e-9})
    assert float(end(x0=0)["xf"]) == pytest.approx(mu * normal * (1 - math.exp(-x / length)), rel=1e-5)
    f_s = 2.0
    assert number(BRISTLE.rate(ca.SX(v), (ca.SX(f_s),), ca.SX(normal))[0]) == pytest.approx(
        4e4 * (v - f_s * v / (normal * mu))
    )


@equation("5b", "5c")
def test_friction_weakens_with_the_first_power_of_speed_and_has_a_viscous_part():
    assert number(BRISTLE.coefficient(ca.SX(7e-3))) == pytest.approx(0.15 + 0.1 * math.exp(-7 / 5))
    assert number(BRISTLE.state_force((ca.SX(3.0),)) + BRISTLE.viscous_force(ca.SX(-0.2))) == pytest.approx(3.0 - 0.8)


@equation("4.3", "4.4", "4.5")
@pytest.mark.parametrize("n", [1, 6, 40])
def test_the_equivalent_coefficient_gives_the_capstan_ratio_for_any_number_of_masses(n):
    mu, theta = 0.2, 3.1
    bar = float(equivalent_coefficient(mu, theta / n))
    assert bar == pytest.approx((1 - math.exp(-mu * theta / n)) / (1 + math.exp(-mu * theta / n)), rel=1e-12)
    tension = 20.0
    for _ in range(n):
        near = tension * (1 + bar) / (1 - bar)
        normal = number(normal_force(ca.SX(near), ca.SX(tension), ca.SX(0)))
        assert near - tension == pytest.approx(bar * normal, rel=1e-12)
        tension = near
    assert tension / 20 == pytest.approx(math.exp(mu * theta), rel=1e-12)


@equation("5.1")
def test_between_two_tensions_lie_friction_and_inertia_of_one_mass(finger):
    whole, step = finger.transmission, 1e-4
    heavy = replace(whole, tendon=replace(whole.tendon, mass_kg=1.0))  # so that inertia is seen
    force = 40 + 20 * np.sin(2 * np.pi * 5 * step * np.arange(1501))
    chain = Chain.of(heavy, Level.PRESLIDING)
    run = simulate(chain, force, step, record=True)
    before, now, after = (ChainState.from_vector(run.states[row], chain.layout) for row in (1399, 1400, 1401))
    acceleration = (after.velocity_m_per_s - before.velocity_m_per_s)[1:-1] / (2 * step)
    inertia = 1.0 / 6 * acceleration
    friction = now.friction[0] + whole.friction.viscous_N_s_per_m / 6 * now.velocity_m_per_s[1:-1]
    difference = run.tension_N[1400][:-1] - run.tension_N[1400][1:]
    assert np.max(np.abs(inertia)) > 0.02 * np.max(np.abs(difference))
    assert difference == pytest.approx(friction + inertia, abs=0.005 * np.max(np.abs(difference)))


@equation("5.2", "5.3")
@pytest.mark.parametrize("v", [-0.02, -1e-4, 3e-3, 0.05])
def test_the_quadratic_of_the_inverse_solves_the_implicit_bristle_law(v):
    step, base, far = 1e-3, 0.7, 60.0
    at = ca.SX(v), (ca.SX(base),), ca.SX(step), ca.SX(far)
    f_s = number(BRISTLE.implicit_from_far_side(*at)[0])
    mu = number(BRISTLE.coefficient(ca.SX(v)))
    b, g = base + step * 4e4 * v, step * 4e4 * abs(v) / mu
    h = (far + g - b) / 2
    assert f_s == pytest.approx(-h + math.sqrt(h * h + far * b), rel=1e-9)
    assert f_s * (1 + g / (far + f_s)) == pytest.approx(b, rel=1e-9)
    assert f_s == pytest.approx(base + step * number(BRISTLE.rate(ca.SX(v), (ca.SX(f_s),), ca.SX(far + f_s))[0]))


def test_forward_through_the_same_chain_the_inverse_returns_the_reference(finger):
    reference = sample_reference(finger)
    chain = Chain.of(finger.transmission, Level.PRESLIDING)
    force = invert(chain, reference.tension_N, reference.step_s).force_N
    back = simulate(chain, force, reference.step_s).output_tension_N
    assert np.max(np.abs(back - reference.tension_N)) < 1e-6


@equation("6.1", "6.2")
def test_the_optimal_profile_keeps_its_limits_and_is_better_than_the_clipped_inverse(finger):
    step, limits = 2e-3, ForceLimits(minimum_N=0, maximum_N=200, rate_N_per_s=250.0)
    reference = 30 + 12 * np.sin(2 * np.pi * np.arange(0, 1 + step, step)) ** 2
    chain = Chain.of(finger.transmission, Level.PRESLIDING, segments=2)

    def mean_square(force):
        return np.mean((simulate(chain, force, step).output_tension_N - reference) ** 2)

    clipped = limits.apply(invert(chain, reference, step).force_N, step, 30.0)
    best = track(chain, reference, step, limits).force_N
    assert mean_square(best) < 0.5 * mean_square(clipped)
    assert np.max(np.abs(np.diff(best))) <= 250.0 * step * (1 + 1e-9)
    assert np.all((best >= 0) & (best <= 200))


@equation("7.1", "7.2")
def test_a_joint_changes_the_angles_of_its_section_and_the_lengths_of_the_links_across_it():
    """Taut and without tension everywhere, the displacements of the bodies make room for what the path gains."""
    sections = (
        Section(name="hip", angle_rad=1.2, length_m=0.2),
        Section(name="knee", angle_rad=0.9, length_m=0.15, joint="knee", angle_per_rad=1.0, length_per_rad_m=0.01),
        Section(name="cuff", angle_rad=0.6, length_m=0.1),
    )
    cut = cut_path(sections, 6)
    q = np.array([-1.2, -0.4, 0.0, 0.6])
    rows = cut.at({"knee": q})
    knee = cut.section_of == 1
    assert rows.angle_rad[:, knee].sum(axis=1) == pytest.approx(np.maximum(0.9 + q, 0.0))
    assert rows.angle_rad[:, ~knee].sum(axis=1) == pytest.approx(1.8)
    assert rows.gained_m.sum(axis=1) == pytest.approx(0.01 * q)
    assert (0.45 / rows.ratio).sum(axis=1) == pytest.approx(0.45 + 0.01 * q)
    bodies = np.concatenate([np.zeros((4, 1)), np.cumsum(rows.gained_m, axis=1)], axis=1)  # q_1 .. from the actuator
    elongation = bodies[:, :-1] - bodies[:, 1:] + rows.gained_m
    assert elongation == pytest.approx(np.zeros_like(elongation), abs=1e-15)


@equation("7.3")
def test_contact_that_is_lost_takes_its_force_along_so_that_the_bound_survives():
    mu, phi, normal = 0.2, 0.9, 50.0
    force = float(equivalent_coefficient(mu, phi)) * normal  # sliding in full
    for q in np.linspace(0, -1.2, 25):
        new = max(0.9 + q, 0.0)
        force *= new / phi if phi > 0 else 0.0
        phi = new
        assert force <= float(equivalent_coefficient(mu, phi)) * normal * (1 + 1e-12)
    assert force == 0


@equation("8.1")
def test_one_step_of_the_recursion_is_that_of_the_packages():
    e, w, s, f, P, R, Q = 0.03, 0.7, 1.9, 1.05, 0.02, 0.4, 1e-4
    loose = (10.0, Q, 1.0, 1.0, 0.1, 9.0)  # neither clip, variance of the start, rate nor bound acts
    level = 3.0
    found = update_law(1).function()(e, w, s, f, P, 0.0, 0.01, 0.0, 0.01, level, R, *loose)
    K = w * P * s / (w * s * s * P + R)
    assert float(found[0]) == pytest.approx(f + K * e, rel=1e-12)
    assert float(found[1]) == pytest.approx((1 + 5 * K * e) * (1 - K * s) * P + w * Q / level, rel=1e-12)


@equation("8.2")
def test_two_plays_bracket_the_output_of_every_plant_between_them():
    a, d = 0.63, 0.12
    force = 40 * np.exp(np.cumsum(np.random.default_rng(4).normal(0, 0.1, 600)))

    def output(exponent):
        law = CapstanLaw(pull_exponent=exponent, release_exponent=exponent, adhesion_N=1.5)
        return law.output_history_N(force, 40.0) + 1.5

    middle = output(a)
    for share in np.linspace(-1, 1, 9):
        truth = output(a + share * d)
        assert np.all(truth >= middle * math.exp(-d) * (1 - 1e-12))
        assert np.all(truth <= middle * math.exp(d) * (1 + 1e-12))
    assert np.min(output(a + d) / middle) == pytest.approx(math.exp(-d), rel=1e-9)  # and the bound is met
    law = CapstanLaw(pull_exponent=a, release_exponent=a, adhesion_N=1.5)
    low, high = CertifiedInterval(law=law, spread=d / a, noise_N=0.0).history_N(force, 40.0)
    for share in np.linspace(-1, 1, 9):
        truth = output(a + share * d) - 1.5
        assert np.all((low - 1e-9 <= truth) & (truth <= high + 1e-9))


@equation("8.3")
@pytest.mark.parametrize(("gain", "settles"), [(0.9, True), (2.5, False)])
def test_integral_action_on_logarithms_comes_to_rest_without_hunting(gain, settles):
    u, w, target, error = math.log(30.0), math.log(30.0), math.log(55.0), []
    for _ in range(200):
        u += gain * (target - w)
        w = min(max(w, u - 0.63), u + 0.63)
        error.append(target - w)
    assert (abs(error[-1]) < 1e-9) == settles
    if settles:
        assert min(error) > -1e-12  # never beyond


@equation("9.1")
@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
def test_the_best_factor_on_two_plants_leaves_tanh_of_the_half_width(share):
    d = share * 0.2 * math.pi
    factors = np.linspace(0.5, 1.5, 200001)
    worst = np.maximum(np.abs(factors * math.exp(d) - 1), np.abs(factors * math.exp(-d) - 1))
    assert worst.min() == pytest.approx(math.tanh(d), rel=1e-4)
    if share == 0.1:
        page = (ROOT / "docs" / "theory" / "error.md").read_text(encoding="utf-8")
        assert f"known to ±10 % means at least {100 * math.tanh(d):.1f} %" in page


@equation("9.2")
@pytest.mark.parametrize("share", [-0.1, 0.1])
def test_the_rms_error_of_a_wrong_coefficient_stays_within_its_bound_and_comes_near_it(share):
    a, p = 0.63, 1.5
    d = abs(share) * a
    reference = 40 + 15 * np.sin(np.linspace(0, 20, 4000)) + 8 * np.sin(np.linspace(0, 53, 4000))
    force = CapstanLaw(pull_exponent=a, release_exponent=a, adhesion_N=p).input_history_N(reference)
    real = CapstanLaw(pull_exponent=a * (1 + share), release_exponent=a * (1 + share), adhesion_N=p)
    error = real.output_history_N(force, reference[0]) - reference
    bound = (math.exp(d) - 1) * np.sqrt(np.mean((reference + p) ** 2))
    assert 0.6 * bound < np.sqrt(np.mean(error**2)) <= bound


@equation("P1", "P2")
def test_the_moduli_of_ropes_follow_from_their_stretch_factors():
    """Per cent of length = W G/D^2, pounds and inches."""
    for factor, gigapascal in ((7.79e-6, 113), (1.20e-5, 73), (1.62e-5, 54), (1.07e-5, 82), (1.40e-5, 63)):
        load_N, diameter_m = 100 * 4.44822, 0.1 * 0.0254
        strain = 100 * factor / 0.1**2 / 100
        assert load_N / strain / (math.pi / 4 * diameter_m**2) / 1e9 == pytest.approx(gigapascal, abs=0.5)
        assert 400 / (math.pi * factor) * 6894.76 / 1e9 == pytest.approx(gigapascal, abs=0.5)


@equation("P4", "P5", "P6")
def test_the_formulas_of_the_parameter_guide_agree_with_the_laws():
    k1, k2 = 2e4, 6e3
    assert (k1 + k2) / k1 - 1 == pytest.approx(k2 / k1)  # (4.1) at 0 over (4.1) at infinity
    mu, normal, sigma = 0.15, 50.0, 4e4
    assert mu * normal / (mu * normal / sigma) == pytest.approx(sigma)  # (4.2), with T_in - T_out = mu f_n
    inertia, gear, drum, speed = 1e-5, 30.0, 0.015, 200.0
    tendon_speed = drum * speed / gear
    assert gear**2 * inertia / drum**2 * tendon_speed**2 == pytest.approx(inertia * speed**2)  # the same energy


# Checked where the packages hold it: the robust objective, and the joint.
ELSEWHERE = {
    "6.3": "ocp/tracking/test_calm.py",
    "6.4": "ocp/tracking/test_robust.py",
    "10.1": "ocp/joint/test_independent_plant.py",
    "10.2": "ocp/joint/test_round_trip.py",
    "10.3": "models/joint/test_closed_form.py",
    "10.4": "models/joint/test_closed_form.py",
    "10.5": "models/joint/test_closed_form.py",
    "12.1": "models/mechanism/test_equations.py",
    "12.2": "models/mechanism/test_equations.py",
    "12.3": "models/mechanism/test_equations.py",
    "12.4": "ocp/mechanism/test_slopes.py",
}


def test_every_numbered_formula_has_its_check():
    printed = set()
    for page in [*(ROOT / "docs" / "theory").glob("*.md"), *(ROOT / "docs" / "guide").glob("*.md")]:
        tags = re.findall(r"\\tag\{(.+?)\}", page.read_text(encoding="utf-8"))
        assert len(tags) == len(set(tags)), page
        assert not printed & set(tags), page
        printed |= set(tags)
    assert printed == CHECKED | set(ELSEWHERE)
    assert all((ROOT / "tests" / place).exists() for place in ELSEWHERE.values())
