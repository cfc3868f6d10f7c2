"""Lengths, wrap angles and moment arms of a driven joint."""

import numpy as np
import pytest

from tests.joint_rig import bent, mechanism


def test_a_joint_tells_lengths_wrap_angles_and_moment_arms_as_a_finger_does() -> None:
    rig = bent(mechanism())
    angles = np.array([[0.1], [0.3]])
    length, wrap, arms = rig.length_m(angles), rig.wrap_angle_rad(angles), rig.moment_arm_m(angles)
    for t, tendon in enumerate(rig.tendons):
        follows = [section for section in tendon.path.sections if section.joint == rig.joint.name]
        assert follows
        wound = sum(s.angle_rad + s.angle_per_rad * (angles[:, 0] if s in follows else 0) for s in tendon.path.sections)
        arm = tendon.arm.moment_arm_m - sum(s.length_per_rad_m for s in follows)
        assert wrap[:, t] == pytest.approx(wound)
        assert np.diff(length[:, t]) == pytest.approx([-0.2 * arm])
        assert arms[:, t, 0] == pytest.approx([arm, arm])
