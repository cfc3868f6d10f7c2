"""Stiffness that grows with the tension: closed forms."""

from dataclasses import replace

import pytest
from scipy.integrate import quad

from tendonff.models.errors import ParameterError
from tendonff.models.parameters.transmission import Tendon
from tendonff.models.tendon.stiffening import StiffeningLink

SHARE, TENSION_N, STIFFNESS_N_PER_M = 0.3, 20.0, 2e4
LINK = StiffeningLink(
    stiffness_N_per_m=STIFFNESS_N_PER_M,
    relaxing_stiffness_N_per_m=0.0,
    relaxation_time_s=1.0,
    damping_N_s_per_m=0.0,
    stiffening=SHARE,
    stiffening_tension_N=TENSION_N,
)


def force_N(link, stretch_m):
    return link.stiffness_N_per_m * stretch_m + link.explicit_force(stretch_m)


@pytest.mark.parametrize("tension_N", [0.5, 15.0, 39.0, 41.0, 90.0])
def test_the_elongation_is_the_integral_of_the_compliance(tension_N):
    """And the force is its inverse; the stiffness stays from twice the tension on."""

    def compliance(tension):
        return 1 / (STIFFNESS_N_PER_M * (1 + SHARE * (min(tension, 2 * TENSION_N) / TENSION_N - 1)))

    stretch, states = LINK.rest(tension_N)
    assert stretch == pytest.approx(quad(compliance, 0, tension_N, points=[2 * TENSION_N])[0], rel=1e-8)
    assert force_N(LINK, stretch) == pytest.approx(tension_N, rel=1e-12)
    assert states == (stretch,)


def test_links_in_a_row_are_the_whole():
    part = LINK.shortened(8.0)
    assert 8 * part.rest(33.0)[0] == pytest.approx(LINK.rest(33.0)[0], rel=1e-12)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"stiffening": 0.3}, "go together"),
        ({"stiffening": 1.0, "stiffening_tension_N": 5.0}, "must be < 1"),
        ({"stiffening": -0.1, "stiffening_tension_N": 5.0}, "stiffening must be a finite number >= 0"),
    ],
)
def test_what_no_tendon_does_is_refused(keys, said):
    plain = Tendon(
        mass_kg=1e-3,
        stiffness_N_per_m=2e4,
        relaxing_stiffness_N_per_m=0.0,
        relaxation_time_s=1.0,
        damping_N_s_per_m=1.0,
    )
    with pytest.raises(ParameterError, match=said):
        replace(plain, **keys)
