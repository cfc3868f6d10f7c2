"""Driven joints under motor angles from a file: options that a tension has as well."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tendonff as tf
from tendonff.compensator import door
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.parameters.numbers import with_numbers

pytestmark = pytest.mark.compiler

WRIST = '[joints.wrist]\nkind = "constant"\nangle_rad = 0.0\n\n'
SECTIONS = """
[[path.sections]]
name = "sheath"
angle_rad = 2.0
length_m = 0.2

[[path.sections]]
name = "wrist"
joint = "wrist"
angle_rad = 1.0
length_m = 0.1
angle_per_rad = 0.5
length_per_rad_m = 0.002
"""
TIME = 1e-3 * np.arange(101)
SWING = 0.1 * (1 - np.cos(2 * np.pi * 3 * TIME))


@pytest.fixture(scope="module")
def files(examples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scenarios of a loop and a finger, the loop's path on a wrist, and files of motor angles and of the wrist."""
    folder = tmp_path_factory.mktemp("motors")
    loop = (examples / "hand_joint.toml").read_text(encoding="utf-8")
    path = loop[loop.index("[path]") : loop.index("[tendon]")]
    moving = loop.replace(path, WRIST + "[path]\nsegments = 6\n" + SECTIONS + "\n")
    finger = (examples / "three_joint_finger.toml").read_text(encoding="utf-8")
    finger = finger.replace("duration_s = 3.0", "duration_s = 0.1").replace("fade_in_s = 0.5", "fade_in_s = 0.1")
    texts = {"loop": loop, "wrist": moving, "finger": finger}
    texts["csv"] = moving.replace('kind = "constant"\nangle_rad = 0.0', 'kind = "csv"\nfile = "long.csv"')
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    wanted = FingerTask.of(load_scenario(folder / "finger.toml")).inversion.motor_rad[: len(TIME)]
    motors = {f"motor_m{k}_linear_rad": column for k, column in enumerate(wanted.T, start=1)}
    pd.DataFrame({"time_s": TIME, "motor_rad": SWING, **motors}).to_csv(folder / "motors.csv", index=False)
    wrist = {"time_s": TIME, "wrist_rad": 0.3 * TIME / TIME[-1]}
    pd.DataFrame(wrist).to_csv(folder / "wrist.csv", index=False)
    held = pd.DataFrame(wrist)
    held.loc[len(held)] = [5.0, 0.3]
    held.to_csv(folder / "long.csv", index=False)
    return folder


def simulated(files: Path, rig: str, **options: object) -> tuple[pd.DataFrame, str | None]:
    out = files / "out.csv"
    asked = {"column": "motor_NAME_linear_rad"} | options if rig == "finger" else options
    scenario = tf.load_scenario(files / f"{rig}.toml")
    found = door.simulate_file(scenario, files / "motors.csv", out, **asked)
    return pd.read_csv(out), found.check


def test_an_integrator_simulates_a_finger_as_the_compiled_step_does(files: Path) -> None:
    """The joints within 0.05 % of range."""
    by_step, by_method = (simulated(files, "finger", method=each)[0] for each in (tf.Method.BDF2, tf.Method.IDAS))
    for joint in ("mcp", "pip", "dip"):
        a, b = (run[f"joint_{joint}_rad"] for run in (by_step, by_method))
        assert np.ptp(a) > 1e-3
        assert float(np.sqrt(np.mean((a - b) ** 2))) < 5e-4 * float(np.ptp(a))


@pytest.mark.parametrize(("rig", "quantity"), [("loop", "joint angle"), ("finger", "joint angles")])
def test_the_check_estimates_the_discretisation_error_of_joints(files: Path, rig: str, quantity: str) -> None:
    _, check = simulated(files, rig, check=True)
    assert check is not None
    assert check.startswith(f"{quantity} against a run with step 0.0005 s: ")
    assert "estimated error" in check


def test_a_joint_that_no_tendon_drives_moves_by_a_file(files: Path) -> None:
    """As if the scenario named the file; the file need not be longer than the run."""
    still, moved, same = (
        simulated(files, rig, **options)[0]
        for rig, options in (("wrist", {}), ("wrist", {"joints": files / "wrist.csv"}), ("csv", {}))
    )
    assert np.abs(moved["tension_flexor_N"] - still["tension_flexor_N"]).max() > 0.1
    assert np.abs(moved - same).to_numpy().max() < 1e-3


@pytest.mark.parametrize("rig", ["loop", "finger"])
def test_without_such_a_joint_the_file_is_refused_with_the_table_to_add(files: Path, rig: str) -> None:
    with pytest.raises(InputError, match=r"--joints moves joints that no tendon drives.*add a table \[joints.NAME\]"):
        simulated(files, rig, joints=files / "wrist.csv")


def test_a_finger_s_log_has_the_torque_of_its_motors_with_dry_friction(files: Path) -> None:
    """As identification reads it, and as logs of joints have it."""
    logs = []
    for dry in (0.0, 0.02):
        scenario = tf.load_scenario(files / "finger.toml")
        numbers = {"motors.m1.drive.coulomb_N_m": dry}
        rubbing = scenario.with_system(with_numbers(scenario.system, numbers), numbers)
        door.simulate_file(rubbing, files / "motors.csv", files / "dry.csv", column="motor_NAME_linear_rad")
        logs.append(pd.read_csv(files / "dry.csv"))
    way = np.sign(np.gradient(logs[0]["motor_m1_rad"]))
    assert np.abs(way).sum() > 50
    assert (logs[1] - logs[0])["motor_torque_m1_N_m"].to_numpy() == pytest.approx(0.02 * way, abs=1e-12)


def test_several_motors_need_a_column_each(files: Path) -> None:
    with pytest.raises(InputError, match="4 motors have a column each; write NAME for the motor's name"):
        simulated(files, "finger", column="motor_rad")
