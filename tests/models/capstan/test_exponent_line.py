"""Mu theta of a path whose sections have coefficients of their own, bearings and joints, against the sum by hand."""

from dataclasses import replace

import pytest

from tendonff.models.capstan import CapstanLaw, exponent_lines
from tendonff.models.path import Section, SectionKind


@pytest.fixture
def wristed(generic):
    """A shaft, a pulley, a wrist whose joint bends it, and a jaw."""
    sections = (
        Section(name="shaft", angle_rad=0.4),
        Section(name="pulley", angle_rad=1.57, kind=SectionKind.PULLEY, bearing_exponent=0.02),
        Section(name="wrist", angle_rad=0.3, joint="wrist", angle_per_rad=1.0, mu_dynamic=0.2, mu_dynamic_release=0.25),
        Section(name="jaw", angle_rad=1.2),
    )
    path = replace(generic.path, sections=sections, total_angle_rad=sum(s.angle_rad for s in sections), segments=8)
    friction = replace(generic.friction, mu_dynamic=0.17, mu_static=0.17, mu_dynamic_release=0.15)
    return replace(generic, path=path, friction=friction)


@pytest.mark.parametrize("wrist_rad", [0.0, 0.5, -0.4])
def test_the_sum_over_the_sections_where_the_joints_stand(wristed, wrist_rad):
    bent = max(0.3 + wrist_rad, 0.0)
    pull, release = exponent_lines(wristed, {"wrist": wrist_rad})
    assert pull.exponent(0.17) == pytest.approx(0.17 * 1.6 + 0.2 * bent + 0.02)
    assert release.exponent(0.15) == pytest.approx(0.15 * 1.6 + 0.25 * bent + 0.02)
    assert pull.mu(pull.exponent(0.17)) == pytest.approx(0.17)
    law = CapstanLaw.of(wristed, {"wrist": wrist_rad})
    assert (law.pull_exponent, law.release_exponent) == pytest.approx((pull.exponent(0.17), release.exponent(0.15)))


def test_less_friction_than_the_sections_have_leaves_no_coefficient(wristed):
    pull, _ = exponent_lines(wristed)
    assert pull.mu(0.05) == 0
