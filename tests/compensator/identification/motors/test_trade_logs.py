"""Logs of motors as controllers of hands write them give what the same log with the contract's names gives."""

from dataclasses import replace

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.tables import read_table
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.motors.log import read_logs, read_several
from tendonff.compensator.identification.motors.run import mechanism_of
from tendonff.compensator.scenario.measurement import Measurement

TIME = np.round(np.arange(0, 6, 0.005), 6)
TURN = 0.8 * np.sin(2 * np.pi * 0.3 * TIME)
TORQUE = 0.1 * np.sin(2 * np.pi * 0.3 * TIME + 0.4)
CONSTANT = 0.5
COUNT = 2 * np.pi / 4096


@pytest.fixture(scope="module")
def joint(examples):
    return tf.load_scenario(examples / "hand_joint.toml")


@pytest.fixture(scope="module")
def pair(examples):
    return tf.load_scenario(examples / "instrument_pair.toml")


def of_loop(scenario, folder, columns, how=None):
    write_csv(folder / "log.csv", columns)
    [log] = read_logs(scenario, [folder / "log.csv"], how or Measurement(torque_constant_N_m_per_A=CONSTANT))
    return log


CONTRACT = {"time_s": TIME, "motor_rad": TURN, "motor_torque_N_m": TORQUE, "joint_rad": TURN / 3}


def orca(joint):
    """A trace of orca_core: motors in rad, currents in mA, joints in degrees, the whole hand in a file."""
    return {
        "t_s": TIME,
        f"{joint}_deg": np.degrees(TURN / 3),
        f"{joint}_temp_c": 30 + TIME,
        f"mcmd_{joint}": TURN,
        f"cur_{joint}": 1e3 * TORQUE / CONSTANT,
        "thumb_deg": 0 * TIME,
        "cur_thumb": 0 * TIME,
    }


def dynamixel(_):
    return {
        "timestamp": TIME,
        "Present Position": np.round(TURN / COUNT),
        "Present Current [2.69 mA]": 1e3 * TORQUE / CONSTANT / 2.69,
        "joint (deg)": np.degrees(TURN / 3),
    }


@pytest.mark.parametrize(("write", "turn"), [(orca, 1e-9), (dynamixel, COUNT)])
def test_a_trace_of_a_hand_is_read_as_the_contract(joint, tmp_path, write, turn):
    plain = of_loop(joint, tmp_path, CONTRACT)
    found = of_loop(joint, tmp_path, write(joint.mechanism.joint.name))
    np.testing.assert_allclose(found.run.motor_rad, plain.run.motor_rad, atol=turn)
    np.testing.assert_allclose(found.torque_N_m, plain.torque_N_m, atol=1e-9)
    if write is orca:
        np.testing.assert_allclose(found.joint_rad, plain.joint_rad, atol=1e-9)
    assert any("read as motor_rad in" in finding.text for finding in found.findings)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("Present Current [2.69 mA]", "Present Current", r"has no unit.*of counts what one is.*\[0\.00269 A\]"),
        ("Present Position", "Present Position [turns]", "has the unit turns"),
        ("timestamp", "time", None),
    ],
)
def test_a_unit_that_is_ambiguous_is_asked_for(joint, tmp_path, old, new, said):
    columns = {new if key == old else key: values for key, values in dynamixel("").items()}
    if said is None:
        columns[new] = 20 * TIME  # steps of 0.1: of seconds or of milliseconds
        said = "steps by 0.1 and has no unit"
    with pytest.raises(InputError, match=said):
        of_loop(joint, tmp_path, columns)


def test_positions_without_unit_that_are_no_counts_are_refused(joint, tmp_path):
    with pytest.raises(InputError, match="is not in counts"):
        of_loop(joint, tmp_path, dynamixel("") | {"Present Position": TURN})


def test_two_columns_that_could_be_meant_are_named(joint, tmp_path):
    with pytest.raises(InputError, match=r'"motor \[deg\]", "Present Position" could be meant by "motor_rad"'):
        of_loop(joint, tmp_path, {"motor [deg]": TURN, **dynamixel("")})


def several(scenario, path, named=None):
    finger, sampled = mechanism_of(scenario)
    drive = replace(finger.motors[0].drive, torque_constant_N_m_per_A=CONSTANT)
    finger = replace(finger, motors=tuple(replace(motor, drive=drive) for motor in finger.motors))
    [log] = read_several(finger, [path], sampled.angle_rad[0], Measurement(channels=named))
    return log


def pair_log(scenario, folder):
    finger, _ = mechanism_of(scenario)
    columns = {"time_s": TIME}
    for k, motor in enumerate(finger.motors):
        columns |= {f"motor_{motor.name}_rad": TURN + k, f"motor_torque_{motor.name}_N_m": (k + 1) * TORQUE}
    write_csv(folder / "plain.csv", columns)
    return [motor.name for motor in finger.motors], several(scenario, folder / "plain.csv")


