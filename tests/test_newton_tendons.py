"""Newton's tendons, which share nothing with the chain: routes of pinholes, and an imported finger."""

import re
from pathlib import Path

import numpy as np
import pytest
from mjcf_models import TWO_JOINTS

import tendonff as tf
from benchmarks.yardstick.__main__ import OURS, adapters, errors
from benchmarks.yardstick.case import all_cases
from tendonff.compensator.compensators.motors.finger import FingerTask

pytestmark = [pytest.mark.nightly, pytest.mark.slow, pytest.mark.compiler]

STEP_S = 5e-4


@pytest.mark.parametrize("key", ["01_one_end", "02_both_ends", "03_role_swap", "05_slack", "13_three_joints"])
def test_chain_and_newton_are_within_two_percent_of_range_of_one_another_on_a_route_of_pinholes(key: str) -> None:
    """Each against the exact answer: their errors add up to less."""
    pytest.importorskip("newton")
    runs, _ = adapters()
    found = errors([OURS, "Newton"], runs, [case for case in all_cases() if case.key == key])[key]
    assert sum(error for error in found.values() if error is not None) < 2.0
    assert found["Newton"] is not None


def test_a_finger_on_newtons_tendons_follows_within_a_tenth_of_the_error_of_lengths_alone(
    tmp_path: Path,
) -> None:
    """MuJoCo moves the bones, eyelets are pinholes, a cylinder and a sphere are rollers; 0.8 s of the reference."""
    pytest.importorskip("newton")
    mujoco = pytest.importorskip("mujoco")
    from examples.mujoco_finger.newton_tendons import NewtonTendons
    from tendonff.compensator.mjcf.model import read_hand

    path = tmp_path / "model.xml"
    path.write_text(TWO_JOINTS)
    hand = read_hand(path)
    source = tf.import_mjcf(hand.path, out=tmp_path / "hand.toml").source
    text = re.sub(r"(relaxing_stiffness_N_per_m|viscous_N_s_per_m) = \S+", r"\1 = 0.0", source.read_text())
    source.write_text(text)
    task = FingerTask.of(tf.load_scenario(source))
    inverse, time, finger = task.inversion, task.sampled.time_s, task.finger
    model = hand.model
    model.opt.timestep = STEP_S
    model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0.0
    start = dict(zip(finger.names, task.wanted_rad[0].tolist(), strict=True))
    carried = dict(zip([tendon.name for tendon in finger.tendons], inverse.tension_N[0].tolist(), strict=True))
    worst = {}
    for name, motors in (("inverse", inverse.motor_rad), ("linear", task.lengths_rad)):
        data = mujoco.MjData(model)

        def motor_rad(at: float, motors: np.ndarray = motors) -> np.ndarray:
            return np.array([np.interp(at, time, column) for column in motors.T])

        off = []
        with NewtonTendons(hand, data, task.scenario, start, carried, motor_rad) as tendons:
            for _ in range(1600):
                mujoco.mj_step(model, data)
                wanted = [np.interp(data.time, time, column) for column in task.wanted_rad.T]
                off.append(data.qpos[tendons.address] - wanted)
        worst[name] = np.sqrt(np.mean(np.square(off)))
    assert worst["inverse"] < 0.1 * worst["linear"]
