import math
from dataclasses import replace

import casadi as ca
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tendonff.models.tendon.friction import LuGreBristle, equivalent_coefficient, from_far_side

BRISTLE = LuGreBristle(
    bristle_stiffness_N_per_m=2e5,
    mu_dynamic_pull=0.06,
    mu_static_pull=0.09,
    mu_dynamic_release=0.04,
    mu_static_release=0.07,
    stribeck_velocity_m_per_s=5e-3,
    viscous_N_s_per_m=1.0,
)
speeds = st.floats(1e-6, 1.0)
forces = st.floats(-30.0, 30.0)


def number(expression: ca.SX) -> float:
    return float(ca.evalf(expression))


def mu(v: float, bristle: LuGreBristle = BRISTLE) -> float:
    return number(bristle.coefficient(ca.SX(v)))


def rate(v: float, f_s: float, f_n: float) -> float:
    return number(BRISTLE.rate(ca.SX(v), (ca.SX(f_s),), ca.SX(f_n))[0])


@given(v=speeds)
def test_pulling_and_releasing_have_coefficients_of_their_own(v: float) -> None:
    """mu_d + (mu_c - mu_d) e^{-abs(v)/omega}, eq. (5b), first power of the speed."""
    assert mu(v) == pytest.approx(0.06 + 0.03 * math.exp(-v / 5e-3), rel=1e-12)
    assert mu(-v) == pytest.approx(0.04 + 0.03 * math.exp(-v / 5e-3), rel=1e-12)


@pytest.mark.parametrize("n", [1, 6, 40])
def test_equivalent_coefficients_of_n_elements_multiply_to_the_capstan_ratio(n: int) -> None:
    """((1 + mu_eq)/(1 - mu_eq))^N = e^{mu theta}, eqs. (4), (8), (9)."""
    mu_eq = float(equivalent_coefficient(0.2, 3.1 / n))
    assert ((1 + mu_eq) / (1 - mu_eq)) ** n == pytest.approx(math.exp(0.2 * 3.1), rel=1e-12)


@given(v=st.floats(-1.0, 1.0), f_s=forces, f_n=st.floats(1e-3, 1e3))
def test_the_bristle_never_gives_energy(v: float, f_s: float, f_n: float) -> None:
    """d/dt f_s^2/(2 sigma0) <= f_s v: what is stored is at most what was put in."""
    stored = f_s * rate(v, f_s, f_n) / 2e5
    assert stored <= f_s * v + 1e-12 * max(1.0, abs(f_s * v))


@given(v=speeds, f_n=st.floats(0.1, 100.0))
def test_sliding_saturates_at_the_coefficient_times_the_normal_force(v: float, f_n: float) -> None:
    assert rate(v, mu(v) * f_n, f_n) == pytest.approx(0.0, abs=1e-9 * 2e5 * v)
    assert rate(-v, -mu(-v) * f_n, f_n) == pytest.approx(0.0, abs=1e-9 * 2e5 * v)


@given(v=st.floats(-0.5, 0.5), base=forces, f_n=st.floats(0.01, 100.0), step=st.floats(1e-5, 1e-2))
def test_the_implicit_bristle_satisfies_its_own_rule(v: float, base: float, f_n: float, step: float) -> None:
    """f_s = base + H df_s/dt at the end of the step."""
    f_s = number(BRISTLE.implicit(ca.SX(v), (ca.SX(base),), ca.SX(step), ca.SX(f_n))[0])
    scale = abs(base) + step * 2e5 * abs(v) * (1 + abs(f_s) / (f_n * 0.04))
    assert f_s == pytest.approx(base + step * rate(v, f_s, f_n), abs=1e-12 * scale + 1e-15)


@given(v=st.floats(-0.5, 0.5), base=forces, far_sum=st.floats(1.0, 300.0), step=st.floats(1e-5, 1e-2))
def test_the_two_directions_of_the_implicit_bristle_are_inverse(
    v: float, base: float, far_sum: float, step: float
) -> None:
    """f_n = A + f_s, taken from the load's side, gives the f_s that f_n gives from the other."""
    at = ca.SX(v), (ca.SX(base),), ca.SX(step)
    f_s = number(BRISTLE.implicit_from_far_side(*at, ca.SX(far_sum))[0])
    f_n = far_sum + f_s
    assume(f_n > 1e-3)
    scale = abs(base) + step * 2e5 * abs(v) + far_sum
    assert number(BRISTLE.implicit(*at, ca.SX(f_n))[0]) == pytest.approx(f_s, abs=1e-11 * scale * (1 + far_sum / f_n))


class WithoutClosedForm(LuGreBristle):
    """The same law, solved for the normal force by the guarded iteration that other laws need."""

    __slots__ = ()

    def implicit_from_far_side(self, *_known: object) -> None:
        return None


def solved(law: LuGreBristle) -> ca.Function:
    """Bristle force and normal force over velocity, base of the step, its weight and what is known of the far side."""
    v, base, step, far_sum = (ca.SX.sym(name) for name in ("v", "base", "step", "far_sum"))
    f_s = from_far_side(law, v, (base,), step, far_sum)[0]
    return ca.Function("solved", [v, base, step, far_sum], [f_s])


CLOSED = solved(BRISTLE)
ITERATED = solved(WithoutClosedForm(**{name: getattr(BRISTLE, name) for name in BRISTLE.__slots__}))


@given(
    v=st.floats(-0.5, 0.5),
    base=st.floats(-1.0, 1.0),
    step=st.floats(1e-5, 1e-2),
    size=st.sampled_from([1e-4, 1e-2, 1.0, 300.0]),
)
def test_the_iteration_finds_what_the_closed_form_gives_for_tensions_of_any_size(
    v: float, base: float, step: float, size: float
) -> None:
    """Nothing in it knows a newton: a hair under a tenth of a millinewton is solved as well as a cable."""
    at = v * size / 100, base * size, step, size
    assert float(ITERATED(*at)) == pytest.approx(float(CLOSED(*at)), abs=1e-7 * size)


def test_a_frictionless_path_runs_through_the_same_expression() -> None:
    flat = replace(BRISTLE, mu_dynamic_pull=0.0, mu_static_pull=0.0, mu_dynamic_release=0.0, mu_static_release=0.0)
    f_s = number(flat.implicit(ca.SX(0.1), (ca.SX(3.0),), ca.SX(1e-3), ca.SX(20.0))[0])
    assert abs(f_s) < 1e-9
