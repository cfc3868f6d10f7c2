"""Sections, joints and the cutting into pieces: lengths and angles add up, whatever the cut."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tendonff.models.errors import ParameterError
from tendonff.models.path import JointMotion, Section, SectionKind, check_motion, cut_path

FINGER = (
    Section(name="arm", angle_rad=1.2, length_m=0.036),
    Section(name="knuckle", angle_rad=0.9, length_m=0.027, joint="q", angle_per_rad=1.0, length_per_rad_m=0.01),
    Section(name="bone", angle_rad=0.0, length_m=0.03),
    Section(name="tip", angle_rad=0.6, length_m=0.018),
)


def motion(*angles: float) -> JointMotion:
    return JointMotion(names=("q",), time_s=np.arange(float(len(angles))), angle_rad=np.array(angles)[:, None])


@given(count=st.integers(3, 40), q=st.floats(-0.5, 0.5))
def test_pieces_and_links_add_up_to_the_path(count: int, q: float) -> None:
    path = cut_path(FINGER, count, motion=motion(-0.6, 0.6))
    rows = path.at({"q": np.array([q])})
    assert rows.angle_rad.sum() == pytest.approx(2.7 + q)
    assert (1 / rows.ratio).sum() == pytest.approx((0.111 + 0.01 * q) / 0.111)  # lengths over that of the whole
    assert rows.gained_m.sum() == pytest.approx(0.01 * q, abs=1e-15)
    assert path.length_share.sum() == pytest.approx(1.0)


def test_a_straight_has_no_mass_and_lies_in_one_link() -> None:
    path = cut_path(FINGER, 5)
    assert path.section_of.tolist() == [0, 0, 1, 1, 3]
    lengths = [0.009, 0.018, 0.009 + 0.00675, 0.0135, 0.00675 + 0.03 + 0.009, 0.009]
    assert 1 / path.at_zero.ratio[0] == pytest.approx(np.array(lengths) / 0.111)


def test_masses_go_where_the_tendon_ever_touches() -> None:
    """A joint that straightens its section, and one that is straight until it bends."""
    opening = (FINGER[0], Section(name="fold", angle_rad=0.0, length_m=0.01, joint="q", angle_per_rad=1.0))
    assert cut_path(opening, 4).section_of.tolist() == [0, 0, 0, 0]
    assert cut_path(opening, 4, motion=motion(0.0, 1.2)).section_of.tolist() == [0, 0, 1, 1]
    rows = cut_path(opening, 4, motion=motion(0.0, 1.2)).at({"q": np.array([-0.3, 0.6])})
    assert rows.angle_rad.tolist() == [[0.6, 0.6, 0.0, 0.0], [0.6, 0.6, 0.3, 0.3]]


def test_without_lengths_they_go_by_the_angles() -> None:
    path = cut_path((Section(name="a", angle_rad=1.0), Section(name="b", angle_rad=2.0)), 3)
    assert path.section_of.tolist() == [0, 1, 1]
    assert 1 / path.at_zero.ratio[0] == pytest.approx(np.array([0.5, 1.0, 1.0, 0.5]) / 3)


def test_joints_are_linear_between_instants_and_held_or_repeated_beyond() -> None:
    bent = motion(0.0, 1.0, 0.5)
    assert bent.at(np.array([-1.0, 0.25, 1.5, 9.0]))[:, 0].tolist() == [0.0, 0.25, 0.75, 0.5]
    again = replace(bent, period_s=2.0)  # repeated instead of held
    assert again.at(np.array([0.25, 2.25, 7.5, -0.5]))[:, 0] == pytest.approx([0.25, 0.25, 0.75, 0.75])
    assert bent.moves
    assert not bent.held(np.array([0.3])).moves


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"angle_rad": -0.1}, 'section "s": angle_rad must be a finite number >= 0, got -0.1'),
        ({"angle_rad": 1.0, "angle_per_rad": 1.0}, r"angle_per_rad = 1 needs a joint"),
        ({"angle_rad": 1.0, "kind": SectionKind.PULLEY}, "bearing_exponent belongs to kind"),
        ({"angle_rad": 0.0, "kind": SectionKind.PULLEY, "bearing_exponent": 0.1}, "a pulley needs angle_rad > 0"),
        (
            {"angle_rad": 1.0, "mu_dynamic": 0.2, "mu_static": 0.1},
            "mu_dynamic = 0.2 is above mu_static = 0.1: change both",
        ),
        (
            {"angle_rad": 1.0, "mu_dynamic_release": 0.2, "mu_static_release": 0.1},
            "mu_dynamic_release = 0.2 is above mu_static_release = 0.1: change both, or delete mu_static_release",
        ),
        (
            {"angle_rad": 1.0, "mu_dynamic": 0.2, "mu_static_release": 0.1},
            "mu_dynamic_release = 0.2 is above mu_static_release = 0.1",
        ),
        (
            {"angle_rad": 1.0, "kind": SectionKind.PULLEY, "bearing_exponent": 0.1, "mu_dynamic": 0.2},
            "bearing_exponent = 0.1 and mu_dynamic = 0.2 are two sources of one friction",
        ),
        ({"angle_rad": 1.0, "length_m": math.nan}, "length_m must be a finite number >= 0, got nan"),
    ],
)
def test_a_section_without_meaning_is_refused(keys: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Section(name="s", **keys)  # type: ignore[arg-type]


def test_a_motion_without_meaning_is_refused() -> None:
    with pytest.raises(ParameterError, match='names the joint "q", which is not given'):
        check_motion(FINGER, 0.111, JointMotion(names=("r",), time_s=np.zeros(1), angle_rad=np.zeros((1, 1))))
    with pytest.raises(ParameterError, match=r"the wrap angle would reach .* more than 100 turns"):
        check_motion(FINGER, 0.111, motion(0.0, 700.0))
    with pytest.raises(ParameterError, match=r"its length would become -0\.003 m"):
        check_motion(FINGER, 0.111, motion(0.0, -3.0))
    with pytest.raises(ParameterError, match=r"segments must be >= 3, got 2"):
        cut_path(FINGER, 2)
