"""Numbers of a mechanism by the dotted keys of its scenario."""

from dataclasses import replace

import pytest

from tendonff.models.parameters.numbers import keys_of, number_of, with_numbers
from tests.joint_rig import bent, mechanism


@pytest.mark.parametrize("rig", [mechanism(), bent(mechanism())], ids=["plain", "bent"])
def test_every_number_can_be_replaced_by_itself(rig) -> None:
    for key in keys_of(rig):
        value = number_of(rig, key)
        if value is not None:
            assert with_numbers(rig, {key: value}) == rig, key


def test_a_key_of_all_tendons_is_there_while_they_agree_and_one_of_a_tendon_always() -> None:
    rig = mechanism()
    both = with_numbers(rig, {"friction.mu_dynamic": 0.1})
    assert [t.friction.mu_static for t in both.tendons] == [0.1, 0.1]  # a ratio of one is kept
    one = with_numbers(rig, {"tendons.flexor.friction.mu_dynamic": 0.1})
    assert [t.friction.mu_dynamic for t in one.tendons] == [0.1, 0.2]
    assert "friction.mu_dynamic" not in keys_of(one)
    assert number_of(one, "tendons.flexor.friction.mu_dynamic") == 0.1
    assert with_numbers(rig, {"mu": 0.5, "stiffness": 2.0}).tendons[1].friction.mu_dynamic == 0.1


def test_joint_drive_arm_and_sections_have_keys_of_their_own() -> None:
    rig = bent(mechanism())
    changed = with_numbers(
        rig,
        {
            "joints.q.gravity_N_m": 0.3,
            "drive.pretension_N": 4.0,
            "tendons.extensor.moment_arm_m": -2e-3,
            "tendons.flexor.path.sections.tube.angle_rad": 1.5,
        },
    )
    assert changed.joint.gravity_N_m == 0.3
    assert changed.drive == replace(rig.drive, pretension_N=4.0)
    assert changed.tendons[1].arm.moment_arm_m == -2e-3
    assert changed.tendons[0].path.total_angle_rad == pytest.approx(2.5)
