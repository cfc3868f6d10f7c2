"""Mu theta of a path whose sections have coefficients of their own, bearings and joints, against the sum by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.capstan import CapstanLaw, exponent_lines
from tendonff.models.fidelity import Level
from tendonff.models.path import JointMotion, Section, SectionKind
from tendonff.models.tendon.chain import Chain, laws_at


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


def slip_exponent_of_the_chain(rig, joint_rad):
    """Ln of the tension ratio of all masses that slip in pulling, where the joint stands."""
    motion = JointMotion(names=("wrist",), time_s=np.zeros(1), angle_rad=np.array([[joint_rad]]))
    chain = Chain.of(replace(rig, motion=motion), Level.VISCOELASTIC)
    friction, _ = laws_at(chain, chain.path_at(np.zeros(1)).table()[0])
    mu = np.asarray(friction.slip_coefficients[0], float)
    return float(np.log((1 + mu) / (1 - mu)).sum())


@pytest.mark.parametrize("wrist_rad", [-0.6, -0.2, 0.0, 0.4])
def test_a_bearing_whose_wrap_angle_a_joint_changes_has_one_law_near_that_of_its_load(generic, wrist_rad):
    """(T1 - T2) R = mu_b r_b 2 T sin(phi/2): the exponent is the angle's share, and zero where the tendon lifts off."""
    pulley = Section(
        name="p", angle_rad=0.6, kind=SectionKind.PULLEY, bearing_exponent=0.05, joint="wrist", angle_per_rad=1.0
    )
    path = replace(generic.path, sections=(Section(name="arc", angle_rad=1.0), pulley), total_angle_rad=1.6)
    rig = replace(generic, path=path)
    arc, joints = generic.friction.mu_dynamic * 1.0, {"wrist": wrist_rad}
    found = CapstanLaw.of(rig, joints).pull_exponent - arc
    assert found == pytest.approx(slip_exponent_of_the_chain(rig, wrist_rad) - arc, abs=1e-9)
    assert found == pytest.approx(0.05 * math.sin((0.6 + wrist_rad) / 2) / math.sin(0.3), rel=0.05, abs=1e-12)
    assert exponent_lines(rig, joints)[1].held == pytest.approx(found, abs=1e-12)
