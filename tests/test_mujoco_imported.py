"""Tendons of an imported model in MuJoCo: what they give is what they got."""

from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

import tendonff as tf  # noqa: E402
from examples.mujoco_finger.imported import ImportedTendons  # noqa: E402

MODEL = Path(__file__).parents[1] / "examples" / "tendon_finger.xml"
ROWS, STEP_S = 20, 5e-4


@pytest.mark.compiler
@pytest.mark.slow
@pytest.mark.parametrize("motions", [60, pytest.param(1000, marks=pytest.mark.nightly)])
def test_imported_tendons_give_no_more_work_than_they_got_in_random_motions(motions: int, tmp_path: Path) -> None:
    """Work at the joints: at most that of the motors plus what the tendons stored at the start."""
    chosen = {"tendons": ["deep", "flat", "back"], "joints": ["pip", "dip"]}
    scenario = tf.import_mjcf(MODEL, **chosen, out=tmp_path / "two.toml")
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    model.opt.timestep = STEP_S
    model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0.0
    data = mujoco.MjData(model)
    random, worst, moved = np.random.default_rng(4), -np.inf, 0.0
    turns = np.zeros(3)
    with ImportedTendons(model, data, scenario, lambda t: turns * min(t / 0.005, 1.0), masses=12) as tendons:
        names = scenario.mechanism.names
        dofs = [int(model.joint(name).dofadr[0]) for name in names]
        stored = tendons.stored_J
        for _ in range(motions):
            turns = random.uniform(-0.1, 0.6, 3)
            tendons.restart(data)
            data.qvel[dofs] = random.normal(0.0, 10.0, 2)
            given = got = 0.0
            torque, pulls, at = tendons.torque_N_m, tendons.motor_N_m, turns * 0.0
            for _ in range(ROWS):
                q = data.qpos[tendons.address].copy()
                mujoco.mj_step(model, data)
                tendons.follow(data)
                now = tendons.motor_rad(data.time)
                given += float((torque + tendons.torque_N_m) / 2 @ (data.qpos[tendons.address] - q))
                got += float((pulls + tendons.motor_N_m) / 2 @ (now - at))
                torque, pulls, at = tendons.torque_N_m, tendons.motor_N_m, now
            worst, moved = max(worst, given - got - stored), max(moved, abs(given))
    assert moved > stored
    assert worst < 0
