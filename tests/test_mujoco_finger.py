"""The finger of MuJoCo: it judges lengths and wrap angles, and the inverse runs in a loop of measured joints."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

from examples.mujoco_finger.passive import PassiveTendon, tendon_jacobian  # noqa: E402
from examples.mujoco_finger.rig import (  # noqa: E402
    JOINTS,
    MODEL,
    RADII_M,
    Controller,
    run,
    sections,
    settled,
    transmission,
    wrap_angles,
)
from tendonff.models.path import JointMotion  # noqa: E402


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
    errors = {controller: run(controller, 1.0).error_percent for controller in Controller}
    text = ", ".join(f"{name} {error:.2g} %" for name, error in errors.items())
    record_property("figure", f"MuJoCo finger: {text}")  # type: ignore[operator]
    assert errors[Controller.MEASURED] < 0.1
    assert errors[Controller.PLAIN] > 15
    assert errors[Controller.AT_REST] > 15


@pytest.mark.compiler
@pytest.mark.slow
@pytest.mark.parametrize("motions", [250, pytest.param(1000, marks=pytest.mark.nightly)])
def test_the_exported_plant_as_a_passive_force_gives_no_more_work_than_it_got_in_random_motions(motions: int) -> None:
    """Work at the joints: at most that of the actuator plus what the tendon stored at the start.

    Motions with a step that the plant found no solution for, slack at 30 rad/s and more, are left out: it holds there.
    """
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    rows, start, stiffness = 20, 20.0, 3e4  # the tendon's in `rig.py`
    random, worst, judged = np.random.default_rng(4), -np.inf, 0
    still = JointMotion(names=JOINTS, time_s=np.zeros(1), angle_rad=np.array([settled(model).qpos]))
    with PassiveTendon(
        model, settled(model), transmission(still, 12), start_N=start, force_N=lambda _: start
    ) as tendon:
        for _ in range(motions):
            data, top = settled(model), start * random.uniform(0.3, 3.0)
            tendon.restart(data)
            held = tendon.plant.held
            tendon.force_N = lambda t, top=top: float(np.interp(t, [0.0, 0.005], [start, top]))
            data.qvel[:] = random.normal(0.0, 20.0, 2)
            given = gained = 0.0
            torque, force = tendon.torque_N_m(model, data), start
            for _ in range(rows):
                q, at, pulled, pushes = data.qpos.copy(), tendon.plant.actuator_m, force, torque
                mujoco.mj_step(model, data)
                tendon.follow(data)
                torque, force = tendon.torque_N_m(model, data), tendon.force_N(data.time)
                assert tendon.tension_N[-1] == pytest.approx(tendon.plant.output_N, rel=1e-6, abs=1e-6)
                given += float((torque + pushes) / 2 @ (data.qpos - q))
                gained += (force + pulled) / 2 * (tendon.plant.actuator_m - at)
            if tendon.plant.held == held:
                worst = max(worst, given - gained - start**2 / (2 * stiffness))
                judged += 1
        assert judged > 0.95 * motions
    assert worst < 0


def test_the_jacobian_of_a_tendon_is_that_of_mujoco_s_own_finite_difference() -> None:
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    data = mujoco.MjData(model)
    data.qpos[:] = (0.5, 0.3)
    mujoco.mj_forward(model, data)
    here, found = float(data.ten_length[0]), tendon_jacobian(model, data, 0)
    for k in range(2):
        data.qpos[:] = (0.5, 0.3)
        data.qpos[k] += 1e-6
        mujoco.mj_forward(model, data)
        assert found[k] == pytest.approx((float(data.ten_length[0]) - here) / 1e-6, rel=1e-4)
