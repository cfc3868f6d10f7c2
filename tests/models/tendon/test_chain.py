"""The chain as a whole."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.parameters import Path, Transmission
from tendonff.models.parameters.numbers import keys_of, number_of, with_numbers, without_friction
from tendonff.models.path import Section
from tendonff.models.tendon.chain import Chain

SECTIONS = (
    Section(name="sheath", angle_rad=1.5, length_m=0.2),
    Section(name="guide", angle_rad=0.9, length_m=0.1, mu_dynamic=0.12, mu_static=0.14),
)
PATHS = {
    "arc": Path(total_angle_rad=2.4, segments=3),
    "sections": Path(total_angle_rad=2.4, segments=4, sections=SECTIONS),
}


def rate(chain: Chain) -> np.ndarray:
    """Rate of every state somewhere in motion."""
    equations = chain_equations(chain)
    at = [equations.state, equations.inputs, equations.place, equations.place_rate]
    f = ca.Function("f", at, [equations.rate])
    place = chain.path_at(np.zeros(1)).table()[0]
    state = chain.rest_state(30.0).vector() + 1e-3 * np.sin(1.0 + np.arange(chain.layout.size))
    return np.array(f(state, [31.0, 0, 0, 0], place, 0 * place)).ravel()


@pytest.mark.parametrize("path", PATHS)
def test_stiffened_bristles_are_those_of_a_stiffer_transmission_on_every_path(path: str, generic: Transmission) -> None:
    rig = replace(generic, path=PATHS[path])
    stiff = Chain.of(with_numbers(rig, {"bristle_stiffness": 30.0}), Level.PRESLIDING)
    plain = Chain.of(rig, Level.PRESLIDING)
    assert rate(plain.stiffened(30.0)) == pytest.approx(rate(stiff), rel=1e-12)
    assert np.abs(rate(stiff) - rate(plain)).max() > 1


def test_a_factor_on_mu_takes_sections_and_pulleys_along(generic: Transmission) -> None:
    pulley = Section(name="wheel", angle_rad=0.5, length_m=0.1, kind="pulley", bearing_exponent=0.02)
    path = Path(total_angle_rad=2.9, segments=4, sections=(*SECTIONS, pulley))
    less = with_numbers(replace(generic, path=path), {"mu": 0.5})
    sheath, guide, wheel = less.path.sections
    assert (sheath.mu_dynamic, guide.mu_dynamic, guide.mu_static, wheel.bearing_exponent) == (None, 0.06, 0.07, 0.01)
    assert less.friction.mu_dynamic_release == 0.5 * generic.friction.release_dynamic
    bare = without_friction(less)
    assert rate(Chain.of(bare, Level.ELASTIC)) is not None
    assert bare.friction.adhesion_N == 0 == bare.path.sections[2].bearing_exponent


def test_every_key_can_be_read_and_set_to_what_it_is(generic: Transmission) -> None:
    rig = replace(generic, path=PATHS["sections"])
    for key in keys_of(rig):
        value = number_of(rig, key)
        if value is not None:
            assert with_numbers(rig, {key: value}) == rig, key


def test_a_static_coefficient_keeps_its_ratio_unless_it_is_given(generic: Transmission) -> None:
    friction = with_numbers(generic, {"friction.mu_dynamic": 0.1}).friction
    assert friction.mu_static == pytest.approx(0.1 * 0.23 / 0.2)
    both = with_numbers(generic, {"friction.mu_dynamic": 0.1, "friction.mu_static": 0.3}).friction
    assert (both.mu_dynamic, both.mu_static) == (0.1, 0.3)


def test_a_key_that_there_is_not_is_an_error(generic: Transmission) -> None:
    with pytest.raises(KeyError, match="load\\.stifness"):
        with_numbers(generic, {"load.stifness": 1.0})
