"""What each mass of a path in sections gets: worked out by hand for two sections that differ in everything."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from tendonff.models.fidelity import Level
from tendonff.models.parameters import Path, Transmission
from tendonff.models.path import JointMotion, Section
from tendonff.models.tendon.chain import Chain, laws_at

TIGHT = Section(name="tight", angle_rad=2.4, length_m=0.02, joint="q", angle_per_rad=1.0)
WIDE = Section(name="wide", angle_rad=0.6, length_m=0.06)
SHARES = np.array([0.25 / 2, 0.25 / 2, 0.75])  # of the length, two masses on the tight section, one on the wide


def chain_of(generic: Transmission, **own: float) -> Chain:
    sections = (TIGHT, replace(WIDE, **own))  # type: ignore[arg-type]
    motion = JointMotion(names=("q",), time_s=np.zeros(1), angle_rad=np.zeros((1, 1)))
    path = Path(total_angle_rad=3.0, segments=3, sections=sections)
    return Chain.of(replace(generic, path=path, motion=motion), Level.PRESLIDING)


def numbers_of(chain: Chain, name: str) -> list[np.ndarray]:
    """A number of each mass's friction as the chain was cut, and as it is where the joints stand."""
    there = laws_at(chain, ca.DM(chain.path_at(np.zeros(1)).table()[0]))[0]
    return [np.ravel(np.asarray(getattr(law, name), float)) for law in (chain.friction, there)]


def test_viscous_friction_goes_by_length_and_bristles_by_wrap_angle(generic: Transmission) -> None:
    """A lubricant acts on all that slides in it, a contact where the tendon presses."""
    chain = chain_of(generic)
    assert chain.elements.path.section_of.tolist() == [0, 0, 1]
    for viscous in numbers_of(chain, "viscous_N_s_per_m"):
        assert viscous == pytest.approx(1.0 * SHARES)
    for bristle in numbers_of(chain, "bristle_stiffness_N_per_m"):
        assert bristle == pytest.approx(2e4 * np.array([1.2, 1.2, 0.6]) / 3.0)
    assert np.ravel(chain.elements.piece.mass_kg) == pytest.approx(0.002 * SHARES)


@pytest.mark.parametrize(
    ("own", "expected"),
    [
        # mu_dynamic, mu_static, mu_dynamic_release, mu_static_release; the whole has 0.2, 0.23, 0.15, 0.18
        ({}, (0.2, 0.23, 0.15, 0.18)),
        ({"mu_dynamic": 0.3}, (0.3, 0.3 * 0.23 / 0.2, 0.3, 0.3 * 0.18 / 0.15)),  # the static excess of the whole stays
        ({"mu_dynamic": 0.3, "mu_static": 0.31}, (0.3, 0.31, 0.3, 0.3 * 0.18 / 0.15)),
        ({"mu_dynamic_release": 0.1, "mu_static_release": 0.12}, (0.2, 0.23, 0.1, 0.12)),
        (
            {"mu_dynamic": 0.3, "mu_static": 0.4, "mu_dynamic_release": 0.1, "mu_static_release": 0.11},
            (0.3, 0.4, 0.1, 0.11),
        ),
    ],
)
def test_a_section_has_its_own_coefficients_and_the_others_those_of_the_whole(
    generic: Transmission, own: dict[str, float], expected: tuple[float, ...]
) -> None:
    """Tanh(mu phi/2) on each mass, phi = 1.2, 1.2, 0.6."""
    names = ("mu_dynamic_pull", "mu_static_pull", "mu_dynamic_release", "mu_static_release")
    for name, usual, there in zip(names, (0.2, 0.23, 0.15, 0.18), expected, strict=True):
        exponents = np.array([1.2 * usual, 1.2 * usual, 0.6 * there])
        for mu in numbers_of(chain_of(generic, **own), name):
            assert mu == pytest.approx(np.tanh(exponents / 2)), name
