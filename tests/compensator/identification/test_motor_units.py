"""Logs of motors in other units are refused before anything is fitted, with what to do about it."""

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv

TIME = np.arange(0, 6, 0.01)
TURN = 0.8 * np.sin(2 * np.pi * 0.3 * TIME)


def refused(scenario, tmp_path, work=tf.identify, **columns):
    write_csv(tmp_path / "log.csv", {"time_s": TIME, **columns})
    with pytest.raises(InputError) as error:
        work(scenario, [tmp_path / "log.csv"])
    return str(error.value)


@pytest.mark.parametrize("work", [tf.identify, tf.watch], ids=["identify", "watch"])
def test_a_joint_in_degrees_and_a_torque_in_mN_m_are_refused_before_the_fit(examples, tmp_path, work):
    joint = tf.load_scenario(examples / "hand_joint.toml")
    said = refused(
        joint, tmp_path, work, motor_rad=np.degrees(TURN), motor_torque_N_m=150.0 * TURN, joint_rad=np.degrees(TURN)
    )
    assert "log.csv: the motor turns by 91.6" in said
    assert "degrees? Then it is 1.6 rad: name the column in deg" in said
    assert "mN m, or a current in mA? Then it is 0.12 N m: name the column in mNm, or --scale input=0.001" in said
    assert "log.csv: " in said
    assert "it turns to 45.8" in said
    keys = '"measurement.input_position_scale", "measurement.input_scale", "joints.'
    assert (
        f"Nothing was computed: correct this, or go on all the same with --yes or, for good, with accept = [{keys}"
        in said
    )


def test_the_columns_of_each_motor_of_a_finger_are_judged_by_themselves(examples, tmp_path):
    finger = tf.load_scenario(examples / "three_joint_finger.toml")
    columns = {f"motor_{m.name}_rad": TURN for m in finger.mechanism.motors}
    columns |= {f"motor_torque_{m.name}_N_m": 150.0 * TURN for m in finger.mechanism.motors}
    said = refused(finger, tmp_path, **columns)
    first = finger.mechanism.motors[0].name
    assert f'the torque of motor "{first}" reaches 120 N m' in said
    assert "convert the column" in said
    assert "degrees" not in said
