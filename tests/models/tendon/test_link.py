import casadi as ca
import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tendonff.models.tendon.link import TwoTimesLink, ZenerLink, tendon_force

LINK = ZenerLink(stiffness_N_per_m=2e4, relaxing_stiffness_N_per_m=6e3, relaxation_time_s=0.4, damping_N_s_per_m=30.0)


def response(elongation: np.ndarray, rate: np.ndarray, step_s: float) -> np.ndarray:
    """Force of the link under a given motion from rest, by the law's own differential equation."""
    e, e_rate, z, h = (ca.SX.sym(name) for name in ("e", "e_rate", "z", "h"))
    slope = ca.Function("slope", [z, e], [LINK.rate(e, (z,))[0]])
    e_mid, e_end = ca.SX.sym("e_mid"), ca.SX.sym("e_end")
    k1 = slope(z, e)
    k2 = slope(z + h / 2 * k1, e_mid)
    k3 = slope(z + h / 2 * k2, e_mid)
    k4 = slope(z + h * k3, e_end)
    step = ca.Function(
        "step", [z, e, e_mid, e_end], [ca.substitute(z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), h, step_s)]
    )
    run = step.mapaccum(len(elongation) // 2)
    ends = np.asarray(run(0.0, elongation[:-2:2], elongation[1:-1:2], elongation[2::2])).ravel()
    force = ca.Function("force", [e, e_rate, z], [LINK.unclipped_force(e, e_rate, (z,))])
    return np.asarray(force(elongation[2::2][None, :], rate[2::2][None, :], ends[None, :])).ravel()


def test_the_step_response_is_that_of_the_transfer_function() -> None:
    """F/V = [b_k (k1 + k2) s + k1 k2]/(b_k s^2 + k2 s), eq. (7), with the structural damping c beside it."""
    h, count, b_k = 1e-3, 3000, 6e3 * 0.4
    by_speed = control.tf([b_k * 2.6e4, 2e4 * 6e3], [b_k, 6e3, 0.0]) + 30.0
    time = np.arange(count + 1) * h
    speed = 0.01  # a step of velocity: a ramp of elongation
    expected = control.step_response(speed * by_speed, T=time).outputs
    fine = np.arange(2 * count + 1) * h / 2
    force = response(speed * fine, np.full(fine.shape, speed), h)
    assert force == pytest.approx(expected[1:], rel=1e-9)
    # The three terms are seen: damping at once, both springs at first, the lasting one in the end.
    assert expected[0] == pytest.approx(30.0 * speed, rel=1e-6)
    slope = np.diff(expected) / (speed * h)
    assert slope[0] == pytest.approx(2.6e4, rel=2e-3)
    assert slope[-1] == pytest.approx(2e4, rel=2e-3)


@given(f=st.floats(-100.0, 100.0))
def test_a_tendon_cannot_push(f: float) -> None:
    assert float(ca.evalf(tendon_force(ca.SX(f)))) == max(f, 0.0)


@given(
    e_base=st.floats(-0.01, 0.01), z_base=st.floats(-0.01, 0.01), rate=st.floats(-1.0, 1.0), step=st.floats(1e-5, 1e-1)
)
def test_the_implicit_link_satisfies_its_own_rule(e_base: float, z_base: float, rate: float, step: float) -> None:
    """z = base + H (e - z)/tau at the elongation of the end, and the force is that of the law there."""
    e = e_base + step * rate
    (end,) = LINK.implicit(ca.SX(e), (ca.SX(z_base),), ca.SX(step))
    z, force = (float(ca.evalf(x)) for x in (end, LINK.unclipped_force(ca.SX(e), ca.SX(rate), (end,))))
    assert z == pytest.approx(z_base + step * (e - z) / 0.4, abs=1e-14)
    assert force == pytest.approx(2e4 * e + 6e3 * (e - z) + 30.0 * rate, abs=1e-9)


TWO_TIMES = TwoTimesLink(
    stiffness_N_per_m=2e4,
    relaxing_stiffness_N_per_m=6e3,
    relaxation_time_s=0.4,
    damping_N_s_per_m=30.0,
    second_relaxing_stiffness_N_per_m=3e3,
    second_relaxation_time_s=5.0,
)


def test_a_link_with_two_times_relaxes_as_the_sum_of_two_exponentials() -> None:
    """Stretched by e at once and held: f = k1 e + k2 e exp(-t/tau) + k3 e exp(-t/tau3), by the law's own rate."""
    e, step, count = 1e-3, 2e-3, 5000
    states = [ca.SX.sym("z"), ca.SX.sym("z_second")]
    ends = TWO_TIMES.implicit(ca.SX(e), tuple(states), ca.SX(step / 2))  # midpoint rule: 2 end - start
    midpoint = ca.Function("step", [ca.vertcat(*states)], [2 * ca.vertcat(*ends) - ca.vertcat(*states)])
    z = np.hstack([np.zeros((2, 1)), np.asarray(midpoint.mapaccum(count)(np.zeros(2)))])
    force = ca.Function("f", states, [TWO_TIMES.unclipped_force(ca.SX(e), ca.SX(0), tuple(states))])
    time = step * np.arange(count + 1)
    expected = e * (2e4 + 6e3 * np.exp(-time / 0.4) + 3e3 * np.exp(-time / 5.0))
    assert np.asarray(force(z[:1], z[1:])).ravel() == pytest.approx(expected, abs=1e-5)


def test_pieces_of_a_link_with_two_times_add_up_to_the_whole() -> None:
    """Seven pieces in a row, each stretched by a seventh, carry what the whole carries."""
    e, e_rate, z = 1e-3, 0.02, (2e-4, 5e-4)
    whole = TWO_TIMES.unclipped_force(ca.SX(e), ca.SX(e_rate), tuple(map(ca.SX, z)))
    piece = TWO_TIMES.shortened(ca.SX(7))
    part = piece.unclipped_force(ca.SX(e / 7), ca.SX(e_rate / 7), tuple(ca.SX(one / 7) for one in z))
    assert float(ca.evalf(part)) == pytest.approx(float(ca.evalf(whole)), rel=1e-12)