def test_columns_of_several_motors_state_other_units(pair, tmp_path):
    names, plain = pair_log(pair, tmp_path)
    columns = {"time [ms]": 1e3 * TIME}
    for k, name in enumerate(names):
        columns |= {f"motor_{name}_deg": np.degrees(TURN + k), f"cur_{name}": 1e3 * (k + 1) * TORQUE / CONSTANT}
    write_csv(tmp_path / "other.csv", columns)
    found = several(pair, tmp_path / "other.csv")
    np.testing.assert_allclose(found.run.motor_rad, plain.run.motor_rad, atol=1e-9)
    np.testing.assert_allclose(found.torque_N_m, plain.torque_N_m, atol=1e-9)


def write_dump(folder, rows, kind="tx"):
    folder.mkdir(parents=True)
    (folder / "info.log").write_text(f"Type: Bottle;\nStamp: {kind};\n[1.0] /hand/stateExt:o [connected]\n")
    stamps = "{0:.6f} {0:.6f}" if kind == "tx+rx" else "{:.6f}"
    text = [f"{k} {stamps.format(1.7e9 + time)} {row}" for k, (time, row) in enumerate(zip(TIME, rows, strict=True))]
    (folder / "data.log").write_text("\n".join(text) + "\n")


def state(k):
    """A state of a control board with two axes, velocities not valid."""
    motor = " ".join(f"{np.degrees(TURN[k] + j):.12g}" for j in range(2))
    current = " ".join(f"{(j + 1) * TORQUE[k] / CONSTANT:.12g}" for j in range(2))
    unknown = "(0.0 0.0) 0"
    before, after = f"(1.0 2.0) 1 {unknown} {unknown}", f"{unknown} {unknown} {unknown} {unknown}"
    return f"{before} ({motor}) 1 {after} ({current}) 1 ([pos] [pos]) 1 (7 7) 1"


@pytest.mark.parametrize("stamps", ["tx", "tx+rx"])
def test_a_folder_of_the_yarp_dumper_is_read_without_conversion(pair, tmp_path, stamps):
    names, plain = pair_log(pair, tmp_path)
    write_dump(tmp_path / "dump", [state(k) for k in range(len(TIME))], stamps)
    named = [f"motor_{n}_rad=motorPosition[{k}]" for k, n in enumerate(names)]
    named += [f"motor_current_{n}_A=current[{k}]" for k, n in enumerate(names)]
    found = several(pair, tmp_path / "dump", tuple(named))
    np.testing.assert_allclose(found.run.motor_rad, plain.run.motor_rad, atol=1e-6)
    np.testing.assert_allclose(found.torque_N_m, plain.torque_N_m, atol=1e-6)
    assert "jointVelocity[0]" not in read_table(tmp_path / "dump").columns  # not valid


def test_ports_of_a_yarp_dump_are_joined_on_one_clock(tmp_path):
    write_dump(tmp_path / "dump" / "motor", [f"{x:.9g}" for x in TURN])
    write_dump(tmp_path / "dump" / "cells", [f"{x:.9g} {2 * x:.9g}" for x in TORQUE])
    table = read_table(tmp_path / "dump", ("motor.data[0]",))
    assert set(table.columns) == {"time_s", "motor.data[0]", "cells.data[0]", "cells.data[1]"}
    np.testing.assert_allclose(table.numbers("cells.data[1]"), 2 * TORQUE, atol=1e-7)


def test_a_channel_of_a_loop_is_named_by_its_usual_name(joint, tmp_path):
    plain = of_loop(joint, tmp_path, CONTRACT)
    how = Measurement(channels=("motor_rad=encoder", "joint_rad=knuckle [deg]"))
    columns = {"time_s": TIME, "encoder": TURN, "motor_torque_N_m": TORQUE, "knuckle [deg]": np.degrees(TURN / 3)}
    found = of_loop(joint, tmp_path, columns, how)
    np.testing.assert_allclose(found.run.motor_rad, plain.run.motor_rad, atol=1e-9)
    np.testing.assert_allclose(found.joint_rad, plain.joint_rad, atol=1e-9)


def test_a_channel_that_no_motor_has_is_refused(pair, tmp_path, examples):
    pair_log(pair, tmp_path)
    with pytest.raises(InputError, match='unknown channel "motor_thumb_rad"'):
        several(pair, tmp_path / "plain.csv", ("motor_thumb_rad=x",))
    given = ["--data", str(tmp_path / "plain.csv"), "--channel", "a=b", "--out", str(tmp_path / "fit")]
    assert run(["identify", str(examples / "finger.toml"), *given]) == 2
