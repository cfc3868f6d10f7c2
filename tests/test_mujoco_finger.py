"""The finger of MuJoCo: it judges lengths and wrap angles, and the inverse runs in a loop of measured joints."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

from examples.mujoco_finger.rig import JOINTS, MODEL, RADII_M, Controller, run, sections, wrap_angles  # noqa: E402


@pytest.mark.parametrize("knuckle", [-0.2, 0.4, 1.2])
@pytest.mark.parametrize("middle", [0.0, 0.9])
def test_lengths_moment_arms_and_wrap_angles_are_those_of_mujoco(knuckle: float, middle: float) -> None:
    joints = dict(zip(JOINTS, (knuckle, middle), strict=True))
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    data = mujoco.MjData(model)
    data.qpos[:] = list(joints.values())
    mujoco.mj_forward(model, data)
    angles, _ = wrap_angles(model, data)
    own = [s.angle_rad + s.angle_per_rad * joints.get(s.joint or "", 0.0) for s in sections() if s.angle_rad > 0]
    assert angles == pytest.approx(own, abs=1e-12)
    length = sum((s.length_m or 0.0) + s.length_per_rad_m * joints.get(s.joint or "", 0.0) for s in sections())
    assert float(data.ten_length[0]) == pytest.approx(
        length - RADII_M[1] * middle, abs=1e-12
    )  # the far end moves there
    assert np.array(data.ten_J).ravel() == pytest.approx([-RADII_M[0], -RADII_M[1]], abs=1e-12)


@pytest.mark.compiler
@pytest.mark.slow
def test_the_inverse_with_measured_joints_follows_where_plain_force_and_the_design_at_rest_do_not(
    record_property: pytest.FixtureRequest,
) -> None:
    errors = {controller: run(controller, 1.5).error_percent for controller in Controller}
    text = ", ".join(f"{name} {error:.2g} %" for name, error in errors.items())
    record_property("figure", f"MuJoCo finger: {text}")  # type: ignore[operator]
    assert errors[Controller.MEASURED] < 0.1
    assert errors[Controller.PLAIN] > 15
    assert errors[Controller.AT_REST] > 15
